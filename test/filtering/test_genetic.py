from __future__ import annotations

import itertools
import math
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from ahf_ros.filtering.genetic import DELTA, Gene, search
from ahf_ros.filtering.settings import GeneticSettings

GENES = [Gene('gamma_high', 1.0, 4.0, 0.1), Gene('gamma_low', 0.0, 1.0, 0.01)]
FREE = {'max_evaluations': 0}


def hill(values):
    """Return a discrepancy with one small goal around (2.8, 0.82), flat far from it."""
    high, low = values
    return round(54 * (1 - math.exp(-(((high - 2.8) / 0.4) ** 2) - ((low - 0.82) / 0.1) ** 2)))


def unreachable(values):
    return 1 + hill(values)


def run(objective, seed=0, **settings):
    keywords = {
        key: settings.pop(key)
        for key in ('initial', 'reference', 'executor', 'clock')
        if key in settings
    }
    generator = np.random.default_rng(seed)
    return search(objective, GENES, GeneticSettings(**settings), generator, **keywords)


class Recorder:
    """An objective that remembers what it was asked."""

    def __init__(self, objective=hill):
        self.objective = objective
        self.asked = []
        self.lock = threading.Lock()

    def __call__(self, values):
        with self.lock:
            self.asked.append(values)
        return self.objective(values)


@pytest.mark.parametrize('seed', range(5))
def test_it_finds_a_small_goal_in_a_fraction_of_the_space(seed):
    result = run(hill, seed, **FREE)
    assert result.reason == 'found'
    assert result.discrepancy == hill(result.values) == 0
    assert result.evaluations < 1000


def test_nothing_is_evaluated_twice():
    objective = Recorder(unreachable)
    result = run(objective, generations=30, **FREE)
    assert len(objective.asked) == len(set(objective.asked)) == result.evaluations


def test_every_value_tried_lies_on_the_grid():
    objective = Recorder(unreachable)
    run(objective, generations=30, **FREE)
    high, low = np.array(objective.asked).T
    assert 1.0 <= high.min() <= high.max() <= 4.0
    assert 0.0 <= low.min() <= low.max() <= 1.0
    np.testing.assert_allclose(high * 10, np.round(high * 10), atol=1e-9)
    np.testing.assert_allclose(low * 100, np.round(low * 100), atol=1e-9)


def test_it_stops_at_the_first_success_in_order():
    objective = Recorder(lambda values: 0.0)
    result = run(objective)
    assert len(objective.asked) == result.evaluations == result.generations == 1
    assert result.values == objective.asked[0]


def test_of_equally_good_ones_the_first_wins():
    objective = Recorder(lambda values: 3)
    result = run(objective, generations=5)
    assert result.values == objective.asked[0]


def test_the_best_ever_wins_although_its_generation_is_gone():
    objective = Recorder(unreachable)
    result = run(objective, generations=20, mutation=0.5, crossover=1.0, tournament=1, **FREE)
    assert result.discrepancy == min(unreachable(values) for values in objective.asked)
    assert unreachable(result.values) == result.discrepancy


def test_the_same_seed_gives_the_same_search_and_another_seed_another():
    assert run(unreachable, 3) == run(unreachable, 3)
    assert run(unreachable, 3) != run(unreachable, 4)


@pytest.mark.parametrize('threads', [1, 2, 4])
@pytest.mark.parametrize('objective', [hill, unreachable])
def test_the_result_does_not_depend_on_the_threads(objective, threads):
    def slow(values):
        time.sleep(hash(values) % 7 * 1e-4)
        return objective(values)

    with ThreadPoolExecutor(threads) as executor:
        assert run(slow, max_evaluations=150, executor=executor) == run(
            objective, max_evaluations=150
        )


def test_it_stops_at_the_first_success_in_order_with_threads_too():
    order = Recorder(unreachable)
    run(order, max_evaluations=50)
    goals = {order.asked[10]: 0.05, order.asked[12]: 0.0}

    def objective(values):
        if values not in goals:
            return 5
        time.sleep(goals[values])  # the later success is known first
        return 0

    with ThreadPoolExecutor(4) as executor:
        result = run(objective, executor=executor)
    assert result.values == order.asked[10]
    assert result.evaluations == 11


def test_nothing_is_begun_behind_a_success_that_waits_for_its_turn():
    order = Recorder(unreachable)
    run(order, max_evaluations=2)
    first, second = order.asked
    asked, succeeded = [], threading.Event()

    def objective(values):
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


def test_when_it_returns_no_evaluation_is_under_way():
    under_way = []

    def objective(values):
        under_way.append(values)
        time.sleep(0.01)
        under_way.remove(values)
        return 0

    with ThreadPoolExecutor(4) as executor:
        run(objective, executor=executor)
        assert under_way == []


@pytest.mark.parametrize('most', [1, 7, 50, 51, 120])
def test_the_limit_on_evaluations_is_obeyed(most):
    objective = Recorder(unreachable)
    result = run(objective, max_evaluations=most)
    assert result.reason == 'evaluations'
    assert len(objective.asked) == result.evaluations == most


def test_the_limit_on_generations_is_obeyed():
    result = run(unreachable, generations=4, **FREE)
    assert (result.reason, result.generations) == ('generations', 4)


def test_it_stops_when_the_best_has_not_improved():
    result = run(lambda values: 7, stall=6, **FREE)
    assert (result.reason, result.generations) == ('stall', 7)


