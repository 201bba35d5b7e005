"""Sub-pixel frames of targets, from the edges of their circles in the original image.

Frames are moved onto measured edges by robust weighted least squares. Edges of light that cross a
target do not look like its own: the gray values beside them have another ratio, the profile is not
a step, or it does not lie on the circles. They lose their weight. A slope of the light, which
would move all edges to the same side, is taken from the profiles and corrected for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.circles import Circles, dot_circles, ring_circles
from ahf_ros.features.edge_weights import median, trust_edges
from ahf_ros.features.profiles import BLURS, CORRELATION, USUAL_BLUR, Edges, measure_edges

__all__ = ['Circles', 'Fit', 'dot_circles', 'fit_circles', 'ring_circles']

_NOISE = 1.0  # of gray values, of 255; the fit scales it to what it finds
_OUTLIER = 3.0  # times the usual distance from the circle that quarters the trust
_ROUNDS = 4  # of robust least squares
_LIGHT_REACH = 0.3  # standard deviation of the window in which the light is even, dot radii
_LIGHT_PRIOR = 5.0  # px of trusted edges that say as much of the slope as the prior, none, does
_SHARPENED = 0.03  # slope of all edges that makes those of single ones doubtful, 1/px
_LEAST_SLOPE_ERROR = 0.002  # that counts as usual, 1/px
_UNEVEN_LIGHT = 0.011  # usual error of slopes from which the variance of a centre is twice, 1/px
_PRIOR_SCALE = 0.003  # standard deviation of the printed proportions of band and dot
_PRIOR_PERSPECTIVE = 0.02  # of the projective part, in 1 a dot radius
_PRIOR_SHIFT = 1.0  # of the shift of edges towards the dark side, px
_WEAK_PRIOR = 1e-6
_SYSTEMATIC = 0.001  # standard deviation of what pixels and interpolation do to a centre, px


@dataclass(frozen=True, slots=True)
class Fit:
    """Frames fitted to edges.

    Attributes
    ----------
    frames : ndarray of float64, shape (k, 3, 3)
    contrast : ndarray of float64, shape (k,)
        Usual gray value of the dark side of an edge over that of the bright side.
    bright : ndarray of float64, shape (k,)
        Usual gray value of the bright side.
    share : ndarray of float64, shape (k,)
        Share of the expected edges that were found in their place.
    deviation : ndarray of float64, shape (k,)
        Standard deviation of the edges that were, px.
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the centre, px^2.
    blur : ndarray of float64, shape (k,)
        Of the edges, standard deviation in px.
    """

    frames: np.ndarray
    contrast: np.ndarray
    bright: np.ndarray
    share: np.ndarray
    deviation: np.ndarray
    covariance: np.ndarray
    blur: np.ndarray

    def chosen(self, which: np.ndarray) -> Fit:
        """Return the fits of some of the frames."""
        return Fit(*(getattr(self, item.name)[which] for item in fields(self)))

    @staticmethod
    def joined(parts: Sequence[Fit]) -> Fit:
        """Return the fits of all the frames, one part after the other."""
        names = [item.name for item in fields(Fit)]
        return Fit(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def fit_circles(
    gray: np.ndarray,
    frames: np.ndarray,
    circles: Circles,
    *,
    reach: float,
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
    reach : float
        How far from an expected edge to look, dot radii.
    projective : bool
        Whether the circles have different radii, so that they show where the common centre is.
        Without, the centre is that of the ellipse.
    rounds : int
        Number of measurements.

    Returns
    -------
    Fit
    """
    blur = np.full(len(frames), USUAL_BLUR)
    for _ in range(rounds):
        edges = measure_edges(gray, frames, circles, blur, reach)
        blur = np.clip(blur + median(edges.softness, edges.visible, 0.0), *BLURS)
        changes, fit = _solve(frames, circles, edges, blur, projective)
        frames = frame.moved(frames, np.clip(changes[:, : 7 if projective else 5], -0.3, 0.3))
    affine = frame.local_affine(frames)
    covariance = affine @ fit.covariance @ affine.transpose(0, 2, 1)
    covariance += _SYSTEMATIC**2 * np.eye(2)
    return replace(fit, frames=frames, covariance=covariance)


def _solve(
    frames: np.ndarray, circles: Circles, edges: Edges, blur: np.ndarray, projective: bool
) -> tuple[np.ndarray, Fit]:
    """Return the changes of the frames that bring the circles onto the edges."""
    expected = edges.visible
    trusted = trust_edges(edges)
    seen, trust = trusted.seen, trusted.trust
    light = _light(edges, trust, circles)
    displacement = (edges.offset - edges.sensitivity * light.slope) / edges.scale
    noise = _NOISE * np.sqrt(2 * np.sqrt(np.pi) * USUAL_BLUR)
    deviation = noise / np.maximum(edges.bright - edges.dark, 1.0) / edges.scale
    model = _Model(circles, edges.scale, projective)
    weights = trust / deviation**2
    robust = weights
    for _ in range(_ROUNDS):
        changes, normal = model.solve(displacement, robust)
        errors = displacement - model.displacement(changes)
        relative = np.abs(errors) / deviation
        spread = np.maximum(1.4826 * median(relative, seen), 0.5)[:, None]
        doubt = (relative / (_OUTLIER * spread)) ** 2
        robust = weights / (1 + doubt) ** 2
    placed = seen & (relative < 4 * spread) & (np.abs(errors) < 0.08)
    share = placed.sum(axis=1) / np.maximum(expected.sum(axis=1), 1)
    squares = np.where(placed, errors * edges.scale, 0) ** 2
    scatter = np.sqrt(squares.sum(axis=1) / np.maximum(placed.sum(axis=1), 1))
    # What an error changes is not its weight times the error, but the derivative of that.
    gain = (weights * (1 - 3 * doubt) / (1 + doubt) ** 3).sum(axis=1)
    gain = np.maximum(gain / np.maximum(robust.sum(axis=1), 1e-9), 0.2)
    influence = model.influence(normal) * (robust / gain[:, None])[:, None]
    parts = influence * errors[:, None]
    parts -= light.influence(influence * (edges.sensitivity / edges.scale)[:, None])
    used = trust / (1 + doubt) ** 2
    covariance = _covariance(parts, used, edges.spacing, normal.shape[1])
    # Where slopes differ that much from their neighbours, light is no slope within a profile.
    uneven = (used * light.errors**2).sum(axis=1) / np.maximum(used.sum(axis=1), 1e-9)
    covariance *= (1 + np.minimum(uneven / _UNEVEN_LIGHT**2, 1))[:, None, None]
    bright = median(np.maximum(edges.bright, 0), seen)
    fit = Fit(frames, trusted.contrast, bright, share, scatter, covariance, blur)
    return changes, fit


