"""Votes for places in an image, counted in cells, and the places with the most.

Most votes are strays. So they are counted in blocks of cells first, and cell by cell only where
blocks have enough. Votes for different things are counted in planes of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.features.array_record import ArrayRecord

_SHIFT = 1
_BLOCK = 1 << _SHIFT  # cells, side of a block
_SPREAD = 1.4  # votes in a cell and beside it, in weighted votes, at the least
_OWN = 1 / 8  # of the weighted votes of a peak, that its own cell has
_WEIGHTS = (0.5, 1.0, 0.5)  # of votes for the cell before, for a cell itself, and the next one
_OUTSIDE = cv2.BORDER_CONSTANT  # no votes are there
_FLAT = 1e-6  # curvature of votes from which their top is computed


@dataclass(frozen=True, slots=True)
class Peaks(ArrayRecord):
    """k places with more votes than their neighbourhood.

    Attributes
    ----------
    x, y : ndarray of float64, shape (k,)
        In cells; the middle of the first one of a plane is at 0.
    plane : ndarray of int, shape (k,)
    votes : ndarray of float64, shape (k,)
        In units of those needed.
    """

    x: np.ndarray
    y: np.ndarray
    plane: np.ndarray
    votes: np.ndarray


_NONE = np.zeros(0)
NO_PEAKS = Peaks(_NONE, _NONE, _NONE.astype(int), _NONE)
"""An empty record."""


def find_peaks(
    columns: np.ndarray,
    rows: np.ndarray,
    shape: tuple[int, int, int],
    needed: float,
    reach: int,
) -> Peaks:
    """Return the cells with enough votes in them and beside them, and none with more within reach.

    Parameters
    ----------
    columns, rows : ndarray of int32, shape (n,)
        Cells voted for; rows count through all planes.
    shape : tuple of 3 int
        Number of planes, and of rows and columns of each; nobody votes for those within `reach`
        of its border.
    needed : float
        Votes; one for a neighbouring cell counts half, and a quarter on the diagonal.
    reach : int
        Cells.
    """
    planes, tall, wide = shape
    which = _promising(columns, rows, (planes * tall, wide), needed)
    if not len(which):
        return NO_PEAKS
    cells, counts = np.unique(rows[which] * np.int32(wide) + columns[which], return_counts=True)
    votes = np.zeros(planes * tall * wide, np.uint16)
    votes[cells] = counts
    cells = cells[counts > _OWN * needed]
    sums = _weighted(votes, cells, wide)
    enough = sums > needed
    cells, sums = cells[enough], sums[enough]
    kept = highest(cells, sums, (planes * tall, wide), reach)
    cells, sums = cells[kept], sums[kept]
    row, column = np.divmod(cells, wide)
    plane, row = np.divmod(row, tall)
    x, y = (
        middle
        + _top(_weighted(votes, cells - step, wide), sums, _weighted(votes, cells + step, wide))
        for middle, step in ((column, 1), (row, wide))
    )
    return Peaks(x, y, plane.astype(int), sums / needed)


def highest(
    cells: np.ndarray, values: np.ndarray, shape: tuple[int, int], reach: int
) -> np.ndarray:
    """Return whether no value within reach is higher, for k values, shape (k,).

    Parameters
    ----------
    cells : ndarray of int, shape (k,)
        Indices of the cells with values, row by row.
    values : ndarray of float, shape (k,)
        More than 0.
    shape : tuple of 2 int
        Number of rows and columns.
    reach : int
        Cells.
    """
    field = np.zeros(shape[0] * shape[1], np.float32)
    values = values.astype(np.float32)
    np.maximum.at(field, cells, values)
    free = np.ones(len(cells), bool)
    for down in range(-reach, reach + 1):
        for across in range(-reach, reach + 1):
            free &= values >= field.take(cells + (down * shape[1] + across), mode='clip')
    return free


def _promising(
    columns: np.ndarray, rows: np.ndarray, shape: tuple[int, int], needed: float
) -> np.ndarray:
    """Return the indices of the votes in blocks that, with some neighbours, have enough."""
    tall, wide = (-(-side // _BLOCK) for side in shape)
    block = (rows >> _SHIFT) * np.int32(wide) + (columns >> _SHIFT)
    of_blocks = np.zeros((tall, wide), np.uint16)
    np.add.at(of_blocks.ravel(), block, np.uint16(1))
    # A cell and its neighbours lie in two by two blocks.
    of_four = cv2.boxFilter(of_blocks, -1, (2, 2), normalize=False, borderType=_OUTSIDE)
    enough = (of_four > _SPREAD * needed).astype(np.uint8)
    if not enough.any():
        return np.zeros(0, np.intp)
    hot = cv2.dilate(enough, np.ones((2, 2), np.uint8), anchor=(0, 0))
    return np.flatnonzero(hot.ravel().take(block))


def _weighted(votes: np.ndarray, cells: np.ndarray, wide: int) -> np.ndarray:
    """Return the votes in cells and, with less weight, beside them, float32, shape (k,)."""
    sums = np.zeros(len(cells), np.float32)
    for down, of_row in zip((-wide, 0, wide), _WEIGHTS, strict=True):
        for across, of_column in zip((-1, 0, 1), _WEIGHTS, strict=True):
            beside = votes.take(cells + (down + across), mode='clip')
            sums += np.float32(of_row * of_column) * beside.astype(np.float32)
    return sums


def _top(before: np.ndarray, value: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return where the parabola through values at -1, 0 and 1 is highest, at most half a cell."""
    curvature = np.maximum(2 * value - before - after, _FLAT)
    return np.clip((after - before) / (2 * curvature), -0.5, 0.5)
