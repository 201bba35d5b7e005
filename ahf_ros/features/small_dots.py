"""Small dots in even light: blobs of the logarithm of the image, at full resolution.

Dots of a few pixels, and those seen at steep angles, have no outline that edges could be followed
along. In even light they need none.
"""

from __future__ import annotations

from collections.abc import Sequence

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
_BLUR = 0.15  # px^2, variance that blur adds to a dot that is cut off at half of its height
_MINIMUM_MINOR = 0.6  # px
_MINIMUM_PIXELS = 4
_FILLED = (0.7, 1.35)  # pixels of a dot over the area of its ellipse


def small_dots(
    log: np.ndarray,
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    log_scale: float,
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
        found.append(_blobs(cv2.subtract(*pair), min_radius, max_radius, polarity))
    return Dots.joined(found)


def _blobs(height: np.ndarray, min_radius: float, max_radius: float, polarity: int) -> Dots:
    """Return the blobs of an image of steps that have the shape of a dot."""
    near = np.ones((2 * _REACH + 1, 2 * _REACH + 1), np.uint8)
    least = _MINIMUM_STEP / _LN_RANGE * 255
    highest = cv2.dilate(height, near)
    share = _LEVELS[polarity]
    level = cv2.convertScaleAbs(np.maximum(highest, np.uint8(least)), alpha=share)
    mask = cv2.compare(height, level, cv2.CMP_GT)
    # The default algorithm of OpenCV 4.5 crashes on large images with this connectivity.
    count, labels, stats, _ = cv2.connectedComponentsWithStatsWithAlgorithm(
        mask, 4, cv2.CV_32S, cv2.CCL_SAUF
    )
    longest = stats[:, cv2.CC_STAT_WIDTH : cv2.CC_STAT_HEIGHT + 1].max(axis=1)
    area = stats[:, cv2.CC_STAT_AREA]
    usable = (area >= _MINIMUM_PIXELS) & (longest <= 2 * max_radius + 3)
    usable &= longest >= 2 * min_radius - 2
    usable[0] = False
    pixels = cv2.findNonZero(mask)
    if pixels is None or not usable.any():
        return Dots(np.zeros((0, 3, 3)), np.zeros(0, int), np.zeros(0))
    x, y = pixels.reshape(-1, 2).T
    label = labels[y, x]
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
