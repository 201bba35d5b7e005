"""Places taken from the image as received, for targets that were found elsewhere."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.families.ring.refinement import refine_centres
from ahf_ros.identification.filtering.identifier import Identifier
from ahf_ros.identification.filtering.settings import AdaptiveSettings, GeneticSettings
from ahf_ros.prints.ring import family
from ahf_ros.scenes.scene import SceneSettings
from support.scenes import rendered

SCENE = SceneSettings(width=700, height=500, targets=6, dot_radius=16.0, light='stripe', seed=3)
CODE = family('metashape12')


def found(scene: SceneSettings) -> list[Target]:
    """Return the targets of a scene as something less exact would report them."""
    generator = np.random.default_rng(1)
    return [
        replace(target, x=target.x + dx, y=target.y + dy, confidence=0.7, covariance=(0.0,) * 4)
        for target, (dx, dy) in zip(
            rendered(scene).targets, generator.uniform(-0.6, 0.6, (6, 2)), strict=True
        )
    ]


def distances(targets: list[Target], scene: SceneSettings) -> np.ndarray:
    truth = {target.id: target for target in rendered(scene).targets}
    return np.array([np.hypot(it.x - truth[it.id].x, it.y - truth[it.id].y) for it in targets])


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
def test_places_become_those_of_the_image(polarity: str) -> None:
    scene = replace(SCENE, polarity=polarity)
    targets = found(scene)
    refined = refine_centres(rendered(scene).image, targets, [CODE])
    assert distances(targets, scene).max() > 0.4
    assert distances(refined, scene).max() < 0.05
    for before, after in zip(targets, refined, strict=True):
        assert (after.id, after.code, after.confidence) == (before.id, before.code, 0.7)
        assert 0 < np.linalg.det(np.reshape(after.covariance, (2, 2))) < 1e-4


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
def test_small_dots_are_not_taken_for_their_own_inside(polarity: str) -> None:
    scene = replace(SCENE, targets=24, polarity=polarity, dot_radius=7.0, light='normal')
    shown = rendered(scene)
    refined = refine_centres(shown.image, shown.targets, [CODE])
    for before, after in zip(shown.targets, refined, strict=True):
        assert after.semi_major == pytest.approx(before.semi_major, abs=0.7)
    assert distances(refined, scene).max() < 0.04


def test_images_of_16_bit_give_the_same() -> None:
    image, targets = rendered(SCENE).image, found(SCENE)
    expected = refine_centres(image, targets, [CODE])
    refined = refine_centres(image.astype(np.uint16) * 16, targets, [CODE])
    assert 255 / image.max() < 1.5  # images of more bits are scaled to their largest value
    places = [[(it.x, it.y) for it in of] for of in (refined, expected)]
    assert np.abs(np.subtract(*places)).max() < 0.01


def test_undecoded_targets_get_the_centre_of_their_dot() -> None:
    targets = [replace(it, id=UNDECODED, code=0) for it in found(SCENE)]
    refined = refine_centres(rendered(SCENE).image, targets, [CODE])
    truth = np.array([(it.x, it.y) for it in rendered(SCENE).targets])
    places = np.array([(it.x, it.y) for it in refined])
    assert np.linalg.norm(places - truth, axis=1).max() < 0.12
    assert {it.id for it in refined} == {UNDECODED}


def test_a_band_that_says_something_else_is_not_used() -> None:
    """The centre of the ellipse of an oblique dot is not the image of its centre."""
    scene = replace(SCENE, light='normal', tilt=50.0, focal_length=2.0)
    own, targets = rendered(scene), found(scene)
    other = [replace(it, code=CODE.word(it.id % len(CODE.words) + 1)) for it in targets]
    undecoded = [replace(it, id=UNDECODED, code=0) for it in targets]
    by_dot, of_dot, by_band = (
        refine_centres(own.image, of, [CODE]) for of in (other, undecoded, targets)
    )
    assert [(it.x, it.y) for it in by_dot] == [(it.x, it.y) for it in of_dot]
    assert [it.id for it in by_dot] == [it.id for it in targets]
    assert distances(by_band, scene).max() < distances(by_dot, scene).max() / 2


def test_targets_without_an_edge_stay_as_they_are() -> None:
    image = rendered(SCENE).image.copy()
    lost, *others = found(SCENE)
    cv2.circle(image, (round(lost.x), round(lost.y)), 70, 90, cv2.FILLED)
    refined = refine_centres(image, [lost, *others], [CODE])
    assert refined[0] is lost
    assert all(after != before for after, before in zip(refined[1:], others, strict=True))


def test_targets_do_not_move_far() -> None:
    """An error of a quarter of the radius is another dot, or none."""
    target, *_ = rendered(SCENE).targets
    far = replace(target, x=target.x + 0.25 * target.semi_minor)
    assert refine_centres(rendered(SCENE).image, [far], [CODE]) == [far]


def test_nothing_is_refined_to_nothing() -> None:
    assert refine_centres(rendered(SCENE).image, [], [CODE]) == []


@pytest.mark.lasting
@pytest.mark.parametrize('name', ['ring', 'traditional'])
def test_a_filter_leaves_no_trace_in_the_places(name: str) -> None:
    """The detector is blind to the image as received; AHF refines there all the same."""
    image = rendered(SCENE).image

    class Filtered(type(create_detector(name, family='metashape12'))):
        def __call__(self, shown: Any) -> list[Target]:
            return [] if shown is image else super().__call__(shown)

    settings = AdaptiveSettings(threads=1, genetic=GeneticSettings(max_evaluations=6))
    detector = Filtered(DetectorSettings(family='metashape12'))
    result = Identifier(detector, settings, refine=detector.refine).identify(
        image, expected_targets=6
    )
    unrefined = Identifier(detector, settings).identify(image, expected_targets=6)
    assert result.filter.applied
    assert result.count == unrefined.count >= 4
    before, after = (distances(of.targets, SCENE) for of in (unrefined, result))
    assert np.sqrt((after**2).mean()) < 0.7 * np.sqrt((before**2).mean())


def test_bright_dots_on_black_keep_their_size() -> None:
    """Where black is 0, edges within a bright dot are as clear as its outline."""
    scene = replace(SCENE, targets=12, dot_radius=8.0, polarity='bright', light='normal')
    dark = np.rint((rendered(scene).image / 255) ** 3 * 120)
    image = np.where(dark < 6, 0, dark).astype(np.uint8)
    detector = create_detector('ring', family='metashape12')
    targets = detector(image)
    assert len(targets) == 12
    for target, refined in zip(targets, detector.refine(image, targets), strict=True):
        assert refined.semi_major == pytest.approx(target.semi_major, rel=0.02)
        assert np.hypot(refined.x - target.x, refined.y - target.y) < 0.02
