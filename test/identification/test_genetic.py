import itertools
import math
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NoReturn, TypeAlias

import numpy as np
import pytest

from ahf_ros.identification.filtering.genetic import Gene, SearchResult, decoded, encoded, search
from ahf_ros.identification.filtering.settings import GeneticSettings

Objective: TypeAlias = Callable[[tuple[float, ...]], float]

GENES = HIGH, _ = Gene(1.0, 4.0, 0.1), Gene(0.0, 1.0, 0.01)
FREE = {'max_evaluations': 0}


def hill(values: tuple[float, ...]) -> float:
    """Return a discrepancy with one small goal around (2.8, 0.82), flat far from it."""
    high, low = values
    return round(54 * (1 - math.exp(-(((high - 2.8) / 0.4) ** 2) - ((low - 0.82) / 0.1) ** 2)))


def unreachable(values: tuple[float, ...]) -> float:
    return 1 + hill(values)


def run(objective: Objective, seed: int = 0, **settings: Any) -> SearchResult:
    keywords = {
        key: settings.pop(key)
        for key in ('initial', 'reference', 'executor', 'clock')
        if key in settings
    }
    generator = np.random.default_rng(seed)
    return search(objective, GENES, GeneticSettings(**settings), generator, **keywords)


class Recorder:
    """An objective that remembers what it was asked."""

    def __init__(self, objective: Objective = hill) -> None:
        self.objective = objective
        self.asked = []
        self.lock = threading.Lock()

    def __call__(self, values: tuple[float, ...]) -> float:
        with self.lock:
            self.asked.append(values)
        return self.objective(values)


@pytest.mark.parametrize('seed', range(5))
def test_it_finds_a_small_goal_in_a_fraction_of_the_space(seed: int) -> None:
    result = run(hill, seed, **FREE)
    assert result.reason == 'found'
    assert min(result.discrepancies) == hill(result.values) == 0
    assert len(result.tried) < 1000


def test_nothing_is_evaluated_twice() -> None:
    objective = Recorder(unreachable)
    result = run(objective, generations=30, **FREE)
    assert len(objective.asked) == len(set(objective.asked)) == len(result.tried)


def test_it_stops_at_the_first_success_in_order() -> None:
    objective = Recorder(lambda values: 0.0)
    result = run(objective)
    assert len(objective.asked) == len(result.tried) == len(result.history) == 1
    assert result.values == objective.asked[0]


def test_of_equally_good_ones_the_first_wins() -> None:
    objective = Recorder(lambda values: 3)
    result = run(objective, generations=5)
    assert result.values == objective.asked[0]


def test_the_best_ever_wins_although_its_generation_is_gone() -> None:
    objective = Recorder(unreachable)
    result = run(objective, generations=20, mutation=0.5, crossover=1.0, tournament=1, **FREE)
    assert min(result.discrepancies) == min(unreachable(values) for values in objective.asked)
    assert unreachable(result.values) == min(result.discrepancies)


def test_the_same_seed_gives_the_same_search_and_another_seed_another() -> None:
    assert run(unreachable, 3) == run(unreachable, 3)
    assert run(unreachable, 3) != run(unreachable, 4)


@pytest.mark.parametrize('threads', [1, 2, 4])
@pytest.mark.parametrize('objective', [hill, unreachable])
def test_the_result_does_not_depend_on_the_threads(objective: Objective, threads: int) -> None:
    def slow(values: tuple[float, ...]) -> float:
        time.sleep(hash(values) % 7 * 1e-4)
        return objective(values)

    with ThreadPoolExecutor(threads) as executor:
        assert run(slow, max_evaluations=150, executor=executor) == run(
            objective, max_evaluations=150
        )


def test_it_stops_at_the_first_success_in_order_with_threads_too() -> None:
    order = Recorder(unreachable)
    run(order, max_evaluations=50)
    goals = {order.asked[10]: 0.05, order.asked[12]: 0.0}

    def objective(values: tuple[float, ...]) -> int:
        if values not in goals:
            return 5
        time.sleep(goals[values])  # the later success is known first
        return 0

    with ThreadPoolExecutor(4) as executor:
        result = run(objective, executor=executor)
    assert result.values == order.asked[10]
    assert len(result.tried) == 11


def test_nothing_is_begun_behind_a_success_that_waits_for_its_turn() -> None:
    order = Recorder(unreachable)
    run(order, max_evaluations=2)
    first, second = order.asked
    asked, succeeded = [], threading.Event()

    def objective(values: tuple[float, ...]) -> int:
        asked.append(values)
        if values == second:
            succeeded.set()
            return 0
        succeeded.wait()
        time.sleep(0.05)  # so that the other thread could begin the third
        return 1

    with ThreadPoolExecutor(2) as executor:
        assert run(objective, executor=executor).values == second
    assert sorted(asked) == sorted([first, second])


def test_when_it_returns_no_evaluation_is_under_way() -> None:
    under_way = []

    def objective(values: tuple[float, ...]) -> int:
        under_way.append(values)
        time.sleep(0.01)
        under_way.remove(values)
        return 0

    with ThreadPoolExecutor(4) as executor:
        run(objective, executor=executor)
        assert under_way == []


@pytest.mark.parametrize('most', [1, 7, 50, 51, 120])
def test_the_limit_on_evaluations_is_obeyed(most: int) -> None:
    objective = Recorder(unreachable)
    result = run(objective, max_evaluations=most)
    assert result.reason == 'evaluations'
    assert len(objective.asked) == len(result.tried) == most


