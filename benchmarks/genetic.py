"""Evaluations that the genetic search needs, by the choices that Table 1 leaves open.

The objectives have the shape of |N - n| with 54 targets: zero at some filter, flat far from it.

    python -m benchmarks.genetic [--seeds 40]
"""

from __future__ import annotations

import argparse
import math
import statistics
from collections.abc import Callable
from unittest import mock

import numpy as np

from ahf_ros.filtering import genetic
from ahf_ros.filtering.chromosome import Values, mutated
from ahf_ros.filtering.genes import genes_of
from ahf_ros.filtering.genetic import search
from ahf_ros.filtering.settings import PUBLISHED, GeneticSettings, TuningSettings

N = 54

WAYS = {
    'bit, tournament of 2': ('bit', 0.1, 2),
    'bit, tournament of 4': ('bit', 0.1, 4),
    'bit, tournament of 8': ('bit', 0.1, 8),
    'chromosome, tournament of 2': ('chromosome', 0.1, 2),
    'chromosome, tournament of 8': ('chromosome', 0.1, 8),
    'random search': ('bit', 0.5, 1),
}
"""What the mutation is the probability of, its probability, and the size of a tournament."""


def hill(high: float, low: float, width_high: float, width_low: float) -> Callable:
    """Return an objective with its goal at one filter."""

    def discrepancy(values: Values) -> int:
        distance = math.hypot((values[0] - high) / width_high, (values[1] - low) / width_low)
        return round(N * (1 - math.exp(-(distance**2))))

    return discrepancy


def ridge(values: Values) -> int:
    """Return an objective that depends on the ratio of the gains, most of all."""
    ratio = math.exp(-(((values[1] / values[0] - 0.2) / 0.02) ** 2))
    return round(N * (1 - ratio * math.exp(-(((values[0] - 1.2) / 0.4) ** 2))))


OBJECTIVES = {
    'wide hill': hill(1.2, 0.25, 1.0, 0.3),
    'middle hill': hill(2.8, 0.82, 0.4, 0.1),
    'narrow hill': hill(3.8, 0.7, 0.15, 0.04),
    'corner': hill(1.0, 0.0, 0.3, 0.1),
    'ridge': ridge,
}


def one_bit_mutated(
    population: np.ndarray, probability: float, generator: np.random.Generator
) -> np.ndarray:
    """Return the chromosomes, each with one bit flipped with a probability."""
    children = mutated(population, 0.0, generator)
    mutants = np.flatnonzero(generator.random(len(children)) < probability)
    bits = generator.integers(children.shape[1], size=len(mutants))
    children[mutants, bits] ^= True
    return children


def trial(objective: Callable, way: tuple[str, float, int], seed: int, most: int) -> tuple:
    """Return the evaluations of one search and what it left."""
    kind, mutation, tournament = way
    settings = GeneticSettings(
        population=50, mutation=mutation, tournament=tournament, max_evaluations=most
    )
    mutation_of = one_bit_mutated if kind == 'chromosome' else mutated
    with mock.patch.object(genetic, 'mutated', mutation_of):
        generator = np.random.default_rng(seed)
        result = search(objective, genes_of(TuningSettings(search=PUBLISHED)), settings, generator)
    return result.evaluations, result.discrepancy


def main() -> None:
    """Run every way on every objective and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seeds', type=int, default=40)
    seeds = range(parser.parse_args().seeds)
    print(
        '| objective | mutation of a | evaluations | searches without success | missing at 200 |'
    )
    print('|---|---|---|---|---|')
    for name, objective in OBJECTIVES.items():
        for text, way in WAYS.items():
            free = [trial(objective, way, seed, 0) for seed in seeds]
            short = [trial(objective, way, seed, 200) for seed in seeds]
            print(
                f'| {name} | {text} | {statistics.mean(count for count, _ in free):.0f} '
                f'| {sum(left > 0 for _, left in free)} of {len(seeds)} '
                f'| {statistics.mean(left for _, left in short):.1f} |'
            )


if __name__ == '__main__':
    main()
