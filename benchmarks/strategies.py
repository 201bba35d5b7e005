"""The genetic search against random ones and a grid, at equal numbers of filters tried.

Every strategy looks for a filter of the same scenes with many seeds, by the published genes and by
the extended ones: the mean of the best |N - n| after a number of filters.

    python -m benchmarks.strategies [--detector traditional] [--seeds 20]
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from functools import partial
from itertools import islice, product

import numpy as np
from rich.console import Console
from rich.progress import track

from ahf_ros.detectors import DETECTOR_NAMES, Drafter, create_detector
from ahf_ros.filtering.chromosome import Gene, Values
from ahf_ros.filtering.genes import genes_of, tuned
from ahf_ros.filtering.genetic import search
from ahf_ros.filtering.homomorphic import HomomorphicFilter
from ahf_ros.filtering.settings import EXTENDED, PUBLISHED, GeneticSettings, TuningSettings
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import count_codes

LIGHTS = (
    ('stripe', 0.3),
    ('stripe', 0.12),
    ('fine_stripe', 0.12),
    ('wide_stripe', 0.12),
    ('lattice', 0.3),
    ('lattice', 0.12),
)
TRIED = (1, 5, 10, 25, 50, 100)
MAXIMUM_FILTERS = max(TRIED)


class Scene:
    """|N - n| of filters of one scene, each computed once."""

    def __init__(self, detector: str, light: str, ambient: float) -> None:
        scene = SceneSettings(width=1600, height=1066, targets=14, light=light, ambient=ambient)
        made = create_detector(detector)
        self._identify = made.draft if isinstance(made, Drafter) else made
        self._expected = scene.targets
        self._prepared = HomomorphicFilter(render(scene).image)
        self.known: dict[Values, int] = {}

    def discrepancy(self, values: Values) -> int:
        """Return |N - n|."""
        if values not in self.known:
            it = tuned(self._prepared.shape, values)
            image = self._prepared.filtered(it.gamma_high, it.gamma_low, it.cutoff, it.attenuation)
            self.known[values] = abs(self._expected - count_codes(self._identify(image)))
        return self.known[values]


Strategy = Callable[[Scene, tuple[Gene, ...], np.random.Generator, Executor], list[int]]
"""To |N - n| of the filters that are tried, in their order."""


def genetic(
    scene: Scene,
    genes: tuple[Gene, ...],
    generator: np.random.Generator,
    executor: Executor,
    population: int = GeneticSettings().population,
) -> list[int]:
    """Try filters as the genetic search does."""
    settings = GeneticSettings(population=population, max_evaluations=MAXIMUM_FILTERS)
    result = search(scene.discrepancy, genes, settings, generator, executor=executor)
    return [scene.known[values] for values in result.tried]


def at_random(
    scene: Scene, genes: tuple[Gene, ...], generator: np.random.Generator, executor: Executor
) -> list[int]:
    """Try filters drawn at random."""
    return tried(scene, _drawn(genes, generator), executor)


def on_a_grid(
    scene: Scene, genes: tuple[Gene, ...], generator: np.random.Generator, executor: Executor
) -> list[int]:
    """Try a grid, ten by ten where there are two genes, in random order."""
    steps = round(MAXIMUM_FILTERS ** (1 / len(genes)))
    points = [[_part(gene, (step + 0.5) / steps) for step in range(steps)] for gene in genes]
    grid = list(product(*points))
    return tried(scene, (grid[place] for place in generator.permutation(len(grid))), executor)


def tried(scene: Scene, filters: Iterator[Values], executor: Executor) -> list[int]:
    """Return |N - n| of one filter after the other, up to the first that shows N targets."""
    found: list[int] = []
    chosen = list(islice(dict.fromkeys(filters), MAXIMUM_FILTERS))
    for start in range(0, len(chosen), 10):
        found += executor.map(scene.discrepancy, chosen[start : start + 10])
        if 0 in found:
            return found[: found.index(0) + 1]
    return found


def _drawn(genes: tuple[Gene, ...], generator: np.random.Generator) -> Iterator[Values]:
    for _ in range(2 * MAXIMUM_FILTERS):
        yield tuple(gene.value(int(generator.integers(gene.count))) for gene in genes)


def _part(gene: Gene, share: float) -> float:
    return gene.value(round(share * (gene.count - 1)))


STRATEGIES: dict[str, Strategy] = {
    f'genetic, population {GeneticSettings().population}': genetic,
    'genetic, population 50': partial(genetic, population=50),
    'random': at_random,
    'grid': on_a_grid,
}


def main() -> None:
    """Print the comparison as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--detector', choices=DETECTOR_NAMES, default='traditional')
    parser.add_argument('--seeds', type=int, default=20)
    options = parser.parse_args()
    print(f'| light | genes | strategy | {" | ".join(map(str, TRIED))} filters |')
    print('|---|---|---|' + '---|' * len(TRIED))
    with ThreadPoolExecutor(os.cpu_count()) as executor:
        for light, ambient in LIGHTS:
            scene = Scene(options.detector, light, ambient)
            for tuning, (name, strategy) in product((PUBLISHED, EXTENDED), STRATEGIES.items()):
                genes = genes_of(TuningSettings(search=tuning))
                best = np.zeros((options.seeds, len(TRIED)))
                console = Console(stderr=True)
                for seed in track(range(options.seeds), f'{light} {tuning}', console=console):
                    found = strategy(scene, genes, np.random.default_rng(seed), executor)
                    lowest = np.minimum.accumulate(found)
                    best[seed] = [lowest[min(count, len(lowest)) - 1] for count in TRIED]
                means = ' | '.join(f'{mean:.2f}' for mean in best.mean(axis=0))
                print(f'| {light} {ambient:g} | {tuning} | {name} | {means} |', flush=True)


if __name__ == '__main__':
    main()
