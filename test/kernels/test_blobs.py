"""Blobs of pixels, against a plain flood fill."""

import numpy as np
import pytest

from ahf_ros import kernels

SEEDS = range(12)


def flooded(shown: np.ndarray) -> list[np.ndarray]:
    """Return rows and columns of the pixels of each blob, (n, 2), in the order of the first."""
    left = {(int(row), int(column)) for row, column in np.argwhere(shown)}
    found = []
    while left:
        rest, blob = [min(left)], []
        left.remove(rest[0])
        while rest:
            row, column = rest.pop()
            blob.append((row, column))
            for near in (
                (row - 1, column),
                (row + 1, column),
                (row, column - 1),
                (row, column + 1),
            ):
                if near in left:
                    left.remove(near)
                    rest.append(near)
        found.append(np.array(blob))
    return found


@pytest.mark.parametrize('seed', SEEDS)
def test_blobs_are_those_of_a_flood_fill(seed: int) -> None:
    generator = np.random.default_rng(seed)
    tall, wide = [(1, 40), (40, 1), (30, 50), (60, 37)][seed % 4]
    shown = generator.random((tall, wide)) < [0.3, 0.5, 0.62][seed // 4]
    values = generator.integers(0, 256, shown.shape).astype(np.uint8)
    fewest, longest = 1 + seed % 3, 4 + 3 * seed
    first, size, length, highest, moments, _ = kernels.blobs(
        shown, values, fewest, longest, most=np.count_nonzero(shown)
    )
    expected = []
    for blob in flooded(shown):
        row, column = blob.T
        side = max(np.ptp(row), np.ptp(column)) + 1
        if len(blob) >= fewest and side <= longest:
            (xx, xy), (_, yy) = np.cov(column, row, ddof=0)
            whole = row.min() * wide + column[row == row.min()].min(), len(blob), side
            expected.append(
                (*whole, values[row, column].max(), column.mean(), row.mean(), xx, xy, yy)
            )
    count = np.count_nonzero(size)
    assert count == len(expected) > 0
    assert (size[count:] == 0).all()
    found = np.stack([first, size, length, highest, *moments], axis=1)[np.argsort(first[:count])]
    assert found == pytest.approx(np.array(expected), rel=1e-12, abs=1e-12)


def test_arrays_are_filled_with_the_first_blobs_that_are_complete() -> None:
    shown = np.array([[1, 0, 1, 0, 1], [1, 0, 0, 0, 0]], bool)
    values = np.full(shown.shape, 7, np.uint8)
    first, size, *_ = kernels.blobs(shown, values, 1, 5, most=2)
    assert (first.tolist(), size.tolist()) == ([2, 4], [1, 1])


def test_blobs_that_meet_again_and_again_are_one() -> None:
    """The teeth of a comb are one blob from the last row on; rings in rings stay apart."""
    shown = np.zeros((41, 41), bool)
    shown[:40, ::2] = shown[40] = True
    *_, size, length = kernels.blobs(shown, shown.astype(np.uint8), 1, 41, most=9)[:3]
    assert (size[0], length[0], size[1]) == (21 * 40 + 41, 41, 0)
    away = np.abs(np.arange(41) - 20)
    rings = np.maximum(away, away[:, None]) % 2 == 0
    size = kernels.blobs(rings, rings.astype(np.uint8), 1, 41, most=99)[1]
    assert size[:12].tolist() == [*(max(8 * radius, 1) for radius in range(0, 21, 2)), 0]
