"""Time and memory of large networks, with covariances."""

from __future__ import annotations

import resource
import time
from collections.abc import Sequence

import numpy as np

from ahf_ros.orientation.adjustment import adjust
from benchmarks.network_ellipsoids import RELEASED
from benchmarks.network_scenes import Field, approximate, simulate

SIZES = (125, 250, 500, 1000)


def table(seeds: Sequence[int]) -> list[str]:
    """Return times of 200 targets, 80 in a photograph, as lines of Markdown."""
    lines = [
        '| photographs | observations | parameters given, no tests, s | all and tests, s '
        '| memory MB |',
        '|---|---|---|---|---|',
    ]
    for photographs in SIZES:
        random = np.random.default_rng([seeds[0], photographs])
        network, truth = simulate(Field(photographs, 200, each=80), random)
        start = approximate(truth, random)
        begin = time.perf_counter()
        adjust(network, start, release=RELEASED, test=False)
        between = time.perf_counter()
        adjust(network, start)
        end = time.perf_counter()
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        lines.append(
            f'| {photographs} | {len(network.observations.xy)} | {between - begin:.1f} '
            f'| {end - between:.1f} | {memory:.0f} |'
        )
    return lines
