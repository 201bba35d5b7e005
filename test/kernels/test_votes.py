"""Votes and their peaks, against plain loops over all cells."""

import numpy as np
import pytest

from ahf_ros import kernels
from ahf_ros.vision.candidates import find_peaks

SEEDS = range(6)
WEIGHTS = np.outer([0.5, 1, 0.5], [0.5, 1, 0.5])


@pytest.mark.parametrize('seed', SEEDS)
def test_votes_are_counted_in_the_cells_at_steps(seed: int) -> None:
    generator = np.random.default_rng(seed)
    count, tall, wide = int(generator.choice([1, 30])), 1 + 6 * seed, 1 + 4 * seed
    x, y = generator.random((2, count)) * 40 - 5
    angles, turned = generator.random(count) * 7, np.array([0.0, 1.1])
    unit_x, unit_y = (of(angles).astype(np.float32) for of in (np.cos, np.sin))
    steps, aspect = generator.normal(0, 5, (2, 3)).astype(np.float32), [1.0, 0.5][seed % 2]
    of_ellipse = np.cos(turned), np.sin(turned), aspect**2, 0.75
    votes = kernels.count_votes(x, y, unit_x, unit_y, steps, *of_ellipse, tall=tall, wide=wide)
    expected = np.zeros_like(votes)
    for i, d in np.ndindex(count, 2):
        towards = np.array([np.cos(angles[i]), np.sin(angles[i])])
        if aspect < 1:
            axes = np.array([[np.cos(turned[d]), np.sin(turned[d])]]).repeat(2, axis=0)
            axes[1] = -axes[0, 1], axes[0, 0]
            along, across = axes @ towards
            if abs(along) >= 0.75:
                continue
            towards = axes.T @ [along, aspect**2 * across] / np.hypot(along, aspect * across)
        for p, step in np.ndindex(steps.shape):
            at = np.array([x[i], y[i]]) + steps[p, step] * towards
            if (at >= 0).all() and (at < [wide, tall]).all():
                expected[p, d, int(at[1]), int(at[0])] += 1
    assert np.count_nonzero(votes != expected) <= 2  # single precision
    strange = np.full(count, [np.nan, np.inf, -np.inf][seed % 3])
    kernels.count_votes(strange, y, unit_x, unit_y, steps, *of_ellipse, tall=tall, wide=wide)


def weighted(votes: np.ndarray, row: int, column: int) -> float:
    return float((np.pad(votes, 1)[row : row + 3, column : column + 3] * WEIGHTS).sum())


@pytest.mark.parametrize('seed', SEEDS)
def test_peaks_are_the_highest_of_cells_in_whole_blocks(seed: int) -> None:
    generator = np.random.default_rng(seed)
    planes, tall, wide = 1 + seed % 2, [1, 20, 24][seed % 3], [30, 17, 1][seed // 2]
    votes = generator.poisson(2.0 + seed, (planes, tall, wide)).astype(np.uint16)
    needed, reach = 4.3 * (2 + seed), 1 + seed % 3
    peaks = find_peaks(votes, needed, reach)
    # Blocks of two by two cells, of all planes in one, with room for neighbours.
    whole = np.pad(votes.reshape(-1, wide).astype(float), 4)
    whole = np.pad(whole, ((0, whole.shape[0] % 2), (0, whole.shape[1] % 2)))
    rows, columns = whole.shape
    blocks = whole.reshape(rows // 2, 2, columns // 2, 2).sum(axis=(1, 3))
    enough = blocks[1:, 1:] + blocks[1:, :-1] + blocks[:-1, 1:] + blocks[:-1, :-1]
    enough = np.pad(enough > int(1.4 * needed), 1)
    good = enough[1:, 1:] | enough[1:, :-1] | enough[:-1, 1:] | enough[:-1, :-1]
    left = whole * good.repeat(2, axis=0).repeat(2, axis=1)
    sums = {
        (r - 4, c - 4): weighted(left, r, c)
        for r, c in np.ndindex(rows, columns)
        if left[r, c] > int(needed / 8) and weighted(whole, r, c) > needed
    }
    sums = {cell: of for cell, of in sums.items() if of > needed}
    expected = [
        (r, c, of)
        for (r, c), of in sums.items()
        if not any(
            sums.get((r + down, c + across), 0) > of
            for down in range(-reach, reach + 1)
            for across in range(-reach, reach + 1)
        )
    ]
    if wide > 2 * reach:
        found = np.rint([peaks.plane * tall + peaks.y, peaks.x]).T.tolist()
        near = {(r, c) for r, c, _ in expected}
        assert len(found) == len(expected)
        assert peaks.votes * needed == pytest.approx([of for *_, of in expected])
        for r, c in found:
            assert any(abs(r - a) + abs(c - b) <= 2 for a, b in near)


@pytest.mark.parametrize('seed', SEEDS)
def test_of_neighbours_the_highest_are_kept(seed: int) -> None:
    generator = np.random.default_rng(seed)
    wide, reach = 40, 1 + seed % 4
    cells = np.sort(generator.integers(0, 20 * wide, 1 + 60 * seed))
    cells = cells[(cells % wide >= 4) & (cells % wide < wide - 4)]
    values = generator.integers(1, 9, len(cells)).astype(np.float32)
    kept = kernels.highest_cells(cells, values, wide, reach)
    rows, columns = np.divmod(cells, wide)
    for i in range(len(cells)):
        near = np.maximum(abs(rows - rows[i]), abs(columns - columns[i])) <= reach
        assert kept[i] == (values[near].max() == values[i])
