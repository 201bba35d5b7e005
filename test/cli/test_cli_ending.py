"""The command line under signals, closed and full outputs: it ends in order, and soon."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import nullcontext, suppress
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from ahf_ros.bag import run
from ahf_ros.bag.definitions import typestore
from ahf_ros.cli import main
from ahf_ros.files.image_files import write_image
from support import ROOT, bags, environment, packages
from support.command_line import status as status_of

LIMIT = 300.0
SLOW = 'import pathlib, sys, time; pathlib.Path({mark!r}).touch(); time.sleep(600)'
RAMP = np.tile(np.arange(40, dtype=np.uint8), (30, 1))


def start(
    *arguments: object, path: Path = ROOT, stdout: object = subprocess.PIPE, **variables: str
) -> subprocess.Popen[bytes]:
    """Start the command line, which also imports from a path."""
    command = [sys.executable, '-m', 'ahf_ros.cli', *map(str, arguments)]
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # also where the tests run with nohup
    variables = environment(path, **variables)
    try:
        return subprocess.Popen(
            command, cwd=ROOT, stdout=stdout, stderr=subprocess.PIPE, env=variables
        )
    finally:
        signal.signal(signal.SIGHUP, before)


def end_of(process: subprocess.Popen[bytes]) -> tuple[int | None, bytes, bytes]:
    """Return the exit status of a process and what it has written, which is no traceback."""
    output, errors = process.communicate(timeout=LIMIT)
    assert b'Traceback' not in (output or b'') + errors
    return process.returncode, output, errors


@pytest.fixture
def image(tmp_path: Path) -> Path:
    write_image(tmp_path / 'image.png', RAMP)
    return tmp_path / 'image.png'


def wait_for(condition: object) -> None:
    limit = time.monotonic() + LIMIT
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < limit, 'it does not happen in time'
        time.sleep(0.02)


def is_running(mark: Path) -> bool:
    """Return whether a path is on the command line of another process."""
    for line in Path('/proc').glob('[0-9]*/cmdline'):  # empty for a zombie
        with suppress(OSError):
            if line.parent.name != str(os.getpid()) and str(mark).encode() in line.read_bytes():
                return True
    return False


KILLER = """
import os, signal
from ahf_ros import Target
class MyDetector:
    name = family = 'mine'
    def __init__(self, settings):
        pass
    def __call__(self, image):
        if image.shape[0] == 31:
            os.kill(os.getpid(), signal.SIGKILL)
        print('noise')
        return [Target(7, 0, *image[0, :2] + 5.0, 3.0, 2.0)]
