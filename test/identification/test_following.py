"""Targets that are followed: the results are those of a fresh search, in less time."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from ahf_ros.base.target import Identification, Target
from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.families.contract import Confirmed
from ahf_ros.families.explained import without_targets
from ahf_ros.identification.filtering.identifier import Seen
from ahf_ros.identification.following import Following
from ahf_ros.identification.session import create_identifier
from ahf_ros.identification.session_settings import IdentificationSettings
from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.vision.parts import Part, area
from support.calls import calls_of

WALL = SceneSettings(width=1000, height=700, targets=8, dot_radius=8.0, seed=4, full_well=0.0)
STRIPES = replace(WALL, light='stripe', ambient=0.3)
FAMILY = {'family': WALL.family, 'threads': 1}
MARGIN = 40  # px about what is shown of a wall


def noisy(image: np.ndarray, seed: int) -> np.ndarray:
    """Return an image with noise of its own."""
    noise = np.random.default_rng(seed).normal(0.0, 1.2, image.shape)
    return np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)


def shown(image: np.ndarray, seed: int, x: int = 0, y: int = 0) -> np.ndarray:
    """Return what a camera shows of a wall that it is displaced from by some px."""
    height, width = (side - MARGIN for side in image.shape)
    return noisy(image[MARGIN + y : height + y, MARGIN + x : width + x], seed)


def check_alike(found: Identification, fresh: Identification) -> None:
    """Check that two identifications have the same targets, each in the same place."""
    assert [it.print for it in found] == [it.print for it in fresh]
    away = np.linalg.norm(found.centres - fresh.centres, axis=1)
    sigma = np.sqrt(np.trace(fresh.covariances, axis1=1, axis2=2) / 2)
    assert (away < 2 * sigma).all()


def followed(found: Iterable[Target]) -> set[int]:
    return {it.id for it in found if it.followed}


def sequence(images: Iterable[np.ndarray], **options: int) -> list[Identification]:
    """Identify images one after the other, and check each against a fresh search."""
    identifier, results = create_identifier(**FAMILY, **options), []
    for image in images:
        found = identifier.identify(image)
        check_alike(found, create_identifier(**FAMILY).identify(image))
        results.append(found)
    return results


@pytest.mark.parametrize('scene', [WALL, STRIPES], ids=['even', 'stripes'])
@pytest.mark.parametrize('step', [0, 3], ids=['still', 'moving'])
def test_all_targets_are_followed(scene: SceneSettings, step: int) -> None:
    wall = render(scene).image
    results = sequence(shown(wall, it, step * it, -step * it) for it in range(4))
    assert not followed(results[0])
    for before, found in pairwise(results):
        assert followed(found) == {*found.ids.tolist()} & {*before.ids.tolist()}
        assert len(followed(found)) >= 5


def test_a_pattern_moves_over_targets() -> None:
    phases = replace(STRIPES, phases=3)
    results = sequence(noisy(render(phases, it).image, it) for it in range(3))
    assert len(followed(results[-1])) >= 6


@pytest.mark.parametrize('scene', [WALL, STRIPES], ids=['even', 'stripes'])
def test_light_that_flickers_as_a_whole_is_nothing_new(scene: SceneSettings) -> None:
    wall, identifier = render(scene).image, create_identifier(**FAMILY)
    shown = wall * 1.15  # what is bright is white
    for number, gain in enumerate((1.0, 0.9, 1.05, 0.93)):
        image = noisy(shown * gain, number)
        check_alike(identifier.identify(image), create_identifier(**FAMILY).identify(image))
        assert identifier.memory.seen is not None
        assert identifier.memory.seen.still == number
    shadow = image.copy()
    shadow[:200, :200] //= 2
    identifier.identify(shadow)
    assert identifier.memory.seen.still == 0


def test_targets_are_covered_uncovered_and_replaced() -> None:
    wall = render(WALL)
    first, second = wall.targets[:2]
    prints = create_identifier(**FAMILY).identify(wall.image).prints
    without = without_targets(wall.image, [first], prints)
    # Another print in the place of the first one.
    reach, other = round(4.5 * second.semi_major), without.copy()
    (x, y), (left, top) = ((round(it.x), round(it.y)) for it in (second, first))
    sheet = wall.image[y - reach : y + reach + 1, x - reach : x + reach + 1]
    other[top - reach : top + reach + 1, left - reach : left + reach + 1] = sheet
    other = without_targets(other, [second], prints)
    images = [wall.image, without, wall.image, other]
    covered, back, another = sequence(noisy(it, number) for number, it in enumerate(images))[1:]
    assert first.id not in covered.ids
    assert first.id in back.ids
    assert first.id not in followed(back)
    assert first.id not in another.ids
    moved = next(it for it in another if it.id == second.id)
    assert np.hypot(moved.x - left, moved.y - top) < 2
    assert len(followed(another)) == len(wall.targets) - 2


def test_targets_enter_with_a_camera_that_pans() -> None:
    wall = render(replace(STRIPES, targets=20, dot_radius=6.0))
    views = [noisy(wall.image[5 * it :, 8 * it :][:500, :700], it) for it in range(20)]
    prints = create_identifier(**FAMILY).identify(views[0]).prints
    detector, searched = create_detector('ring', settings=DetectorSettings(family=WALL.family)), []

    def confirm(image: np.ndarray, targets: Sequence[Target]) -> Confirmed:
        again = detector.confirm(image, targets)

        def search(parts: Sequence[Part]) -> list[Target]:
            searched.append(sum(map(area, parts)))
            return again.search(parts)

        return replace(again, search=search)

    follow = Following(detector, confirm, prints, 30)
    seen = Seen(views[0], tuple(detector(views[0])))
    entered = set()
    for view in views[1:]:
        known = {it.print for it in seen.targets}
        seen = follow(view, seen)
        assert {it.print for it in seen.targets} == {it.print for it in detector(view)}
        entered |= {it.print for it in seen.targets} - known
    assert len(entered) >= 3
    assert np.median(searched) < 0.6 * views[0].size


def test_a_camera_that_jumps_searches_wholly() -> None:
    walls = [render(replace(WALL, seed=seed)).image for seed in (4, 5)]
    results = sequence(noisy(walls[it // 2], it) for it in range(4))
    assert [bool(followed(it)) for it in results] == [False, True, False, True]


def test_what_did_not_change_is_searched_in_turn() -> None:
    wall = render(WALL).image
    identifier = create_identifier(**FAMILY, follow=4)
    every = identifier.identify(noisy(wall, 0))
    seen = identifier.memory.seen
    assert seen is not None
    # As if the first search had missed one.
    identifier.memory = replace(identifier.memory, seen=replace(seen, targets=seen.targets[1:]))
    counts = [len(identifier.identify(noisy(wall, it))) for it in range(1, 5)]
    assert counts == sorted(counts)
    assert counts[-1] == len(every)


def test_equal_images_have_equal_results() -> None:
    image = render(WALL).image
    identifier = create_identifier(**FAMILY)
    first, second = identifier.identify(image), identifier.identify(image.copy())
    assert first.targets == second.targets


def test_an_array_may_be_filled_again() -> None:
    wall, identifier = render(WALL).image, create_identifier(**FAMILY)
    image = wall.copy()
    before = identifier.identify(image)
    image[:] = np.arange(image.shape[1]) // 8
    assert len(before) == 8
    assert not len(identifier.identify(image))


@pytest.mark.parametrize('other', ['size', 'type', 'off'])
def test_other_images_are_searched_wholly(other: str) -> None:
    wall = render(WALL).image
    identifier = create_identifier(**FAMILY, follow=0 if other == 'off' else 30)
    identifier.identify(noisy(wall, 0))
    image = noisy(wall, 1)
    image = {'size': image[:-8], 'type': image.astype(np.uint16) * 256, 'off': image}[other]
    fresh = create_identifier(**FAMILY).identify(image)
    assert identifier.identify(image).targets == fresh.targets


def test_results_do_not_depend_on_threads() -> None:
    wall = render(STRIPES).image
    images = [shown(wall, it, 2 * it, it) for it in range(3)]
    results = []
    for threads in (1, 3):
        identifier = create_identifier(family=WALL.family, threads=threads, expected_targets=8)
        results.append([identifier.identify(it).targets for it in images])
    assert results[0] == results[1]


def test_following_takes_a_part_of_the_calls() -> None:
    wall = render(STRIPES).image
    images = [noisy(wall, it) for it in range(7)]
    counts = []
    for interval in (0, 30):
        identifier = create_identifier(**FAMILY, follow=interval)
        identifier.identify(images[0])
        counts.append(calls_of(lambda it=identifier: [it.identify(of) for of in images[1:]]))
    assert counts[1] < 0.7 * counts[0]


def test_how_often_all_is_searched_is_checked() -> None:
    with pytest.raises(ValueError, match='follow is -1, accepted is an integer from 0'):
        IdentificationSettings(follow=-1)
