"""Sub-pixel frames of targets, from the edges of their circles in the original image.

Frames are moved onto measured edges by robust weighted least squares. Edges of light that cross a
target do not look like its own: the gray values beside them have another ratio, the profile is not
a step, or it does not lie on the circles. They lose their weight. A slope of the light, which
would move all edges to the same side, is taken from the profiles and corrected for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.array_record import ArrayRecord
from ahf_ros.features.circles import Circles, dot_circles
from ahf_ros.features.displacement_model import DisplacementModel
from ahf_ros.features.edge_covariance import common_errors, edge_covariance
from ahf_ros.features.edge_weights import EdgeWeights, weigh_edges
from ahf_ros.features.light_slope import LightSlope, common_slope, smooth_slopes, unevenness
from ahf_ros.features.profiles import BLURS, USUAL_BLUR, Edges, measure_edges
from ahf_ros.features.robust import geman_mcclure, geman_mcclure_gain, median, reweight, spread

ENOUGH = 0.5
"""Share of the expected edges from which a fit counts."""

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
_SHARPENED = 0.03  # slope of all edges that makes single slopes doubtful, 1/px
_OF_COMMON, _OF_SIZE = 1.1, 4.5  # of the variance of whole targets, as rendered scenes have it
_SYSTEMATIC = 0.001  # standard deviation of what pixels and interpolation do to a centre, px
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
        Usual gray value of the dark side of an edge, divided by the bright side's.
    bright : ndarray of float64, shape (k,)
        Usual gray value of the bright side.
    share : ndarray of float64, shape (k,)
        Share of the expected edges that were measured where they are expected.
    deviation : ndarray of float64, shape (k,)
        Standard deviation of these edges, px.
    covariance : ndarray of float64, shape (k, 2, 2)
        Of the image of the centre, px^2; NaN where it was not asked for.
    blur : ndarray of float64, shape (k,)
        Of the edges, standard deviation in px.
    edge_shift : ndarray of float64, shape (k,)
        By how much what is dark has grown on all edges, px; 0 for a single circle.
    """

    frames: np.ndarray
    polarity: np.ndarray
    contrast: np.ndarray
    bright: np.ndarray
    share: np.ndarray
    deviation: np.ndarray
    covariance: np.ndarray
    blur: np.ndarray
    edge_shift: np.ndarray

    @property
    def size(self) -> np.ndarray:
        """Radii of circles with the areas of the dots, px, shape (k,)."""
        return frame.mean_radii(self.frames)


_NO_FRAMES, _NO_COVARIANCES = np.zeros((0, 3, 3)), np.zeros((0, 2, 2))
NO_FITS = Fit(
    *[_NO_FRAMES, np.zeros(0, int), *np.zeros((4, 0)), _NO_COVARIANCES, *np.zeros((2, 0))]
)
"""An empty record."""


def fit_dots(
    gray: np.ndarray,
    frames: np.ndarray,
    polarity: np.ndarray,
    *,
    rays: int,
    reach: float,
    rounds: int = 2,
    blur: np.ndarray | None = None,
    covariances: bool = True,
) -> Fit:
    """Fit the ellipses of dots.

    Parameters
    ----------
    gray, frames, reach, rounds, blur, covariances
        As for `fit_circles`.
    polarity : ndarray of int, shape (k,)
        1 for a dark dot, -1 for a bright one.
    rays : int
        Number of points about a dot.
    """
    return fit_circles(
        gray,
        frames,
        dot_circles(polarity, rays),
        reach=reach,
        projective=False,
        rounds=rounds,
        blur=blur,
        covariances=covariances,
    )