@dataclass(frozen=True, slots=True)
class _Light:
    """The slope of the light along circles, smoothed."""

    slope: np.ndarray  # (k, m), outwards, 1/px
    errors: np.ndarray  # (k, m), of the slopes of the single profiles
    weights: np.ndarray  # (k, m), of these
    totals: np.ndarray  # (k, m), of the weights that a smoothed slope is made from
    window: np.ndarray  # (m, m), what each profile adds to each smoothed slope

    def influence(self, of_slopes: np.ndarray) -> np.ndarray:
        """Return what the errors do, given what the smoothed slopes do, shape (k, n, m) both."""
        of_profiles = (of_slopes / self.totals[:, None]) @ self.window.T
        return of_profiles * (self.weights * self.errors)[:, None]


def _light(edges: Edges, trust: np.ndarray, circles: Circles) -> _Light:
    """Return the slope of the light along the circles."""
    # What all edges have towards their bright side is not the light's: the blur is another than
    # that of the step, or edges were sharpened, and then none of their slopes is the light's.
    common = (trust * circles.polarity * edges.slope).sum(axis=1)
    common /= np.maximum(trust.sum(axis=1), 1e-9)
    slopes = edges.slope - circles.polarity * common[:, None]
    window = _window(circles)
    seen = trust > 0
    middle = median(slopes, seen)[:, None]
    usual = np.maximum(median(np.abs(slopes - middle), seen), _LEAST_SLOPE_ERROR)[:, None]
    prior = _LIGHT_PRIOR / edges.scale.mean(axis=1, keepdims=True)
    prior *= (1 + (common[:, None] / _SHARPENED) ** 2) ** 2
    weights = trust
    for _ in range(2):
        totals = weights @ window + prior
        smooth = (weights * slopes) @ window / totals
        errors = slopes - smooth
        used, weights = weights, trust / (1 + (errors / (3 * usual)) ** 2)
    return _Light(smooth, errors, used, totals, window)


def _window(circles: Circles) -> np.ndarray:
    """Return the weights by which points see the light of others on the same circle, (m, m)."""
    points = circles.radii[:, None] * np.stack(
        [np.cos(circles.angles), np.sin(circles.angles)], axis=1
    )
    squares = 2 * (circles.radii**2 - points @ points.T)
    squares[circles.radii[:, None] != circles.radii] = np.inf
    window = np.exp(-0.5 * squares / _LIGHT_REACH**2)
    return window / window.sum(axis=0)


def _covariance(
    parts: np.ndarray, trust: np.ndarray, spacing: np.ndarray, unknowns: int
) -> np.ndarray:
    """Return the covariance of centres, dot radii^2, from what each edge's error does to them.

    Neighbours closer than `CORRELATION` share pixels, so that their errors are alike. Their
    products are not taken as they are: a fit leaves little of what they have in common.
    """
    distance = np.maximum(spacing / CORRELATION, 0.1)
    alike = np.ones_like(distance)
    for steps in range(1, 10):
        alike += 2 * np.maximum(1 - steps * distance, 0)
    count = trust.sum(axis=1) ** 2 / np.maximum((trust**2 * alike).sum(axis=1), 1e-9)
    free = count / np.maximum(count - unknowns, 1)
    return free[:, None, None] * ((parts * alike[:, None]) @ parts.transpose(0, 2, 1))


class _Model:
    """How changes of k frames, and of what else is unknown, move their edges outwards.

    The unknowns are the changes in the order of `frame.displacement_basis`. In a projective model
    the scale of the band, and the shift of all edges towards the dark side which the gamma of a
    camera causes, follow.
    """

    def __init__(self, circles: Circles, scale: np.ndarray, projective: bool) -> None:
        shared = frame.displacement_basis(circles.angles, circles.radii)
        own = np.zeros((len(scale), len(shared), 0))
        prior: np.ndarray = np.full(9, _WEAK_PRIOR)
        prior[5:7], prior[7:] = _PRIOR_PERSPECTIVE**-2, (_PRIOR_SCALE**-2, _PRIOR_SHIFT**-2)
        if projective:
            band = np.where(circles.radii > 1, circles.radii, 0)
            self._shared = np.concatenate([shared, band[:, None]], axis=1)
            own = (-circles.polarity / scale)[..., None]
        else:
            self._shared, prior = shared[:, :5], prior[:5]
        self._own, self._prior = own, np.diag(prior)
        products = self._shared[:, :, None] * self._shared[:, None]
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
