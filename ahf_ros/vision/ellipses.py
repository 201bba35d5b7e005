"""Ellipses of dots, fitted about candidates despite edges of light that cross them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ahf_ros import kernels
from ahf_ros.vision import frame
from ahf_ros.vision.candidates import Candidates
from ahf_ros.vision.dots import NO_DOTS, Dots
from ahf_ros.vision.log_edges import LOG_SCALE
from ahf_ros.vision.pyramid import MINIMUM_ASPECT
from ahf_ros.vision.robust import fit_linear, medians
from ahf_ros.vision.sampling import sample_circles

_RAYS, _FEW_RAYS = 32, 24  # about an ellipse that is refined, and about a candidate
_ANGLES, _FEW_ANGLES = (2 * np.pi * np.arange(rays) / rays for rays in (_RAYS, _FEW_RAYS))
_BINS = 22  # of the radius, in equal ratios
_MINIMUM_RADIUS = 0.4  # radius sampled, in the smallest one of the range
_MAXIMUM_RADIUS = 1.35  # the same, in the largest one
_WIDTH = 1.5  # from the middle of an ellipse to where its weights end, bins
_SHAPES = ((1.0, 1), (0.75, 4), (0.55, 6), (0.4, 8))  # aspect, number of directions
_BESIDE, _SIDES = 0.4, 6  # distance of circles beside a candidate in their radius, directions
_COUNTED = -0.3, 0.6  # steps of ln; one beyond counts no more
_MINIMUM_SCORE = 0.15  # mean step of ln along the ellipse
_SMALL = 8.0  # largest radius of a range of the first level that is fitted in the image, px
_OVERSIZE = 1.6  # semi-major axis of a dot, in the largest radius of its range, at the most
_WINDOWS = (  # about the ellipse, in its own radius; share of inliers; one of so many rays
    (0.5, 0.25, 2),
    (0.3, 0.3, 1),
    (0.15, 0.35, 1),
)
_MINIMUM_WINDOW, _MAXIMUM_WINDOW = 2.0, 0.5  # the same: px, and in its own radius
_PROFILE, _SAMPLES = 1.15, 13  # half length of a profile across it, in windows, and its samples
_MINIMUM_STEP = 0.1  # of ln, for a ray to count in the fit
_CLEAR_STEP = 1.5 * _MINIMUM_STEP  # for a ray to show the edge
_FLAT = -1e-3  # curvature of a peak of the steps, from which its top is computed
_ROUNDS = 3  # of robust least squares
_OUTLIERS = 5.0  # to a window: residuals that quarter the weight of a ray
_INLIER, _PIXEL_INLIER = 0.06, 0.4  # of the radius, or px
_MINIMUM_MINOR = 1.0  # px
_PART = 512  # dots fitted at a time, which stay in the cache


def fit_ellipses(logs: Sequence[np.ndarray], candidates: Sequence[Candidates]) -> Dots:
    """Fit ellipses to the dots about candidates.

    About each candidate the steps of ln I along rays are summed on circles and ellipses of all
    sizes; the best one is then refined, robustly, on the strongest step of each ray near to it.
    The images are the logarithmic ones of the pyramid. Only candidates that the edges support are
    returned, in px of the first level.
    """
    found = [NO_DOTS]
    for some in candidates:
        level = 0 if some.level == 1 and some.radii[1] < _SMALL else some.level
        shrink = 2.0 ** (some.level - level)
        points = (some.points + 0.5) * shrink - 0.5
        low, high = (radius * shrink for radius in some.radii)
        for start in range(0, len(points), _PART):
            part = slice(start, start + _PART)
            dots = _best_ellipses(logs[level], points[part], some.polarity[part], low, high)
            dots = refine_ellipses(logs[level], dots)
            dots = dots.select(frame.ellipse_axes(dots.frames)[0] < _OVERSIZE * high)
            found.append(replace(dots, frames=frame.enlarged(dots.frames, level)))
    return Dots.joined(found)


def refine_ellipses(log: np.ndarray, dots: Dots) -> Dots:
    """Refine dots in px of a logarithmic image, and drop those that its edges do not support."""
    for window, minimum_share, every in _WINDOWS:
        dots = _refined(log, dots, window, _ANGLES[::every])
        major, minor, _ = frame.ellipse_axes(dots.frames)
        good = (minor > MINIMUM_ASPECT * major) & (minor > _MINIMUM_MINOR)
        good &= dots.share > minimum_share
        dots = dots.select(good)
    return resized(log, dots)


def _best_ellipses(
    log: np.ndarray, points: np.ndarray, polarity: np.ndarray, low: float, high: float
) -> Dots:
    """Return the ellipses about points with the highest mean steps, if these are clear."""
    x, y = points.T
    templates, radii, ellipses = _templates(low, high)
    one = np.ones(len(x))
    frames = frame.affine_frames(x, y, one, one, 0 * one)
    values = sample_circles(log, frames, _FEW_ANGLES, radii).astype(np.float32)
    steps = (values[:, :, 2:] - values[:, :, :-2]) * (polarity / LOG_SCALE)[:, None, None]
    steps = np.clip(steps, *_COUNTED, dtype=np.float32)
    scores = steps.reshape(len(x), len(templates)) @ templates
    best, highest = scores.argmax(axis=1), scores.max(axis=1)
    move_x, move_y, *axes = ellipses[best].T
    fitted = frame.affine_frames(x + move_x, y + move_y, *axes)
    return Dots(fitted, polarity, highest).select(highest > _MINIMUM_SCORE)


@lru_cache(maxsize=16)  # a megabyte each; radii may be set to any number while a node runs
def _templates(low: float, high: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return templates of ellipses about a candidate, and of circles beside it.

    They are weights, float32 of shape (rays x bins, n), that average steps along each of n; the
    radii that are sampled, shape (bins + 2,); and the centres of the ellipses, seen from the
    candidate, with their semi-axes and directions, shape (n, 5).
    """
    radii = np.geomspace(_MINIMUM_RADIUS * low, _MAXIMUM_RADIUS * high, _BINS)
    ratio = np.log(radii[1] / radii[0])
    middle = radii[1:-1]
    outlines, ellipses = [], []
    for aspect, count in _SHAPES:
        for direction in np.pi * np.arange(count) / count:
            along, across = (
                np.cos(_FEW_ANGLES - direction),
                np.sin(_FEW_ANGLES - direction) / aspect,
            )
            for major in middle[middle * aspect >= middle[0]]:
                outlines.append(major / np.hypot(along, across))
                ellipses.append((0.0, 0.0, major, aspect * major, direction))
    for direction in 2 * np.pi * np.arange(_SIDES) / _SIDES:
        along, across = (_BESIDE * of(_FEW_ANGLES - direction) for of in (np.cos, np.sin))
        x, y = _BESIDE * np.cos(direction), _BESIDE * np.sin(direction)
        for radius in middle[middle * (1 - _BESIDE) >= middle[0]]:
            outlines.append(radius * (along + np.sqrt(1 - across**2)))
            ellipses.append((x * radius, y * radius, radius, radius, 0.0))
    bins = np.log(np.array(outlines) / middle[0]) / ratio
    distance = np.abs(bins[:, :, None] - np.arange(len(middle)))
    weights = np.clip(_WIDTH - distance, 0, 1, dtype=np.float32) / _FEW_RAYS
    return weights.reshape(len(weights), -1).T, radii, np.array(ellipses)


