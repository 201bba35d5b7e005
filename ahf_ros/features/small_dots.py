"""Small dots in even light: blobs of the logarithm of the image, at full resolution.

Dots of a few pixels, and those seen at steep angles, have no outline that edges could be followed
along. In even light they need none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from ahf_ros.features.dots import Dots, best
from ahf_ros.features.frame import affine_frames

MAXIMUM_BLOBS = 20_000
"""Small dots kept at the most, those with the highest contrast."""

_LN_RANGE = 3.6  # of ln(I + 8) for gray values of 8 bit
_MINIMUM_STEP = 0.2  # of ln, from the ground to the dot
_LEVELS = {-1: 0.62, 1: 0.4}  # of the step of ln, about halfway in gray values
_REDUCTION = 4  # of the image in which the ground is looked for
_REACH = 4  # px about a pixel, in which the highest step is looked for
_NEAR = np.ones((2 * _REACH + 1, 2 * _REACH + 1), np.uint8)
_BLUR = 0.15  # px^2, variance that blur adds to a dot that is cut off at half of its height
_MINIMUM_MINOR = 0.6  # px
_MINIMUM_PIXELS = 4
_FILLED = (0.7, 1.35)  # pixels of a dot over the area of its ellipse
_TILE = 32  # side of the tiles of which empty ones are left out, px
_MOST_TILES = 0.3  # of the image; where there are more, it is looked at as a whole


def small_dots(
    log: np.ndarray,
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    log_scale: float,
    explained: Sequence[np.ndarray] | np.ndarray = (),
) -> Dots:
    """Return the dots that stand out of an even ground all the way round.

    Parameters
    ----------
    log : ndarray of int16, shape (height, width)
        `log_scale` ln(I + 8).
    min_radius, max_radius : float
        Bounds of the semi-major axis, px.
    polarities : sequence of int
        1 to find dark dots, -1 to find bright ones.
    log_scale : float
        Units of `log` in one unit of ln.
    explained : sequence of ndarray of float, each of shape (m, 2)
        Outlines of objects that are known already, px. No dots are looked for inside.

    Returns
    -------
    Dots
        To a few tenths of a pixel.
    """
    scale = 255 / (_LN_RANGE * log_scale)
    offset = -float(np.log(8.0)) * log_scale * scale
    eight_bit = cv2.convertScaleAbs(log, alpha=scale, beta=offset)
    height, width = log.shape
    size = (-(-width // _REDUCTION), -(-height // _REDUCTION))
    reduced = cv2.resize(eight_bit, size, interpolation=cv2.INTER_AREA)
    side = 2 * int(np.ceil(max_radius / _REDUCTION)) + 3
    kernel = np.ones((side, side), np.uint8)
    found = []
    for polarity in polarities:
        operation = cv2.MORPH_CLOSE if polarity > 0 else cv2.MORPH_OPEN
        ground = cv2.morphologyEx(reduced, operation, kernel)
        ground = cv2.resize(ground, (width, height), interpolation=cv2.INTER_LINEAR)
        pair = (ground, eight_bit) if polarity > 0 else (eight_bit, ground)
        steps = cv2.subtract(*pair)
        for outline in explained:
            cv2.fillConvexPoly(steps, np.rint(outline).astype(np.int32), 0)
        found.append(_blobs(steps, min_radius, max_radius, polarity))
    return Dots.joined(found)


def _blobs(height: np.ndarray, min_radius: float, max_radius: float, polarity: int) -> Dots:
    """Return the blobs of an image of steps that have the shape of a dot."""
    least = _MINIMUM_STEP / _LN_RANGE * 255
    x, y, label, stats = _connected(height, least, _LEVELS[polarity])
    count = len(stats)
    longest = stats[:, cv2.CC_STAT_WIDTH : cv2.CC_STAT_HEIGHT + 1].max(axis=1)
    area = stats[:, cv2.CC_STAT_AREA]
    usable = (area >= _MINIMUM_PIXELS) & (longest <= 2 * max_radius + 3)
    usable &= longest >= 2 * min_radius - 2
    if not usable.any():
        return Dots(np.zeros((0, 3, 3)), np.zeros(0, int), np.zeros(0))
    kept = usable[label]
    x, y, label = x[kept].astype(np.float64), y[kept].astype(np.float64), label[kept]
    peak = np.zeros(count)
    np.maximum.at(peak, label, height[y.astype(int), x.astype(int)])
    size = np.maximum(np.bincount(label, minlength=count), 1)

    def mean(values: np.ndarray) -> np.ndarray:
        means: np.ndarray = np.bincount(label, values, minlength=count) / size
        return means

    centre_x, centre_y = mean(x), mean(y)
    x, y = x - centre_x[label], y - centre_y[label]
    xx, xy, yy = mean(x * x), mean(x * y), mean(y * y)
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    ellipse = np.pi * 4 * np.sqrt(np.maximum(xx * yy - xy * xy, 0))
    filled = size / np.maximum(ellipse, 1e-9)
    major = 2 * np.sqrt(np.maximum(middle + half - _BLUR, 0))
    minor = 2 * np.sqrt(np.maximum(middle - half - _BLUR, (_MINIMUM_MINOR / 2) ** 2))
    good = usable & (major >= min_radius) & (major <= max_radius) & (peak >= least)
    good &= (ellipse > 0) & (filled < _FILLED[1]) & (filled > _FILLED[0])
    which = best(np.flatnonzero(good), -peak[good], MAXIMUM_BLOBS, 'small dots')
    frames = affine_frames(centre_x, centre_y, major, minor, np.arctan2(xy, (xx - yy) / 2) / 2)
    return Dots(frames[which], np.full(len(which), polarity), np.ones(len(which)))


def _connected(
    height: np.ndarray, least: float, share: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return columns, rows and labels of the pixels of all blobs, and OpenCV's table of these."""
    found = []
    total = 0
    for top, left, part, own in _parts(height, int(share * least)):
        level = cv2.convertScaleAbs(
            np.maximum(cv2.dilate(part, _NEAR), np.uint8(least)), alpha=share
        )
        mask = cv2.compare(part, level, cv2.CMP_GT)
        if own is not None:
            mask = cv2.bitwise_and(mask, own)
        # The default algorithm of OpenCV 4.5 crashes on large images with this connectivity.
        _, labels, stats, _ = cv2.connectedComponentsWithStatsWithAlgorithm(
            mask, 4, cv2.CV_32S, cv2.CCL_SAUF
        )
        pixels = cv2.findNonZero(mask)
        if pixels is not None:
            x, y = pixels.reshape(-1, 2).T
            found.append((x + left, y + top, labels[y, x] + (total - 1), stats[1:]))
            total += len(stats) - 1
    nothing = np.zeros(0, np.int32)
    found.append((nothing, nothing, nothing, np.zeros((0, 5), np.int32)))
    x, y, label, stats = (np.concatenate(column) for column in zip(*found, strict=True))
    return x, y, label, stats


