"""Ink that is larger on every edge, for every family: what lies within its growth is inked."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from ahf_ros.codes.designs import proportions
from ahf_ros.synthetic.designs import designs
from support.square_markers import needs_square_markers

NUMBER = 18
STEP = 0.015  # of the samples, radii of the dot
ROUND = ('metashape12', 'metashape20', 'aicon14', 'gsi', 'dots')


def ink_of(name: str, growth: float) -> np.ndarray:
    """Return where there is ink, on a grid that is the same for all growths."""
    half = proportions(name).reach + 0.5
    along = np.arange(-half, half, STEP, dtype=np.float32)
    x, y = np.meshgrid(along, along[::-1])
    cover = designs(name, 0.0)[1](NUMBER, 0.4, growth).cover
    return cover(x, y, np.eye(2, dtype=np.float32) * np.float32(STEP)) > 0.5


def reached(inked: np.ndarray, distance: float) -> np.ndarray:
    """Return what lies within a distance of ink."""
    ground = (~inked).astype(np.uint8)
    steps = cv2.distanceTransform(ground, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) - 0.5
    return steps * STEP < distance


@pytest.mark.parametrize(
    'name', [*ROUND, pytest.param('aruco_4x4_50', marks=needs_square_markers)]
)
def test_ink_grows_and_shrinks_by_the_same_length_on_every_edge(name: str) -> None:
    plain = ink_of(name, 0.0)
    for found, expected in (
        (ink_of(name, 0.15), reached(plain, 0.15)),
        (ink_of(name, -0.12), ~reached(~plain, 0.12)),
    ):
        changed = (expected != plain).sum()
        assert changed > 0.1 * plain.sum()
        # Where ink grows, sectors keep sharp corners.
        assert (found != expected).sum() < 0.08 * changed


def test_the_same_growth_leaves_holes_that_are_smaller() -> None:
    hole = designs('metashape12', 0.3)[1]
    near = np.zeros((1, 2), np.float32)
    near[0] = 0.05, 0.25
    jacobian = np.eye(2, dtype=np.float32) * np.float32(STEP)
    for growth, inked in ((0.0, [0, 0]), (0.1, [0, 1]), (0.35, [1, 1])):
        assert hole(1, 0.0, growth).cover(near, near * 0, jacobian)[0].tolist() == inked
