"""The genetic algorithm of AHF [1]_: binary chromosomes, tournament, crossover, mutation.

It knows nothing of images: it minimises a discrepancy, |N - n| in the paper, down to zero.

Two choices that Table 1 leaves open were made by experiment (five synthetic objectives shaped like
|N - n|, 40 seeds each). The mutation rate of 0.1 applies to each bit: applied to each chromosome,
where one bit then flips, 37 % of the searches got stuck instead of 12 %. A tournament of eight
needed 24 to 51 % of the evaluations of a tournament of two, and was closer to zero on every
objective after 200 evaluations.

References
----------
.. [1] Shang & Liu, Remote Sens. 2023, 15, 3151, section 2.2 and Table 1.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, wait
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from ahf_ros.filtering.chromosome import (
    Gene,
    Values,
    crossed,
    decoded,
    first_population,
    mutated,
    selected,
)
from ahf_ros.filtering.settings import GeneticSettings

DELTA = 1.0
"""delta of Eq. (10). With 1, a fitness of 1 is success. It does not affect the search, because
tournaments only compare."""


def in_order(
    discrepancy: Callable[[Values], float], tried: Sequence[Values], executor: Executor | None
) -> Generator[float, None, None]:
    """Yield the discrepancies of values in their order.

    Close the generator to cancel what has not begun and to wait for what has.

    Parameters
    ----------
    discrepancy : callable
        From one value per gene to a number; thread-safe if there is an executor.
    tried : sequence of tuple of float
        Values to evaluate. None behind one whose discrepancy is zero is begun.
    executor : concurrent.futures.Executor or None
        Threads; None evaluates one after the other.

    Examples
    --------
    >>> list(in_order(sum, [(1.0, 2.0), (3.0, 4.0)], None))
    [3.0, 7.0]
    """
    if executor is None:
        yield from map(discrepancy, tried)
        return
    successes: list[int] = []

    def evaluate(index: int, values: Values) -> float:
        if successes and min(successes) < index:
            return math.nan  # never read: the search ends before
        result = discrepancy(values)
        if result == 0:
            successes.append(index)
        return result

    futures = [executor.submit(evaluate, *it) for it in enumerate(tried)]
    try:
        for future in futures:
            yield future.result()
    finally:
        for future in futures:
            future.cancel()
        wait(futures)


@dataclass(frozen=True, slots=True)
class Generation:
    """Summary of one generation.

    Attributes
    ----------
    best, mean : float
        Fitness, 1 / (discrepancy + delta), of its fittest chromosome and on average.
    evaluations : int
        Number of evaluations since the search began.
    """

    best: float
    mean: float
    evaluations: int


@dataclass(frozen=True, slots=True)
class SearchResult:
    """Result of a search.

    Attributes
    ----------
    values : tuple of float
        The first of the best values that were evaluated.
    discrepancy : float
        Discrepancy of `values`.
    evaluations : int
        Number of evaluations that counted.
    history : tuple of Generation
        All generations; the last one may be incomplete.
    tried : tuple of tuple of float
        All values evaluated, in the order in which they counted.
    reason : str
        Why the search ended: 'found', 'patience' if so many in a row were not better than before,
        'generations', 'stall', 'evaluations', 'duration', or 'exhausted' if all values were
        tried.
    in_vain : int
        Number of evaluations at the end that were not better than those before.
    discrepancies : tuple of float
        Those of `tried`.
    """

    values: Values
    discrepancy: float
    evaluations: int
    history: tuple[Generation, ...]
    tried: tuple[Values, ...]
    reason: str
    in_vain: int = 0
    discrepancies: tuple[float, ...] = ()

    @property
    def generations(self) -> int:
        """Number of generations, the last one included."""
        return len(self.history)


def search(
    discrepancy: Callable[[Values], float],
    genes: Sequence[Gene],
    settings: GeneticSettings,
    generator: np.random.Generator,
    *,
    initial: Sequence[Values] = (),
    reference: float = math.inf,
    executor: Executor | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> SearchResult:
    """Search for values whose discrepancy is zero.

    Parameters
    ----------
    discrepancy : callable
        From one value per gene to a number of at least 0. It is called once for equal values. Its
        exceptions are passed on.
    genes : sequence of Gene
        At least one.
    settings : GeneticSettings
        Its seed is not used, and a patience of 0 is no limit.
    generator : numpy.random.Generator
        Source of all random numbers.
    initial : sequence of tuple of float, optional
        Values of the first chromosomes, each rounded to a value of its gene.
    reference : float, optional
        Discrepancy without any values, which counts for the patience.
    executor : concurrent.futures.Executor, optional
        Threads that evaluate a generation; `discrepancy` must be thread-safe. Results count in
        the order of the chromosomes: without `max_duration`, the search does not depend on the
        number of threads.
    clock : callable, optional
        Returns the time in s, for `max_duration`.

    Returns
    -------
    SearchResult
        Of at least one evaluation, whatever the limits. No call of `discrepancy` is running when
        the search returns.

    Raises
    ------
    ValueError
        If there is no gene, or if a discrepancy is negative or not a number.
    """
    if not genes:
        raise ValueError('genes is empty, accepted is at least one gene')
    objective = _Objective(discrepancy, settings, reference, executor, clock)
    population = first_population(genes, settings.population, generator, initial)
    history: list[Generation] = []
    stalled = 0
    while True:
        tried = [decoded(chromosome, genes) for chromosome in population]
        before = objective.best_discrepancy
        reason = objective.evaluate(tried)
        history.append(objective.generation(tried))
        stalled = 0 if objective.best_discrepancy < before else stalled + 1
        if not reason:
            if len(objective.known) == math.prod(gene.count for gene in genes):
                reason = 'exhausted'
            elif stalled >= settings.stall:
                reason = 'stall'
            elif len(history) >= settings.generations:
                reason = 'generations'
        if reason:
            return objective.result(tuple(history), reason)
        discrepancies = np.array([objective.known[values] for values in tried])
        parents = selected(population, discrepancies, settings.tournament, generator)
        children = crossed(parents, settings.crossover, generator)[: settings.population]
        population = mutated(children, settings.mutation, generator)


class _Objective:
    """The discrepancies known so far, and the limits of a search."""

    def __init__(
        self,
        discrepancy: Callable[[Values], float],
        settings: GeneticSettings,
        reference: float,
        executor: Executor | None,
        clock: Callable[[], float],
    ) -> None:
        self.known: dict[Values, float] = {}
        self.best: Values = ()
        self.best_discrepancy = math.inf
        self._discrepancy = discrepancy
        self._settings = settings
        self._reference = reference
        self._in_vain = 0  # in a row
        self._executor = executor
        self._clock = clock
        self._started = clock()

    def evaluate(self, tried: Sequence[Values]) -> str:
        """Evaluate unknown values, in order; return why the search ends, or ''."""
        fresh = [values for values in dict.fromkeys(tried) if values not in self.known]
        maximum = self._settings.max_evaluations
        if maximum:
            fresh = fresh[: maximum - len(self.known)]
        patience, reason = self._settings.patience, ''
        while fresh and not reason:
            # No more are begun than count if all are in vain.
            number = patience - self._in_vain if patience else len(fresh)
            reason = self._evaluate_some(fresh[:number])
            fresh = fresh[number:]
        return reason

    def _evaluate_some(self, fresh: Sequence[Values]) -> str:
        settings = self._settings
        with closing(in_order(self._discrepancy, fresh, self._executor)) as results:
            for values, result in zip(fresh, results, strict=True):
                self._learn(values, result)
                if result == 0:
                    return 'found'
                if 0 < settings.patience <= self._in_vain:
                    return 'patience'
                if len(self.known) == settings.max_evaluations:
                    return 'evaluations'
                if 0 < settings.max_duration <= self._clock() - self._started:
                    return 'duration'
        return ''

    def generation(self, tried: Sequence[Values]) -> Generation:
        """Summarise a generation."""
        fitness = [1 / (self.known[values] + DELTA) for values in tried if values in self.known]
        return Generation(max(fitness), sum(fitness) / len(fitness), len(self.known))

    def result(self, history: tuple[Generation, ...], reason: str) -> SearchResult:
        """Return the result of the search."""
        best, tried = self.best_discrepancy, tuple(self.known)
        found, count = tuple(self.known.values()), len(tried)
        return SearchResult(
            values=self.best,
            discrepancy=best,
            evaluations=count,
            history=history,
            tried=tried,
            reason=reason,
            in_vain=self._in_vain,
            discrepancies=found,
        )

    def _learn(self, values: Values, result: float) -> None:
        if not result >= 0:
            raise ValueError(
                f'discrepancy of {values} is {result!r}, accepted is a number of at least 0'
            )
        self.known[values] = result
        better = result < min(self.best_discrepancy, self._reference)
        self._in_vain = 0 if better else self._in_vain + 1
        if result < self.best_discrepancy:
            self.best, self.best_discrepancy = values, result
