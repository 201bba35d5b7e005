"""Sub-pixel frames of targets, from the edges of their circles in the original image.

Frames are moved onto measured edges by robust weighted least squares. Edges of light that cross a
target do not look like its own: the gray values beside them have another ratio, the profile is not
a step, or it does not lie on the circles. They lose their weight. A slope of the light, which
would move all edges to the same side, is taken from the profiles and corrected for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.circles import Circles, dot_circles
from ahf_ros.features.edge_covariance import common_errors, edge_covariance
from ahf_ros.features.edge_weights import weigh_edges
from ahf_ros.features.light_slope import LightSlope, common_slope, smooth_slopes
from ahf_ros.features.profiles import BLURS, USUAL_BLUR, Edges, measure_edges
from ahf_ros.features.robust import geman_mcclure, geman_mcclure_gain, median, reweight, spread

_NOISE = 1.0  # of gray values, of 255; the fit scales it to what it finds
_MINIMUM_STEP = 1.0  # gray values, that the error of an edge is computed from
_OUTLIER = 3.0  # times the usual distance from the circle that quarters the weight
_MINIMUM_SPREAD = 0.5  # that counts as usual, in deviations that noise alone would cause
_ROUNDS = 4  # of robust least squares
_PLACED, _PLACED_RADII = 4 / 3, 0.08  # error of an edge in its place: in outliers, and dot radii
_MINIMUM_GAIN = 0.2  # where many errors lie beyond the turning point of the weight function
_MAXIMUM_CHANGE = 0.3  # of a frame in one measurement, dot radii
_LIGHT_REACH = 0.3  # standard deviation of the window in which the light is even, dot radii
_LIGHT_PRIOR = 5.0  # px of whole edges that say as much of the slope as the prior, none, does
_SHARPENED = 0.03  # slope of all edges that makes those of single ones doubtful, 1/px
_UNEVEN_LIGHT = 0.011  # usual error of slopes from which the variance of a centre is twice, 1/px
_PRIOR_SCALE = 0.003  # standard deviation of the printed proportions of circles and dot
_PRIOR_PERSPECTIVE = 0.02  # of the projective part, in 1 a dot radius
_PRIOR_SHIFT = 1.0  # of the shift of edges towards the dark side, px
_WEAK_PRIOR = 1e-6  # of the other changes, so that they can always be solved for
_SYSTEMATIC = 0.001  # standard deviation of what pixels and interpolation do to a centre, px
_ROUNDED, _ROUNDED_FROM = 0.0055, 1.0  # the same, in the cube of blur beyond this one, px
_NO_WEIGHT = 1e-9  # instead of a sum of no weights


@dataclass(frozen=True, slots=True)
class Fit(ArrayRecord):
    """Frames of k targets fitted to edges.

    Attributes
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
    polarity : ndarray of int, shape (k,)
        1 for a dark target on bright ground, -1 for a bright one on dark.
    contrast : ndarray of float64, shape (k,)
        Usual gray value of the dark side of an edge over that of the bright side.
    bright : ndarray of float64, shape (k,)
        Usual gray value of the bright side.
    share : ndarray of float64, shape (k,)
        Share of the expected edges that were measured where they are expected.
    deviation : ndarray of float64, shape (k,)
        Standard deviation of these edges, px.
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the centre, px^2.
    blur : ndarray of float64, shape (k,)
        Of the edges, standard deviation in px.
    """

    frames: np.ndarray
    polarity: np.ndarray
    contrast: np.ndarray
    bright: np.ndarray
    share: np.ndarray
    deviation: np.ndarray
    covariance: np.ndarray
    blur: np.ndarray

    @property
    def size(self) -> np.ndarray:
        """Radii of circles with the areas of the dots, px, shape (k,)."""
        return frame.mean_radii(self.frames)


def fit_dots(
    gray: np.ndarray,
    frames: np.ndarray,
    polarity: np.ndarray,
    *,
    rays: int,
    reach: float,
    rounds: int = 2,
    min_share: float = 0.0,
    max_contrast: float = 1.0,
) -> Fit:
    """Fit the ellipses of dots, and drop those that their edges do not support.

    Parameters
    ----------
    gray, frames, reach, rounds
        As for `fit_circles`.
    polarity : ndarray of int, shape (k,)
        1 for a dark dot, -1 for a bright one.
    rays : int
        Number of points about a dot.
    min_share, max_contrast : float
        Bounds of `Fit.share` and `Fit.contrast`.
    """
    circles = dot_circles(polarity, rays)
    fit = fit_circles(gray, frames, circles, reach=reach, projective=False, rounds=rounds)
    return fit.select((fit.share >= min_share) & (fit.contrast <= max_contrast))


def fit_circles(
    gray: np.ndarray,
    frames: np.ndarray,
    circles: Circles,
    *,
    reach: float | np.ndarray,
    projective: bool,
    rounds: int = 2,
) -> Fit:
    """Move frames onto the edges of circles.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, 3, 3)
        To about two pixels.
    circles : Circles
    reach : float or ndarray of float, shape (k, 1)
        Distance from an expected edge within which edges are measured, dot radii.
    projective : bool
        Whether the circles have different radii, so that they determine the common centre.
        Otherwise the centre is that of the ellipse.
    rounds : int
        Number of measurements.

    Returns
    -------
    Fit
    """
    blur, window = np.full(len(frames), USUAL_BLUR), _window(circles)
    for _ in range(rounds):
        edges = measure_edges(gray, frames, circles, blur, reach)
        blur = np.clip(blur + median(edges.softness, edges.visible, 0.0), *BLURS)
        changes, fit = _solve(frames, circles, window, edges, blur, projective)
        changes = np.clip(changes, -_MAXIMUM_CHANGE, _MAXIMUM_CHANGE)
        frames = frame.moved(frames, changes[:, : 7 if projective else 5])
    affine = frame.local_affine(frames)
    covariance = affine @ fit.covariance @ affine.transpose(0, 2, 1)
    rounded = _ROUNDED * np.maximum(fit.blur**2 - _ROUNDED_FROM**2, 0) ** 1.5
    covariance += (_SYSTEMATIC**2 + rounded**2)[:, None, None] * np.eye(2)
    return replace(fit, frames=frames, covariance=covariance)


def _solve(
    frames: np.ndarray,
    circles: Circles,
    window: np.ndarray,
    edges: Edges,
    blur: np.ndarray,
    projective: bool,
) -> tuple[np.ndarray, Fit]:
    """Return the changes of the frames that bring the circles onto the edges."""
    own = weigh_edges(edges)
    light = _light(edges, own.weights, circles, window)
    displacement = (edges.offset - edges.sensitivity * light.slope) / edges.scale
    noise = _NOISE * np.sqrt(2 * np.sqrt(np.pi) * USUAL_BLUR)
    deviation = noise / np.maximum(edges.bright - edges.dark, _MINIMUM_STEP) / edges.scale
    model = _Model(circles, edges.scale, projective)

    def solve(weights: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
        changes, normal = model.solve(displacement, weights)
        return (changes, normal), np.abs(displacement - model.displacement(changes)) / deviation

    weights = own.weights / deviation**2
    (changes, normal), relative, robust = reweight(
        solve, weights, lambda sizes: _OUTLIER * spread(sizes, own.seen, _MINIMUM_SPREAD), _ROUNDS
    )
    errors = displacement - model.displacement(changes)
    placed = own.seen & (relative < _PLACED) & (np.abs(errors) < _PLACED_RADII)
    share = placed.sum(axis=1) / np.maximum(edges.visible.sum(axis=1), 1)
    squares = np.where(placed, errors * edges.scale, 0) ** 2
    scatter = np.sqrt(squares.sum(axis=1) / np.maximum(placed.sum(axis=1), 1))
    # What an error changes is not its weight times the error, but the derivative of that.
    gain = geman_mcclure_gain(weights, relative).sum(axis=1)
    gain = np.maximum(gain / np.maximum(robust.sum(axis=1), _NO_WEIGHT), _MINIMUM_GAIN)
    influence = model.influence(normal) * (robust / gain[:, None])[:, None]
    parts = influence * errors[:, None]
    parts -= light.influence(influence * (edges.sensitivity / edges.scale)[:, None])
    used = geman_mcclure(own.weights, relative)
    common = common_errors(used * errors * edges.scale, circles.radii)
    covariance = edge_covariance(parts, used, edges.spacing, normal.shape[1], common)
    # Where slopes differ that much from their neighbours, light is no slope within a profile.
    total = np.maximum(used.sum(axis=1), _NO_WEIGHT)
    uneven = (used * light.errors**2).sum(axis=1) / total
    covariance *= (1 + np.minimum(uneven / _UNEVEN_LIGHT**2, 1))[:, None, None]
    bright = median(np.maximum(edges.bright, 0), own.seen)
    polarity = circles.polarity[:, 0]
    fit = Fit(frames, polarity, own.contrast, bright, share, scatter, covariance, blur)
    return changes, fit


def _light(edges: Edges, weights: np.ndarray, circles: Circles, window: np.ndarray) -> LightSlope:
    """Return the slope of the light along the circles."""
    common = common_slope(edges.slope, circles.polarity, weights)
    prior = _LIGHT_PRIOR / edges.scale.mean(axis=1, keepdims=True)
    # Where edges were sharpened, none of their slopes is the light's.
    prior *= (1 + (common / _SHARPENED) ** 2) ** 2
    slopes = edges.slope - circles.polarity * common
    return smooth_slopes(slopes, weights, window, prior)


def _window(circles: Circles) -> np.ndarray:
    """Return the weights by which points see the light of others on the same circle, (m, m)."""
    points = circles.radii[:, None] * np.stack(
        [np.cos(circles.angles), np.sin(circles.angles)], axis=1
    )
    squares = 2 * (circles.radii**2 - points @ points.T)
    squares[circles.radii[:, None] != circles.radii] = np.inf
    window = np.exp(-0.5 * squares / _LIGHT_REACH**2)
    return window / window.sum(axis=0)


class _Model:
    """How changes of k frames, and of what else is unknown, move their edges outwards.

    The unknowns are the changes in the order of `frame.displacement_basis`. In a projective model
    the scale of each group of circles, and the shift of all edges towards the dark side which the
    gamma of a camera causes, follow.
    """

    def __init__(self, circles: Circles, scale: np.ndarray, projective: bool) -> None:
        shared = frame.displacement_basis(circles.angles, circles.radii)
        own = np.zeros((len(scale), len(shared), 0))
        prior: np.ndarray = np.full(5, _WEAK_PRIOR)
        if projective:
            groups = np.arange(1, circles.group.max(initial=0) + 1)
            scales = np.where(circles.group[:, None] == groups, circles.radii[:, None], 0)
            shared = np.concatenate([shared, scales], axis=1)
            own = (-circles.polarity / scale)[..., None]
            deviations = [_PRIOR_PERSPECTIVE] * 2 + [_PRIOR_SCALE] * len(groups) + [_PRIOR_SHIFT]
            prior = np.concatenate([prior, np.array(deviations) ** -2])
        else:
            shared = shared[:, :5]
        self._shared, self._own, self._prior = shared, own, np.diag(prior)
        products = shared[:, :, None] * shared[:, None]
        self._products = products.reshape(len(shared), -1)

    def solve(self, values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the unknowns, shape (k, n), and the normal matrices of weighted least squares."""
        count, known = len(values), self._shared.shape[1]
        weighted = weights[..., None] * self._own
        mixed = weighted.transpose(0, 2, 1) @ self._shared
        normal = np.empty((count, *self._prior.shape))
        normal[:, :known, :known] = (weights @ self._products).reshape(count, known, known)
        normal[:, known:, :known] = mixed
        normal[:, :known, known:] = mixed.transpose(0, 2, 1)
        normal[:, known:, known:] = weighted.transpose(0, 2, 1) @ self._own
        normal += self._prior
        right = np.concatenate(
            [(weights * values) @ self._shared, (weighted * values[..., None]).sum(axis=1)], axis=1
        )
        return np.linalg.solve(normal, right[..., None])[..., 0], normal

    def displacement(self, unknowns: np.ndarray) -> np.ndarray:
        """Return how far unknowns, shape (k, n), move the edges, dot radii, shape (k, m)."""
        known = self._shared.shape[1]
        own = (self._own @ unknowns[:, known:, None])[..., 0]
        return unknowns[:, :known] @ self._shared.T + own

    def influence(self, normal: np.ndarray) -> np.ndarray:
        """Return what a weighted displacement does to the translation, shape (k, 2, m)."""
        known = self._shared.shape[1]
        inverse = np.linalg.inv(normal)[:, :2]
        own = inverse[:, :, known:] @ self._own.transpose(0, 2, 1)
        return inverse[:, :, :known] @ self._shared.T + own
