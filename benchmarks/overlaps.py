"""Targets whose paper lies on that of other targets, so that their bands overlap."""

from __future__ import annotations

import math

import numpy as np

from ahf_ros.codes.ring import family
from ahf_ros.target import TrueTarget
from benchmarks import occluders
from benchmarks.exposure import Exposure
from benchmarks.sheets import target_sheet

_CELL = 10.0  # half of the side of a cell with both targets, dot radii


def overlapping(
    name: str, numbers: np.ndarray, seed: int, distance: float, radius: float = 12.0
) -> tuple[np.ndarray, list[TrueTarget]]:
    """Return an image of targets with another one on each, and all targets that it shows.

    Parameters
    ----------
    name : str
        Family of all targets.
    numbers : ndarray of int
        IDs of the targets below; those above have other ones.
    seed : int
    distance : float
        Between the centres of two targets, dot radii.
    radius : float
        Of the dots, px.
    """
    sheet = target_sheet(name, numbers, seed, radius=radius, cell=_CELL)
    generator = np.random.default_rng([seed, 3])
    free = np.setdiff1d(np.arange(1, family(name).words.size + 1), numbers)
    above = generator.permutation(free)[: len(numbers)].tolist()
    directions = generator.uniform(0, 2 * math.pi, len(numbers)).tolist()
    papers = occluders.other_targets(name, above, distance, directions)
    truth = list(sheet.truth)
    for mark, number, direction in zip(sheet.marks, above, directions, strict=True):
        x, y = mark.plane @ (distance * np.array([math.cos(direction), math.sin(direction)]))
        truth.append(TrueTarget(number, mark.x + x, mark.y + y))
    return sheet.photograph(Exposure(occluder=papers)), truth
