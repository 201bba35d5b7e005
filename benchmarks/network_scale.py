"""Time and memory of large networks, with covariances."""

from __future__ import annotations

import resource
import time
from collections.abc import Sequence

import numpy as np

from ahf_ros.orientation.adjustment import adjust
from ahf_ros.orientation.orient import orient
from benchmarks.network_ellipsoids import RELEASED
from benchmarks.network_scenes import Field, approximate, simulate
from benchmarks.report import table as markdown

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


def from_ids(seeds: Sequence[int]) -> list[str]:
    """Return the processor time of photographs that all show 200 targets, from IDs alone."""
    field = Field(300, 200)
    network, _ = simulate(field, np.random.default_rng([seeds[0], field.photographs]))
    begin = time.process_time()
    (solution,) = orient(network)
    taken = time.process_time() - begin
    counts = (
        field.photographs,
        field.targets,
        len(network.observations.xy),
        solution.oriented.sum(),
    )
    head = 'photographs', 'targets', 'image points', 'oriented', 'sigma0', 'processor, s'
    return markdown(head, [(*counts, f'{solution.sigma0:.3f}', f'{taken:.0f}')])
