"""Ellipses of dots, found about candidates despite the edges of light that cross them."""

from __future__ import annotations

from functools import cache

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.candidates import LOG_SCALE, Candidates

_RAYS = 32
_ANGLES = 2 * np.pi * np.arange(_RAYS) / _RAYS
_BINS = 26  # of the radius, in equal ratios
_NEAREST, _FARTHEST = 0.4, 1.35  # radii sampled, in the smallest and the largest of the range
_SHAPES = ((1.0, 1), (0.75, 4), (0.55, 6), (0.4, 8))  # aspect, number of directions
_LOWEST_STEP, _HIGHEST_STEP = -0.3, 0.6  # of ln; higher steps count no more
_LEAST_SCORE = 0.15  # mean step of ln along the ellipse
_WINDOWS = (0.35, 0.22, 0.14)  # about the ellipse, in its own radius
_LEAST_STEP = 0.1  # of ln, for a ray to count in the fit
_LEAST_WINDOW = 2.0  # the same, px
_INLIER, _PIXEL_INLIER = 0.06, 0.4  # of the radius, or px
_LEAST_INLIERS = 0.45
_LEAST_ASPECT = 0.28


def fit_dots(logs: list[np.ndarray], candidates: Candidates) -> tuple[np.ndarray, ...]:
    """Fit ellipses to the dots about candidates.

    About each candidate the steps of ln I along rays are summed on circles and ellipses of all
    sizes; the best one is then refined, robustly, on the strongest step of each ray near to it.

    Parameters
    ----------
    logs : list of ndarray of int16
        The pyramid of logarithmic images.
    candidates : Candidates

    Returns
    -------
    frames : ndarray of float64, shape (k, 3, 3)
        Affine, in pixels of the first level.
    signs : ndarray of int, shape (k,)
        1 for dark dots.
    inliers : ndarray of float64, shape (k,)
        Share of the rays that show the edge of the ellipse.
    """
    # Dots of a few pixels are fitted one level below the one that they were found on.
    level = candidates.level - (candidates.radii[1] < 8)
    shrink = 2.0 ** (candidates.level - level)
    points = (candidates.points + 0.5) * shrink - 0.5
    low, high = candidates.radii[0] * shrink, candidates.radii[1] * shrink
    frames, scores = _best_ellipses(logs[level], points, candidates.signs, low, high)
    kept = scores > _LEAST_SCORE
    frames, signs, inliers = refine_dots(logs[level], frames[kept], candidates.signs[kept])
    kept = frame.ellipse_axes(frames)[0] < 1.6 * high
    return frame.enlarged(frames[kept], level), signs[kept], inliers[kept]


