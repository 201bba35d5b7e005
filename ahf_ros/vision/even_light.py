"""The largest values of a stack, in light that is made even.

Where patterns overlap only a little, the largest of all images still has dark seams of light. How
bright a point is lit shows in the ratios of its images: they depend on the light and not on the
print. In a seam the best images are alike, and in full light most others are far darker. How much
darker than its surroundings a point is, on average over all points with the same ratios, is
measured in the stack itself, and taken away. This is done only where the best images are alike:
elsewhere one of them lights the point in full, and ratios of dark values depend on noise and so on
the print.
"""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from ahf_ros.vision.resampling import remapped

_BLUR = 1.0  # px, of the images before their ratio is taken, against noise
_RANKS = 3  # images that ratios are taken of: the brightest ones of each point
_BINS = 24  # of each ratio, from 0 to 1
_SPREAD = 0.7  # bins, by which the table is smoothed
_FLOOR = 2 / 255  # of the range; added to gray values, about what noise adds
_ALIKE = (0.35, 0.65)  # ratio of the second image to the first, from which light is evened
_ENOUGH = 0.1  # share of points in full light of one image, to measure how bright it is
_TILE = 64  # px, side of the parts whose mean brightness is the surroundings'
_SURROUNDINGS = 2.0  # tiles, by which it is smoothed
_PAPER = 4.0  # power of the brightness with which points count: paper, and hardly ink
_RELIABLE = 100.0  # points of a bin that count as much as what all points show
_EVERY = 2  # rows and columns; one of them goes into the table, at random, unlike light
_MAXIMUM_PERCENTILE = 99.9  # percentile that stays within the range


def even_light(images: Iterable[np.ndarray]) -> np.ndarray:
    """Return the largest values of images, without the seams of their light.

    All are float32, shape (height, width), with gray values from 0 to 1.

    Examples
    --------
    >>> light = np.abs(np.linspace(-1, 1, 400, dtype=np.float32)).reshape(1, -1) ** 0.5
    >>> images = [np.repeat(of, 200, axis=0) for of in (light, 1 - 0.6 * light)]
    >>> bool(even_light(images).std() < np.maximum(*images).std())
    True
    """
    largest, ranked = _ranked(images)
    ratios = [of / ranked[0] for of in ranked[1:]]
    logarithm = cv2.log(largest + np.float32(_FLOOR))
    table, full = _brightness(logarithm - _surroundings(logarithm), ratios)
    places = [of * np.float32(_BINS) - np.float32(0.5) for of in ratios]
    excess = remapped(table, places[1], places[0])
    low, high = _ALIKE
    alike = (ratios[0] - np.float32(low)) / np.float32(high - low)
    np.clip(alike, 0, 1, out=alike)
    excess -= np.float32(full)
    excess *= alike
    result: np.ndarray = cv2.exp(cv2.subtract(logarithm, excess, logarithm), logarithm)
    result -= np.float32(_FLOOR)
    result /= np.float32(max(float(np.percentile(result[::5, ::5], _MAXIMUM_PERCENTILE)), 1.0))
    return np.clip(result, 0, 1, out=result)


def _ranked(images: Iterable[np.ndarray]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the largest values, and the brightest ones of the blurred images, in order."""
    ranked: list[np.ndarray] = []
    for image in images:
        if not ranked:
            largest = np.zeros(image.shape, np.float32)
            ranked = [np.full(image.shape, _FLOOR, np.float32) for _ in range(_RANKS)]
            lower = np.empty(image.shape, np.float32)
        cv2.max(largest, image, largest)
        rest = cv2.GaussianBlur(image, (0, 0), _BLUR)
        rest += np.float32(_FLOOR)
        for brighter in ranked:
            cv2.min(brighter, rest, lower)
            cv2.max(brighter, rest, brighter)
            rest, lower = lower, rest
    return largest, ranked


def _surroundings(logarithm: np.ndarray) -> np.ndarray:
    """Return the mean of the logarithm around each point."""
    height, width = logarithm.shape
    size = (max(width // _TILE, 1), max(height // _TILE, 1))
    tiles = cv2.resize(logarithm, size, interpolation=cv2.INTER_AREA)
    tiles = cv2.GaussianBlur(tiles, (0, 0), _SURROUNDINGS)
    return cv2.resize(tiles, (width, height), interpolation=cv2.INTER_LINEAR)


def _brightness(excess: np.ndarray, ratios: list[np.ndarray]) -> tuple[np.ndarray, float]:
    """Return how bright points with given ratios are on average, a table, and in full light."""
    generator = np.random.default_rng(0)
    lattice = [_drawn(length, generator) for length in excess.shape]
    sampled = excess[np.ix_(*lattice)].ravel()
    weights = np.exp(_PAPER * sampled)
    rows, columns = (
        np.minimum((of[np.ix_(*lattice)].ravel() * _BINS).astype(int), _BINS - 1) for of in ratios
    )

    def binned(values: np.ndarray) -> np.ndarray:
        sums = np.bincount(rows * _BINS + columns, values, minlength=_BINS**2)
        return cv2.GaussianBlur(
            sums.reshape(_BINS, _BINS), (0, 0), _SPREAD, borderType=cv2.BORDER_CONSTANT
        )

    total, counts = binned(weights * sampled), binned(weights)
    single = slice(0, int(_ALIKE[0] * _BINS))
    if counts[single].sum() < _ENOUGH * counts.sum():
        single = slice(0, _BINS)
    full = float(total[single].sum() / counts[single].sum())
    table = full + (total - full * counts) / (counts + _RELIABLE / _EVERY**2)
    return table.astype(np.float32), full


def _drawn(length: int, generator: np.random.Generator) -> np.ndarray:
    """Return one place at random of every few, ascending."""
    first = np.arange(0, length - _EVERY + 1, _EVERY)
    return first + generator.integers(_EVERY, size=len(first))
