"""The registry of detectors and the settings that they share."""

import gc
import runpy
import time
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NoReturn

import cv2
import numpy as np
import pytest

from ahf_ros import families as detectors
from ahf_ros.base.target import Target
from ahf_ros.families import (
    DETECTOR_NAMES,
    FAMILY_NAMES,
    Detector,
    DetectorSettings,
    Drafter,
    EarlyStopping,
    Refiner,
    create_detector,
    detector_name,
    estimator,
)
from ahf_ros.families.external.guarded import guarded
from ahf_ros.identification.session import identify
from ahf_ros.identification.session_settings import IdentificationSettings
from ahf_ros.prints.families import KINDS
from support.packages import EXAMPLE, write_package
from support.square_markers import needs_square_markers

RAMP = np.arange(60, dtype=np.uint8) + np.zeros((20, 1), np.uint8)
OWN = {'gsi': 'gsi', 'dots': 'dots', 'cctag': 'cctag3'}
SQUARES = {
    'aruco': 'aruco_4x4_50',
    'apriltag': 'apriltag_36h11',
    'square': 'aruco_4x4_50,apriltag_36h11',
}


ALL = [
    pytest.param(name, marks=needs_square_markers if name in SQUARES else ())
    for name in DETECTOR_NAMES
]


def made(name: str) -> Detector:
    """Return a detector of a family that it identifies."""
    kind = name.partition('_')[0]
    family = SQUARES.get(name) or (
        kind if kind in ('gsi', 'dots') else OWN.get(kind, 'metashape12')
    )
    detector = create_detector(name, family=family, command='program')
    assert (detector.name, detector.family) == (name, family)
    return detector


@pytest.mark.parametrize('name', ALL)
@pytest.mark.parametrize(
    ('image', 'message'),
    [
        (np.zeros((0, 0), np.uint8), 'image'),
        (np.zeros((1, 1), np.uint8), 'image'),
        (np.full((50, 50), 7, np.uint8), 'constant'),
        (np.full((50, 50), np.nan), 'NaN'),
        (np.zeros((50, 50, 3), np.uint8), 'shape'),
    ],
)
def test_every_detector_is_called_as_registered_and_refuses_what_is_no_image(
    name: str, image: np.ndarray, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        made(name)(image)


def test_every_family_chooses_a_detector() -> None:
    for family in FAMILY_NAMES:
        kind = family.partition('_')[0]
        kind = kind.rstrip('34') if kind in ('cctag3', 'cctag4') else kind
        name = kind if kind in ('aruco', 'apriltag', 'gsi', 'dots', 'cctag') else 'ring'
        assert detector_name('auto', DetectorSettings(family=family)) == name


@pytest.mark.parametrize(
    ('name', 'family', 'accepted'),
    [
        ('aruco', 'metashape12', ['auto, ring, traditional, command', 'aruco_4x4_50, ']),
        ('ring', 'apriltag_36h11', ['auto, apriltag, square, command', 'one of metashape12, ']),
        ('traditional', 'aicon12,aicon14', ['auto, ring, command', 'one of metashape12, ']),
        ('aruco', 'metashape12,aicon12', ['auto, ring, command', 'aruco_4x4_50, ']),
    ],
)
def test_a_detector_that_does_not_identify_the_family_is_refused(
    name: str, family: str, accepted: list[str]
) -> None:
    with pytest.raises(ValueError) as caught:
        create_detector(name, family=family)
    message = str(caught.value)
    assert message.startswith(f'detector is {name!r} and family is {family!r}; accepted with')
    assert all(part in message for part in accepted)


def test_a_detector_reads_all_families_that_it_can() -> None:
    names = 'auto', 'ring', 'traditional', 'gsi_published', 'command'
    read = [create_detector(name, family='auto', command='program').family for name in names]
    assert read == ['auto', ','.join(KINDS['ring']), 'metashape12', 'gsi', 'auto']


def test_a_family_that_is_not_there_is_refused_with_those_that_are() -> None:
    with pytest.raises(ValueError, match=r"family is 'aruco', accepted is .*, apriltag_36h11"):
        create_detector(family='aruco')


def test_only_families_that_can_be_counted_are_estimated() -> None:
    assert estimator(DetectorSettings(family='aicon12'))
    square = DetectorSettings(family='aruco_4x4_50')
    message = (
        "estimate_expected is True and family is 'aruco_4x4_50'; accepted .* False, .*aicon14"
    )
    with pytest.raises(ValueError, match=message):
        estimator(square)
    with pytest.raises(ValueError, match=message):
        IdentificationSettings(estimate_expected=True, detection=square)


@pytest.mark.parametrize('name', ALL)
def test_refinement_drafts_and_patience_are_part_of_the_contract(name: str) -> None:
    detector = made(name)
    assert isinstance(detector, Refiner) == (not name.endswith('_published') and name != 'command')
    assert isinstance(detector, Drafter) == (name in SQUARES)
    # Only detectors that hardly need a filter have a patience.
    assert isinstance(detector, EarlyStopping) == (name in ('ring', 'gsi', 'dots'))


def test_an_unknown_detector_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"detector is 'magic', accepted is one of .*traditional"):
        create_detector('magic')


