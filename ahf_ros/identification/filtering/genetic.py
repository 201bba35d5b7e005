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

import math
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, wait
from contextlib import closing
from dataclasses import dataclass, field

import numpy as np

from ahf_ros.identification.filtering.settings import GeneticSettings

Values = tuple[float, ...]
"""What a chromosome stands for: one value per gene, in the order of the genes."""


@dataclass(frozen=True, slots=True)
class Gene:
    """The values of one number: `minimum`, `minimum + step`, ... up to `maximum`."""

    minimum: float
    maximum: float
    step: float

    @property
    def count(self) -> int:
        """Number of values."""
        return math.floor((self.maximum - self.minimum) / self.step + 1e-9) + 1

    @property
    def bits(self) -> int:
        """Number of its bits in the chromosome."""
        return (self.count - 1).bit_length()

    def value(self, index: int) -> float:
        """Return value number `index`, from 0, without the rounding error of the step."""
        return round(self.minimum + index * self.step, 9)

    def index(self, code: int) -> int:
        """Return the number of the value that the bits of the gene, as an integer, stand for."""
        return code * self.count >> self.bits

    def code(self, value: float) -> int:
        """Return the minimum code of the value nearest to `value`."""
        index = round((min(max(value, self.minimum), self.maximum) - self.minimum) / self.step)
        return -(-(min(index, self.count - 1) << self.bits) // self.count)


def encoded(values: Values, genes: Sequence[Gene]) -> list[bool]:
    """Return the bits of a chromosome for the values nearest to `values`."""
    return [
        bool(gene.code(value) >> place & 1)
        for gene, value in zip(genes, values, strict=True)
        for place in reversed(range(gene.bits))
    ]


def decoded(chromosome: np.ndarray, genes: Sequence[Gene]) -> Values:
    """Return the values of a chromosome, ndarray of bool, shape (bits,).

    The first gene has the first bits, the most significant one first. A gene of five bits and 31
    values distributes its 32 codes among them, in ascending order and as evenly as possible.
    """
    values, start = [], 0
    for gene in genes:
        part = chromosome[start : start + gene.bits]
        code = int(part @ (1 << np.arange(gene.bits)[::-1]))
        values.append(gene.value(gene.index(code)))
        start += gene.bits
    return tuple(values)


@dataclass(frozen=True, slots=True)
class SearchResult:
    """Result of a search, of at least one evaluation.

    Attributes
    ----------
    tried : tuple of tuple of float
        All values evaluated, in the order in which they counted.
    discrepancies : tuple of float
        Those of `tried`.
    history : tuple of int
        Number of evaluations by the end of each generation; the last one may be incomplete.
    reason : str
        Why the search ended: 'found', 'patience' if so many in a row were not better than before,
        'generations', 'stall', 'evaluations', 'duration', or 'exhausted' if all values were
        tried.
    in_vain : int
        Number of evaluations at the end that were not better than those before.
    duration : float
        Its time, s, with what confirms it on the whole image.
    """

    tried: tuple[Values, ...]
    discrepancies: tuple[float, ...]
    history: tuple[int, ...]
    reason: str
    in_vain: int
    duration: float = field(default=0.0, compare=False)

    @property
    def values(self) -> Values:
        """The first of the best values."""
        return self.tried[self.discrepancies.index(min(self.discrepancies))]


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
    """Search for values whose discrepancy is zero; whatever the limits, one is evaluated.

    Parameters
    ----------
    discrepancy : callable
        From one value per gene to a number of at least 0. It is called once for equal values. Its
        exceptions are passed on, and no call is running when the search returns.
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
    """
    objective = _Objective(discrepancy, settings, reference, executor, clock)
    shape = settings.population, sum(gene.bits for gene in genes)
    population = generator.integers(2, size=shape).astype(bool)
    for chromosome, values in zip(population, initial, strict=False):
        chromosome[:] = encoded(values, genes)
    history: list[int] = []
    stalled = 0
    while True:
        tried = [decoded(chromosome, genes) for chromosome in population]
        before = objective.best
        reason = objective.evaluate(tried)
        history.append(len(objective.known))
        stalled = 0 if objective.best < before else stalled + 1
        if not reason:
            if len(objective.known) == math.prod(gene.count for gene in genes):
                reason = 'exhausted'
            elif stalled >= settings.stall:
                reason = 'stall'
            elif len(history) >= settings.generations:
                reason = 'generations'
        if reason:
            return SearchResult(
                tried=tuple(objective.known),
                discrepancies=tuple(objective.known.values()),
                history=tuple(history),
                reason=reason,
                in_vain=objective.in_vain,
            )
        discrepancies = np.array([objective.known[values] for values in tried])
        parents = _selected(population, discrepancies, settings.tournament, generator)
        children = _crossed(parents, settings.crossover, generator)[: settings.population]
        population = children ^ (generator.random(children.shape) < settings.mutation)


def _selected(
    population: np.ndarray, discrepancies: np.ndarray, size: int, generator: np.random.Generator
) -> np.ndarray:
    """Return as many parents as chromosomes, or one more to make pairs.

    Each parent wins a tournament of `size` chromosomes by the smallest discrepancy.
    """
    parents = len(population) + len(population) % 2
    drawn = generator.integers(len(population), size=(parents, size))
    winners = drawn[np.arange(parents), discrepancies[drawn].argmin(axis=1)]
    return population[winners]


def _crossed(
    parents: np.ndarray, probability: float, generator: np.random.Generator
) -> np.ndarray:
    """Return the children of pairs of parents, by single-point crossover with a probability."""
    mothers, fathers = parents[::2], parents[1::2]
    pairs, bits = mothers.shape
    crossing = generator.random((pairs, 1)) < probability
    points = generator.integers(1, max(bits, 2), size=(pairs, 1))
    exchanged = crossing & (np.arange(bits) >= points)
    return np.concatenate(
        [np.where(exchanged, fathers, mothers), np.where(exchanged, mothers, fathers)]
    )


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
        self.best = math.inf
        self.in_vain = 0  # in a row
        self._discrepancy = discrepancy
        self._settings = settings
        self._reference = reference
        self._executor = executor
        self._clock = clock
        self._started = clock()

    def evaluate(self, tried: Sequence[Values]) -> str:
        """Evaluate unknown values, in order; return why the search ends, or ''."""
        fresh = [values for values in dict.fromkeys(tried) if values not in self.known]
        maximum, patience = self._settings.max_evaluations, self._settings.patience
        if maximum:
            fresh = fresh[: maximum - len(self.known)]
        while fresh:
            # No more are begun than count if all are in vain.
            number = patience - self.in_vain if patience else len(fresh)
            some, fresh = fresh[:number], fresh[number:]
            with closing(_in_order(self._discrepancy, some, self._executor)) as results:
                for values, result in zip(some, results, strict=True):
                    better = result < min(self.best, self._reference)
                    self.in_vain = 0 if better else self.in_vain + 1
                    self.best = min(self.best, result)
                    self.known[values] = result
                    if reason := self._reason(result):
                        return reason
        return ''

    def _reason(self, result: float) -> str:
        """Return why the search ends after a result, or ''."""
        settings = self._settings
        if result == 0:
            return 'found'
        if 0 < settings.patience <= self.in_vain:
            return 'patience'
        if len(self.known) == settings.max_evaluations:
            return 'evaluations'
        if 0 < settings.max_duration <= self._clock() - self._started:
            return 'duration'
        return ''


def _in_order(
    discrepancy: Callable[[Values], float], tried: Sequence[Values], executor: Executor | None
) -> Generator[float, None, None]:
    """Yield the discrepancies of values in their order; none behind a zero is begun.

    Close the generator to cancel what has not begun and to wait for what has.
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
