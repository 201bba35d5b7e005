"""Parts of an image whose contrast is faint, stretched to that of a print.

Haze, gloss, washed-out paper and the gamma of a camera add much the same gray to ink and paper.
What remains of their contrast may be too small a ratio to be looked at, and yet be many times the
noise. Taking that gray away and multiplying the rest gives back what a clear image would show,
with more noise. A linear change of gray values moves no edge.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.imaging.logarithm import LOG_OFFSET

TILE = 64
"""Side of the tiles of which the contrast is measured, px."""

INK, PAPER = 55.0, 220.0
"""Gray values to which the darkest and the brightest of the neighbourhood are stretched."""

# All that follows refers to the image at half its size.
_HALF = TILE // 2  # side of a tile, px
_EXTREMES = 2  # sampled pixels of a tile that may be darker or brighter than its extremes
_SAMPLED = 4  # every so many pixels of a tile are sampled for its extremes
_MAXIMUM_RANGE = 0.5  # of ln, where contrast is faint
_MINIMUM_RANGE = 14.0  # of gray values, in standard deviations of the noise
_STEPS = 16  # pixels of a tile that have a step, at least
_MINIMUM_STEP = 0.4  # height of a step, in the range
_CLEAR_STEP = 10.0  # the same, in standard deviations of the noise
_GROUP = 2  # faint tiles side by side, for the part to be worth reading
_ROUNDING = 0.15  # noise of gray values that were whole numbers
_NO_WEIGHT = 1e-6  # instead of no known tile
_MEDIAN = 0.6745 * 6  # of sizes of second differences both ways, in deviations of the noise


@dataclass(frozen=True, slots=True)
class FaintPart:
    """A part of an image, stretched.

    Attributes
    ----------
    x, y : int
        Its first pixel in the image.
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    """

    x: int
    y: int
    gray: np.ndarray


def faint_parts(gray: np.ndarray) -> Iterator[FaintPart]:
    """Yield the parts of an image with clear edges of faint contrast.

    Parameters
    ----------
    gray : ndarray of uint8 or float32, shape (height, width)
        Gray values from 0 to 255.
    """
    low, high, faint = measure_tiles(gray)
    faint = _in_groups(faint)
    if not faint.any():
        return
    box = np.ones((3, 3), np.uint8)
    around = cv2.dilate(faint.astype(np.uint8), box)
    low, high = _spread(low, faint), _spread(high, faint)
    count, labels, boxes, _ = cv2.connectedComponentsWithStats(around, connectivity=8)
    for label in range(1, count):
        left, top, width, height, _ = boxes[label]
        rows, columns = slice(top, top + height), slice(left, left + width)
        part = gray[TILE * top : TILE * (top + height), TILE * left : TILE * (left + width)]
        within = labels[rows, columns] == label
        stretched = _stretched(part, low[rows, columns], high[rows, columns], within)
        yield FaintPart(TILE * int(left), TILE * int(top), stretched)


def measure_tiles(gray: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the extremes around each tile of an image, and whether their contrast is faint.

    Parameters
    ----------
    gray : ndarray of uint8 or float32, shape (height, width)

    Returns
    -------
    low, high : ndarray of float32, shape (rows, columns)
        Gray values, of the tile and its neighbours.
    faint : ndarray of bool, shape (rows, columns)
        Whether the range is small, but the tile has edges of such a height, clear of noise.
    """
    rows, columns = (-(-side // TILE) for side in gray.shape)
    size = (columns * _HALF, rows * _HALF)
    height, width = (max(side // 2, 1) for side in gray.shape)
    half = cv2.resize(
        gray.astype(np.float32, copy=False), (width, height), interpolation=cv2.INTER_AREA
    )
    half = cv2.copyMakeBorder(
        half, 0, size[1] - height, 0, size[0] - width, borderType=cv2.BORDER_REPLICATE
    )
    tiles = np.partition(_tiles(half)[..., ::_SAMPLED], (_EXTREMES, -1 - _EXTREMES), axis=2)
    box = np.ones((3, 3), np.uint8)
    low = cv2.erode(tiles[..., _EXTREMES], box)
    high = cv2.dilate(tiles[..., -1 - _EXTREMES], box)
    faint = np.log((high + LOG_OFFSET) / (low + LOG_OFFSET)) < _MAXIMUM_RANGE
    faint &= high - low > _MINIMUM_RANGE * _ROUNDING
    if faint.any():
        noise, contrast = _noise(half, faint), (high - low)[faint]
        clear = contrast > _MINIMUM_RANGE * noise
        faint[faint] = clear
        step, noise, contrast = _steps(half, faint), noise[clear], contrast[clear]
        faint[faint] = (step > _CLEAR_STEP * noise) & (step > _MINIMUM_STEP * contrast)
    return low, high, faint


def _tiles(half: np.ndarray) -> np.ndarray:
    """Return the pixels by tile, shape (rows, columns, pixels)."""
    rows, columns = (side // _HALF for side in half.shape)
    split = half.reshape(rows, _HALF, columns, _HALF).swapaxes(1, 2)
    return split.reshape(rows, columns, _HALF * _HALF)


def _noise(half: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Return the noise of some tiles, from the median of the second differences both ways."""
    second = np.array([1, -2, 1], np.float32)
    sizes = np.abs(cv2.sepFilter2D(half, -1, second, second))
    return np.hypot(np.median(_tiles(sizes)[..., ::_SAMPLED][which], axis=1) / _MEDIAN, _ROUNDING)


def _steps(half: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Return the height that `_STEPS` pixels of some tiles have as a step across two pixels."""
    tiles = _tiles(half)[which].reshape(-1, _HALF, _HALF)
    across = np.abs(tiles[:, 1:-1, 2:] - tiles[:, 1:-1, :-2])
    down = np.abs(tiles[:, 2:, 1:-1] - tiles[:, :-2, 1:-1])
    sizes = np.maximum(across, down).reshape(len(tiles), (_HALF - 2) ** 2)
    return np.partition(sizes, -_STEPS, axis=1)[:, -_STEPS]


def _in_groups(faint: np.ndarray) -> np.ndarray:
    """Return the faint tiles that have faint neighbours."""
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(faint.astype(np.uint8), connectivity=8)
    return faint & (boxes[labels, cv2.CC_STAT_AREA] >= _GROUP)


def _spread(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return values with those of unknown tiles next to known ones from these."""
    weights = known.astype(np.float32)
    sums = cv2.blur(values * weights, (3, 3), borderType=cv2.BORDER_CONSTANT)
    total = cv2.blur(weights, (3, 3), borderType=cv2.BORDER_CONSTANT)
    return np.where(known, values, sums / np.maximum(total, _NO_WEIGHT))


def _stretched(
    part: np.ndarray, low: np.ndarray, high: np.ndarray, within: np.ndarray
) -> np.ndarray:
    """Return a part whose tiles have these extremes, stretched within and of paper elsewhere."""
    height, width = part.shape
    size = (TILE * low.shape[1], TILE * low.shape[0])
    zero, unit = (
        cv2.resize(of_tiles, size, interpolation=cv2.INTER_LINEAR)[:height, :width]
        for of_tiles in (low, np.maximum(high - low, 1.0))
    )
    gray = (part - zero) * ((PAPER - INK) / unit) + INK
    outside = np.repeat(np.repeat(~within, TILE, axis=0), TILE, axis=1)[:height, :width]
    gray[outside] = PAPER
    return np.clip(gray, 0, 255).astype(np.float32)
