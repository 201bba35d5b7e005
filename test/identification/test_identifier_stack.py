"""Stacks of images in AHF: the combination is chosen by the identification."""

from typing import Any

import numpy as np
import pytest

from ahf_ros.base.target import Target
from ahf_ros.identification.filtering.identifier import Identifier, Memory
from ahf_ros.identification.filtering.settings import AdaptiveSettings, GeneticSettings
from ahf_ros.vision.stack import COMBINATIONS, ImageStack

GENERATOR = np.random.default_rng(3)
IMAGES = tuple(GENERATOR.integers(20, 200, (40, 40)).astype(np.uint8) for _ in range(3))
STACK = ImageStack(IMAGES)
SHORT = AdaptiveSettings(genetic=GeneticSettings(max_evaluations=12))


def targets(count: int) -> list[Target]:
    return [Target(n, n, 9.0 * n, 1.0, 1.0, 1.0) for n in range(1, count + 1)]


class Liking:
    """A detector that sees five targets in a combination, and in others two."""

    def __init__(self, name: str) -> None:
        self.image = STACK.combined(name)
        self.images: list[np.ndarray] = []

    def __call__(self, image: np.ndarray) -> list[Target]:
        self.images.append(image)
        return targets(5 if np.array_equal(image, self.image) else 2)


@pytest.mark.parametrize('name', COMBINATIONS)
def test_the_first_combination_that_shows_n_is_chosen_before_any_search(name: Any) -> None:
    detector = Liking(name)
    identifier = Identifier(detector, SHORT, expected_targets=5)
    found = identifier.identify(STACK)
    assert (found.count, found.combination, found.filter.applied) == (5, name, False)
    assert found.filter.evaluations == len(detector.images) == COMBINATIONS.index(name) + 1
    assert identifier.last_search is None
    again = identifier.identify(STACK)
    assert (again.combination, again.filter.evaluations) == (name, 1)


def test_without_n_the_most_promising_combination_is_looked_at_alone() -> None:
    detector = Liking('mean_gray')
    found = Identifier(detector).identify(STACK)
    assert (found.combination, found.count, len(detector.images)) == (COMBINATIONS[0], 2, 1)


def test_the_combination_is_a_gene_of_the_search() -> None:
    def detector(image: np.ndarray) -> list[Target]:
        plain = any(np.array_equal(image, STACK.combined(name)) for name in COMBINATIONS)
        return targets(2 if plain else 4)

    settings = AdaptiveSettings(genetic=GeneticSettings(max_evaluations=40))
    identifier = Identifier(detector, settings, expected_targets=5)
    found = identifier.identify(STACK)
    assert (found.count, found.filter.applied) == (4, True)
    assert identifier.last_search is not None
    numbers = {int(values[-1]) for values in identifier.last_search.tried}
    assert numbers == set(range(len(COMBINATIONS)))
    assert found.search is not None
    assert set(found.search.combinations) == set(COMBINATIONS)
    assert {len(values) for values in identifier.last_search.tried} == {5}
    assert found.filter.evaluations == 40 + len(COMBINATIONS)


def test_a_result_does_not_depend_on_threads() -> None:
    def identified(threads: int) -> object:
        settings = AdaptiveSettings(threads=threads, genetic=SHORT.genetic)
        found = Identifier(
            lambda image: targets(int(image.mean()) % 7), settings, expected_targets=8
        ).identify(STACK)
        return found.targets, found.combination, found.filter.gamma_high

    assert identified(1) == identified(3)


@pytest.mark.parametrize('kind', [np.uint8, np.uint16, np.float32])
def test_a_stack_of_one_image_is_that_image(kind: Any) -> None:
    image = IMAGES[0].astype(kind)
    results = []
    for received in (image, ImageStack((image,))):
        identifier = Identifier(
            lambda image: targets(int(image.mean()) % 7), SHORT, expected_targets=8
        )
        found = identifier.identify(received)
        results.append((found.targets, found.combination, identifier.memory))
    assert results[0] == results[1]
    assert results[0][1] == ''


def test_refinement_gets_the_combination_that_was_chosen() -> None:
    seen: list[np.ndarray] = []
    stack = ImageStack(tuple(image.astype(np.uint16) for image in IMAGES))

    def refine(image: np.ndarray, found: list[Target]) -> list[Target]:
        seen.append(image)
        return found

    found = Identifier(lambda image: targets(3), refine=refine).identify(stack)
    assert found.combination == COMBINATIONS[0]
    assert len(seen) == 1
    assert np.array_equal(seen[0], stack.combined(COMBINATIONS[0]))


@pytest.mark.parametrize('memory', [(2.0, 0.5, 0.0, 0.0), (1.0,), (2.0, 0.5, 0.0, 0.0, 1.0)])
@pytest.mark.parametrize('received', [IMAGES[0], STACK])
def test_what_worked_for_other_images_is_no_obstacle(memory: Any, received: Any) -> None:
    identifier = Identifier(lambda image: targets(3), expected_targets=3)
    identifier.memory = Memory(memory)
    assert identifier.identify(received).count == 3


def test_a_combination_without_contrast_shows_nothing() -> None:
    same = ImageStack((IMAGES[0], IMAGES[0]))
    found = Identifier(lambda image: targets(3), SHORT, expected_targets=4).identify(same)
    assert found.count == 3


def test_stacks_are_searched_at_half_their_size() -> None:
    settings = AdaptiveSettings(coarse=True, genetic=GeneticSettings(max_evaluations=8))
    shapes: set[tuple[int, ...]] = set()

    def detector(image: np.ndarray) -> list[Target]:
        shapes.add(image.shape)
        return targets(1)

    Identifier(detector, settings, expected_targets=2).identify(STACK)
    assert shapes == {(40, 40), (20, 20)}
