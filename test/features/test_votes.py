"""Votes: counted in cells, and their peaks between them."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.features.candidates import find_peaks, highest

SHAPE = (2, 40, 60)


def votes_about(x: float, y: float, plane: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the cells that votes scattered about a point are for."""
    scatter = np.random.default_rng(3).normal(0, 0.7, (2, count))
    columns, rows = np.rint(np.array([[x], [y]]) + scatter).astype(np.int32)
    return columns, rows + np.int32(plane * SHAPE[1])


@pytest.mark.parametrize('plane', [0, 1])
@pytest.mark.parametrize('x', [20.0, 20.3, 20.5, 20.8])
def test_a_peak_lies_between_cells(plane, x):
    peaks = find_peaks(*votes_about(x, 15.4, plane, 400), SHAPE, 100, 2)
    assert peaks.plane.tolist() == [plane]
    assert (peaks.x[0], peaks.y[0]) == pytest.approx((x, 15.4), abs=0.15)
    assert peaks.votes[0] > 1


def test_too_few_votes_make_no_peak():
    assert len(find_peaks(*votes_about(20, 15, 0, 60), SHAPE, 100, 2).x) == 0
    none = np.zeros(0, np.int32)
    assert len(find_peaks(none, none, SHAPE, 100, 2).x) == 0


def test_peaks_of_two_planes_do_not_touch():
    parts = [votes_about(20, 37, 0, 300), votes_about(20, 2, 1, 400)]
    columns, rows = (np.concatenate(of) for of in zip(*parts, strict=True))
    peaks = find_peaks(columns, rows, SHAPE, 100, 2)
    assert sorted(peaks.plane.tolist()) == [0, 1]


def test_of_neighbours_the_highest_is_kept():
    cells = np.array([10 * 60 + 10, 10 * 60 + 12, 10 * 60 + 15])
    assert highest(cells, np.array([2.0, 3.0, 1.0]), (40, 60), 2).tolist() == [False, True, True]
