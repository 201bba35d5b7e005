"""Whether error ellipsoids of points hold the truth as often as they say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.orientation.adjustment import adjust
from ahf_ros.orientation.similarity import similarity_between
from ahf_ros.orientation.solution import Solution, Start
from benchmarks.network_scenes import Field, approximate, simulate

CHI_SQUARE = 7.814728  # 95 % of three degrees
RELEASED = ('f', 'cx', 'cy', 'k1', 'k2', 'p1', 'p2')
SIZES = (8, 15, 30, 60)


def table(seeds: Sequence[int], runs: int = 125) -> list[str]:
    """Return coverage of 95 % ellipsoids as lines of Markdown: runs of each size and field.

    The truth is brought into the datum of the solution, inner constraints on all points, by the
    similarity of least squares.
    """
    lines = [
        '| field | photographs | runs | parameters given % | all, usual lenses % | sigma0 |',
        '|---|---|---|---|---|---|',
    ]
    for planar in (True, False):
        for photographs in SIZES:
            field = Field(photographs, targets=25, planar=planar)
            held: tuple[list[float], list[float]] = ([], [])
            sigma0 = []
            for run in range(runs):
                random = np.random.default_rng([seeds[0], photographs, planar, run])
                network, truth = simulate(field, random)
                start = approximate(truth, random)
                given = adjust(network, start, release=RELEASED, test=False)
                held[0].append(coverage(given, truth))
                sigma0.append(given.sigma0)
                if run < runs // 5:
                    held[1].append(coverage(adjust(network, start), truth))
            name = 'planar' if planar else '3-D'
            lines.append(
                f'| {name} | {photographs} | {runs} | {100 * np.mean(held[0]):.1f} '
                f'| {100 * np.mean(held[1]):.1f} ({len(held[1])} runs) | {np.mean(sigma0):.3f} |'
            )
    return lines


def coverage(solution: Solution, truth: Start) -> float:
    """Return the share of points whose 95 % ellipsoid holds the truth."""
    points = solution.start.points
    found = np.isfinite(points[:, 0])
    movement = similarity_between(truth.points[found], points[found])
    error = points[found] - movement.moved(truth.points[found])
    own = solution.point_covariances[found]
    squares = np.einsum('ni,ni->n', error, np.linalg.solve(own, error[:, :, None])[:, :, 0])
    return float((squares < CHI_SQUARE).mean())