def _parts(
    height: np.ndarray, above: int
) -> Iterator[tuple[int, int, np.ndarray, np.ndarray | None]]:
    """Yield the parts of an image that hold its pixels above a value, connected ones in one.

    Each comes with its first row and column, and a mask of what in it is not in another part; the
    image as a whole where that is not much more. A margin is as wide as `_NEAR` reaches.
    """
    mask = cv2.threshold(height, above, 255, cv2.THRESH_BINARY)[1]
    if not mask.any():
        return
    pixels = cv2.findNonZero(mask)
    tiles = np.zeros([-(-side // _TILE) for side in height.shape], np.uint8)
    x, y = pixels.reshape(-1, 2).T
    tiles[y // _TILE, x // _TILE] = 1
    count, labels, stats, _ = cv2.connectedComponentsWithStats(tiles)
    extents = stats[1:, cv2.CC_STAT_WIDTH] * stats[1:, cv2.CC_STAT_HEIGHT]
    if extents.sum() > _MOST_TILES * tiles.size:
        yield 0, 0, height, None
        return
    for number in range(1, count):
        column, row, columns, rows, _ = stats[number].tolist()
        own = labels[row : row + rows, column : column + columns] == number
        own = np.kron(own.astype(np.uint8), np.full((_TILE, _TILE), 255, np.uint8))
        own = np.pad(own, _REACH)
        top, left = row * _TILE - _REACH, column * _TILE - _REACH
        bottom, right = top + own.shape[0], left + own.shape[1]
        own = own[max(-top, 0) :, max(-left, 0) :]
        top, left = max(top, 0), max(left, 0)
        part = height[top:bottom, left:right]
        yield top, left, part, np.ascontiguousarray(own[: part.shape[0], : part.shape[1]])