def test_an_improvement_starts_the_stall_again():
    calls = iter(range(10**6))
    result = run(lambda values: 1000 if next(calls) < 120 else 900, stall=5, mutation=0.5, **FREE)
    assert result.reason == 'stall'
    best = [generation.best for generation in result.history]
    assert result.generations == best.index(max(best)) + 6


@pytest.mark.parametrize('threads', [1, 4])
def test_patience_ends_a_search_and_begins_nothing_that_does_not_count(threads):
    objective = Recorder(lambda values: 7)
    with ThreadPoolExecutor(threads) as executor:
        result = run(objective, patience=3, reference=7, executor=executor)
    assert (result.reason, result.evaluations, result.in_vain) == ('patience', 3, 3)
    assert sorted(objective.asked) == sorted(result.tried)


@pytest.mark.parametrize(('first', 'evaluations'), [(6, 3), (7, 2)])
def test_what_is_better_than_no_values_starts_the_patience_again(first, evaluations):
    calls = itertools.count()
    result = run(lambda values: 7 if next(calls) else first, patience=2, reference=7)
    assert (result.evaluations, result.discrepancy) == (evaluations, first)


def test_patience_lasts_from_one_generation_to_the_next():
    result = run(lambda values: 7, patience=25, population=20, reference=7)
    assert (result.reason, result.evaluations, result.generations) == ('patience', 25, 2)


def test_the_limit_on_time_is_obeyed():
    seconds = iter(range(1000))
    result = run(unreachable, max_duration=10.0, clock=lambda: float(next(seconds)), **FREE)
    assert result.reason == 'duration'
    assert result.evaluations == 10


def test_one_evaluation_is_made_however_late_it_is():
    seconds = iter(range(0, 10**6, 1000))
    result = run(unreachable, max_duration=0.001, clock=lambda: float(next(seconds)))
    assert result.evaluations == 1
    assert len(result.values) == 2


def test_it_stops_when_the_whole_space_is_known():
    objective = Recorder(lambda values: 1)
    genes = [Gene('a', 0.0, 3.0, 1.0), Gene('b', 0.0, 2.0, 1.0)]
    result = search(objective, genes, GeneticSettings(), np.random.default_rng(0))
    assert result.reason == 'exhausted'
    assert sorted(objective.asked) == [(float(a), float(b)) for a in range(4) for b in range(3)]


def test_a_gene_with_one_value_is_no_gene():
    genes = [Gene('a', 2.0, 2.0, 1.0)]
    result = search(lambda values: 4, genes, GeneticSettings(), np.random.default_rng(0))
    assert (result.values, result.evaluations, result.reason) == ((2.0,), 1, 'exhausted')


def test_initial_values_are_tried_first():
    objective = Recorder(unreachable)
    result = run(objective, initial=[(2.8, 0.82), (3.14159, 7.0)], generations=1)
    assert objective.asked[:2] == [(2.8, 0.82), (3.1, 1.0)]
    assert result.values == (2.8, 0.82)


def test_the_history_tells_the_fitness_of_every_generation():
    objective = Recorder(unreachable)
    result = run(objective, generations=10, **FREE)
    evaluations = [generation.evaluations for generation in result.history]
    assert evaluations == sorted(evaluations)
    assert evaluations[0] == GeneticSettings().population  # with this seed none comes twice
    first = [1 / (unreachable(values) + DELTA) for values in objective.asked[: evaluations[0]]]
    assert result.history[0].best == max(first)
    assert result.history[0].mean == pytest.approx(sum(first) / len(first))
    assert evaluations[-1] == result.evaluations
    best = max(generation.best for generation in result.history)
    assert best == 1 / (result.discrepancy + DELTA)
    assert all(0 < it.mean <= it.best for it in result.history)
    assert result.history[-1].mean > result.history[0].mean


def test_an_odd_population_stays_odd():
    objective = Recorder(unreachable)
    result = run(objective, population=7, generations=3, mutation=0.5)
    assert 7 < result.evaluations <= 21


@pytest.mark.parametrize('threads', [0, 3])
def test_what_the_objective_raises_is_raised(threads):
    def objective(values):
        raise RuntimeError('no camera')

    if not threads:
        with pytest.raises(RuntimeError, match='no camera'):
            run(objective)
        return
    with ThreadPoolExecutor(threads) as executor, pytest.raises(RuntimeError, match='no camera'):
        run(objective, executor=executor)


@pytest.mark.parametrize('value', [-1, float('nan')])
def test_a_discrepancy_that_is_none_is_refused(value):
    with pytest.raises(ValueError, match=r'discrepancy of \(.*\) is .*, accepted is a number'):
        run(lambda values: value)


def test_no_gene_is_refused():
    with pytest.raises(ValueError, match='genes is empty'):
        search(hill, [], GeneticSettings(), np.random.default_rng(0))


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('population', 1),
        ('population', 50.0),
        ('generations', 0),
        ('stall', 0),
        ('tournament', 0),
        ('crossover', 1.1),
        ('mutation', -0.1),
        ('mutation', float('nan')),
        ('max_evaluations', -1),
        ('max_duration', -1.0),
        ('seed', -1),
    ],
)
def test_a_setting_out_of_range_is_refused(name, value):
    with pytest.raises(ValueError, match=f'^{name} is {value}, accepted is'):
        GeneticSettings(**{name: value})
