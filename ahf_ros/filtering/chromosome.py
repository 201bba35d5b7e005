"""Chromosomes: numbers coded in binary, one after the other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Values = tuple[float, ...]
"""One value a gene, in the order of the genes: what a chromosome stands for."""


@dataclass(frozen=True, slots=True)
class Gene:
    """A number that is searched for: `minimum`, `minimum + step`, ... up to `maximum`.

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
        """Length of its part of the chromosome."""
        return (self.count - 1).bit_length()

    def value(self, index: int) -> float:
        """Return value number `index`, from 0, without the rounding error of the step."""
        return round(self.minimum + index * self.step, 9)

    def index(self, code: int) -> int:
        """Return the number of the value that a part of a chromosome, read as binary, means."""
        return code * self.count >> self.bits

    def code(self, value: float) -> int:
        """Return the smallest code that means the value nearest to `value`."""
        index = round((min(max(value, self.minimum), self.maximum) - self.minimum) / self.step)
        return -(-(min(index, self.count - 1) << self.bits) // self.count)


def encoded(values: Values, genes: Sequence[Gene]) -> list[bool]:
    """Return the bits of a chromosome that stands for the values nearest to `values`."""
    return [
        bool(gene.code(value) >> place & 1)
        for gene, value in zip(genes, values, strict=True)
        for place in reversed(range(gene.bits))
    ]


def decoded(chromosome: np.ndarray, genes: Sequence[Gene]) -> Values:
    """Return what a chromosome, ndarray of bool, shape (bits,), stands for.

    The first gene has the first bits, the first bit of a gene is its highest. A gene of five bits
    and 31 values shares its 32 codes out among them, in ascending order and as evenly as it can.
    """
    values, start = [], 0
    for gene in genes:
        part = chromosome[start : start + gene.bits]
        code = int(part @ (1 << np.arange(gene.bits)[::-1]))
        values.append(gene.value(gene.index(code)))
        start += gene.bits
    return tuple(values)
