"""A detector that is another program."""

import resource
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ahf_ros.families import create_detector
from ahf_ros.families.external import command as module
from ahf_ros.identification.session import identify

IMAGE = np.arange(400, dtype=np.uint8).reshape(20, 20)


def detector(tmp_path: Path, script: str, words: str = '', timeout: float = 600.0) -> Any:
    """Return the detector that runs a Python script."""
    path = tmp_path / 'program.py'
    path.write_text(script)
    command = f'{sys.executable} {path} {words}'
    return create_detector('command', command=command, detector_timeout=timeout)


def printing(text: str) -> str:
    return f'print({text!r})'


def test_what_a_program_prints_is_what_was_identified(tmp_path: Path) -> None:
    found = detector(
        tmp_path,
        'import cv2, json, sys\n'
        'image = cv2.imread(sys.argv[-1], cv2.IMREAD_UNCHANGED)\n'
        'targets = [{"id": 7, "x": int(image[0, 9]), "y": image.shape[0], "angle": 0.5},\n'
        '           {"id": 3, "x": 1, "y": 2.5, "covariance": [1, 0, 0, 2], "new": 1}]\n'
        'print(json.dumps({"targets": targets, "more": []}))\n',
    )(IMAGE)
    assert [(it.id, it.x, it.y) for it in found] == [(3, 1.0, 2.5), (7, 9.0, 20.0)]
    assert found[0].covariance == (1.0, 0.0, 0.0, 2.0)
    assert found[1].angle == 0.5


def test_the_path_goes_where_the_command_says(tmp_path: Path) -> None:
    script = 'import sys; assert sys.argv[1].endswith(".png"); assert sys.argv[2] == "last"\n'
    assert detector(tmp_path, script + printing('{"targets": []}'), '{image} last')(IMAGE) == []


@pytest.mark.parametrize(
    ('script', 'message'),
    [
        ('import sys; sys.exit("no licence")', "ended with status 1: 'no licence'"),
        ('import os; os.kill(os.getpid(), 9)', 'ended by signal 9'),
        ('print("garbage")', "printed 'garbage', accepted is JSON"),
        ('', "printed '', accepted is JSON"),
        (printing('[]'), 'is not an object with a list of targets'),
        (printing('[' * 100_000), 'accepted is JSON: RecursionError'),
        (printing('{"targets": [{"id": 1, "x": 1, "y": 1, "code": -1}]}'), 'code is -1, accepted'),
        (printing('{"targets": [4]}'), 'target is 4, accepted is an object'),
        (printing('{"targets": [{"id": 1, "x": 2}]}'), 'y is None, accepted is a number'),
        (printing('{"targets": [{"id": 1, "x": NaN, "y": 2}]}'), 'x is nan, accepted is a number'),
        (printing('{"targets": [{"id": 1.5, "x": 1, "y": 2}]}'), 'id is 1.5, accepted is an int'),
        (
            printing('{"targets": [{"id": 1, "x": 1, "y": 2, "covariance": 3}]}'),
            'covariance is 3, accepted are four finite numbers',
        ),
    ],
)
def test_what_is_not_accepted_is_named(tmp_path: Path, script: str, message: str) -> None:
    with pytest.raises(ValueError, match=r'^command .*program\.py') as caught:
        detector(tmp_path, script)(IMAGE)
    assert message in str(caught.value)


def test_a_program_that_hangs_is_ended_with_all_that_it_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pid = tmp_path / 'pid'
    # The time limit is over once the program has got that far, however slow the machine is.
    clock = SimpleNamespace(monotonic=lambda: 3.0 if pid.exists() else 0.0)
    monkeypatch.setattr(module, 'time', clock)
    script = (
        'import os, subprocess, sys, time\n'
        'child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])\n'
        f'open("{pid}.part", "w").write(str(child.pid))\n'
        f'os.rename("{pid}.part", "{pid}")\n'
        'time.sleep(60)\n'
    )
    with pytest.raises(ValueError, match='took longer than detector_timeout, 2 s'):
        detector(tmp_path, script, timeout=2.0)(IMAGE)
    child = int(pid.read_text())
    limit = time.monotonic() + 60
    while _runs(child):
        assert time.monotonic() < limit
        time.sleep(0.1)


