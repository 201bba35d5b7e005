"""What both detectors of ring codes promise."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.families import create_detector
from ahf_ros.prints.ring import FAMILY_NAMES
from support.scenes import SMALL, counts, errors_of, rendered, scored

SCENES = [('ring', 'normal'), ('ring', 'stripe'), ('traditional', 'normal')]


@pytest.fixture(params=['ring', 'traditional'])
def detector(request: pytest.FixtureRequest) -> Any:
    return create_detector(request.param, family='metashape12')


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
@pytest.mark.parametrize('family', FAMILY_NAMES)
@pytest.mark.parametrize(('name', 'maximum_error'), [('ring', 0.03), ('traditional', 0.05)])
def test_all_targets_of_every_family(
    name: str, maximum_error: float, family: Any, polarity: str
) -> None:
    figures = scored(rendered(replace(SMALL, family=family, polarity=polarity)), name)
    assert counts(figures) == (6, 0, 0)
    assert errors_of(figures)[-1] < maximum_error


@pytest.mark.parametrize(
    'converted',
    [
        lambda image: image.astype(np.uint16) * 16,
        lambda image: image.astype(np.float32) / 255,
        lambda image: image.astype(np.float64) * 1e3,
    ],
    ids=['12 bit', 'float32', 'float64'],
)
@pytest.mark.parametrize(('name', 'light'), SCENES)
def test_other_types_of_pixels_show_the_same(converted: Any, name: str, light: str) -> None:
    image = rendered(replace(SMALL, light=light)).image
    detector = create_detector(name, family='metashape12')
    expected, found = detector(image), detector(converted(image))
    assert expected and [target.id for target in found] == [target.id for target in expected]
    for target, other in zip(found, expected, strict=True):
        assert (target.x, target.y) == pytest.approx((other.x, other.y), abs=0.05)


def test_a_mirrored_image_shows_other_codes(detector: Any) -> None:
    rendering = rendered(SMALL)
    mirrored = detector(np.ascontiguousarray(rendering.image[:, ::-1]))
    assert {target.id for target in mirrored} != {target.id for target in rendering.targets}


def test_noise_shows_no_targets(detector: Any) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (600, 800)).astype(np.uint8)
    assert detector(noise) == []
    assert detector(cv2.GaussianBlur(noise, (0, 0), 5) * 4) == []


@pytest.mark.parametrize(('name', 'light'), SCENES)
def test_the_result_does_not_depend_on_threads(name: str, light: str) -> None:
    image = rendered(replace(SMALL, light=light)).image
    detector = create_detector(name, family='metashape12')
    expected = detector(image)
    threads = cv2.getNumThreads()
    try:
        for number in (1, 3):
            cv2.setNumThreads(number)
            assert detector(image) == expected
    finally:
        cv2.setNumThreads(threads)
    with ThreadPoolExecutor(4) as executor:
        assert list(executor.map(detector, [image] * 4)) == [expected] * 4


def test_the_image_is_not_changed(detector: Any) -> None:
    image = rendered(SMALL).image.astype(np.float32)
    before = image.copy()
    detector(image)
    assert (image == before).all()