"""


def test_images_that_kill_and_detectors_that_print_do_no_harm(tmp_path: Path) -> None:
    packages.write_package(tmp_path, 'killing', KILLER)
    paths = [tmp_path / name for name in ('a.png', 'killer.png', 'b.png', 'missing.png', 'c.png')]
    for path, height in zip(paths, (30, 31, 33, 0, 35), strict=True):
        if height:
            write_image(path, np.tile(np.arange(height, height + 40, dtype=np.uint8), (height, 1)))

    def result(jobs: int, *images: Path) -> tuple[int | None, list[object], str]:
        process = start(
            'identify', '--json', *images, '--jobs', jobs, '--detector', 'mine',
            '--export', f'csv={tmp_path / str(jobs)}', '--overlay', tmp_path / f'seen{jobs}',
            path=tmp_path,
        )  # fmt: skip
        status, output, errors = end_of(process)
        lines = [{**json.loads(line), 'elapsed_s': 0} for line in output.splitlines()]
        return status, lines, errors.decode()

    status, lines, errors = result(2, *paths)
    assert status == 1
    assert [line['image'] for line in lines] == [str(paths[number]) for number in (0, 2, 4)]
    assert f'ahf identify: {paths[1]}: given up, 2 processes that worked on it died' in errors
    assert 'missing.png cannot be read' in errors and 'noise' in errors
    assert result(1, *paths[::2])[:2] == (0, lines), errors
    for one, two in (('1', '2'), ('seen1', 'seen2')):
        files = [
            {file.name: file.read_bytes() for file in (tmp_path / folder).iterdir()}
            for folder in (one, two)
        ]
        assert files[0] and files[0] == files[1]


def is_free(target: Path) -> bool:
    """Return whether no process writes a bag."""
    try:
        with run.locked(target) if target.exists() else nullcontext():
            return True
    except ValueError:
        return False


def slow_command(tmp_path: Path) -> tuple[str, Path]:
    mark = tmp_path / 'mark'
    (tmp_path / 'slow.py').write_text(SLOW.format(mark=str(mark)))
    return f'{sys.executable} {tmp_path / "slow.py"} {{image}}', mark


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_command_and_its_files(tmp_path: Path, number: signal.Signals) -> None:
    images = ['a.png', 'b.png'][: 2 if number == signal.SIGINT else 1]  # two workers, or none
    for name in images:
        write_image(tmp_path / name, RAMP)
    command, mark = slow_command(tmp_path)
    (tmp_path / 'scratch').mkdir()
    process = start(
        'identify', *(tmp_path / name for name in images), '--jobs', 2, '--expected-targets', 3,
        '--detector', 'command', '--command', command, '--detector-timeout', 600,
        TMPDIR=str(tmp_path / 'scratch'),
    )  # fmt: skip
    wait_for(mark.exists)
    for _ in range(2):  # a terminal and a launcher both send one
        process.send_signal(number)
        time.sleep(0.005)
    status, _, errors = end_of(process)
    assert status == 128 + number, errors
    wait_for(lambda: not is_running(tmp_path / 'slow.py'))
    assert list((tmp_path / 'scratch').iterdir()) == []


@pytest.mark.parametrize(
    ('number', 'fast'),
    [(signal.SIGTERM, 0), (signal.SIGINT, 1)],  # a search calls it in other threads
)
def test_a_signal_does_not_wait_for_a_detector_of_another_package(
    tmp_path: Path, image: Path, number: signal.Signals, fast: int
) -> None:
    mark = tmp_path / 'mark'
    packages.write_package(tmp_path, 'hanging', packages.SLOW.format(fast=fast, mark=str(mark)))
    process = start(
        'identify', image, '--detector', 'mine', '--expected-targets', 3,
        '--detector-timeout', 600, path=tmp_path,
    )  # fmt: skip
    wait_for(mark.exists)
    process.send_signal(number)
    status, _, errors = end_of(process)
    assert status == 128 + number, errors


INTERRUPTING = """
import os, signal, time
class Field:
    def __set_name__(self, owner, name):
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.1)
class Settings:
    field = Field()
"""
IMPORTING = """
import sys, time
from ahf_ros.base import ending
try:
    with ending.handled():
        import interrupting
        time.sleep(60)
except KeyboardInterrupt:
    sys.exit(130)
