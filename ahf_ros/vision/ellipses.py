"""Ellipses of dots, fitted about candidates despite edges of light that cross them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros import kernels
from ahf_ros.vision import frame
from ahf_ros.vision.candidates import Candidates
from ahf_ros.vision.dots import NO_DOTS, Dots
from ahf_ros.vision.log_edges import LOG_SCALE
from ahf_ros.vision.pyramid import MINIMUM_ASPECT


def _rays(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors along rays, (2, count), and how changes move edges there, (count, 5)."""
    angles = 2 * np.pi * np.arange(count) / count
    basis = frame.displacement_basis(angles, np.ones(count))[:, :5]
    return np.array([np.cos(angles), np.sin(angles)]), basis.copy()


_ANGLES = 2 * np.pi * np.arange(24) / 24  # of rays about a candidate
_ABOUT, _FEW, _MANY = map(_rays, (24, 16, 32))
_SIZES = 22  # that are sampled about a candidate, in equal ratios
_MINIMUM_RADIUS = 0.4  # radius sampled, in the smallest one of the range
_MAXIMUM_RADIUS = 1.35  # the same, in the largest one
_SHAPES = ((1.0, 1), (0.75, 4), (0.55, 6), (0.4, 8))  # aspect, number of directions
_BESIDE, _SIDES = 0.4, 6  # distance of circles beside a candidate in their radius, directions
_COUNTED = -0.3, 0.6  # steps of ln; one beyond counts no more
_SMALL = 8.0  # largest radius of a range of the first level that is fitted in the image, px
_OVERSIZE = 1.6  # semi-major axis of a dot, in the largest radius of its range, at the most
_WINDOWS = (  # about the ellipse, in its own radius; share of inliers; rays
    (0.5, 0.25, _FEW),
    (0.3, 0.3, _MANY),
    (0.15, 0.35, _MANY),
)
_MINIMUM_WINDOW, _MAXIMUM_WINDOW = 2.0, 0.5  # the same: px, and in its own radius
_PLACES = np.linspace(-1.15, 1.15, 13)  # of samples of a profile across it, in windows
_MINIMUM_STEP = 0.1  # of ln, for a ray to count in the fit
_CLEAR_STEP = 1.5 * _MINIMUM_STEP  # for a ray to show the edge
_FLAT = -1e-3  # curvature of a peak of the steps, from which its top is computed
_ROUNDS = 3  # of robust least squares
_OUTLIERS = 5.0  # to a window: residuals that quarter the weight of a ray
_PRIOR = np.full(5, 1e-3)  # inverse variance of no change, in weights
_INLIER, _PIXEL_INLIER = 0.06, 0.4  # of the radius, or px

MINIMUM_MINOR = 1.0
"""Smallest semi-minor axis of a dot, px."""


def fit_ellipses(logs: Sequence[np.ndarray], candidates: Sequence[Candidates]) -> Dots:
    """Fit ellipses to the dots about candidates.

    About each candidate the steps of ln I along rays are summed on circles and ellipses of all
    sizes; the best one is then refined, robustly, on the strongest step of each ray near to it.
    The images are the logarithmic ones of the pyramid. Only candidates that the edges support are
    returned, in px of the first level.
    """
    found = [NO_DOTS]
    for some in (of for of in candidates if len(of.points)):
        level = 0 if some.level == 1 and some.radii[1] < _SMALL else some.level
        shrink = 2.0 ** (some.level - level)
        points = (some.points + 0.5) * shrink - 0.5
        low, high = (radius * shrink for radius in some.radii)
        dots = _best_ellipses(logs[level], points, some.polarity, low, high)
        dots = refine_ellipses(logs[level], dots)
        dots = dots.select(frame.ellipse_axes(dots.frames)[0] < _OVERSIZE * high)
        found.append(replace(dots, frames=frame.enlarged(dots.frames, level)))
    return Dots.joined(found)


