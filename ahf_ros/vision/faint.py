"""Parts of an image whose contrast is faint, stretched to the contrast of a print.

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

from ahf_ros.vision.logarithm import LOG_OFFSET
from ahf_ros.vision.parts import joined

TILE = 64
"""Side of the tiles whose contrast is measured, px."""

INK, PAPER = 55.0, 220.0
"""Gray values to which the darkest and the brightest of the neighbourhood are stretched."""

# All that follows refers to the image at half its size.
_HALF = TILE // 2  # side of a tile, px
_EXTREMES = 2  # columns of a tile that may hold darker or brighter pixels than its extremes
_SAMPLED = 4  # every so many columns of a tile are sampled for its noise
_MAXIMUM_RANGE = 0.5  # of ln, where contrast is faint
_MINIMUM_RANGE = 14.0  # of gray values, in standard deviations of the noise
_STEPS = 16  # pixels of a tile that have a step, at least
_MINIMUM_STEP = 0.4  # height of a step, in the range
_CLEAR_STEP = 10.0  # the same, in standard deviations of the noise
_EACH = 120  # tiles, half a million pixels, to which the search of a part amounts at the least
_GROUP = 2  # faint tiles side by side, for the part to be worth reading
_ROUNDING = 0.15  # noise of gray values that were whole numbers
_NO_WEIGHT = 1e-6  # instead of no known tile
_MEDIAN = 0.6745 * 6  # of sizes of second differences both ways, in deviations of the noise


@dataclass(frozen=True, slots=True)
class FaintPart:
    """A stretched part of an image: its first pixel, and gray values from 0 to 255, float32."""

    x: int
    y: int
    gray: np.ndarray


def faint_parts(gray: np.ndarray) -> Iterator[FaintPart]:
    """Yield the parts of an image with clear edges of faint contrast.

    The image has gray values from 0 to 255, uint8 or float32, shape (height, width).
    """
    low, high, faint = _measured_tiles(gray)
    faint = _in_groups(faint)
    if not faint.any():
        return
    box = np.ones((3, 3), np.uint8)
    around = cv2.dilate(faint.astype(np.uint8), box)
    low, high = _spread(low, faint), _spread(high, faint)
    _, _, boxes, _ = cv2.connectedComponentsWithStats(around, connectivity=8)
    groups = [(x, y, x + width, y + height) for x, y, width, height, _ in boxes[1:].tolist()]
    for left, top, right, bottom in joined(groups, _EACH):
        tiles = np.s_[top:bottom, left:right]
        part = gray[TILE * top : TILE * bottom, TILE * left : TILE * right]
        stretched = _stretched(part, low[tiles], high[tiles], around[tiles] > 0)
        yield FaintPart(x=TILE * left, y=TILE * top, gray=stretched)


def _measured_tiles(gray: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the extremes of each tile and its neighbours, and whether their contrast is faint.

    All have the shape (rows, columns). Contrast is faint where the range is small, but the tile
    has edges of such a height, clear of noise.
    """
    half = _half(gray)
    low, high = _extremes(half)
    faint = np.log((high + LOG_OFFSET) / (low + LOG_OFFSET)) < _MAXIMUM_RANGE
    faint &= high - low > _MINIMUM_RANGE * _ROUNDING
    for row in np.flatnonzero(faint.any(axis=1)):
        tiles = half[row * _HALF : (row + 1) * _HALF]
        faint[row] &= _has_clear_edges(tiles, high[row] - low[row], faint[row])
    return low, high, faint


def _half(gray: np.ndarray) -> np.ndarray:
    """Return an image at half its size, in whole tiles, float32.

    At its border, where cameras and codecs leave lines of their own, it continues what is inside.
    """
    rows, columns = (-(-side // TILE) for side in gray.shape)
    height, width = (max(side // 2, 1) for side in gray.shape)
    half = np.empty((height, width), np.float32)
    for top in range(0, height, _HALF):  # what is converted stays in the cache of the processor
        part = half[top : top + _HALF]
        values = gray[2 * top : 2 * (top + len(part))].astype(np.float32, copy=False)
        cv2.resize(values, part.shape[::-1], dst=part, interpolation=cv2.INTER_AREA)
    if min(height, width) > 2:
        half[[0, -1]] = half[[1, -2]]
        half[:, [0, -1]] = half[:, [1, -2]]
    below, beside = rows * _HALF - height, columns * _HALF - width
    return cv2.copyMakeBorder(half, 0, below, 0, beside, borderType=cv2.BORDER_REFLECT)


def _extremes(half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the extremes of tiles and their neighbours, a few columns of each left out."""
    split = half.reshape(len(half) // _HALF, _HALF, half.shape[1])
    box, last = np.ones((3, 3), np.uint8), -1 - _EXTREMES
    of_columns = (split.min(axis=1), split.max(axis=1))
    darkest, brightest = (of.reshape(len(split), -1, _HALF) for of in of_columns)
    low = np.partition(darkest, _EXTREMES, axis=2)[..., _EXTREMES]
    high = np.partition(brightest, last, axis=2)[..., last]
    return cv2.erode(low, box), cv2.dilate(high, box)


def _has_clear_edges(row: np.ndarray, contrast: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Return the tiles of a row whose contrast has edges and is clear of noise, among some."""
    sizes = np.zeros_like(row)
    across = cv2.absdiff(row[1:-1, 2:], row[1:-1, :-2])
    cv2.max(across, cv2.absdiff(row[2:, 1:-1], row[:-2, 1:-1]), dst=sizes[1:-1, 1:-1])
    which = which & _many_higher(sizes, _MINIMUM_STEP * contrast)
    if which.any():
        noise = np.full(len(which), np.inf)
        noise[which] = _noise(row.reshape(_HALF, len(which), _HALF)[:, which])
        which &= contrast > _MINIMUM_RANGE * noise
        which &= _many_higher(sizes, _CLEAR_STEP * noise)
    return which


def _many_higher(sizes: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Return the tiles of a row that have `_STEPS` steps of more than a height each."""
    higher = sizes > np.repeat(heights.astype(np.float32), _HALF)
    columns = np.add.reduce(higher, axis=0, dtype=np.uint8)
    return columns.reshape(len(heights), _HALF).sum(axis=1) >= _STEPS


def _noise(tiles: np.ndarray) -> np.ndarray:
    """Return the noise of tiles (height, k, width), from second differences both ways."""
    down = tiles[:-2] - 2 * tiles[1:-1] + tiles[2:]
    left, middle, right = (down[..., shift : _HALF - 2 + shift : _SAMPLED] for shift in range(3))
    sizes = np.abs(left - 2 * middle + right)
    return np.hypot(np.median(sizes, axis=(0, 2)) / _MEDIAN, _ROUNDING)


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
