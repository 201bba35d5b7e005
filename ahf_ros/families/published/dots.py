"""Rings of dots as they were published: threshold, regions, ellipses, development of the ring.

This is the identification of [1]_: Otsu's threshold in overlapping blocks; a dark region in a
bright one in a dark one; least-squares ellipses of the inner and the outer circle; the ring
between them unrolled into a rectangle, where a place that is dark with bright outside (01) has a
dot, one that is bright (11) has none, and others are no target's. It has no defence against uneven
light, which makes it a fair test of a filter. The centre is the centre of the ellipse of the outer
circle, with the perspective bias in it.

References
----------
.. [1] Knyaz & Sibiryakov, ISPRS Commission V, 1998.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np

from ahf_ros.base.target import UNDECODED, Target, sorted_targets
from ahf_ros.families.claims import best_targets
from ahf_ros.families.contract import DetectorSettings, FamilyDetector
from ahf_ros.prints.dots import DotRingPrint
from ahf_ros.vision.ellipse_targets import targets_from_frames
from ahf_ros.vision.frame import affine_frames, circle_points, project
from ahf_ros.vision.image import check_image, stretched_to_8_bit
from ahf_ros.vision.resampling import remapped
from ahf_ros.vision.sampling import sample, within

_LEVELS = 256  # of gray values
_MINIMUM_CONTRAST = 20.0  # difference of the means of the two classes for a block to have any

_MINIMUM_POINTS = 5  # points of a contour, which an ellipse takes
_MAXIMUM_MISFIT = 0.2  # between the areas of a contour and of its ellipse, relative
_MAXIMUM_RADIUS = 60.0  # radius of a disc that blocks of the threshold are made for, px
_RATIO = 1.35  # of the radii of the two circles over the printed one, at the most, or below it
_MAXIMUM_DISTANCE = 0.4  # of their centres, radii of the disc
_DIRECTIONS = 24  # of the development, for a place
_MINIMUM_SHARE = 0.75  # of the samples at a place that agree about its colour
_CONTOUR_ERROR = 0.5  # standard deviation of a point of a contour, px


def local_otsu(gray: np.ndarray, side: int) -> np.ndarray:
    """Return Otsu's threshold for every pixel, ndarray of float32, shape (height, width).

    Blocks overlap by half. One that has no contrast takes the thresholds of those about it. The
    side of a block is at least 2 px.

    References
    ----------
    Otsu, IEEE Trans. Systems, Man and Cybernetics 9, 1979, 62-66.

    Examples
    --------
    >>> gray = np.where(np.arange(64) < 32, 40, 200).astype(np.uint8)
    >>> bool(((local_otsu(np.tile(gray, (64, 1)), 32) - 120) ** 2 < 1).all())
    True
    """
    height, width = gray.shape
    tile = max(side // 2, 1)
    rows, columns = -(-height // tile), -(-width // tile)
    rows_of, columns_of = np.arange(height) // tile, np.arange(width) // tile
    of_pixel = (rows_of[:, None] * columns + columns_of) * _LEVELS + gray
    tiles = np.bincount(of_pixel.ravel(), minlength=rows * columns * _LEVELS)
    tiles = np.pad(tiles.reshape(rows, columns, _LEVELS), ((1, 1), (1, 1), (0, 0)))
    blocks = tiles[:-1, :-1] + tiles[1:, :-1] + tiles[:-1, 1:] + tiles[1:, 1:]
    thresholds, contrast = otsu(blocks)
    grid = _filled(thresholds, contrast >= _MINIMUM_CONTRAST)
    # Block (i, j) has its middle at pixel (i, j) tile - 0.5.
    x = ((np.arange(width) + 0.5) / tile).astype(np.float32)
    y = ((np.arange(height) + 0.5) / tile).astype(np.float32)
    across, down = np.meshgrid(x, y)
    return remapped(grid, across, down)


def otsu(histograms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the thresholds that part histograms best, and the distance of the two means.

    Histograms, shape (..., n), count the values 0 to n - 1. The threshold is halfway between the
    means of the two classes. Both are ndarray of float64, shape (...).
    """
    levels = np.arange(histograms.shape[-1])
    below = np.cumsum(histograms, axis=-1).astype(np.float64)
    first = np.cumsum(histograms * levels, axis=-1).astype(np.float64)
    above, second = below[..., -1:] - below, first[..., -1:] - first
    low, high = first / np.maximum(below, 1), second / np.maximum(above, 1)
    between = below * above * (high - low) ** 2
    best = between.argmax(axis=-1)[..., None]
    low, high = (np.take_along_axis(mean, best, axis=-1)[..., 0] for mean in (low, high))
    parted = np.take_along_axis(between, best, axis=-1)[..., 0] > 0
    return (low + high) / 2, np.where(parted, high - low, 0.0)


