"""Candidates for the dots of targets, from the gradient of the logarithm of the image.

In ln I an edge of a target is a step of the same height wherever the light falls, so that its
direction says where the centre of a dot may lie: each edge pixel votes, along its gradient, for
the centres at the radii of interest (Kimme, Ballard & Sklansky, Comm. ACM 18, 1975). An edge that
runs straight on for longer than a dot is wide belongs to no dot and does not vote, which silences
projected stripes.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from math import ceil, log2

import cv2
import numpy as np

from ahf_ros.features.frame import affine_frames
from ahf_ros.imaging.logarithm import LOG_OFFSET

LOG_SCALE = 1000.0
"""Units of a logarithmic image of int16 in one unit of ln."""

MAXIMUM_OUTLINES = 20_000
"""Whole ellipses kept at the most, those that are most exactly ellipses."""

MAXIMUM_CANDIDATES = 6000
"""Candidates kept at the most for one range of radii, those with the most votes."""

_LOG = logging.getLogger(__name__)

_WEAK_EDGE, _STRONG_EDGE = 0.15, 0.22  # steps of ln, of the thresholds with hysteresis
_MINIMUM_VOTES = 1.5  # a unit of the circumference
_FIRST_RANGES = ((2.0, 3.4, 1), (3.4, 5.8, 1), (5.8, 11.2, 2))  # radii and accumulator cell, px
_RANGES = ((5.8, 11.2, 2),)
_REGION = 16  # cells
_STRAIGHT = 0.97  # cosine between the directions of an edge and of its continuation
_OUTLINE_SPREAD = 0.15  # of the radius, of the points of a whole ellipse
_OUTLINE_SIGN = 0.7  # mean agreement of their gradients with the outward direction


@dataclass(frozen=True, slots=True)
class Candidates:
    """Places where a dot may be, in the pixels of one level of the pyramid.

    Attributes
    ----------
    level : int
        The level; its pixels are 2^level wide.
    points : ndarray of float64, shape (k, 2)
        Centres, px of the level, to about two pixels.
    radii : tuple of 2 float
        Smallest and largest radius of the dots, px of the level.
    signs : ndarray of int, shape (k,)
        1 for a dark dot on bright, -1 for a bright one on dark.
    """

    level: int
    points: np.ndarray
    radii: tuple[float, float]
    signs: np.ndarray


def log_image(gray: np.ndarray) -> np.ndarray:
    """Return the logarithm of an image.

    Parameters
    ----------
    gray : ndarray of uint8 or float32, shape (height, width)
        Gray values from 0 to 255.

    Returns
    -------
    ndarray of int16, shape (height, width)
        LOG_SCALE ln(I + LOG_OFFSET).
    """
    if gray.dtype == np.uint8:
        table = LOG_SCALE * np.log(np.arange(256) + LOG_OFFSET)
        return cv2.LUT(gray, table.astype(np.int16))
    return (LOG_SCALE * cv2.log(gray + np.float32(LOG_OFFSET))).astype(np.int16)


def halvings(max_radius: float) -> int:
    """Return how often an image is halved until dots of `max_radius` px can be voted for."""
    return max(1, ceil(log2(max_radius / _RANGES[-1][1])))


def pyramid(image: np.ndarray, levels: int) -> list[np.ndarray]:
    """Return an image and its halves; pixel (x, y) of one covers four of the one before."""
    images = [image]
    for _ in range(levels):
        height, width = (max(side // 2, 1) for side in images[-1].shape)
        even = images[-1][: 2 * height, : 2 * width]
        images.append(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA))
    return images


@dataclass(frozen=True, slots=True)
class LogEdges:
    """The edge pixels of a logarithmic image, and their gradients.

    Attributes
    ----------
    dx, dy : ndarray of int16, shape (height, width)
        Gradient of the image.
    marked : ndarray of uint8, shape (height, width)
        Not zero on edges.
    x, y : ndarray of int32, shape (m,)
        The edge pixels.
    unit_x, unit_y, strength : ndarray of float32, shape (m,)
        Direction and size of their gradients.
    """

    dx: np.ndarray
    dy: np.ndarray
    marked: np.ndarray
    x: np.ndarray
    y: np.ndarray
    unit_x: np.ndarray
    unit_y: np.ndarray
    strength: np.ndarray

    def outside(self, polygons: list[np.ndarray]) -> LogEdges:
        """Return the edges that lie outside of polygons, each of shape (m, 2), px."""
        mask = np.zeros(self.marked.shape, np.uint8)
        for polygon in polygons:
            cv2.fillPoly(mask, [np.rint(polygon).astype(np.int32)], 1)
        kept = mask[self.y, self.x] == 0
        chosen = (self.x, self.y, self.unit_x, self.unit_y, self.strength)
        return LogEdges(self.dx, self.dy, self.marked, *(values[kept] for values in chosen))

    def curved(self, length: float) -> tuple[np.ndarray, ...]:
        """Return x, y and unit gradient of the edges that do not run straight on to `length`."""
        straight = np.ones(len(self.x), bool)
        for way in (length, -length):
            rest = np.flatnonzero(straight)
            straight[rest] = self._continues(rest, way)
        kept = ~straight
        return self.x[kept], self.y[kept], self.unit_x[kept], self.unit_y[kept]

    def _continues(self, which: np.ndarray, way: float) -> np.ndarray:
        """Return whether edges have the same gradient `way` px along themselves."""
        height, width = self.dx.shape
        unit_x, unit_y = self.unit_x[which], self.unit_y[which]
        x = np.clip(np.rint(self.x[which] - way * unit_y).astype(np.int32), 0, width - 1)
        y = np.clip(np.rint(self.y[which] + way * unit_x).astype(np.int32), 0, height - 1)
        across, down = self.dx[y, x].astype(np.float32), self.dy[y, x].astype(np.float32)
        along = across * unit_x + down * unit_y
        return (along > _STRAIGHT * np.hypot(across, down)) & (along > self.strength[which] / 2)

    def outlines(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the ellipses that whole connected edges form, at any tilt.

        Parameters
        ----------
        low, high : float
            Smallest and largest semi-major axis, px.

        Returns
        -------
        frames : ndarray of float64, shape (k, 3, 3)
        signs : ndarray of int, shape (k,)
            1 for a dark inside.
        """
        count, labels = cv2.connectedComponents(self.marked, connectivity=8, ltype=cv2.CV_32S)
        label = labels[self.y, self.x]
        size = np.bincount(label, minlength=count)
        usable = (size > 2 * np.pi * low * 0.6) & (size < 2 * np.pi * high * 1.1)
        number = np.cumsum(usable) - 1
        kept = usable[label]
        label, count = number[label[kept]], int(usable.sum())

        def mean(values: np.ndarray) -> np.ndarray:
            sums = np.bincount(label, values, minlength=count)
            return sums / np.maximum(np.bincount(label, minlength=count), 1)

        x, y = self.x[kept].astype(np.float64), self.y[kept].astype(np.float64)
        centre_x, centre_y = mean(x), mean(y)
        x, y = x - centre_x[label], y - centre_y[label]
        # The points of an ellipse have half of its squared axes as their covariance.
        xx, xy, yy = 2 * mean(x * x), 2 * mean(x * y), 2 * mean(y * y)
        determinant = np.maximum(xx * yy - xy * xy, 1e-6)
        radius = (yy[label] * x * x - 2 * xy[label] * x * y + xx[label] * y * y) / determinant[
            label
        ]
        spread = np.sqrt(mean((np.sqrt(np.maximum(radius, 0)) - 1) ** 2))
        outwards = mean(np.sign(self.unit_x[kept] * x + self.unit_y[kept] * y))
        middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
        major, minor = np.sqrt(middle + half), np.sqrt(np.maximum(middle - half, 0))
        good = (spread < _OUTLINE_SPREAD) & (np.abs(outwards) > _OUTLINE_SIGN)
        good &= (major >= low) & (major <= high) & (minor >= 1.0)
        kept = _first(np.flatnonzero(good), spread[good], MAXIMUM_OUTLINES, 'whole ellipses')
        angle = np.arctan2(xy, (xx - yy) / 2) / 2
        frames = affine_frames(centre_x, centre_y, major, minor, angle)
        return frames[kept], np.sign(outwards[kept]).astype(int)


