"""Kernels of outlines, against plain loops and numpy's fits."""

import math

import numpy as np
import pytest

from ahf_ros import kernels

SEEDS = range(4)
NEAR, MIDDLE, OUTWARDS = 1.3, 0.41, 0.7


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


@pytest.mark.parametrize('seed', SEEDS)
def test_lines_of_sides(seed: int) -> None:
    some = outlines(seed)
    generator = np.random.default_rng(seed)
    corners = np.array([[5.0, 5], [45, 9], [41, 50], [2, 43]])
    sides = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    sides = sides + generator.normal(0, 0.5, (len(some), 4, 2, 2))
    ends = np.cumsum([len(of) for of in some])
    of_sides = sides, np.full(len(some), NEAR), np.full(len(some), OUTWARDS)
    lines, fewest = kernels.side_lines(np.concatenate(some), ends, *of_sides, MIDDLE, 1e-9)
    for index, points in enumerate(some):
        counts = []
        for side, line in zip(sides[index], lines[index], strict=True):
            length = math.dist(*side.tolist())
            along = (side[1] - side[0]) / length
            outwards = np.array([along[1], -along[0]])
            at, away = (points - side[0]) @ along / length - 0.5, (points - side[0]) @ outwards
            used = (np.abs(away) < NEAR) & (np.abs(at) < MIDDLE)
            counts.append(used.sum())
            if used.sum() > 2:
                fitted = np.polyval(np.polyfit(at[used], away[used], 1), [-0.5, 0.5]) + OUTWARDS
                np.testing.assert_allclose(line, side + fitted[:, None] * outwards, atol=1e-9)
        assert fewest[index] == min(counts)


@pytest.mark.parametrize('bad', [math.nan, math.inf, -1e300])
def test_bad_values_end(bad: float) -> None:
    points, ends = np.full((3, 2), -(2**31), np.int32), np.array([2**62, -5, 2, 1])
    kernels.outline_sizes(points, ends)
    bads = np.full((4, 4, 2, 2), bad), np.full(4, bad), np.full(4, bad)
    kernels.side_lines(points, ends, *bads, bad, bad)
