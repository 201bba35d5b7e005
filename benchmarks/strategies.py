"""The genetic search against random ones and a grid, at equal numbers of filters tried.

For each light |N - n| is computed for all filters there are, once. Strategies are then compared on
that table with many seeds: the mean of the best |N - n| after so many filters.

    python benchmarks/strategies.py [--detector traditional] [--seeds 200]
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import product

import numpy as np
from rich.console import Console
from rich.progress import track

from ahf_ros.chromosome import Gene
from ahf_ros.detectors import DETECTOR_NAMES, create
from ahf_ros.genetic import GeneticSettings, Values, search
from ahf_ros.homomorphic import HomomorphicFilter
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import count_codes
from ahf_ros.tuning import TuningSettings

LIGHTS = (('stripe', 0.3), ('stripe', 0.12), ('lattice', 0.3), ('lattice', 0.12))
TRIED = (5, 10, 25, 50, 100)

Table = dict[Values, int]
"""|N - n| of every filter."""


def table(detector: str, light: str, ambient: float) -> Table:
    """Return |N - n| of all filters for one scene."""
    scene = SceneSettings(width=1600, height=1066, targets=14, light=light, ambient=ambient)
    image = render(scene).image
    prepared, identify = HomomorphicFilter(image), create(detector)
    genes = TuningSettings().genes
    every = list(product(*(map(gene.value, range(gene.count)) for gene in genes)))

    def discrepancy(values: Values) -> int:
        return abs(scene.targets - count_codes(identify(prepared.filtered(*values))))

    with ThreadPoolExecutor(os.cpu_count()) as threads:
        found = track(
            threads.map(discrepancy, every),
            f'{light} {ambient:g}',
            total=len(every),
            console=Console(stderr=True),
        )
        return dict(zip(every, found, strict=True))


def genetic(known: Table, generator: np.random.Generator) -> list[int]:
    """Return what the genetic search finds, in its order."""
    settings = GeneticSettings(max_evaluations=max(TRIED))
    result = search(known.__getitem__, TuningSettings().genes, settings, generator)
    return [known[values] for values in result.tried]


def at_random(known: Table, generator: np.random.Generator) -> list[int]:
    """Return what filters drawn at random find."""
    return generator.permutation(list(known.values()))[: max(TRIED)].tolist()


def on_a_grid(known: Table, generator: np.random.Generator) -> list[int]:
    """Return what a grid of ten by ten filters finds, in random order."""
    high, low = ([_tenth(gene, step) for step in range(10)] for gene in TuningSettings().genes)
    return generator.permutation([known[values] for values in product(high, low)]).tolist()


def _tenth(gene: Gene, step: int) -> float:
    return gene.value(round((step + 0.5) * (gene.count - 1) / 10))


STRATEGIES: dict[str, Callable[[Table, np.random.Generator], list[int]]] = {
    'genetic': genetic,
    'random': at_random,
    'grid of 10 x 10': on_a_grid,
}


def main() -> None:
    """Print the comparison as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--detector', choices=DETECTOR_NAMES, default='traditional')
    parser.add_argument('--seeds', type=int, default=200)
    options = parser.parse_args()
    print(f'| light | best of all | strategy | {" | ".join(map(str, TRIED))} filters |')
    print('|---|---|---|' + '---|' * len(TRIED))
    for light, ambient in LIGHTS:
        known = table(options.detector, light, ambient)
        for name, strategy in STRATEGIES.items():
            best = np.zeros((options.seeds, len(TRIED)))
            for seed in range(options.seeds):
                found = np.minimum.accumulate(strategy(known, np.random.default_rng(seed)))
                best[seed] = [found[min(tried, len(found)) - 1] for tried in TRIED]
            means = ' | '.join(f'{mean:.2f}' for mean in best.mean(axis=0))
            lowest = min(known.values())
            print(f'| {light} {ambient:g} | {lowest} | {name} | {means} |', flush=True)


if __name__ == '__main__':
    main()
