"""The core without what only POSIX has, as on Windows: nothing of it is imported or used."""

import json
import sys
from pathlib import Path, PureWindowsPath

import cv2
import numpy as np
import pytest

from ahf_ros.families.external.command import words_of
from ahf_ros.files.files import checked_file_name
from support import ROOT, packages
from support.command_line import python, status

pytestmark = pytest.mark.lasting

WITHOUT_POSIX = """
import multiprocessing, os, select, signal, sys

for name in ('fcntl', 'grp', 'pwd', 'resource', 'termios'):
    sys.modules[name] = None
for module, names in {
    os: 'PRIO_PROCESS fork getpgid killpg memfd_create mkfifo pread sched_getaffinity '
    'set_blocking setpriority setsid statvfs',
    select: 'poll',
    signal: 'SIGALRM SIGHUP SIGPROF ITIMER_PROF ITIMER_REAL pthread_sigmask setitimer',
}.items():
    for name in names.split():
        delattr(module, name)
for stream in (sys.stdout, sys.stderr):
    stream.reconfigure(encoding='cp1252')
"""

COMMANDS = """
import json
from ahf_ros.cli import main

if __name__ == '__main__':
    for line in json.loads(sys.argv[1]):
        if status := main(line):
            sys.exit(status)
"""

DETECTOR = """
import json
print(json.dumps({'targets': [{'id': 7, 'x': 1.5, 'y': 2.5}]}))
"""

TESTS = """
import support.live  # which locks files itself
{without}
import pytest
sys.exit(pytest.main(['-q', '-p', 'no:cacheprovider', *sys.argv[1:]]))
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    folder = tmp_path / 'scene'
    options = '--count', 2, '--width', 640, '--height', 400, '--targets', 3, '--dot-radius', 14
    assert status('render', folder, *options) == 0
    return folder


def test_batches_with_every_kind_of_detector(scene: Path, tmp_path: Path) -> None:
    """Two processes that are started by spawn, twice; a command; a class of another package."""
    program, detector = tmp_path / 'batch.py', tmp_path / 'detector.py'
    program.write_text(WITHOUT_POSIX + COMMANDS)
    detector.write_text(DETECTOR)
    image = next(scene.glob('*.png'))
    example = ROOT / 'docs' / 'examples' / 'my_detector.py'
    packages.write_package(tmp_path, 'blobs', example.read_text())
    batch = [
        'identify',
        scene,
        '--family',
        'metashape12',
        '--jobs',
        2,
        '--json',
        '--output',
        tmp_path / 'out',
    ]
    command = f'"{sys.executable}" "{detector}"'
    lines = [
        batch,
        batch,
        ['identify', image, '--json', '--detector', 'command', '--command', command],
        ['identify', image, '--json', '--detector', packages.MINE],
    ]
    done = python(program, json.dumps([[str(it) for it in line] for line in lines]))
    assert done.returncode == 0, done.stderr
    said = done.stdout.splitlines()
    assert said[:2] == said[2:4]
    records = [json.loads(line)['targets'] for line in said]
    assert [len(it) for it in records[:4]] == [3] * 4
    assert [it['id'] for it in records[4]] == [7]
    assert [it['id'] for it in records[5]] == list(range(1, len(records[5]) + 1)) != []


def test_a_command_and_what_it_started_end_without_groups_of_processes(tmp_path: Path) -> None:
    """By a tool of Windows, or at least the command itself where that tool is not there."""
    lasting = tmp_path / 'lasting.py'
    lasting.write_text('import time\ntime.sleep(1000)')
    image = tmp_path / 'a.png'
    cv2.imwrite(str(image), np.eye(60, dtype=np.uint8))
    program = tmp_path / 'one.py'
    program.write_text(WITHOUT_POSIX + COMMANDS)
    command = f'"{sys.executable}" "{lasting}"'
    line = ['identify', image, '--detector', 'command', '--command', command]
    done = python(program, json.dumps([[*map(str, line), '--detector-timeout', '0.2']]))
    assert done.returncode == 1
    assert 'took longer than detector_timeout, 0.2 s' in done.stderr


@pytest.mark.parametrize(
    ('command', 'words'),
    [
        (r'C:\tools\find.exe {image}', [r'C:\tools\find.exe', '{image}']),
        (r'"C:\My tools\find.exe" -x \\host\a', [r'C:\My tools\find.exe', '-x', r'\\host\a']),
    ],
)
def test_commands_of_windows_have_words(command: str, words: list[str]) -> None:
    assert words_of(command, escape='') == words


def test_tests_of_the_core() -> None:
    files = ('files/test_target_json.py', 'vision/test_stack.py', 'prints/test_families.py')
    done = python(
        '-c', TESTS.replace('{without}', WITHOUT_POSIX), *(ROOT / 'test' / it for it in files)
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize('path', [r'C:\photos\a.png', r'\\server\share\a.png', 'D:a.png'])
def test_paths_of_windows_have_file_names(path: str) -> None:
    assert checked_file_name(PureWindowsPath(path).as_posix(), 'image').endswith('a.png')
