"""`ahf doctor`: what is there, and what is missing for what."""

import re
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from ahf_ros import kernels
from ahf_ros.base.extras import EXTRAS
from ahf_ros.cli import doctor
from support import ROOT
from support.command_line import ahf, python, status

EXTRA = ('rclpy', 'asyncio', 'dask', 'distributed', 'jinja2', 'rosbags', 'mcap', 'scipy')


def installed_as_other(folder: Path, name: str) -> None:
    """Put the metadata of a package into a folder that can be imported from."""
    info = folder / f'{name.replace("-", "_")}-9.9.dist-info'
    info.mkdir()
    (info / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {name}\nVersion: 9.9\n')


def test_it_names_versions_and_every_extra(capsys: pytest.CaptureFixture[str]) -> None:
    status('doctor')
    said = capsys.readouterr().out
    assert f'numpy {np.__version__}' in said
    assert re.search(r'^OpenCV \d\S* \(.*\) with \d+ threads', said, re.MULTILINE)
    for extra, (purpose, _) in EXTRAS.items():
        (line,) = re.findall(rf'^  {extra}: (.*)$', said, re.MULTILINE)
        assert purpose in line


def test_two_kinds_of_opencv_are_a_problem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    there = [it for it in ('opencv-python', 'opencv-python-headless') if is_installed(it)]
    for name in {'opencv-python', 'opencv-python-headless'} - set(there):
        installed_as_other(tmp_path, name)
    monkeypatch.syspath_prepend(tmp_path)
    assert status('doctor') == 1
    assert 'overwrite each other: pip uninstall' in capsys.readouterr().out


def test_opencv_of_a_distribution_is_not_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(doctor, '_OPENCV', ())
    status('doctor')
    said = capsys.readouterr().out
    assert ' (not of pip) with ' in said
    assert 'opencv' not in said


def test_a_missing_opencv_is_said_in_one_line() -> None:
    program = (
        'import sys; sys.modules["cv2"] = None; import ahf_ros.cli as it; sys.exit(it.main())'
    )
    done = python('-c', program, 'identify', 'a.png')
    assert (done.returncode, done.stderr) == (1, 'ahf: error: cv2 is missing, see ahf doctor\n')


@pytest.mark.parametrize('command', [('identify', ROOT / 'docs/pictures/report.jpg'), ('doctor',)])
def test_kernels_that_are_not_of_this_machine_are_said_in_one_line(
    command: tuple[object, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(kernels.VARIABLE, str(tmp_path / 'kernels.bin'))
    for content, said in ((None, 'does not exist'), (b'MZ', 'compiled for another machine')):
        if content:
            (tmp_path / 'kernels.bin').write_bytes(content)
        done = ahf(*command)
        assert (done.returncode, 'Traceback' in done.stderr) == (1, False)
        last = (done.stderr or done.stdout).splitlines()[-1]
        assert said in last and 'pip install . or python scripts/build_kernels.py' in last


def is_installed(name: str) -> bool:
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def test_identification_imports_nothing_of_what_is_extra(tmp_path: Path) -> None:
    """Neither ROS nor what only other commands need is imported by `ahf identify`."""
    folder = tmp_path / 'scene'
    assert status('render', folder, '--width', 800, '--height', 600, '--targets', 3) == 0
    program = (
        'import sys\n'
        'from ahf_ros.cli import main\n'
        f'status = main(["identify", {str(folder)!r}])\n'
        f'print(status, [it for it in {EXTRA} if it in sys.modules])\n'
    )
    done = python('-c', program)
    assert done.stdout.strip().endswith('0 []'), done.stdout + done.stderr


def test_the_command_needs_no_ros() -> None:
    assert ahf('doctor').stdout.startswith('ahf_ros ')