def _filled(thresholds: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Return thresholds, those that are not valid from their neighbours, ndarray of float32."""
    values = np.where(valid, thresholds, 0.0).astype(np.float32)
    weights = valid.astype(np.float32)
    filled, known = values.copy(), valid.copy()
    reach = 3
    while not known.all() and reach < 4 * max(valid.shape):
        mass = cv2.blur(weights, (reach, reach), borderType=cv2.BORDER_CONSTANT)
        mean = cv2.blur(values, (reach, reach), borderType=cv2.BORDER_CONSTANT)
        new = ~known & (mass > 0)
        filled[new] = mean[new] / mass[new]
        known |= new
        reach = 2 * reach + 1
    return filled


@dataclass(frozen=True, slots=True)
class PublishedDotsDetector(FamilyDetector):
    """The detector `dots_published`; call it with an image."""

    name: ClassVar[str] = 'dots_published'

    @property
    def design(self) -> DotRingPrint:
        """Printed design of the family."""
        return self.settings.codes(DotRingPrint)[0]

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`.

        The blocks of the threshold are as wide as a target whose disc has the geometric mean of
        the smallest and the largest radius, of at most 60 px.
        """
        check_image(image)
        settings, code = self.settings, self.design
        gray = stretched_to_8_bit(image)
        smallest, largest = settings.radii
        usual = np.sqrt(smallest * max(smallest, min(largest, _MAXIMUM_RADIUS)))
        side = 2 * code.border_radius * usual
        height = gray.astype(np.float32) - local_otsu(gray, round(side))
        targets: list[Target] = []
        for polarity in settings.polarities:
            frames, points = _concentric(polarity * height < 0, settings, code)
            targets += _identified(polarity * height, frames, points, code)
        targets = best_targets(targets, code.border_radius)
        if not settings.report_undecoded:
            targets = [target for target in targets if target.id != UNDECODED]
        return sorted_targets(targets)


def _concentric(
    mask: np.ndarray, settings: DetectorSettings, code: DotRingPrint
) -> tuple[np.ndarray, np.ndarray]:
    """Return the targets that regions of a mask look like.

    The mask is true where a pixel has the colour of the disc. Of each target: the frame of the
    disc, from the ellipse of the outer circle, and the number of points on its contour.
    """
    contours, hierarchy = cv2.findContours(
        mask.astype(np.uint8), cv2.RETR_TREE, cv2.CHAIN_APPROX_NONE
    )
    low, high = settings.radii
    found, points = [], []
    for index, contour in enumerate(contours):
        # The outline of a region in a hole of another one; outlines and holes alternate.
        hole = hierarchy[0, index, 3]
        if hole < 0 or hierarchy[0, hole, 3] < 0:
            continue
        disc, outer = _ellipse(contour, 0.5), _ellipse(contours[hole], -0.5)
        if disc is None or outer is None or not low <= max(disc[2:4]) <= high:
            continue
        if _matches(disc, outer, code):
            found.append(outer)
            points.append(len(contours[hole]))
    frames = affine_frames(*np.reshape(found, (-1, 5)).T)
    frames[:, :2, :2] /= code.ground_radius
    return frames, np.array(points, int)


def _ellipse(contour: np.ndarray, shift: float) -> tuple[float, ...] | None:
    """Return centre, semi-axes and direction of the ellipse of a contour; None of other shapes.

    Contours run through the centres of pixels, `shift` px inside of the edge.
    """
    if len(contour) < _MINIMUM_POINTS:
        return None
    (x, y), (width, height), angle = cv2.fitEllipse(contour)
    area = cv2.contourArea(contour)
    if abs(np.pi / 4 * width * height - area) > _MAXIMUM_MISFIT * area:
        return None
    return x, y, width / 2 + shift, height / 2 + shift, float(np.deg2rad(angle))


def _matches(disc: tuple[float, ...], outer: tuple[float, ...], code: DotRingPrint) -> bool:
    """Return whether two ellipses have the centres and the sizes of the circles of a target."""
    ratios = np.divide(sorted(outer[2:4]), sorted(disc[2:4])) / code.ground_radius
    distance = np.hypot(outer[0] - disc[0], outer[1] - disc[1])
    alike = bool((np.abs(np.log(ratios)) < np.log(_RATIO)).all())
    return alike and bool(distance < _MAXIMUM_DISTANCE * min(disc[2:4]))


def _identified(
    height: np.ndarray, frames: np.ndarray, points: np.ndarray, code: DotRingPrint
) -> list[Target]:
    """Return the targets that a threshold shows, undecoded where a place is neither 01 nor 11.

    `height` is negative where a pixel has the colour of the disc, `points` the number of points on
    each contour.
    """
    words, clarity, inside = _develop(height, frames, code)
    ids = np.where(clarity >= _MINIMUM_SHARE, code.ids(words), 0)
    ids = np.where(ids > 0, ids, UNDECODED)
    certainty = np.where(ids == UNDECODED, 0.0, clarity)
    error = 2 * _CONTOUR_ERROR**2 / np.maximum(points, 1)
    covariance = error[:, None, None] * np.eye(2)
    shown = np.flatnonzero(inside)
    ids, codes, certainty = ids[shown], code.canonical(words)[shown], certainty[shown]
    return targets_from_frames(frames[shown], covariance[shown], ids, codes, certainty, code.name)


def _develop(
    height: np.ndarray, frames: np.ndarray, code: DotRingPrint
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Read the rings between the two circles, unrolled into rectangles.

    Returns
    -------
    words : ndarray of int64, shape (k,)
    clarity : ndarray of float64, shape (k,)
        Share of the samples that agree with the word where it is the least; 0 where the outside
        of the dots is not bright.
    inside : ndarray of bool, shape (k,)
        Whether the ring lies in the image.
    """
    count = code.bits * _DIRECTIONS
    angles = -2 * np.pi * np.arange(count) / count
    outside = (code.dot_circle + code.dot_radius + code.ground_radius) / 2
    pixels = project(frames, circle_points(angles, np.array([code.dot_circle, outside])))
    dark = sample(height, pixels) < 0
    inside = np.asarray(within(pixels, height.shape).all(axis=(1, 2)))
    # The first place is where the dots of all places, laid on top of each other, have theirs.
    folded = dark[..., 0].reshape(-1, code.bits, _DIRECTIONS).sum(axis=1)
    turns = np.exp(2j * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS)
    middle = np.angle(folded @ turns) / (2 * np.pi) * _DIRECTIONS
    # The inner half of a dot, as a share of the distance from dot to dot.
    share = code.dot_radius / code.dot_circle / (2 * np.pi / code.bits)
    half = max(round(_DIRECTIONS * share / 2), 1)
    window = np.arange(-half, half + 1) + _DIRECTIONS * np.arange(code.bits)[:, None]
    columns = (np.rint(middle).astype(int)[:, None, None] + window) % count
    rows = np.arange(len(frames))[:, None, None]
    dots, clear = dark[rows, columns, 0].mean(axis=2), ~dark[rows, columns, 1]
    words = (dots > 0.5) @ (1 << np.arange(code.bits, dtype=np.int64))
    clarity = np.minimum(np.maximum(dots, 1 - dots), clear.mean(axis=2)).min(axis=1)
    return words, clarity, inside
