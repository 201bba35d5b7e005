"""The light on a target, predicted from its ground.

Stripes, fringes and lattices repeat themselves, and even light is the same everywhere. The light
at a point of the band is that of the ground at all places that are alike: moved by the shifts that
bring the ground of the target, gap and margin, best onto itself. Correlations by Fourier
transforms compare all shifts at once, and give the prediction for all points at once.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ahf_ros import kernels
from ahf_ros.prints.ring import Radii
from ahf_ros.vision.logarithm import LOG_OFFSET

_CELLS, _TRANSFORM = 64, 96  # sides of the rectified target and of its transforms
_MARGIN = 0.85  # beyond the band, dot radii
_MAXIMUM_SHIFT = 3.6  # shift, dot radii
_ASIDE = 0.18  # distance of ground from edges, dot radii
_OVERLAP = 0.12  # share of the ground that a shift must compare
_SHIFTS = 60  # best ones, that predict
_SHADOW = 0.1  # share of a gap that is as dark as ink in shadow
_ALIKE = 1.1  # ratio of differences of shifts that are as good as each other
_UNKNOWN = 0.03  # weight of ground below which less than two of the shifts predict a point
_ROUNDING = 1e-5  # square of ln by which whole gray values near 90 differ, without any noise
_NO_MATCH = 1e6  # square of differences of shifts that compare too little
_PART = 32  # targets at a time, whose transforms stay in the cache


def predicted_light(
    gray: np.ndarray,
    frames: np.ndarray,
    lift: np.ndarray,
    angles: np.ndarray,
    radii: np.ndarray,
    band: Radii,
    circles: tuple[Radii, ...] = (),
    plate: np.ndarray | None = None,
    contrast: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the gray values that paper has at points of bands, and how far they are known.

    The points are at angles (m,), rad, and radii (d,) of targets with frames (k, 3, 3), in which
    black is lifted to gray values (k,); `circles` are no ground. Where dark ground ends on white
    paper, between the radii of a `plate`, shape (k, 2, m), see `PolarImages.rim`, that paper is as
    bright as the ground over its `contrast`, shape (k,). The second array is the standard
    deviation of the logarithm of the first, infinite where no ground predicts it; both are
    float32, (k, d, m).
    """
    points, ground, candidates, order, compared = _geometry(band, circles)
    place = _places(band[1] + _MARGIN, angles, radii)
    shape = len(frames), len(radii), len(angles)
    light, spread = np.empty(shape, np.float32), np.empty(shape, np.float32)
    for start in range(0, len(frames), _PART):
        part = slice(start, start + _PART)
        at = frames[part], points.reshape(-1, 2).T, np.ones((len(lift[part]), 1))
        values, _ = kernels.circle_values(gray, *at, lift[part].astype(np.float32))
        values = values.reshape(-1, _CELLS, _CELLS)
        grounds, (seen, overlap, few) = ground[None], compared
        if plate is not None and contrast is not None and np.isfinite(plate[part]).any():
            ends = plate[part][..., _nearest(angles, points)]
            values, grounds = _as_dark(values, ground, points, band, ends, contrast[part])
            seen, overlap, few = _compared(grounds, candidates)
        logs = np.log(values + np.float32(LOG_OFFSET))
        whole = grounds.sum(axis=(1, 2), keepdims=True)
        middle = (logs * grounds).sum(axis=(1, 2), keepdims=True) / whole
        logs = (logs - middle) * grounds
        first, second = (np.fft.rfft2(of, (_TRANSFORM,) * 2) for of in (logs, logs * logs))
        # Of the squares of differences between ground and shifted ground.
        both = 2 * seen.conj() * second - 2 * np.abs(first) ** 2
        differ = np.fft.irfft2(both, (_TRANSFORM,) * 2)
        differ = (differ + _turned(differ)).reshape(len(logs), -1)[:, candidates] / 2
        differ = np.maximum(differ / np.maximum(overlap, 1), _ROUNDING) * order
        differ = np.where(few, _NO_MATCH, differ)
        best = np.argpartition(differ, _SHIFTS, axis=1)[:, :_SHIFTS]
        of_best = np.take_along_axis(differ, best, axis=1)
        weight = 1 / (of_best + of_best.min(axis=1, keepdims=True) / 2)
        kernel = np.zeros((len(logs), _TRANSFORM**2), np.float32)
        weight /= weight.sum(axis=1, keepdims=True)
        error = (weight * of_best).sum(axis=1)[:, None, None]
        np.put_along_axis(kernel, candidates[best], weight, axis=1)
        moved = np.fft.rfft2(kernel.reshape(-1, _TRANSFORM, _TRANSFORM)).conj()
        known, sums, second_sums = (
            _read(np.fft.irfft2(moved * of, (_TRANSFORM,) * 2), *place)
            for of in (seen, first, second)
        )
        mean = sums / np.maximum(known, _UNKNOWN)
        variance = np.maximum(second_sums / np.maximum(known, _UNKNOWN) - mean**2, 0)
        light[part] = np.exp(mean + middle) - LOG_OFFSET
        spread[part] = np.where(known > _UNKNOWN, np.sqrt(variance + error), np.inf)
    return np.maximum(light, 0), spread


