"""Other packages that add a detector, made on the spot."""

import runpy
from pathlib import Path

from ahf_ros.families import GROUP, Detector, DetectorSettings
from support import ROOT

EXAMPLE = ROOT / 'docs' / 'examples' / 'my_detector.py'

MINE = 'mine'
"""Name of the detector that the package adds."""


def write_package(folder: Path, module: str, body: str = EXAMPLE.read_text()) -> None:
    """Write a package whose class `MyDetector` is the detector `MINE`."""
    (folder / f'{module}.py').write_text(body)
    told = folder / f'{module}-1.0.dist-info'
    told.mkdir()
    (told / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n')
    (told / 'entry_points.txt').write_text(f'[{GROUP}]\n{MINE} = {module}:MyDetector\n')


SLOW = """
import pathlib, time
class MyDetector:
    name = family = 'mine'
    calls = 0
    def __init__(self, settings):
        pass
    def __call__(self, image):
        MyDetector.calls += 1
        if MyDetector.calls > {fast}:
            pathlib.Path({mark!r}).touch()
            time.sleep(600)
        return []
"""
"""A detector that touches a file and hangs from a call on."""


def my_detector() -> Detector:
    """Return the detector of the example in the documentation."""
    return runpy.run_path(str(EXAMPLE))['MyDetector'](DetectorSettings())