def test_a_program_that_writes_without_end_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, 'MAXIMUM_OUTPUT', 2**20)
    script = 'import os\nwhile True:\n    os.write(1, bytes(2**16))\n'
    with pytest.raises(ValueError, match='bytes, accepted are at most 1048576'):
        detector(tmp_path, script)(IMAGE)


def test_a_program_ends_with_all_that_it_started_in_sessions_of_their_own(tmp_path: Path) -> None:
    pid = tmp_path / 'pid'
    script = (
        'import subprocess, sys\n'
        'code = "import time; time.sleep(600)"\n'
        'child = subprocess.Popen([sys.executable, "-c", code], start_new_session=True)\n'
        f'open({str(pid)!r}, "w").write(str(child.pid))\n'
    )
    assert detector(tmp_path, script + printing('{"targets": []}'))(IMAGE) == []
    limit = time.monotonic() + 60
    while _runs(int(pid.read_text())):
        assert time.monotonic() < limit
        time.sleep(0.1)


@pytest.mark.parametrize('when', ['before', 'meanwhile'])
def test_a_temporary_folder_that_vanishes_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, when: str
) -> None:
    scratch = tmp_path / 'scratch'
    scratch.mkdir()
    monkeypatch.setattr('tempfile.tempdir', str(scratch))
    script = f'import shutil\nshutil.rmtree({str(scratch)!r})\n' + printing('{"targets": []}')
    made = detector(tmp_path, script)
    if when == 'before':
        scratch.rmdir()
    with pytest.raises(ValueError, match='the temporary folder cannot be used: No such file'):
        made(IMAGE)


def test_a_temporary_folder_that_is_full_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    image = np.random.default_rng(0).integers(0, 255, (300, 300), np.uint8)
    made = detector(tmp_path, printing('{"targets": []}'))
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(ValueError, match='folder cannot be used: File too large'):
            made(image)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, before)


def _runs(pid: int) -> bool:
    try:
        status = Path(f'/proc/{pid}/stat').read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rpartition(')')[2].split()[0] != 'Z'


@pytest.mark.parametrize(
    ('command', 'message'),
    [
        ('', "command '' is empty, accepted is a program"),
        ('"open', 'cannot be split into words'),
        ('/nowhere/nothing', 'cannot be started: No such file'),
    ],
)
def test_a_command_that_is_none(command: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        create_detector('command', command=command)(IMAGE)


def test_several_threads_at_once_and_no_file_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('TMPDIR', str(tmp_path))
    monkeypatch.setattr('tempfile.tempdir', None)
    script = (
        'import cv2, json, sys\n'
        'value = int(cv2.imread(sys.argv[-1], cv2.IMREAD_UNCHANGED)[0, 0])\n'
        'print(json.dumps({"targets": [{"id": value, "x": 0, "y": 0}]}))\n'
    )
    made = detector(tmp_path, script)
    images = [np.where(IMAGE == 0, value, IMAGE).astype(np.uint8) for value in range(8)]
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(made, images))
    assert [[it.id for it in targets] for targets in found] == [[value] for value in range(8)]
    assert [path.name for path in tmp_path.iterdir()] == ['program.py']


def test_a_program_behind_the_adaptive_filter(tmp_path: Path) -> None:
    """It identifies one target only in images that are not the one received."""
    script = (
        'import cv2, json, sys\n'
        'image = cv2.imread(sys.argv[-1], cv2.IMREAD_UNCHANGED)\n'
        'seen = image[0, :3].tolist() != [0, 1, 2]\n'
        'print(json.dumps({"targets": [{"id": 1, "x": 0, "y": 0}] if seen else []}))\n'
    )
    found = identify(IMAGE, detector=detector(tmp_path, script), expected_targets=1)
    assert found.count == 1 and found.filter.applied
