"""Sub-pixel places of targets: a homography through all of their dots.

The edges of each dot are fitted in the image as received. The centres of the ellipses are not the
images of the centres of the dots; the homography tells the difference.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.vision.black import black_lift
from ahf_ros.vision.circle_fit import ENOUGH, dot_circles, fit_circles_of_any_blur
from ahf_ros.vision.dots import Dots
from ahf_ros.vision.ellipse_targets import stayed
from ahf_ros.vision.frame import ellipse_axes, mean_radii, project
from ahf_ros.vision.homography import fit_homographies, local_frames
from ahf_ros.vision.robust import median
from ahf_ros.vision.sampling import sample_circles

_RAYS = 32  # about a dot
_SIZES, _REACHES = np.array([0.5, 1.1, 2.3]), np.array([1.9, 0.95, 0.45])
# Semi-minor axis of a dot, px, from where on its edge is looked for within a reach, dot radii.
_CLEAR = 1.5  # semi-minor axis of a dot, px, from which its edge is found in nearly any light
_UNMEASURED = 0.3  # standard deviation of a centre whose edge was not fitted, px
_OUTLIER = 4.0  # standard deviations from which a dot loses its weight
_USUAL = (0.08, 0.004)  # distance of a dot from the homography, px and dot radii
_ROUNDS = 4
_LEVEL_ANGLES = 2 * np.pi * np.arange(8) / 8
_LEVEL_RADII = np.array([0.0, 1.8])  # where the levels of a dot and of its ground are read


@dataclass(frozen=True, slots=True)
class Placement:
    """Where k targets are.

    Attributes
    ----------
    homographies : ndarray of float64, shape (k, 3, 3)
        From the plane of the printed design to pixels.
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the reference point, px^2.
    share : ndarray of float64, shape (k,)
        Share of the dots whose edges were found where they should be.
    missing : ndarray of float64, shape (k,)
        Share of the dots whose edges were not, of those large enough for that; 0 without such.
    misplacement : ndarray of float64, shape (k,)
        Sum of ln(1 + (d / s)^2) over the dots but the worst, with the distance d of a dot from
        the homography and the usual one, s.
    scale : ndarray of float64, shape (k,)
        Usual radius of the dots in that of the printed design.
    growth : ndarray of float64, shape (k,)
        Growth of what is dark in light, by the radii of the dots, px.
    """

    homographies: np.ndarray
    covariance: np.ndarray
    share: np.ndarray
    missing: np.ndarray
    misplacement: np.ndarray
    scale: np.ndarray
    growth: np.ndarray


@dataclass(frozen=True, slots=True)
class MeasuredDots:
    """Dots, and what their edges say.

    Attributes
    ----------
    frames : ndarray of float64, shape (n, 3, 3)
        As fitted; those given where no edge was found.
    covariance : ndarray of float64, shape (n, 2, 2)
        Of the centre of the ellipse, px^2; large where there is no edge about where it should be.
    found : ndarray of bool, shape (n,)
        Whether there is an edge.
    near : ndarray of bool, shape (n,)
        Whether it is about where it should be.
    clear : ndarray of bool, shape (n,)
        Whether the dot is so large that an edge is found in nearly any light.
    growth : ndarray of float64, shape (n,)
        Of what is dark in light, where there is an edge, if in gray values there was none, px.
    """

    frames: np.ndarray
    covariance: np.ndarray
    found: np.ndarray
    near: np.ndarray
    clear: np.ndarray
    growth: np.ndarray


def measure_dots(gray: np.ndarray, frames: np.ndarray, polarity: np.ndarray) -> MeasuredDots:
    """Fit the edges of dots, whose affine frames, shape (n, 3, 3), are known to about a pixel."""
    minor = ellipse_axes(frames)[1]
    fitted = frames.copy()
    covariance = np.tile(_UNMEASURED**2 * np.eye(2), (len(frames), 1, 1))
    found, near = np.zeros((2, len(frames)), bool)
    growth = np.zeros(len(frames))
    which = np.flatnonzero(minor >= _SIZES[0])
    reach = _REACHES[np.searchsorted(_SIZES, minor[which], 'right') - 1, None]
    circles = dot_circles(polarity[which], _RAYS)
    fit = fit_circles_of_any_blur(gray, frames[which], circles, reach=reach, projective=False)
    good = fit.share >= ENOUGH
    found[which], fitted[which[good]] = good, fit.frames[good]
    growth[which] = fit.growth
    good &= stayed(fit.frames, frames[which])
    near[which] = good
    covariance[which[good]] = fit.covariance[good]
    return MeasuredDots(
        frames=fitted,
        covariance=covariance,
        found=found,
        near=near,
        clear=minor >= _CLEAR,
        growth=growth,
    )


def resized(gray: np.ndarray, dots: Dots) -> Dots:
    """Return dots with their size in gray values where dot or ground is darker than ink.

    There the edges in the logarithm of the image, by which dots are found, lie elsewhere, by more
    than templates allow for.
    """
    levels = np.median(sample_circles(gray, dots.frames, _LEVEL_ANGLES, _LEVEL_RADII), axis=1)
    dark, bright = levels.min(axis=1), np.maximum(levels.max(axis=1), 1.0)
    black = np.flatnonzero(black_lift(dark / bright, bright) > 0)
    if not black.size:
        return dots
    frames = dots.frames.copy()
    frames[black] = measure_dots(gray, frames[black], dots.polarity[black]).frames
    return replace(dots, frames=frames)


def place_targets(
    gray: np.ndarray,
    frames: np.ndarray,
    polarity: np.ndarray,
    places: np.ndarray,
    radii: np.ndarray,
    reach: float,
) -> Placement:
    """Return the homographies of targets through their dots.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, n, 3, 3)
        Of the dots of k targets, to about a pixel.
    polarity : ndarray of int, shape (k,)
    places, radii : ndarray of float64, shape (k, n, 2) and (k, n)
        Of the dots in the printed design, about the reference point. Those in the image may all
        be larger or smaller by one factor.
    reach : float
        Size of the printed design.
    """
    shape = frames.shape[:2]
    signs = np.repeat(polarity, shape[1])
    dots = measure_dots(gray, frames.reshape(-1, 3, 3), signs)
    near, found, clear = (it.reshape(shape) for it in (dots.near, dots.found, dots.clear))
    fitted = dots.frames[:, :2, 2].reshape(*shape, 2)
    centres = np.where(near[..., None], fitted, frames[..., :2, 2])
    weights = np.linalg.inv(dots.covariance).reshape(*shape, 2, 2)
    robust = weights
    size = np.log(mean_radii(dots.frames)).reshape(shape)
    measured = found | ~found.any(axis=1, keepdims=True)
    shift = np.zeros((*shape, 2))
    for _ in range(_ROUNDS):
        fit = fit_homographies(places, centres - shift, robust, reach)
        expected = project(fit.homographies, places[:, :, None])[:, :, 0]
        implied = mean_radii(local_frames(fit.homographies, places, radii).reshape(-1, 3, 3))
        growth = size - np.log(implied).reshape(shape)
        scale = np.exp(median(growth, measured))
        shift = ellipse_centres(fit.homographies, places, radii * scale[:, None]) - expected
        error = (centres - shift - expected)[..., None]
        squares = (error.swapaxes(2, 3) @ weights @ error)[..., 0, 0]
        usual = np.maximum(np.median(squares, axis=1, keepdims=True), 1.0)
        robust = weights / ((1 + squares / usual / _OUTLIER**2) ** 2)[..., None, None]
    # Dots that lie farther from the homography than they should say how wrong the errors are.
    free = max(2 * shape[1] - 8, 1)
    excess = np.maximum((squares / (1 + squares / _OUTLIER**2)).sum(axis=1) / free, 1.0)
    usual_distance = _USUAL[0] + _USUAL[1] * np.exp(size)
    distance = np.hypot(*np.moveaxis(fitted - shift - expected, 2, 0)) / usual_distance
    misplaced = np.sort(np.where(found, np.log1p(distance**2), 0.0), axis=1)[:, :-1]
    of_dots = polarity[:, None] * implied.reshape(shape) * np.expm1(growth)
    of_dots += dots.growth.reshape(shape)
    return Placement(
        homographies=fit.homographies,
        covariance=fit.covariance * excess[:, None, None],
        share=near.mean(axis=1),
        missing=(clear & ~near).sum(axis=1) / np.maximum(clear.sum(axis=1), 1),
        misplacement=misplaced.sum(axis=1),
        scale=scale,
        growth=np.where(found.any(axis=1), median(of_dots, found), np.nan),
    )


def dot_frames(homographies: np.ndarray, places: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return the frames of dots as ellipses, centred where these are, shape (k, n, 3, 3)."""
    frames = local_frames(homographies, places, radii)
    frames[..., :2, 2] = ellipse_centres(homographies, places, radii)
    return frames


def ellipse_centres(homographies: np.ndarray, points: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return the centres of the ellipses that circles are seen as, px, shape (k, m, 2).

    Under perspective that is not the image of the centre of the circle. Points, shape (m, 2) or
    (k, m, 2), and radii are those of the circles in the plane of the object.
    """
    count = len(homographies)
    points = np.broadcast_to(points, (count, *points.shape[-2:]))
    radii = np.broadcast_to(radii, points.shape[:2])
    homogeneous = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=2)
    images = homogeneous @ homographies.transpose(0, 2, 1)
    slope = homographies[:, None, 2, :2]
    # The pole of the line at infinity with respect to the dual conic of the image.
    along = radii[..., None] ** 2 * (slope @ homographies[:, :, :2].transpose(0, 2, 1))
    pole = images * images[..., 2:] - along
    return pole[..., :2] / pole[..., 2:]
