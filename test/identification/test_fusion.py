"""Several results of one image, settled by how many agree."""

from dataclasses import replace
from typing import Any

import numpy as np

from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.identification.filtering.identifier import Identifier
from ahf_ros.identification.filtering.settings import AdaptiveSettings, GeneticSettings
from ahf_ros.identification.filtering.trials import fused


def at(number: int, x: float, y: float = 50.0) -> Target:
    return Target(number, number, x, y, 10.0, 8.0)


def places(results: Any) -> list[tuple[int, float]]:
    return [(target.id, target.x) for target in fused(results)]


def test_what_the_best_filter_shows_and_what_two_others_do() -> None:
    best, second, third = [at(1, 100)], [at(2, 200), at(3, 300)], [at(2, 201)]
    assert places([best, second, third]) == [(1, 100), (2, 200)]


def test_the_place_is_that_of_the_best_filter_that_shows_a_target() -> None:
    assert places([[at(1, 100.5)], [at(1, 100)], [at(1, 103)]]) == [(1, 100.5)]


def test_two_ids_at_one_place_cancel_each_other_unless_one_is_clear() -> None:
    one, other = [at(1, 100)], [at(2, 102)]
    assert places([one, *[other] * 5]) == [(2, 102)]
    assert places([one, *[other] * 4]) == []
    assert places([one, *[other] * 5, one]) == []
    assert places([*[one] * 5, other]) == [(1, 100)]
    assert places([one, other]) == []


def test_one_id_at_two_places() -> None:
    here, there = [at(1, 100)], [at(1, 400)]
    assert places([there, *[here] * 5]) == [(1, 100)]
    assert places([there, *[here] * 4]) == []


def test_all_that_contradicts_counts_together() -> None:
    """A spot of light may look like a target wherever there is one, through few filters each."""
    often, elsewhere = [at(1, 100)], [[at(1, 400)], [at(1, 700)]]
    assert places([*[often] * 5, elsewhere[0]]) == [(1, 100)]
    assert places([*[often] * 9, *elsewhere]) == []
    assert places([*[often] * 10, *elsewhere]) == [(1, 100)]


def test_dots_that_overlap_cannot_both_be_there() -> None:
    dot, beside, apart = at(1, 100), at(2, 119), at(2, 121)
    assert places([[dot], [dot], [beside], [beside]]) == []
    assert places([[dot], [dot], [apart], [apart]]) == [(1, 100), (2, 121)]


def test_one_id_of_two_families_is_two_targets() -> None:
    here, there = [replace(at(1, 100), family='aicon12')], [replace(at(1, 400), family='aicon14')]
    assert places([[*here, *there], here, there]) == [(1, 100), (1, 400)]
    assert places([here, there, [*here, *there]]) == [(1, 100), (1, 400)]


def test_undecoded_targets_are_left_out_and_nothing_is_nothing() -> None:
    assert places([[at(UNDECODED, 100)], [at(UNDECODED, 100)], []]) == []
    assert fused([]) == []


IMAGE = np.random.default_rng(0).integers(0, 200, (40, 50)).astype(np.uint8)
IMAGE[0, :3] = 1, 2, 3


def three(shown: np.ndarray) -> list[Target]:
    """Return targets 1 to 3 or 2 to 4, by the mean of an image, none in the one received."""
    if shown[0, :3].tolist() == [1, 2, 3]:
        return []
    first = 1 + round(1000 * float(shown.mean())) % 2
    return [at(number, 100.0 * number) for number in range(first, first + 3)]


def identifier(**changes: Any) -> Identifier:
    settings = AdaptiveSettings(genetic=GeneticSettings(max_evaluations=30), **changes)
    return Identifier(three, settings, expected_targets=4)


def test_a_search_that_finds_no_filter_for_all_shows_what_several_do() -> None:
    single = identifier(fusion=False).identify(IMAGE)
    assert single.count == 3
    together = identifier().identify(IMAGE)
    assert [target.id for target in together.targets] == [1, 2, 3, 4]
    assert together.filter.gamma_high == single.filter.gamma_high
    alone = identifier(threads=1).identify(IMAGE)
    assert alone.targets == together.targets


def test_a_filter_that_shows_all_is_believed() -> None:
    results = iter([[], [at(1, 100), at(2, 200), at(3, 300)], [at(1, 100), at(2, 200)]])
    found = Identifier(lambda _: next(results), AdaptiveSettings(threads=1), expected_targets=2)
    assert [target.id for target in found.identify(IMAGE)] == [1, 2]


def test_a_steady_stream_is_not_searched_again_though_filters_agreed_on_more() -> None:
    """The filter that worked last shows three of the four again."""
    settings = AdaptiveSettings(genetic=GeneticSettings(max_evaluations=30))
    stream = Identifier(three, settings, estimate=lambda _: 5)
    assert [len(stream.identify(IMAGE)) for _ in range(2)] == [4, 3]
    assert stream.last_search is None