def test_settings_reach_the_detector() -> None:
    settings = DetectorSettings(family='aicon14')
    assert create_detector('traditional', settings=settings).settings == settings


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'family': 'ring12'}, r"family is 'ring12', accepted is one of metashape12, "),
        ({'polarity': 'black'}, r"polarity is 'black', accepted is one of auto, dark, bright"),
        ({'min_radius': -0.5}, r'min_radius is -0.5, accepted is a number from 0 to 10000'),
        (
            {'min_radius': 61.0, 'max_radius': 60.0},
            r'min_radius is 61.0, accepted .* at most max_radius, 60.0',
        ),
        ({'report_undecoded': 1}, r'report_undecoded is 1, accepted is true or false'),
    ],
)
def test_settings_that_make_no_sense_are_refused(change: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        DetectorSettings(**change)


def added(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, body: str
) -> dict[str, Any]:
    """Return the registry of a process in which another package has added a detector."""
    write_package(tmp_path, module, body)
    monkeypatch.syspath_prepend(str(tmp_path))
    return runpy.run_path(detectors.__file__)


def test_a_detector_of_another_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    registry = added(tmp_path, monkeypatch, 'package_with_detector', EXAMPLE.read_text())
    assert registry['DETECTOR_NAMES'] == (*DETECTOR_NAMES, 'mine')
    detector = registry['create_detector']('mine', min_radius=5.0, detector_timeout=600.0)
    assert detector.timeout == 600.0
    image = np.full((100, 120), 200, np.uint8)
    cv2.circle(image, (40, 50), 8, 20, -1)
    (target,) = detector(image)
    assert (target.x, target.y) == pytest.approx((40, 50), abs=0.1)
    assert identify(image, detector=detector, expected_targets=1).count == 1


def test_a_detector_of_another_package_that_cannot_be_imported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    registry = added(tmp_path, monkeypatch, 'package_that_is_broken', 'import nothing_like_this')
    assert registry['create_detector']('ring').name == 'ring'
    with pytest.raises(ValueError, match="detector is 'mine', but package_that_is_broken:MyDet"):
        registry['create_detector']('mine')


HOSTILE = """
import sys
class MyDetector:
    name, family = 'mine', {family}
    def __init__(self, settings):
        {made}
"""


@pytest.mark.parametrize(
    ('number', 'family', 'made', 'reason'),
    [
        (0, '5', 'pass', 'family is 5, accepted is a printable text of at most 200 characters'),
        (1, 'chr(0xD800)', 'pass', r"family is '\ud800', accepted is a printable text of at most"),
        (2, 'property(lambda _: 1 / 0)', 'pass', 'name or family cannot be read: ZeroDivisionE'),
        (3, "'a'", "raise KeyError('weights')", "KeyError: 'weights'"),
        (4, "'a'", 'raise ValueError(chr(0xD800))', r'\ud800'),
        (5, "'a'", 'sys.exit(0)', 'SystemExit: 0'),
    ],
)
def test_a_detector_of_another_package_that_cannot_be_made(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    number: int,
    family: str,
    made: str,
    reason: str,
) -> None:
    module = f'package_not_made_{number}'
    registry = added(tmp_path, monkeypatch, module, HOSTILE.format(family=family, made=made))
    with pytest.raises(ValueError) as raised:
        registry['create_detector']('mine')
    expected = f"detector is 'mine', but {module}:MyDetector cannot be loaded: {reason}"
    assert str(raised.value).startswith(expected)


class Plugin:
    """A detector of another package, which returns what a function makes of an image."""

    name = family = 'mine'

    def __init__(self, call: Any) -> None:
        self._call = call

    def __call__(self, image: np.ndarray) -> Any:
        try:
            return self._call(image)
        finally:
            image[:] = 0

    def refine(self, image: np.ndarray, targets: Any) -> NoReturn:
        raise RuntimeError('no GPU')


class Endless(list):
    def __iter__(self) -> Iterator[Target]:
        while True:
            yield Target(7, 19, 1.0, 2.0, 4.0, 3.0)


class Raising(Target):
    def __getattribute__(self, name: str) -> NoReturn:
        raise RuntimeError('no fields')


def failing(error: BaseException) -> Callable[[np.ndarray], NoReturn]:
    def fail(image: np.ndarray) -> NoReturn:
        raise error

    return fail


@pytest.mark.parametrize(
    ('call', 'message'),
    [
        (lambda _: time.sleep(3600), 'took longer than detector_timeout, 0.2 s'),
        (failing(KeyError('weights')), "failed: KeyError: 'weights'"),
        (failing(ValueError('image is too dark')), 'failed: ValueError: image is too dark'),
        (failing(SystemExit(0)), 'failed: SystemExit: 0'),
        (Endless, 'returned more targets than are accepted, at most 100000'),
        (lambda _: [Raising(7, 19, 1.0, 2.0, 4.0, 3.0)], 'failed: RuntimeError: no fields'),
    ],
)
def test_no_failure_and_no_result_of_another_package_gets_past_its_guard(
    call: Any, message: str
) -> None:
    detector = guarded(Plugin(call), 0.2 if 'longer' in message else 600.0)
    image = RAMP.copy()
    with pytest.raises(ValueError) as raised:
        identify(image, detector=detector, expected_targets=0)
    assert str(raised.value) == f"detector 'mine' {message}"
    assert (image == RAMP).all()


def test_a_refinement_that_fails() -> None:
    with pytest.raises(ValueError, match="detector 'mine' failed: RuntimeError: no GPU"):
        guarded(Plugin(list), 600.0).refine(RAMP, [])


def test_no_image_that_a_detector_failed_on_stays_in_memory() -> None:
    images = []

    def fail(image: np.ndarray) -> NoReturn:
        images.append(weakref.ref(image))
        raise RuntimeError('no')

    gc.collect()
    gc.disable()
    try:
        with pytest.raises(ValueError, match="detector 'mine' failed: RuntimeError: no"):
            guarded(Plugin(fail), 60.0)(RAMP)
        limit = time.monotonic() + 60
        while images[0]() is not None:  # until the thread has ended, too
            assert time.monotonic() < limit
            time.sleep(0.01)
    finally:
        gc.enable()


def test_a_search_ends_when_a_detector_hangs_in_it() -> None:
    plugin = Plugin(lambda image: time.sleep(3600) if image.max() > 100 else [])
    assert identify(RAMP, detector=guarded(plugin, 600.0), expected_targets=0).targets == ()
    with pytest.raises(ValueError, match='took longer than detector_timeout'):
        identify(RAMP, detector=guarded(plugin, 0.2), expected_targets=5)