@pytest.mark.parametrize(('limit', 'most'), [('generations', 4), ('stall', 3)])
def test_a_search_that_gets_no_better_ends_after_some_generations(limit: str, most: int) -> None:
    result = run(lambda values: 7, **{limit: most}, **FREE)
    assert (result.reason, len(result.history)) == (limit, 4)


def test_patience_lasts_from_one_generation_to_the_next() -> None:
    result = run(lambda values: 7, patience=25, population=20, reference=7)
    assert (result.reason, result.history) == ('patience', (20, 25))


def test_an_improvement_starts_the_stall_again() -> None:
    calls = iter(range(10**6))
    result = run(lambda values: 1000 if next(calls) < 70 else 900, stall=5, mutation=0.5, **FREE)
    assert result.reason == 'stall'
    best = result.discrepancies.index(900)
    assert len(result.history) == sum(count <= best for count in result.history) + 6


@pytest.mark.parametrize('threads', [1, 4])
def test_patience_ends_a_search_and_begins_nothing_that_does_not_count(threads: int) -> None:
    objective = Recorder(lambda values: 7)
    with ThreadPoolExecutor(threads) as executor:
        result = run(objective, patience=3, reference=7, executor=executor)
    assert (result.reason, len(result.tried), result.in_vain) == ('patience', 3, 3)
    assert sorted(objective.asked) == sorted(result.tried)


@pytest.mark.parametrize(('first', 'evaluations'), [(6, 3), (7, 2)])
def test_what_is_better_than_no_values_starts_the_patience_again(
    first: int, evaluations: int
) -> None:
    calls = itertools.count()
    result = run(lambda values: 7 if next(calls) else first, patience=2, reference=7)
    assert (len(result.tried), min(result.discrepancies)) == (evaluations, first)


def test_the_limit_on_time_is_obeyed() -> None:
    seconds = iter(range(1000))
    result = run(unreachable, max_duration=10.0, clock=lambda: float(next(seconds)), **FREE)
    assert result.reason == 'duration'
    assert len(result.tried) == 10


def test_one_evaluation_is_made_however_late_it_is() -> None:
    seconds = iter(range(0, 10**6, 1000))
    result = run(unreachable, max_duration=0.001, clock=lambda: float(next(seconds)))
    assert len(result.tried) == 1
    assert len(result.values) == 2


def test_it_stops_when_the_whole_space_is_known() -> None:
    objective = Recorder(lambda values: 1)
    genes = [Gene(0.0, 3.0, 1.0), Gene(0.0, 2.0, 1.0)]
    result = search(objective, genes, GeneticSettings(), np.random.default_rng(0))
    assert result.reason == 'exhausted'
    assert sorted(objective.asked) == [(float(a), float(b)) for a in range(4) for b in range(3)]


def test_a_gene_with_one_value_is_no_gene() -> None:
    genes = [Gene(2.0, 2.0, 1.0)]
    result = search(lambda values: 4, genes, GeneticSettings(), np.random.default_rng(0))
    assert (result.values, len(result.tried), result.reason) == ((2.0,), 1, 'exhausted')


def test_initial_values_are_tried_first() -> None:
    objective = Recorder(unreachable)
    result = run(objective, initial=[(2.8, 0.82), (3.14159, 7.0)], generations=1)
    assert objective.asked[:2] == [(2.8, 0.82), (3.1, 1.0)]
    assert result.values == (2.8, 0.82)


def test_an_odd_population_stays_odd() -> None:
    objective = Recorder(unreachable)
    result = run(objective, population=7, generations=3, mutation=0.5)
    assert 7 < len(result.tried) <= 21


@pytest.mark.parametrize('threads', [0, 3])
def test_what_the_objective_raises_is_raised(threads: int) -> None:
    def objective(values: tuple[float, ...]) -> NoReturn:
        raise RuntimeError('no camera')

    if not threads:
        with pytest.raises(RuntimeError, match='no camera'):
            run(objective)
        return
    with ThreadPoolExecutor(threads) as executor, pytest.raises(RuntimeError, match='no camera'):
        run(objective, executor=executor)


@pytest.mark.parametrize('gene', [*GENES, Gene(2.0, 2.0, 0.5), Gene(0.0, 1.0, 1.0)])
def test_every_code_means_a_value_in_order_and_every_value_has_a_code(gene: Any) -> None:
    values = [gene.value(gene.index(code)) for code in range(2**gene.bits)]
    assert values == sorted(values)
    assert values[0] == gene.minimum
    assert values[-1] == gene.maximum
    assert len(set(values)) == gene.count
    for index in range(gene.count):
        assert gene.index(gene.code(gene.value(index))) == index


def test_values_are_free_of_rounding_errors() -> None:
    assert [HIGH.value(index) for index in (0, 2, 7, 30)] == [1.0, 1.2, 1.7, 4.0]


def test_a_value_out_of_range_is_coded_as_the_nearest() -> None:
    assert HIGH.index(HIGH.code(9.0)) == 30
    assert HIGH.index(HIGH.code(-9.0)) == 0
    assert HIGH.index(HIGH.code(1.26)) == 3


def test_the_maximum_need_not_be_a_whole_number_of_steps_away() -> None:
    gene = Gene(1.0, 2.0, 0.3)
    assert [gene.value(index) for index in range(gene.count)] == [1.0, 1.3, 1.6, 1.9]


def test_a_chromosome_is_the_genes_in_order_highest_bit_first() -> None:
    genes = [Gene(0.0, 3.0, 1.0), Gene(0.0, 7.0, 1.0)]
    assert decoded(np.array([1, 0, 0, 1, 1], bool), genes) == (2.0, 3.0)
    assert encoded((2.0, 3.0), genes) == [True, False, False, True, True]
