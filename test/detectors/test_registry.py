"""The registry of detectors and the settings that they share."""

from __future__ import annotations

import runpy
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros import detectors
from ahf_ros.detectors import DETECTOR, DETECTOR_NAMES, GROUP, DetectorSettings, create
from ahf_ros.detectors.contract import ProgramSettings
from ahf_ros.filtering.identifier import identify

EXAMPLE = Path(__file__).parents[2] / 'docs' / 'examples' / 'my_detector.py'


NEEDS_MARKERS = pytest.mark.skipif(
    not hasattr(getattr(cv2, 'aruco', None), 'ArucoDetector'),
    reason=f'OpenCV {cv2.__version__} has no square markers',
)


@pytest.mark.parametrize(
    'name',
    [
        pytest.param(name, marks=NEEDS_MARKERS if name in ('aruco', 'apriltag') else ())
        for name in DETECTOR_NAMES
    ],
)
def test_every_detector_is_called_as_it_is_registered(name):
    made = create(name, DetectorSettings(program=ProgramSettings(command='program')))
    assert made.name == name
    assert made.family


def test_the_default_is_registered():
    assert DETECTOR.default in DETECTOR_NAMES


def test_an_unknown_detector_is_refused_by_name():
    with pytest.raises(ValueError, match=r"detector is 'magic', accepted is one of .*traditional"):
        create('magic')


def test_settings_reach_the_detector():
    settings = DetectorSettings(family='aicon14')
    assert create('traditional', settings).settings == settings


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'family': 'ring12'}, r"family is 'ring12', accepted is one of metashape12, "),
        ({'polarity': 'black'}, r"polarity is 'black', accepted is one of auto, dark, bright"),
        ({'min_radius': 0.5}, r'min_radius is 0.5, accepted is a number from 1 to 10000'),
        ({'min_radius': 61.0}, r'min_radius is 61.0, accepted .* at most max_radius, 60.0'),
        ({'report_undecoded': 1}, r'report_undecoded is 1, accepted is true or false'),
    ],
)
def test_settings_that_make_no_sense_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        DetectorSettings(**change)


def added(tmp_path, monkeypatch, module: str, body: str):
    """Return the registry of a process in which another package has added a detector."""
    (tmp_path / f'{module}.py').write_text(body)
    told = tmp_path / f'{module}-1.0.dist-info'
    told.mkdir()
    (told / 'METADATA').write_text(f'Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n')
    (told / 'entry_points.txt').write_text(f'[{GROUP}]\nmine = {module}:MyDetector\n')
    monkeypatch.syspath_prepend(str(tmp_path))
    return runpy.run_path(detectors.__file__)


def test_a_detector_of_another_package(tmp_path, monkeypatch):
    registry = added(tmp_path, monkeypatch, 'package_with_detector', EXAMPLE.read_text())
    assert registry['DETECTOR_NAMES'] == (*DETECTOR_NAMES, 'mine')
    detector = registry['create']('mine', DetectorSettings(min_radius=5.0))
    image = np.full((100, 120), 200, np.uint8)
    cv2.circle(image, (40, 50), 8, 20, -1)
    (target,) = detector(image)
    assert (target.x, target.y) == pytest.approx((40, 50), abs=0.1)
    assert identify(image, detector, expected=1).count == 1


def test_a_detector_of_another_package_that_cannot_be_imported(tmp_path, monkeypatch):
    registry = added(tmp_path, monkeypatch, 'package_that_is_broken', 'import nothing_like_this')
    assert registry['create']('ring').name == 'ring'
    with pytest.raises(ValueError, match="detector is 'mine', but package_that_is_broken:MyDet"):
        registry['create']('mine')


FAILING = """
import time
import numpy as np
class MyDetector:
    name = family = 'mine'
    def __init__(self, settings):
        pass
    def __call__(self, image):
        if image.max() == 1:
            time.sleep(3600)
        if image.max() == 2:
            raise KeyError('weights')
        if image.max() == 3:
            raise ValueError('image is too dark')
        return []
    def refine(self, image, targets):
        raise RuntimeError('no GPU')
"""


@pytest.mark.parametrize(
    ('gray', 'words'),
    [
        (1, "detector 'mine' took longer than detector_timeout, 0.2 s"),
        (2, "detector 'mine' failed: KeyError: 'weights'"),
        (3, "detector 'mine' failed: ValueError: image is too dark"),
    ],
)
def test_a_detector_of_another_package_may_fail_and_hang(tmp_path, monkeypatch, gray, words):
    registry = added(tmp_path, monkeypatch, f'package_that_fails_{gray}', FAILING)
    detector = registry['create']('mine', DetectorSettings(detector_timeout=0.2))
    image = np.full((20, 20), gray, np.uint8)
    image[0] = 0
    with pytest.raises(ValueError) as raised:
        identify(image, detector, expected=0)
    assert str(raised.value) == words
    with pytest.raises(ValueError, match="detector 'mine' failed: RuntimeError: no GPU"):
        detector.refine(image, [])
    assert detector.draft is None


def test_a_search_ends_when_a_detector_hangs_in_it(tmp_path, monkeypatch):
    body = FAILING.replace('image.max() == 1', 'image.max() > 100')
    registry = added(tmp_path, monkeypatch, 'package_that_hangs', body)
    detector = registry['create']('mine', DetectorSettings(detector_timeout=0.2))
    image = np.full((20, 20), 60, np.uint8)
    image[0] = 0
    assert identify(image, detector, expected=0).targets == ()
    with pytest.raises(ValueError, match='took longer than detector_timeout'):
        identify(image, detector, expected=5)
