"""Kernels of outlines, against plain loops."""

import math

import numpy as np
import pytest

from ahf_ros import kernels

SEEDS = range(4)


def outlines(seed: int) -> list[np.ndarray]:
    """Return outlines of about four sides, and one of a point."""
    generator = np.random.default_rng(seed)
    found = [np.array([[3, 4]])]
    for _ in range(seed):
        corners = np.array([[5.0, 5], [45, 9], [41, 50], [2, 43]]) + generator.normal(0, 2, (4, 2))
        along = np.linspace(corners, np.roll(corners, -1, axis=0), 30, endpoint=False)
        found.append(along.swapaxes(0, 1).reshape(-1, 2) + generator.normal(0, 0.4, (120, 2)))
    return [np.rint(of).astype(np.int32) for of in found]


@pytest.mark.parametrize('seed', SEEDS)
def test_sizes(seed: int) -> None:
    some = outlines(seed)
    ends = np.cumsum([len(of) for of in some])
    areas, lengths, boxes = kernels.outline_sizes(np.concatenate(some), ends)
    for index, of in enumerate(some):
        after = np.roll(of, -1, axis=0)
        area = (
            sum(x * q - y * p for (x, y), (p, q) in zip(of.tolist(), after.tolist(), strict=True))
            / 2
        )
        assert areas[index] == pytest.approx(area)
        assert lengths[index] == pytest.approx(sum(map(math.dist, of.tolist(), after.tolist())))
        assert boxes[index].tolist() == (np.ptp(of, axis=0) + 1).tolist()


def test_bad_values_end() -> None:
    points, ends = np.full((3, 2), -(2**31), np.int32), np.array([2**62, -5, 2, 1])
    kernels.outline_sizes(points, ends)