def find_edges(log: np.ndarray) -> LogEdges:
    """Return the edges of a logarithmic image, ndarray of int16, shape (height, width)."""
    dx = cv2.Scharr(log, cv2.CV_16S, 1, 0, scale=1 / 32)
    dy = cv2.Scharr(log, cv2.CV_16S, 0, 1, scale=1 / 32)
    weak, strong = _WEAK_EDGE * LOG_SCALE, _STRONG_EDGE * LOG_SCALE
    marked = cv2.Canny(dx, dy, weak, strong, L2gradient=True)
    places = cv2.findNonZero(marked)
    places = np.zeros((0, 2), np.int32) if places is None else places.reshape(-1, 2)
    x, y = places[:, 0].copy(), places[:, 1].copy()
    across, down = dx[y, x].astype(np.float32), dy[y, x].astype(np.float32)
    strength = np.hypot(across, down)
    return LogEdges(dx, dy, marked, x, y, across / strength, down / strength, strength)


def find_candidates(
    edges: dict[int, LogEdges], min_radius: float, max_radius: float, signs: tuple[int, ...]
) -> list[Candidates]:
    """Find the places where dots may be.

    Parameters
    ----------
    edges : dict of int to LogEdges
        Edges of the levels of the pyramid from the first halved one on.
    min_radius, max_radius : float
        Of the dots, px of the first level.
    signs : tuple of int
        1 to find dark dots, -1 to find bright ones.

    Returns
    -------
    list of Candidates
        One for each range of radii.
    """
    found = []
    for level, of_level in edges.items():
        for low, high, cell in _FIRST_RANGES if level == 1 else _RANGES:
            if high * 2**level < min_radius or low * 2**level > max_radius:
                continue
            curved = of_level.curved(1.5 * high)
            places = [
                _vote(curved, of_level.marked.shape, (low, high), cell, sign) for sign in signs
            ]
            counts = [len(points) for points in places]
            found.append(
                Candidates(level, np.concatenate(places), (low, high), np.repeat(signs, counts))
            )
    return found


