"""Small dots in even light: blobs of the logarithm of the image, at full resolution.

Dots of a few pixels, and those seen at steep angles, have no outline that edges could be followed
along. In even light they need none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np

from ahf_ros import kernels
from ahf_ros.vision.dots import NO_DOTS, Dots, best
from ahf_ros.vision.frame import affine_frames, translated
from ahf_ros.vision.log_edges import LOG_SCALE
from ahf_ros.vision.pyramid import ImagePyramid

LARGEST = 12.0
"""Semi-major axis up to which dots are looked for as blobs, px."""

BLURRED = 0.8
"""Radius of a blob whose edge is blurred, in radii of the smallest dot."""

MAXIMUM_BLOBS = 20_000
"""Small dots kept at the most of a strip, those with the highest contrast."""

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
_STRIP = 2**22  # pixels looked at at a time, so that memory is used again, not made anew


def small_dots_in(
    pyramid: ImagePyramid,
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    explained: Sequence[np.ndarray] | np.ndarray = (),
) -> Dots:
    """Return the `small_dots` of an image, also those that blur makes smaller."""
    if min_radius >= LARGEST:
        return NO_DOTS
    bounds = BLURRED * min_radius, min(max_radius, LARGEST)
    return small_dots(pyramid.logs[0], *bounds, polarities, LOG_SCALE, explained)


def small_dots(
    log: np.ndarray,
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    log_scale: float,
    explained: Sequence[np.ndarray] | np.ndarray = (),
) -> Dots:
    """Return the dots that stand out of an even ground all the way round, to a few tenths of a px.

    The image is `log_scale` ln(I + 8), int16. The bounds are those of the semi-major axis, px. The
    polarities are 1 to find dark dots, -1 to find bright ones. No dots are looked for inside the
    outlines of objects that are explained already, px, each of shape (m, 2).
    """
    scale = 255 / (_LN_RANGE * log_scale)
    offset = -float(np.log(8.0)) * log_scale * scale
    eight_bit = cv2.convertScaleAbs(log, alpha=scale, beta=offset)
    height, width = log.shape
    size = (-(-width // _REDUCTION), -(-height // _REDUCTION))
    reduced = cv2.resize(eight_bit, size, interpolation=cv2.INTER_AREA)
    side = 2 * int(np.ceil(max_radius / _REDUCTION)) + 3
    kernel = np.ones((side, side), np.uint8)
    steps, found = np.empty_like(eight_bit), list[Dots]()
    for polarity in polarities:
        operation = cv2.MORPH_CLOSE if polarity > 0 else cv2.MORPH_OPEN
        ground = cv2.morphologyEx(reduced, operation, kernel)
        cv2.resize(ground, (width, height), steps, interpolation=cv2.INTER_LINEAR)
        cv2.subtract(*((steps, eight_bit) if polarity > 0 else (eight_bit, steps)), steps)
        for outline in explained:
            cv2.fillConvexPoly(steps, np.rint(outline).astype(np.int32), 0)
        found += _blobs_of_strips(steps, min_radius, max_radius, polarity)
    return Dots.joined(found)


def _blobs_of_strips(
    height: np.ndarray, min_radius: float, max_radius: float, polarity: int
) -> Iterator[Dots]:
    """Yield the blobs of an image of steps, some rows at a time where it is large.

    Strips overlap by the longest blob, so that each blob is whole in the strip of its centre.
    """
    margin = int(2 * max_radius + 3) + 2 * _REACH
    rows = max(_STRIP // height.shape[1], 2 * margin)
    for top in range(0, len(height), rows):
        first = max(top - margin, 0)
        dots = _blobs(height[first : top + rows + margin], min_radius, max_radius, polarity)
        dots = replace(dots, frames=translated(dots.frames, 0, first)) if first else dots
        y = dots.frames[:, 1, 2]
        yield dots.select((y >= top - 0.5) & (y < top + rows - 0.5))


def _blobs(height: np.ndarray, min_radius: float, max_radius: float, polarity: int) -> Dots:
    """Return the blobs of an image of steps that have the shape of a dot."""
    least = _MINIMUM_STEP / _LN_RANGE * 255
    longest = 2 * max_radius + 3
    if height.max() < least:  # in even light, where all else is explained
        return NO_DOTS
    level = cv2.dilate(height, _NEAR)
    # In place, as new memory takes longer.
    cv2.max(level, int(least), level)  # type: ignore[call-overload]
    shown = height > cv2.convertScaleAbs(level, level, alpha=_LEVELS[polarity])
    most = np.count_nonzero(shown) // _MINIMUM_PIXELS
    first, size, length, peak, moments, _ = kernels.blobs(
        shown, height, _MINIMUM_PIXELS, int(longest), most=most
    )
    order = np.argsort(first[: np.count_nonzero(size)])
    size, length, peak, moments = size[order], length[order], peak[order], moments[:, order]
    centre_x, centre_y, xx, xy, yy = moments
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    ellipse = np.pi * 4 * np.sqrt(np.maximum(xx * yy - xy * xy, 0))
    filled = size / np.maximum(ellipse, 1e-9)
    major = 2 * np.sqrt(np.maximum(middle + half - _BLUR, 0))
    minor = 2 * np.sqrt(np.maximum(middle - half - _BLUR, (_MINIMUM_MINOR / 2) ** 2))
    good = (length >= 2 * min_radius - 2) & (peak >= least)
    good &= (major >= min_radius) & (major <= max_radius)
    good &= (filled < _FILLED[1]) & (filled > _FILLED[0])
    which = best(np.flatnonzero(good), -peak[good].astype(float), MAXIMUM_BLOBS, 'small dots')
    frames = affine_frames(centre_x, centre_y, major, minor, np.arctan2(xy, (xx - yy) / 2) / 2)
    return Dots(frames[which], np.full(len(which), polarity), np.ones(len(which)))