def fit_circles(
    gray: np.ndarray,
    frames: np.ndarray,
    circles: Circles,
    *,
    reach: float | np.ndarray,
    projective: bool,
    rounds: int = 2,
    blur: np.ndarray | None = None,
    covariances: bool = True,
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
        Otherwise it is the centre of the ellipse.
    rounds : int
        Number of measurements.
    blur : ndarray of float64, shape (k,), optional
        Of the edges, as far as it is known: standard deviation in px.
    covariances : bool
        Whether covariances are needed; they are NaN otherwise.
    """
    blur = np.full(len(frames), USUAL_BLUR) if blur is None else blur
    window = _window(circles)
    for remaining in reversed(range(rounds)):
        edges = measure_edges(gray, frames, circles, blur, reach)
        blur = np.clip(blur + median(edges.softness, edges.visible, 0.0), *BLURS)
        solution = _solve(edges, circles, window, projective)
        of_frame = solution.changes[:, :7]
        np.clip(of_frame, -_MAXIMUM_CHANGE, _MAXIMUM_CHANGE, out=of_frame)
        if remaining:
            frames = frame.moved(frames, solution.changes[:, : 7 if projective else 5])
    return _fit(solution, frames, circles, blur, covariances)


@dataclass(frozen=True, slots=True)
class _Solution:
    """Changes of frames that bring circles onto edges, and what they were computed from."""

    edges: Edges
    own: EdgeWeights
    light: LightSlope
    model: DisplacementModel
    changes: np.ndarray
    normal: np.ndarray
    weights: np.ndarray
    errors: np.ndarray
    relative: np.ndarray
    robust: np.ndarray


def _solve(edges: Edges, circles: Circles, window: np.ndarray, projective: bool) -> _Solution:
    """Return the changes of the frames that bring the circles onto the edges."""
    own = weigh_edges(edges)
    light = _light(edges, own.weights, circles, window)
    displacement = (edges.offset - edges.sensitivity * light.slope) / edges.scale
    noise = _NOISE * np.sqrt(2 * np.sqrt(np.pi) * USUAL_BLUR)
    deviation = noise / np.maximum(edges.bright - edges.dark, _MINIMUM_STEP) / edges.scale
    model = DisplacementModel(circles, edges.scale, projective)

    def solve(
        weights: np.ndarray,
    ) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
        changes, normal = model.solve(displacement, weights)
        errors = displacement - model.displacement(changes)
        return (changes, normal, errors), np.abs(errors) / deviation

    weights = own.weights / deviation**2
    (changes, normal, errors), relative, robust = reweight(
        solve, weights, lambda sizes: _OUTLIER * spread(sizes, own.seen, _MINIMUM_SPREAD), _ROUNDS
    )
    return _Solution(edges, own, light, model, changes, normal, weights, errors, relative, robust)


def _fit(
    of: _Solution, frames: np.ndarray, circles: Circles, blur: np.ndarray, covariances: bool
) -> Fit:
    """Return the fit of frames, which are those before the solution, with its quality."""
    edges, own = of.edges, of.own
    placed = own.seen & (of.relative < _PLACED) & (np.abs(of.errors) < _PLACED_RADII)
    count = placed.sum(axis=1)
    share = count / np.maximum(edges.visible.sum(axis=1), 1)
    squares = np.where(placed, of.errors * edges.scale, 0) ** 2
    scatter = np.sqrt(squares.sum(axis=1) / np.maximum(count, 1))
    bright = median(np.maximum(edges.bright, 0), own.seen)
    covariance = np.full((len(frames), 2, 2), np.nan)
    if covariances:
        covariance = _covariance(of, frames, circles)
    polarity = circles.polarity[:, 0]
    moved = frame.moved(frames, of.changes[:, : 7 if of.model.projective else 5])
    affine = frame.local_affine(moved)
    covariance = affine @ covariance @ affine.transpose(0, 2, 1) + _SYSTEMATIC**2 * np.eye(2)
    shift = -of.changes[:, -1] if of.model.projective else np.zeros(len(frames))
    return Fit(
        frames=moved,
        polarity=polarity,
        contrast=own.contrast,
        bright=bright,
        share=share,
        deviation=scatter,
        covariance=covariance,
        blur=blur,
        edge_shift=shift,
    )


def _covariance(of: _Solution, frames: np.ndarray, circles: Circles) -> np.ndarray:
    """Return the covariances of the centres, shape (k, 2, 2), squared dot radii."""
    edges, errors = of.edges, of.errors
    # What an error changes is not its weight times the error, but the derivative of that.
    gain = geman_mcclure_gain(of.weights, of.relative).sum(axis=1)
    gain = np.maximum(gain / np.maximum(of.robust.sum(axis=1), _NO_WEIGHT), _MINIMUM_GAIN)
    influence = of.model.influence(of.normal) * (of.robust / gain[:, None])[:, None]
    parts = influence * errors[:, None]
    parts -= of.light.influence(influence * (edges.sensitivity / edges.scale)[:, None])
    used = geman_mcclure(of.own.weights, of.relative)
    common = common_errors(used * errors * edges.scale, circles.radii)
    covariance = edge_covariance(parts, used, edges.spacing, of.normal.shape[1], common)
    variance = 1 + unevenness(of.light.errors, used)
    if of.model.projective:
        variance *= _OF_COMMON * common * np.exp(-_OF_SIZE / frame.mean_radii(frames))
    covariance *= variance[:, None, None]
    return covariance


def _light(edges: Edges, weights: np.ndarray, circles: Circles, window: np.ndarray) -> LightSlope:
    """Return the slope of the light along the circles."""
    common = common_slope(edges.slope, circles.polarity, weights)
    prior = _LIGHT_PRIOR / edges.scale.mean(axis=1, keepdims=True)
    # Where edges were sharpened, none of their slopes is the light's.
    prior *= (1 + (common / _SHARPENED) ** 2) ** 2
    slopes = edges.slope - circles.polarity * common
    return smooth_slopes(slopes, weights, window, prior)


def _window(circles: Circles) -> np.ndarray:
    """Return the weights of the light at other points of the same circle, (m, m)."""
    angles, radii = (np.asarray(of, float).tobytes() for of in (circles.angles, circles.radii))
    return _window_of(angles, radii)


@lru_cache(maxsize=8)  # up to two megabytes each; the same circles are fitted again and again
def _window_of(angles: bytes, radii: bytes) -> np.ndarray:
    """Return the same for angles and radii of float64."""
    around, lengths = np.frombuffer(angles), np.frombuffer(radii)
    points = lengths[:, None] * np.stack([np.cos(around), np.sin(around)], axis=1)
    squares = 2 * (lengths**2 - points @ points.T)
    squares[lengths[:, None] != lengths] = np.inf
    window = np.exp(-0.5 * squares / _LIGHT_REACH**2)
    window = (window / window.sum(axis=0)).astype(np.float32)
    window.flags.writeable = False
    return window
