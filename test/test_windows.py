"""The core without what only POSIX has, as on Windows: nothing of it is imported or used."""

from __future__ import annotations

import json
from pathlib import Path, PureWindowsPath

import pytest

from ahf_ros.interchange.files import checked_file_name
from support import ROOT
from support.command_line import python, status

WITHOUT_POSIX = """
import multiprocessing, os, select, signal, sys

for name in ('fcntl', 'grp', 'pwd', 'resource', 'termios'):
    sys.modules[name] = None
for module, names in {
    os: 'getpgid killpg mkfifo pread sched_getaffinity set_blocking setsid statvfs',
    select: 'poll',
    signal: 'SIGALRM SIGHUP SIGPROF ITIMER_PROF ITIMER_REAL pthread_sigmask setitimer',
}.items():
    for name in names.split():
        delattr(module, name)
"""

BATCH = """
from ahf_ros.cli import main

if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
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
    options = '--count', 2, '--width', 800, '--height', 600, '--targets', 3
    assert status('render', folder, *options) == 0
    return folder


def test_a_batch_in_two_processes(scene: Path, tmp_path: Path) -> None:
    """It is started by spawn, and gives what it gives elsewhere."""
    program = tmp_path / 'batch.py'
    program.write_text(WITHOUT_POSIX + BATCH)
    options = 'identify', scene, '--jobs', 2, '--json', '--output', tmp_path / 'out'
    done = python(program, *options)
    assert done.returncode == 0, done.stderr
    records = [json.loads(line) for line in done.stdout.splitlines()]
    assert [len(it['targets']) for it in records] == [3, 3]
    again = python(program, *options)
    assert again.returncode == 0, again.stderr
    assert again.stdout == done.stdout


def test_tests_of_the_core() -> None:
    files = ('interchange/test_target_json.py', 'imaging/test_stack.py', 'codes/test_families.py')
    done = python(
        '-c', TESTS.replace('{without}', WITHOUT_POSIX), *(ROOT / 'test' / it for it in files)
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize('path', [r'C:\photos\a.png', r'\\server\share\a.png', 'D:a.png'])
def test_paths_of_windows_have_file_names(path: str) -> None:
    assert checked_file_name(PureWindowsPath(path).as_posix(), 'image').endswith('a.png')
