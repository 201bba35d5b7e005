"""The genetic algorithm of AHF [1]_: binary chromosomes, tournament, crossover, mutation.

It knows no image: it looks for the values at which a discrepancy, |N - n| in the paper, is zero.

Two things that Table 1 leaves open are settled by trial (`benchmarks/genetic.py`: five made-up
objectives of the shape of |N - n|, 40 seeds each). The mutation of 0.1 is the probability of a
bit: as that of a chromosome, of which one bit then flips, 37 % of the searches got stuck, against
12 %. A tournament is held among eight, which needed 24 to 51 % of the evaluations that a
tournament of two needed and after 200 evaluations was closer on every objective.

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

from ahf_ros.filtering.chromosome import Gene, Values, decoded, encoded
from ahf_ros.settings.parameter import check_parameters, parameter

DELTA = 1.0
"""delta of Eq. (10), so that a fitness of 1 is success; a tournament only compares, so that the
search does not depend on it."""


@dataclass(frozen=True, slots=True)
class GeneticSettings:
    """Table 1 of the paper, and limits.

    The paper has a population of 50. With 20, fifty filters are some generations, and find a
    little more than fifty drawn at random.
    """

    population: int = parameter(20, 'Chromosomes in a generation.', minimum=2, maximum=10000)
    generations: int = parameter(100, 'Most generations of a search.', minimum=1, maximum=100000)
    stall: int = parameter(
        50,
        'Generations without a better chromosome after which a search ends.',
        minimum=1,
        maximum=100000,
    )
    tournament: int = parameter(
        8,
        'Chromosomes drawn for a tournament; the fittest becomes a parent.',
        minimum=1,
        maximum=100,
    )
    crossover: float = parameter(
        0.8,
        'Probability that two parents exchange the bits behind a random place.',
        minimum=0.0,
        maximum=1.0,
    )
    mutation: float = parameter(
        0.1, 'Probability that a bit of a child flips.', minimum=0.0, maximum=1.0
    )
    max_evaluations: int = parameter(
        50, 'Most filters tried in a search, 0: no limit.', minimum=0, maximum=1000000
    )
    max_duration: float = parameter(
        0.0,
        'Time after which a search ends, in s, 0: no limit; results then depend on the machine.',
        minimum=0.0,
        maximum=86400.0,
    )
    seed: int = parameter(0, 'Seed of the random numbers.', minimum=0, maximum=2**31 - 1)

    def __post_init__(self) -> None:
        """Check every parameter."""
        check_parameters(self)


@dataclass(frozen=True, slots=True)
class Generation:
    """What one generation came to.

    Attributes
    ----------
    best, mean : float
        Fitness of its fittest chromosome and of all of them, 1 / (discrepancy + delta).
    evaluations : int
        Evaluations since the search began.
    """

    best: float
    mean: float
    evaluations: int


@dataclass(frozen=True, slots=True)
class SearchResult:
    """What a search came to.

    Attributes
    ----------
    values : tuple of float
        The best ever evaluated, of equally good ones the first.
    discrepancy : float
        Its discrepancy.
    evaluations : int
        Calls of the objective whose result counted.
    history : tuple of Generation
        One a generation, the last one perhaps not complete.
    tried : tuple of tuple of float
        What was evaluated, in the order in which it counted.
    reason : str
        Why the search ended: 'found', 'generations', 'stall', 'evaluations', 'duration', or
        'exhausted' where there is nothing left to try.
    """

    values: Values
    discrepancy: float
    evaluations: int
    history: tuple[Generation, ...]
    tried: tuple[Values, ...]
    reason: str

    @property
    def generations(self) -> int:
        """Generations begun."""
        return len(self.history)


def search(
    discrepancy: Callable[[Values], float],
    genes: Sequence[Gene],
    settings: GeneticSettings,
    generator: np.random.Generator,
    *,
    initial: Sequence[Values] = (),
    executor: Executor | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> SearchResult:
    """Look for the values whose discrepancy is zero.

    Parameters
    ----------
    discrepancy : callable
        From one value a gene to a number of at least 0. It is called once for the same values,
        however many chromosomes stand for them. What it raises, the search raises.
    genes : sequence of Gene
        At least one.
    settings : GeneticSettings
        Its seed is not used here.
    generator : numpy.random.Generator
        Source of every random number.
    initial : sequence of tuple of float, optional
        Values to try first, as the first chromosomes of the first generation; each becomes the
        nearest value that the gene has.
    executor : concurrent.futures.Executor, optional
        Threads that evaluate a generation; `discrepancy` must then be safe to call from several
        threads. Results count in the order of the chromosomes, so that without `max_duration`
        the search is the same for any number of threads.
    clock : callable, optional
        Time in s, for `max_duration`.

    Returns
    -------
    SearchResult
        At least one evaluation is made, whatever the limits. When it returns, no call of
        `discrepancy` is under way any more.

    Raises
    ------
    ValueError
        If there is no gene, or if a discrepancy is negative or not a number.
    """
    if not genes:
        raise ValueError('genes is empty, accepted is at least one gene')
    objective = _Objective(discrepancy, settings, executor, clock)
    population = _first_population(genes, settings.population, generator, initial)
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
        population = _next_population(population, discrepancies, settings, generator)


class _Objective:
    """The discrepancies known so far, and the limits on asking for more."""

    def __init__(
        self,
        discrepancy: Callable[[Values], float],
        settings: GeneticSettings,
        executor: Executor | None,
        clock: Callable[[], float],
    ) -> None:
        self.known: dict[Values, float] = {}
        self.best: Values = ()
        self.best_discrepancy = math.inf
        self._discrepancy = discrepancy
        self._settings = settings
        self._executor = executor
        self._clock = clock
        self._started = clock()

    def evaluate(self, tried: Sequence[Values]) -> str:
        """Evaluate what is not known yet, in order; return why the search ends, or ''."""
        fresh = [values for values in dict.fromkeys(tried) if values not in self.known]
        most = self._settings.max_evaluations
        if most:
            fresh = fresh[: most - len(self.known)]
        with closing(self._results(fresh)) as results:
            for values, result in zip(fresh, results, strict=True):
                self._learn(values, result)
                if result == 0:
                    return 'found'
                if len(self.known) == most:
                    return 'evaluations'
                if 0 < self._settings.max_duration <= self._clock() - self._started:
                    return 'duration'
        return ''

    def generation(self, tried: Sequence[Values]) -> Generation:
        """Return the summary of a generation."""
        fitness = [1 / (self.known[values] + DELTA) for values in tried if values in self.known]
        return Generation(max(fitness), sum(fitness) / len(fitness), len(self.known))

    def result(self, history: tuple[Generation, ...], reason: str) -> SearchResult:
        """Return the result of the search."""
        best, tried = self.best_discrepancy, tuple(self.known)
        return SearchResult(self.best, best, len(tried), history, tried, reason)

    def _learn(self, values: Values, result: float) -> None:
        if not result >= 0:
            raise ValueError(
                f'discrepancy of {values} is {result!r}, accepted is a number of at least 0'
            )
        self.known[values] = result
        if result < self.best_discrepancy:
            self.best, self.best_discrepancy = values, result

    def _results(self, fresh: Sequence[Values]) -> Generator[float, None, None]:
        """Yield the discrepancies in order; on closing, drop what has not begun."""
        if self._executor is None:
            yield from map(self._discrepancy, fresh)
            return
        successes: list[int] = []

        def evaluate(place: int, values: Values) -> float:
            if successes and min(successes) < place:
                return math.nan  # nobody gets that far
            result = self._discrepancy(values)
            if result == 0:
                successes.append(place)
            return result

        futures = [self._executor.submit(evaluate, *it) for it in enumerate(fresh)]
        try:
            for future in futures:
                yield future.result()
        finally:
            for future in futures:
                future.cancel()
            wait(futures)


def _first_population(
    genes: Sequence[Gene], size: int, generator: np.random.Generator, initial: Sequence[Values]
) -> np.ndarray:
    """Return random chromosomes, shape (size, bits), the first standing for `initial`."""
    bits = sum(gene.bits for gene in genes)
    population = generator.integers(2, size=(size, bits)).astype(bool)
    for chromosome, values in zip(population, initial, strict=False):
        chromosome[:] = encoded(values, genes)
    return population


def _next_population(
    population: np.ndarray,
    discrepancies: np.ndarray,
    settings: GeneticSettings,
    generator: np.random.Generator,
) -> np.ndarray:
    """Return the children: tournaments, single-point crossover, mutation."""
    size, bits = population.shape
    pairs = (size + 1) // 2
    drawn = generator.integers(size, size=(2 * pairs, settings.tournament))
    winners = drawn[np.arange(2 * pairs), discrepancies[drawn].argmin(axis=1)]
    mothers, fathers = population[winners[::2]], population[winners[1::2]]
    crossing = generator.random((pairs, 1)) < settings.crossover
    places = generator.integers(1, max(bits, 2), size=(pairs, 1))
    exchanged = crossing & (np.arange(bits) >= places)
    children = np.concatenate(
        [np.where(exchanged, fathers, mothers), np.where(exchanged, mothers, fathers)]
    )[:size]
    return children ^ (generator.random(children.shape) < settings.mutation)
