"""Wrong IDs and a target that was moved, as the adjustment finds them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.orientation.adjustment import adjust
from ahf_ros.orientation.camera import project
from ahf_ros.orientation.network import Network
from ahf_ros.orientation.refinement import refine
from ahf_ros.orientation.solution import Start
from benchmarks.network_scenes import Field, approximate, simulate

WRONG = 0.05
LARGE = 5.0  # standard deviations of a wrong observation that must not be accepted
SIZES = (8, 15, 30, 60)


def table(seeds: Sequence[int], runs: int = 25) -> list[str]:
    """Return what is accepted and kept, as lines of Markdown."""
    lines = [
        '| field | photographs | runs | wrong | accepted above 5 sigma | good | kept % '
        '| moved target named |',
        '|---|---|---|---|---|---|---|---|',
    ]
    for planar in (True, False):
        for photographs in SIZES:
            sums = np.zeros(5, dtype=int)
            for run in range(runs):
                random = np.random.default_rng([seeds[0], photographs, planar, run])
                sums += counted(Field(photographs, 40, planar, each=30), random)
            wrong, accepted, good, kept, named = sums
            lines.append(
                f'| {"planar" if planar else "3-D"} | {photographs} | {runs} | {wrong} '
                f'| {accepted} | {good} | {100 * kept / good:.2f} | {named} |'
            )
    return lines


def counted(field: Field, random: np.random.Generator) -> tuple[int, int, int, int, bool]:
    """Return how many are wrong, wrong and accepted, good, good and kept, and if 0 is named."""
    network, truth = simulate(field, random)
    network, second, late = moved(network, truth, random)
    network, wrong = disturbed(network, random)
    start = refine(network, approximate(truth, random), ('f', 'k1'))
    solution = adjust(network, start)
    observations, used = network.observations, solution.start.used
    right = (observations.point == 0) & ~wrong
    balance = 2 * (late & right).sum() - right.sum()
    if balance > 0 or (balance == 0 and (used & late & right).any()):
        truth.points[0] = second  # where it is more often is where it is
    computed = project(
        truth.calibrations[0],
        truth.rotations[observations.photograph],
        truth.positions[observations.photograph],
        truth.points[observations.point],
    )
    sigma = np.sqrt(observations.covariance[:, 0, 0])
    large = np.linalg.norm(observations.xy - computed, axis=1) > LARGE * sigma
    bad = large | wrong
    named = any(text.startswith('target 0 is at two places') for text in solution.warnings)
    return bad.sum(), (used & large).sum(), (~bad).sum(), (used & ~bad).sum(), named


def moved(
    network: Network, truth: Start, random: np.random.Generator
) -> tuple[Network, np.ndarray, np.ndarray]:
    """Return a network whose target 0 moves halfway, its second place, and the rows there."""
    observations = network.observations
    rows = np.flatnonzero(observations.point == 0)
    late = rows[len(rows) // 2 :]
    step = random.normal(size=3) * [1, 1, 0.2]
    second = truth.points[0] + 0.1 * step / np.linalg.norm(step)
    photographs = observations.photograph[late]
    before, after = (
        project(
            truth.calibrations[0],
            truth.rotations[photographs],
            truth.positions[photographs],
            np.tile(place, (len(late), 1)),
        )
        for place in (truth.points[0], second)
    )
    xy = observations.xy.copy()
    xy[late] += after - before
    moved_network = replace(network, observations=replace(observations, xy=xy))
    return moved_network, second, np.isin(np.arange(len(xy)), late)


def disturbed(network: Network, random: np.random.Generator) -> tuple[Network, np.ndarray]:
    """Return a network with 5 % wrong IDs, of targets not in their photograph, and which."""
    observations = network.observations
    point = observations.point.copy()
    wrong = random.random(len(point)) < WRONG
    for row in np.flatnonzero(wrong):
        present = point[observations.photograph == observations.photograph[row]]
        absent = np.setdiff1d(np.arange(1, len(network.targets)), present)
        if len(absent):
            point[row] = random.choice(absent)
        else:
            wrong[row] = False
    return replace(network, observations=replace(observations, point=point)), wrong
