"""Groups of photographs that do not hang together, each as a network of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ahf_ros.orientation.network import part_of
from ahf_ros.orientation.solution import Solution

Mask = NDArray[np.bool_]


def separated(solutions: Sequence[Solution]) -> list[Solution]:
    """Return the solutions of one network without what only other groups determine.

    What no group determines stays in the first one.
    """
    posed = np.array([it.oriented for it in solutions])
    placed = np.array([it.determined for it in solutions])
    parts = []
    for number, solution in enumerate(solutions):
        masks = []
        for known in (posed, placed):
            nowhere = ~known.any(axis=0) if number == 0 else False
            masks.append(np.asarray(known[number] | nowhere))
        parts.append(part(solution, *masks))
    return parts


def part(solution: Solution, photographs: Mask, targets: Mask) -> Solution:
    """Return a solution with some of its photographs and targets; cameras stay as they are."""
    start = solution.start
    network, rows = part_of(solution.network, np.flatnonzero(photographs), np.flatnonzero(targets))
    entries = np.repeat(targets, 3)
    return replace(
        solution,
        network=network,
        start=replace(
            start,
            rotations=start.rotations[photographs],
            positions=start.positions[photographs],
            points=start.points[targets],
            used=start.used[rows],
        ),
        residuals=solution.residuals[rows],
        normalised=solution.normalised[rows],
        pose_covariances=solution.pose_covariances[photographs],
        covariance_of_points=solution.covariance_of_points[np.ix_(entries, entries)],
        rejected=tuple(it for it in solution.rejected if it.photograph in network.photographs),
    )
