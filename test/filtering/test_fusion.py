"""Several results of one image, settled by how many agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ahf_ros.filtering.identifier import Identifier
from ahf_ros.filtering.settings import AdaptiveSettings, GeneticSettings
from ahf_ros.filtering.trials import fused
from ahf_ros.target import UNDECODED, Target


def at(number: int, x: float, y: float = 50.0) -> Target:
    return Target(number, number, x, y, 10.0, 8.0)


def places(results) -> list[tuple[int, float]]:
    return [(target.id, target.x) for target in fused(results)]


def test_what_the_best_filter_shows_and_what_two_others_do():
    best, second, third = [at(1, 100)], [at(2, 200), at(3, 300)], [at(2, 201)]
    assert places([best, second, third]) == [(1, 100), (2, 200)]


def test_the_place_is_that_of_the_best_filter_that_shows_a_target():
    assert places([[at(1, 100.5)], [at(1, 100)], [at(1, 103)]]) == [(1, 100.5)]


def test_two_ids_at_one_place_cancel_each_other_unless_one_is_clear():
    one, other = [at(1, 100)], [at(2, 102)]
    assert places([one, other, one]) == [(1, 100)]
    assert places([one, other, one, other]) == []
    assert places([one, other, other, other]) == [(2, 102)]
    assert places([one, other]) == []


def test_one_id_at_two_places():
    here, there = [at(1, 100)], [at(1, 400)]
    assert places([here, there, here, here]) == [(1, 100)]
    assert places([here, there, here, there]) == []


def test_one_id_of_two_families_is_two_targets():
    here, there = [replace(at(1, 100), family='aicon12')], [replace(at(1, 400), family='aicon14')]
    assert places([[*here, *there], here, there]) == [(1, 100), (1, 400)]
    assert places([here, there, [*here, *there]]) == [(1, 100), (1, 400)]


def test_undecoded_targets_are_left_out_and_nothing_is_nothing():
    assert places([[at(UNDECODED, 100)], [at(UNDECODED, 100)], []]) == []
    assert fused([]) == []


def test_a_search_that_finds_no_filter_for_all_shows_what_several_do():
    """Every image but the one received shows targets 1 to 3 or 2 to 4, by its mean."""
    image = np.random.default_rng(0).integers(0, 200, (40, 50)).astype(np.uint8)
    image[0, :3] = 1, 2, 3

    def detector(shown: np.ndarray) -> list[Target]:
        if shown[0, :3].tolist() == [1, 2, 3]:
            return []
        first = 1 + round(1000 * float(shown.mean())) % 2
        return [at(number, 100.0 * number) for number in range(first, first + 3)]

    def identify(**changes):
        settings = AdaptiveSettings(genetic=GeneticSettings(max_evaluations=30), **changes)
        return Identifier(detector, settings).identify(image, expected_targets=4)

    single = identify()
    assert single.count == 3
    together = identify(fusion=True)
    assert [target.id for target in together.targets] == [1, 2, 3, 4]
    assert together.filter.gamma_high == single.filter.gamma_high
    alone = identify(fusion=True, threads=1)
    assert alone.targets == together.targets