def _refined(log: np.ndarray, dots: Dots, window: float, angles: np.ndarray) -> Dots:
    """Return dots moved onto the strongest steps near their ellipses."""
    size = frame.mean_radii(dots.frames)[:, None]
    radii, windows = _profiles(size, window)
    values = sample_circles(log, dots.frames, angles, radii).astype(np.float32)
    of_values = values, dots.polarity / LOG_SCALE, radii, *_COUNTED, _FLAT
    displacement, step, _ = kernels.strongest_steps(*of_values)
    half = len(angles) // 2
    middle = np.partition(step, half, axis=1)[:, half, None]
    usual = np.maximum(middle, _MINIMUM_STEP)
    weights = np.clip(step / usual, 0, 1) * (step > _MINIMUM_STEP)
    basis = frame.displacement_basis(angles, np.ones(len(angles)))[:, :5]
    changes, errors = fit_linear(displacement, weights, basis, window / _OUTLIERS, _ROUNDS)
    inlying = np.abs(errors) < np.maximum(_INLIER, _PIXEL_INLIER / size)
    share = (inlying & (step > _CLEAR_STEP)).mean(axis=1)
    frames = frame.moved(dots.frames, np.clip(changes, -windows, windows))
    return Dots(frames, dots.polarity, share)


def resized(log: np.ndarray, dots: Dots) -> Dots:
    """Return dots, in px of an image LOG_SCALE ln(I + 8), with their sizes in gray values.

    In a logarithm a blurred edge lies on its dark side.
    """
    if not len(dots.frames):
        return dots
    window, _, _ = _WINDOWS[-1]
    radii, _ = _profiles(frame.mean_radii(dots.frames)[:, None], window)
    values = sample_circles(log, dots.frames, _ANGLES[::2], radii).astype(np.float32)
    values = np.exp((values - values.max(axis=2, keepdims=True)) / np.float32(LOG_SCALE))
    of_values = values, dots.polarity.astype(float), radii, -1.0, 1.0, _FLAT
    displacement, *_ = kernels.strongest_steps(*of_values)
    frames = dots.frames.copy()
    frames[:, :2, :2] *= 1 + medians(displacement)[:, None, None]
    return replace(dots, frames=frames)


def _profiles(size: np.ndarray, window: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the radii of profiles across ellipses, and their windows."""
    windows = np.clip(_MINIMUM_WINDOW / size, window, _MAXIMUM_WINDOW)
    return 1 + np.linspace(-_PROFILE, _PROFILE, _SAMPLES) * windows, windows