def _vote(
    edges: tuple[np.ndarray, ...],
    shape: tuple[int, ...],
    radii: tuple[float, float],
    cell: int,
    sign: int,
) -> np.ndarray:
    """Return the points, shape (k, 2), where enough edges at the radii point away from."""
    x, y, unit_x, unit_y = edges
    height, width = shape[0] // cell + 1, shape[1] // cell + 1
    low, high = radii
    count = max(2, int(np.ceil((high - low) / (0.8 * cell))))
    steps = low + (np.arange(count) + 0.5) * (high - low) / count
    distance = sign * steps[:, None]
    columns = ((x - distance * unit_x + 0.5) / cell).astype(np.int32).ravel()
    rows = ((y - distance * unit_y + 0.5) / cell).astype(np.int32).ravel()
    inside = (columns >= 0) & (rows >= 0) & (columns < width) & (rows < height)
    columns, rows = columns[inside], rows[inside]
    needed = _MINIMUM_VOTES * 2 * np.pi * low
    # Where few edges are left, no region holds as many votes as one place needs.
    regions = (size // _REGION + 1 for size in (width, height))
    if _votes(columns // _REGION, rows // _REGION, *regions).max() <= needed:
        return np.zeros((0, 2))
    votes = _votes(columns, rows, width, height)
    reach = 2 * max(1, round(low / cell / 2)) + 1
    highest = cv2.dilate(votes, np.ones((reach, reach), np.uint8))
    peaks = np.flatnonzero((votes >= highest) & (votes > needed))
    peaks = _first(peaks, -votes.ravel()[peaks], MAXIMUM_CANDIDATES, 'candidates of one size')
    rows, columns = np.divmod(peaks, width)
    return (np.stack([columns, rows], axis=-1) + 0.5) * cell - 0.5


def _first(places: np.ndarray, ranks: np.ndarray, limit: int, what: str) -> np.ndarray:
    """Return the places of the lowest ranks, in their order; say where some are left out."""
    if len(places) <= limit:
        return places
    _LOG.warning('%d %s, of which the %d best are looked at', len(places), what, limit)
    return np.sort(places[np.argsort(ranks, kind='stable')[:limit]])


def _votes(columns: np.ndarray, rows: np.ndarray, width: int, height: int) -> np.ndarray:
    """Return the votes in the nine cells about each cell, ndarray of float32."""
    cast = np.bincount(rows * width + columns, minlength=height * width)
    return cv2.blur(cast.reshape(height, width).astype(np.float32), (3, 3)) * 9