"""


def test_a_signal_that_an_import_would_lose_ends_the_process(tmp_path: Path) -> None:
    (tmp_path / 'interrupting.py').write_text(INTERRUPTING)
    process = subprocess.Popen(
        [sys.executable, '-c', IMPORTING],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment(tmp_path),
    )
    assert end_of(process) == (130, b'', b'')


@pytest.mark.parametrize(
    ('where', 'command'), [('import', 'identify'), ('__init__', 'bag'), ('__call__', 'identify')]
)
def test_a_detector_of_another_package_that_ends_its_process_is_said(
    tmp_path: Path, image: Path, where: str, command: str
) -> None:
    body = 'import os\nclass MyDetector:\n    name = family = "mine"\n'
    for name in ('__init__', '__call__'):
        body += f'    def {name}(self, _):\n        {"os._exit(0)" if name == where else "pass"}\n'
    packages.write_package(tmp_path, 'leaving', body + 'os._exit(0)\n' * (where == 'import'))
    bag = bags.write_ros2(tmp_path / 'in', bags.recorded(typestore(), [RAMP]))
    inputs = [image] if command == 'identify' else [bag, tmp_path / 'out']
    status, _, errors = end_of(start(command, *inputs, '--detector', 'mine', path=tmp_path))
    assert status == 1
    assert b'2 processes that worked on it died, the last with status 0' in errors


def test_workers_end_with_their_parent_and_a_rerun_is_accepted(tmp_path: Path) -> None:
    images = [RAMP, RAMP + 1]
    sources = [
        bags.write_ros2(tmp_path / name, bags.recorded(typestore(), images)) for name in 'ab'
    ]
    command, mark = slow_command(tmp_path)
    target = tmp_path / 'made'
    arguments = (
        'bag', *sources, target, '--jobs', 2, '--detector', 'command', '--command', command,
        '--detector-timeout', 600,
    )  # fmt: skip
    process = start(*arguments)
    wait_for(mark.exists)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    wait_for(lambda: not is_running(tmp_path) and all(is_free(target / name) for name in 'ab'))
    (tmp_path / 'slow.py').write_text('print(\'{"targets": []}\')')
    assert end_of(start(*arguments))[0] == 0
    for name in 'ab':
        assert len(bags.answers(target / name)) == 2


def test_a_command_that_was_missing_is_tried_again(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    source = bags.write_ros2(tmp_path / 'in', bags.recorded(typestore(), [RAMP]))
    program = tmp_path / 'program'
    arguments = ('bag', source, tmp_path / 'out', '--detector', 'command', '--command', program)
    assert status_of(*arguments) == 1
    assert 'cannot be started: No such file or directory' in capfd.readouterr().err
    program.write_text(f'#!{sys.executable}\nprint(\'{{"targets": []}}\')')
    program.chmod(0o755)
    assert status_of(*arguments) == 0
    assert len(bags.answers(tmp_path / 'out')) == 1


def test_a_full_disk_behind_standard_output_is_named(image: Path) -> None:
    with Path('/dev/full').open('w') as full:
        process = start('identify', '--json', '--detector', 'traditional', image, stdout=full)
        status, _, errors = end_of(process)
    assert status == 1
    assert b'No space left on device' in errors


def test_a_reader_that_stops_reading_is_no_error_to_see(image: Path) -> None:
    process = start('identify', '--json', '--detector', 'traditional', *[image] * 3)
    assert process.stdout and process.stderr
    process.stdout.close()
    errors = process.stderr.read()
    assert process.wait(LIMIT) == 1
    assert b'Traceback' not in errors and b'Exception ignored' not in errors


@pytest.mark.parametrize('closed', ['2>&-', '>&-', '2>/dev/full'])
def test_closed_outputs_do_no_harm(image: Path, closed: str) -> None:
    words = f'{sys.executable} -m ahf_ros.cli identify --detector traditional'
    done = subprocess.run(
        ['sh', '-c', f'{words} {image} {closed}'],
        cwd=ROOT, capture_output=True, timeout=LIMIT,
    )  # fmt: skip
    assert done.returncode in (0, 1)
    assert b'Traceback' not in done.stderr and b'Traceback' not in done.stdout


def test_many_images_are_rendered_one_by_one(tmp_path: Path) -> None:
    scene = ('--width', 64, '--height', 64, '--targets', 1, '--dot-radius', 5)
    process = start('render', tmp_path / 'made', '--count', 10**9, *scene)
    wait_for(lambda: (tmp_path / 'made' / 'truth.csv').exists())
    process.send_signal(signal.SIGINT)
    assert end_of(process)[0] == 130


def test_an_interrupt_during_the_imports_ends_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    class Interrupting:
        def find_spec(self, name: str, *_: object) -> None:
            if name == 'ahf_ros.cli.commands':
                raise KeyboardInterrupt

    import ahf_ros.cli

    monkeypatch.delitem(sys.modules, 'ahf_ros.cli.commands', raising=False)
    monkeypatch.delattr(ahf_ros.cli, 'commands', raising=False)
    monkeypatch.setattr(sys, 'meta_path', [Interrupting(), *sys.meta_path])
    assert main(['--version']) == 130