def refine_ellipses(log: np.ndarray, dots: Dots) -> Dots:
    """Refine dots in px of a logarithmic image, and drop those that its edges do not support."""
    for window, minimum_share, rays in _WINDOWS:
        frames, share = kernels.moved_ellipses(
            log,
            dots.frames,
            dots.polarity / LOG_SCALE,
            *rays,
            _PLACES,
            (_MINIMUM_WINDOW, window, _MAXIMUM_WINDOW),
            *(_COUNTED, _FLAT, _MINIMUM_STEP, _CLEAR_STEP),
            *(window / _OUTLIERS, _ROUNDS, _PRIOR, (_INLIER, _PIXEL_INLIER)),
        )
        dots = Dots(frames, dots.polarity, share)
        major, minor, _ = frame.ellipse_axes(dots.frames)
        good = (minor > MINIMUM_ASPECT * major) & (minor > MINIMUM_MINOR)
        good &= dots.share > minimum_share
        dots = dots.select(good)
    return resized(log, dots)


def _best_ellipses(
    log: np.ndarray, points: np.ndarray, polarity: np.ndarray, low: float, high: float
) -> Dots:
    """Return the ellipses about points with the highest mean steps."""
    radii = np.geomspace(_MINIMUM_RADIUS * low, _MAXIMUM_RADIUS * high, _SIZES)
    step = np.log(radii[1] / radii[0])
    bins = np.rint(_OUTLINES / step).astype(np.int32)
    of_outlines = bins, _OUTLINES / step - bins, -np.log(_SMALLEST) / step
    best, highest = kernels.best_outlines(
        log, points, polarity / LOG_SCALE, _ABOUT[0], radii, *of_outlines, _COUNTED
    )
    x, y, major, minor, angle = _ELLIPSES[best[:, 0]].T
    x, y, major, minor = radii[1 + best[:, 1]] * (x, y, major, minor)
    fitted = frame.affine_frames(points[:, 0] + x, points[:, 1] + y, major, minor, angle)
    return Dots(fitted, polarity, highest)


def _outlines() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return outlines of ellipses about a candidate, and of circles beside it, of size 1.

    They are ln of their radii along rays, shape (n, rays); their smallest radii, shape (n,); and
    their centres, seen from the candidate, semi-axes and directions, shape (n, 5).
    """
    outlines, ellipses = [], []
    for aspect, count in _SHAPES:
        for direction in np.pi * np.arange(count) / count:
            angles = _ANGLES - direction
            outlines.append(1 / np.hypot(np.cos(angles), np.sin(angles) / aspect))
            ellipses.append((0.0, 0.0, 1.0, aspect, direction))
    for direction in 2 * np.pi * np.arange(_SIDES) / _SIDES:
        along, across = (_BESIDE * of(_ANGLES - direction) for of in (np.cos, np.sin))
        outlines.append(along + np.sqrt(1 - across**2))
        ellipses.append((_BESIDE * np.cos(direction), _BESIDE * np.sin(direction), 1.0, 1.0, 0.0))
    x, y, _, minor, _ = np.array(ellipses).T
    return np.log(outlines), minor - np.hypot(x, y), np.array(ellipses)


_OUTLINES, _SMALLEST, _ELLIPSES = _outlines()


def resized(log: np.ndarray, dots: Dots) -> Dots:
    """Return dots, in px of an image LOG_SCALE ln(I + 8), with their sizes in gray values.

    In a logarithm a blurred edge lies on its dark side.
    """
    if not len(dots.frames):
        return dots
    window = _MINIMUM_WINDOW, _WINDOWS[-1][0], _MAXIMUM_WINDOW
    sizes = kernels.gray_sizes(
        log, dots.frames, dots.polarity, _FEW[0], _PLACES, window, LOG_SCALE, _FLAT
    )
    return replace(dots, frames=frame.scaled(dots.frames, sizes))