def refine_dots(
    log: np.ndarray, frames: np.ndarray, signs: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Refine ellipses on a logarithmic image; leave out those that its edges do not bear out.

    Parameters
    ----------
    log : ndarray of int16, shape (height, width)
    frames : ndarray of float64, shape (k, 3, 3)
        Affine, in pixels of `log`.
    signs : ndarray of int, shape (k,)

    Returns
    -------
    frames, signs, inliers
        As `fit_dots` has them, but in pixels of `log`.
    """
    inliers: np.ndarray = np.zeros(len(frames))
    for window in _WINDOWS:
        frames, inliers = _refined(log, frames, signs, window)
        major, minor, _ = frame.ellipse_axes(frames)
        kept = (minor > _LEAST_ASPECT * major) & (minor > 1.0) & (inliers > _LEAST_INLIERS)
        frames, signs, inliers = frames[kept], signs[kept], inliers[kept]
    return frames, signs, inliers


def _best_ellipses(
    log: np.ndarray, points: np.ndarray, signs: np.ndarray, low: float, high: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return for each point the ellipse about it with the highest mean step, and that step."""
    templates, radii, majors, minors, directions = _templates(low, high)
    one = np.ones(len(points))
    frames = frame.affine_frames(points[:, 0], points[:, 1], one, one, 0 * one)
    steps = _steps(log, frames, radii, signs)
    scores = steps.reshape(len(points), len(templates)) @ templates
    best = scores.argmax(axis=1)
    fitted = frame.affine_frames(
        points[:, 0], points[:, 1], majors[best], minors[best], directions[best]
    )
    return fitted, scores[np.arange(len(points)), best]


@cache
def _templates(low: float, high: float) -> tuple[np.ndarray, ...]:
    """Return weights that average steps along ellipses, the sampled radii, and the ellipses."""
    radii = np.geomspace(_NEAREST * low, _FARTHEST * high, _BINS)
    ratio = np.log(radii[1] / radii[0])
    middle = radii[1:-1]
    weights, ellipses = [], []
    for aspect, count in _SHAPES:
        for direction in np.pi * np.arange(count) / count:
            along = np.cos(_ANGLES - direction) ** 2 + (np.sin(_ANGLES - direction) / aspect) ** 2
            for major in middle[middle * aspect >= middle[0]]:
                place = np.log(major / np.sqrt(along) / middle[0]) / ratio
                distance = np.abs(place[:, None] - np.arange(len(middle)))
                weights.append(np.clip(1.5 - distance, 0, 1).ravel() / _RAYS)
                ellipses.append((major, aspect * major, direction))
    majors, minors, directions = np.array(ellipses).T
    return np.array(weights, np.float32).T, radii, majors, minors, directions


def _steps(
    log: np.ndarray, frames: np.ndarray, radii: np.ndarray, signs: np.ndarray
) -> np.ndarray:
    """Return the steps of ln outwards, from dark to bright, at all but the end radii."""
    values = frame.sample_circles(log, frames, _ANGLES, radii).astype(np.float32)
    steps = (values[:, :, 2:] - values[:, :, :-2]) * (signs / LOG_SCALE)[:, None, None]
    return np.clip(steps, _LOWEST_STEP, _HIGHEST_STEP, dtype=np.float32)


def _refined(
    log: np.ndarray, frames: np.ndarray, signs: np.ndarray, window: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return frames moved onto the strongest steps near their circle, and the inliers' share."""
    size = frame.mean_radii(frames)[:, None]
    windows = np.clip(_LEAST_WINDOW / size, window, 0.5)
    radii = 1 + np.linspace(-1.15, 1.15, 13) * windows
    steps = _steps(log, frames, radii, signs)
    best = np.clip(steps.argmax(axis=2), 1, steps.shape[2] - 2)
    before, step, after = (
        np.take_along_axis(steps, (best + shift)[..., None], axis=2)[..., 0].astype(np.float64)
        for shift in (-1, 0, 1)
    )
    curvature = np.minimum(before - 2 * step + after, -1e-3)
    shift = np.clip(0.5 * (before - after) / curvature, -1, 1)
    spacing = radii[:, 1:2] - radii[:, :1]
    displacement = np.take_along_axis(radii, best + 1, axis=1) + shift * spacing - 1
    usual = np.maximum(np.median(step, axis=1, keepdims=True), _LEAST_STEP)
    seen = np.clip(step / usual, 0, 1) * (step > _LEAST_STEP)
    changes, errors = fit_robustly(
        displacement, seen, frame.displacement_basis(_ANGLES, np.ones(_RAYS))[:, :5], window / 5
    )
    inlying = np.abs(errors) < np.maximum(_INLIER, _PIXEL_INLIER / size)
    inliers = (inlying & (step > 1.5 * _LEAST_STEP)).mean(axis=1)
    return frame.moved(frames, np.clip(changes, -windows, windows)), inliers


def fit_robustly(
    values: np.ndarray, weights: np.ndarray, basis: np.ndarray, scale: float, rounds: int = 4
) -> tuple[np.ndarray, np.ndarray]:
    """Fit linear models to k sets of values by iterated reweighting.

    Parameters
    ----------
    values, weights : ndarray of float, shape (k, m)
    basis : ndarray of float, shape (m, n)
    scale : float
        Residual at which a value has lost three quarters of its weight.
    rounds : int
        Number of solutions.

    Returns
    -------
    parameters : ndarray of float64, shape (k, n)
    residuals : ndarray of float64, shape (k, m)
    """
    products = (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)
    size = basis.shape[1]
    ridge = 1e-3 * np.eye(size)
    robust = weights
    for _ in range(rounds):
        normal = (robust @ products).reshape(-1, size, size) + ridge
        right = (robust * values) @ basis
        parameters = np.linalg.solve(normal, right[..., None])[..., 0]
        residuals = values - parameters @ basis.T
        robust = weights / (1 + (residuals / scale) ** 2) ** 2
    return parameters, residuals
