"""What AHF costs, against the published algorithm in the same run.

The published algorithm is that of the paper: every filter by numpy's Fourier transforms, in double
precision, one chromosome after the other, a generation of 50 before it looks whether to stop
(Table 1). Both drive the same detector on the same image.

- One filter, against the recipe, Eq. (1) to (7) as they stand; the tests compare what they give.
- One candidate: a filter and an identification through it; ours with all threads at work.
- The whole of AHF, from the image to its targets.
- A stream: an image under unchanged light, against one filter and one identification.

    python -m benchmarks.speed [--light stripe] [--ambient 0.3] [--seed 101]
"""

import argparse
import os
import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np

from ahf_ros.base.target import count_codes
from ahf_ros.families import Drafter, create_detector
from ahf_ros.identification.filtering.genes import genes_of
from ahf_ros.identification.filtering.genetic import search
from ahf_ros.identification.filtering.homomorphic import HomomorphicFilter, median_distance
from ahf_ros.identification.filtering.settings import (
    PUBLISHED,
    FilterSettings,
    GeneticSettings,
    TuningSettings,
)
from ahf_ros.identification.session import create_identifier, identify
from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.vision.logarithm import mapping
from benchmarks.report import machine, machine_text, table
from support.fourier import distances, sampled

ROUNDS = 7
FRAMES = 6
PAPER_GAINS = (2.8, 0.82)
"""Of a filter that the paper reports."""


class Recipe:
    """The published filter, as one writes it down in numpy."""

    def __init__(self, shape: tuple[int, int], settings: FilterSettings) -> None:
        self.distances = distances(*shape)
        self.median = median_distance(*shape)
        self.settings = settings

    def __call__(self, image: np.ndarray, gamma_high: float, gamma_low: float) -> np.ndarray:
        """Return the filtered image, 8 bit."""
        spectrum = np.fft.fft2(np.log(image / 255 + self.settings.log_offset))
        difference = gamma_high - gamma_low
        attenuated = np.exp(-difference * (self.distances / self.median) ** 2)
        response = difference * (1 - attenuated) + gamma_low
        values = np.fft.ifft2(response * spectrum).real
        scale, zero = mapping(
            sampled(values), self.settings.black_percentile, self.settings.white_percentile
        )
        return np.clip(np.rint(np.exp(values + scale) - zero), 0, 255).astype(np.uint8)


def seconds(
    work: Callable[[], Any], clock: Callable[[], float] = time.perf_counter
) -> tuple[float, Any]:
    """Return the time that `work` takes, s, and its result."""
    started = clock()
    result = work()
    return clock() - started, result


def in_turns(
    works: Sequence[Callable[[], Any]],
    rounds: int = ROUNDS,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[float, ...]:
    """Return the median time of each work, s; in turns, so that all meet the same machine."""
    times = [[seconds(work, clock)[0] for work in works] for _ in range(rounds)]
    return tuple(statistics.median(column) for column in zip(*times, strict=True))


def filters(image: np.ndarray, recipe: Recipe) -> tuple[float, ...]:
    """Return the time of one filter, s: published, ours in one thread and in all threads."""
    prepared, gains = HomomorphicFilter(image), PAPER_GAINS
    with ThreadPoolExecutor(os.cpu_count()) as executor:
        ways = (
            partial(recipe, image, *gains),
            partial(prepared.filtered, *gains),
            partial(prepared.filtered, *gains, executor=executor),
        )
        return in_turns(ways)


def published(recipe: Recipe, image: np.ndarray, detector: Any, expected: int) -> tuple[int, int]:
    """Return n and the number of identifications of the published algorithm."""
    found = [count_codes(detector(image))]
    settings = GeneticSettings(population=50, max_evaluations=0)

    def discrepancy(gains: tuple[float, ...]) -> int:
        found.append(count_codes(detector(recipe(image, *gains))))
        return abs(expected - found[-1])

    genes = genes_of(TuningSettings(search=PUBLISHED))
    generator = np.random.default_rng(settings.seed)
    result = search(discrepancy, genes, settings, generator)
    for _ in range(settings.population * len(result.history) - len(result.tried)):
        # the rest of the last generation, which that algorithm evaluates as well
        discrepancy(result.values)
    return expected - int(min(result.discrepancies)), len(found)


def candidates(image: np.ndarray, detector: Any, recipe: Recipe) -> tuple[float, float]:
    """Return the median time of one candidate, published and ours, s."""
    prepared, threads = HomomorphicFilter(image), os.cpu_count() or 1
    draft = detector.draft if isinstance(detector, Drafter) else detector
    generator = np.random.default_rng(0)
    low, high = generator.uniform(0, 1, 4 * threads), generator.uniform(1, 4, 4 * threads)
    gains = list(zip(high.tolist(), low.tolist(), strict=True))
    chosen = cycle(gains)
    with ThreadPoolExecutor(threads) as executor:
        theirs, ours = in_turns(
            (
                lambda: detector(recipe(image, *next(chosen))),
                lambda: list(executor.map(lambda it: draft(prepared.filtered(*it)), gains)),
            )
        )
    return theirs, ours / len(gains)


def stream(image: np.ndarray, detector: Any, expected: int) -> tuple[float, float]:
    """Return the median time of an image of a stream, and of its filter and identification, s."""
    identifier = create_identifier(detector=detector, expected_targets=expected, follow=0)
    state = identifier.identify(image).filter
    values = state.gamma_high, state.gamma_low, state.cutoff, state.attenuation

    def unchanged() -> None:
        assert identifier.identify(image).filter.evaluations == 1

    with ThreadPoolExecutor(os.cpu_count()) as executor:
        whole, parts = in_turns(
            (unchanged, lambda: detector(HomomorphicFilter(image).filtered(*values, executor))),
            FRAMES,
        )
    return whole, parts


def main() -> None:
    """Measure and print as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--light', default='stripe')
    parser.add_argument('--ambient', type=float, default=0.3)
    parser.add_argument('--seed', type=int, default=101)
    options = parser.parse_args()
    scene = SceneSettings(light=options.light, ambient=options.ambient, seed=options.seed)
    image, expected = render(scene).image, scene.targets
    detector, recipe = create_detector('traditional'), Recipe(image.shape, FilterSettings())
    print(
        f'{scene.light} {scene.ambient:g}, {scene.width} x {scene.height} px, {expected} targets; '
        f'{machine_text(machine())}\n'
    )
    print('\n'.join(table(('', 's', 'compared with', 's', 'times faster'), [])))

    def row(name: str, own: float, other: str, others: float) -> None:
        print(f'| {name} | {own:.3f} | {other} | {others:.3f} | {others / own:.1f} |', flush=True)

    theirs, alone, shared = filters(image, recipe)
    row('one filter, in one thread', alone, 'published', theirs)
    row('one filter, in all threads', shared, 'published', theirs)
    theirs, ours = candidates(image, detector, recipe)
    row('one candidate, traditional', ours, 'published', theirs)
    duration, (count, evaluations) = seconds(lambda: published(recipe, image, detector, expected))
    other = f'published, traditional: {count} in {evaluations} identifications'
    for name in ('traditional', 'ring'):
        run = partial(identify, image, detector=name, expected_targets=expected)
        times = [seconds(run) for _ in range(3)]
        result = times[0][1]
        words = f'AHF, {name}: {result.count} in {result.filter.evaluations}'
        row(words, statistics.median(it[0] for it in times), other, duration)
    whole, parts = stream(image, detector, expected)
    row('one image of a stream, traditional', whole, 'a filter and an identification', parts)


if __name__ == '__main__':
    main()