def _compared(
    grounds: np.ndarray, shifts: np.ndarray | slice
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the transforms of grounds (k, n, n), and what some shifts of them compare.

    That is how many cells, and whether these are too few, (k, shifts).
    """
    seen = np.fft.rfft2(grounds, (_TRANSFORM,) * 2)
    overlap = np.fft.irfft2(np.abs(seen) ** 2, (_TRANSFORM,) * 2)
    overlap = overlap.reshape(len(grounds), -1)[:, shifts]
    return seen, overlap, overlap <= _OVERLAP * grounds.sum(axis=(1, 2))[:, None]


def _as_dark(
    values: np.ndarray,
    ground: np.ndarray,
    points: np.ndarray,
    band: Radii,
    plate: np.ndarray,
    contrast: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return gray values with dark ground in place of white paper, and the ground, (k, n, n).

    Ink of other targets on that paper is no ground; it is darker than ink in shadow would be if it
    was paper.
    """
    inner, outer = band
    radii = np.hypot(*np.moveaxis(points, 2, 0))
    ends, begins = np.moveaxis(plate, 1, 0)
    step = contrast.astype(np.float32)[:, None, None]
    on_paper = (radii > begins) & (radii < outer + _MARGIN)
    gap = np.sort(values[:, (ground > 0) & (radii < inner)], axis=1)
    shadow = gap[:, int(_SHADOW * gap.shape[1])][:, None, None]
    paper = on_paper & (values * np.sqrt(step) > shadow)
    return np.where(on_paper, values * step, values), ground * ((radii < ends) | paper)


def _nearest(angles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return which of even angles (m,) are the nearest to those of points (..., 2), rad."""
    x, y = np.moveaxis(points, -1, 0)
    steps = np.rint((np.arctan2(y, x) - angles[0]) / (angles[1] - angles[0]))
    return np.asarray(steps.astype(np.intp) % len(angles))


@lru_cache(maxsize=16)
def _geometry(
    band: Radii, circles: tuple[Radii, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
    """Return the cells of a rectified target, its ground, the shifts compared, and their order.

    Factors near one put shifts that are alike into any order, so that they reach all places. The
    last is what these shifts compare, see `_compared`.
    """
    inner, outer = band
    reach = outer + _MARGIN
    along = (np.arange(_CELLS) - (_CELLS - 1) / 2) * (2 * reach / _CELLS)
    points = np.stack(np.meshgrid(along, along), axis=-1)
    radii = np.hypot(*np.moveaxis(points, 2, 0))
    ground = ((radii > 1 + _ASIDE) & (radii < inner - _ASIDE)) | (radii > outer + _ASIDE)
    ground &= clear_of(radii, circles, _ASIDE)
    whole = ground.astype(np.float32)
    seen, overlap, few = _compared(whole[None], slice(None))
    steps = np.fft.fftfreq(_TRANSFORM, 1 / _TRANSFORM) * (2 * reach / _CELLS)
    away = np.hypot(steps[:, None], steps)
    near = (away > 0) & (away <= _MAXIMUM_SHIFT)
    which = np.flatnonzero(~few[0] & near.ravel())
    order = np.random.default_rng(0).uniform(1, _ALIKE, len(which))
    return points, whole, which, order, (seen, overlap[:, which], few[:, which])


def clear_of(radii: np.ndarray, circles: tuple[Radii, ...], aside: float = 0.1) -> np.ndarray:
    """Return whether places at radii lie aside of the ink of circles, all in dot radii."""
    near = [(radii > low - aside) & (radii < high + aside) for low, high in circles]
    return np.logical_not(np.logical_or.reduce(near)) if near else np.ones(radii.shape, bool)


def _turned(of_shifts: np.ndarray) -> np.ndarray:
    """Return what belongs to the opposite shifts, which compare the same pairs of points."""
    return np.roll(of_shifts[:, ::-1, ::-1], 1, axis=(1, 2))


def _places(
    reach: float, angles: np.ndarray, radii: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the indices of cells at points, and how far down and across each lies, (d, m)."""
    unit = _CELLS / (2 * reach)
    across, down = (
        np.outer(radii, of(angles)) * unit + (_CELLS - 1) / 2 for of in (np.cos, np.sin)
    )
    row, column = down.astype(np.intp), across.astype(np.intp)
    return row * _TRANSFORM + column, down - row, across - column


def _read(
    images: np.ndarray, place: np.ndarray, down: np.ndarray, across: np.ndarray
) -> np.ndarray:
    """Return the interpolated values of images (k, n, n) at places, shape (k, d, m)."""
    values = images.reshape(len(images), -1)
    below = place + _TRANSFORM
    upper, lower = (
        values.take(left, axis=1) * (1 - across) + values.take(left + 1, axis=1) * across
        for left in (place, below)
    )
    return upper * (1 - down) + lower * down
