"""Binary chromosomes, which hold one number per gene, and the genetic operators on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Values = tuple[float, ...]
"""What a chromosome stands for: one value per gene, in the order of the genes."""


@dataclass(frozen=True, slots=True)
class Gene:
    """The values of one number: `minimum`, `minimum + step`, ... up to `maximum`.

    Raises
    ------
    ValueError
        If a number is not finite, `step` is not positive or `maximum` is below `minimum`.
    """

    name: str
    minimum: float
    maximum: float
    step: float

    def __post_init__(self) -> None:
        """Check the range."""
        for field in ('minimum', 'maximum', 'step'):
            value = getattr(self, field)
            if not math.isfinite(value):
                raise ValueError(f'{self.name}_{field} is {value!r}, accepted is a finite number')
        if self.step <= 0:
            raise ValueError(f'{self.name}_step is {self.step!r}, accepted is a number above 0')
        if self.maximum < self.minimum:
            raise ValueError(
                f'{self.name}_maximum is {self.maximum!r}, '
                f'accepted is a number of at least {self.name}_minimum, {self.minimum:g}'
            )

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


def first_population(
    genes: Sequence[Gene], size: int, generator: np.random.Generator, initial: Sequence[Values]
) -> np.ndarray:
    """Return random chromosomes, shape (size, bits), after those for `initial`."""
    bits = sum(gene.bits for gene in genes)
    population = generator.integers(2, size=(size, bits)).astype(bool)
    for chromosome, values in zip(population, initial, strict=False):
        chromosome[:] = encoded(values, genes)
    return population


def selected(
    population: np.ndarray, discrepancies: np.ndarray, size: int, generator: np.random.Generator
) -> np.ndarray:
    """Return as many parents as chromosomes, or one more to make pairs.

    Each parent wins a tournament of `size` chromosomes by the smallest discrepancy.
    """
    parents = len(population) + len(population) % 2
    drawn = generator.integers(len(population), size=(parents, size))
    winners = drawn[np.arange(parents), discrepancies[drawn].argmin(axis=1)]
    return population[winners]


def crossed(parents: np.ndarray, probability: float, generator: np.random.Generator) -> np.ndarray:
    """Return the children of pairs of parents, by single-point crossover with a probability."""
    mothers, fathers = parents[::2], parents[1::2]
    pairs, bits = mothers.shape
    crossing = generator.random((pairs, 1)) < probability
    points = generator.integers(1, max(bits, 2), size=(pairs, 1))
    exchanged = crossing & (np.arange(bits) >= points)
    return np.concatenate(
        [np.where(exchanged, fathers, mothers), np.where(exchanged, mothers, fathers)]
    )


def mutated(
    population: np.ndarray, probability: float, generator: np.random.Generator
) -> np.ndarray:
    """Return the chromosomes with each bit flipped with a probability."""
    return population ^ (generator.random(population.shape) < probability)
