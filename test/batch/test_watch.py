"""Images that arrive in a folder."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.batch.watch import Arrivals
from ahf_ros.cli import main
from ahf_ros.files.files import RESULTS_FILE

ROOT = Path(__file__).resolve().parents[2]
LIMIT = 300.0


class Clock:
    """A clock that stands still until it is put forward."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_a_file_is_taken_once_it_has_stopped_changing(tmp_path: Path) -> None:
    clock = Clock()
    folder = tmp_path / 'share'
    arrivals = Arrivals(folder, ('.png',), True, 1.0, clock)

    def taken(seconds: float) -> list[str]:
        clock.now += seconds
        return [str(Path(path).relative_to(folder)) for path in arrivals.take()]

    assert taken(0) == [] and arrivals.away == 'No such file or directory'
    (folder / 'deep').mkdir(parents=True)
    for name in ('a.PNG', '.hidden.png', 'notes.txt', 'empty.png', 'deep/b.png'):
        (folder / name).write_bytes(b'' if 'empty' in name else b'half')
    assert taken(0) == [] and arrivals.away == '' and arrivals.settling
    assert taken(0.9) == []
    (folder / 'a.PNG').write_bytes(b'more than half')
    assert taken(0.5) == ['deep/b.png']
    assert taken(0.9) == []
    assert taken(0.2) == ['a.PNG']
    assert taken(9) == [] and not arrivals.settling
    (folder / 'a.PNG').write_bytes(b'something else')
    os.utime(folder / 'a.PNG', (1, 1))
    assert taken(0) == [] and taken(1) == ['a.PNG']
    folder.rename(tmp_path / 'away')
    assert taken(1) == [] and arrivals.away
    (tmp_path / 'away').rename(folder)
    assert taken(1) == [] and not arrivals.away


def test_images_are_identified_as_they_arrive_and_none_twice(tmp_path: Path) -> None:
    folder, output = tmp_path / 'share', tmp_path / 'results'
    folder.mkdir()
    image = np.random.default_rng(0).integers(0, 255, (60, 80), np.uint8)
    content = cv2.imencode('.png', image)[1].tobytes()

    def start() -> subprocess.Popen[str]:
        return subprocess.Popen(
            [
                *(sys.executable, '-m', 'ahf_ros.cli', 'watch', folder, '--output', output),
                *('--settling', '0', '--interval', '0.2', '--jobs', '1', '--json'),
                *('--detector', 'traditional'),
            ],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT,
        )  # fmt: skip

    def results() -> list[str]:
        file = output / RESULTS_FILE
        lines = file.read_text().splitlines(keepends=True) if file.exists() else []
        whole = [line for line in lines if line.endswith('\n')]  # the last is being written
        return [Path(json.loads(line)['image']).name for line in whole]

    def wait_for(*names: str) -> None:
        limit = time.monotonic() + LIMIT
        while results() != list(names):
            assert time.monotonic() < limit, results()
            time.sleep(0.02)

    (folder / 'a.png').write_bytes(content)
    (folder / 'b.png').write_bytes(content[:300])
    process = start()
    wait_for('a.png')
    (folder / 'b.png').write_bytes(content)
    wait_for('a.png', 'b.png')
    folder.rename(tmp_path / 'away')
    (tmp_path / 'away' / 'c.png').write_bytes(content)
    (tmp_path / 'away').rename(folder)
    wait_for('a.png', 'b.png', 'c.png')
    process.kill()
    process.communicate(timeout=LIMIT)
    (folder / 'd.png').write_bytes(content)
    process = start()
    assert process.stdout is not None
    printed = process.stdout.readline()
    process.send_signal(signal.SIGINT)
    others, errors = process.communicate(timeout=LIMIT)
    assert process.returncode == 130
    assert 'Traceback' not in errors
    assert '3 of 4 results are there already' in errors
    assert (Path(json.loads(printed)['image']).name, others) == ('d.png', '')
    assert results() == ['a.png', 'b.png', 'c.png', 'd.png']


def test_overlays_do_not_arrive_in_the_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ['watch', str(tmp_path), '--output', str(tmp_path / 'results')]
    assert main([*command, '--overlay', str(tmp_path)]) == 2
    assert 'accepted is a folder that is not watched' in capsys.readouterr().err
