"""Sub-pixel frames of targets, from the edges of their circles in the original image."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from ahf_ros import kernels
from ahf_ros.vision import frame
from ahf_ros.vision.array_record import ArrayRecord
from ahf_ros.vision.edge_errors import (
    NO_WEIGHT,
    EdgeWeights,
    LightSlope,
    common_errors,
    edge_covariance,
    smooth_slopes,
    unevenness,
)
from ahf_ros.vision.edge_fit import WEAK_PRIOR, EdgeFit, EdgeKind, Outlines, fit_edges
from ahf_ros.vision.growth import growth_in_light
from ahf_ros.vision.profiles import BLURS, SOFTEST, USUAL_BLUR, Edges
from ahf_ros.vision.pyramid import halved
from ahf_ros.vision.robust import median

ENOUGH = 0.5
"""Share of the expected edges from which a fit counts."""

SOFT = 1.0
"""Blur from which on an edge is soft, standard deviation in px."""

_SOFT_ROUNDS = 4  # of measurements of soft edges
_MINIMUM_SPREAD = 0.5  # that counts as usual, in deviations that noise alone would cause
_ROUNDS = 4  # of robust least squares
_PLACED, _PLACED_RADII = 4 / 3, 0.08  # error of an edge in its place: in outliers, and dot radii
_MINIMUM_GAIN = 0.2  # where many errors lie beyond the turning point of the weight function
_MAXIMUM_CHANGE = 0.3  # of a frame in one measurement, dot radii
_LIGHT_REACH = 0.3  # standard deviation of the window in which the light is even, dot radii
_LIGHT_ROUNDS = 2  # of its smoothing
_LIGHT_PRIOR = 5.0  # px of whole edges that say as much of the slope as the prior, none, does
_FAR = 5.5 * _LIGHT_REACH  # from where on light tells nothing of a point
_SHARPENED = 0.03  # slope of all edges that makes single slopes doubtful, 1/px
_UNEVEN = 0.011  # usual error of slopes where light is no slope within a profile, 1/px
# Of the variance of whole targets: a factor, px, by how uneven light is about the dot, and how
# uneven it seems in even light, 1/px. They are those of 4038 centres in scenes of both makers, of
# the seeds 1 to 3, by maximum likelihood.
_OF_LIGHT, _EVEN = 78.0, 0.0085
_LONG = 6.0  # radius of dots, px, from which profiles are long enough for slopes to tell of light
_PRIOR_SCALE = 0.003  # standard deviation of the printed proportions of circles and dot
_PRIOR_LIT_SCALE = 0.02  # the same as uneven light shows them
_PRIOR_PERSPECTIVE = 0.02  # of the projective part, in 1 a dot radius
_PRIOR_SHIFT = 1.0  # of the growth of ink, px


@dataclass(frozen=True, slots=True)
class Fit(ArrayRecord):
    """Frames of k targets fitted to edges."""

    frames: np.ndarray  # (k, 3, 3)
    polarity: np.ndarray  # int, (k,), 1 for a dark target on bright ground, -1 for a bright one
    contrast: np.ndarray  # (k,), usual gray value of the dark side of edges over the bright side's
    bright: np.ndarray  # (k,), usual gray value of the bright side
    share: np.ndarray  # (k,), of expected edges, or of the dot's if fewer, that are in place
    deviation: np.ndarray  # (k,), standard deviation of these edges, px
    covariance: np.ndarray  # (k, 2, 2), of the image of the centre, px^2; NaN if not asked for
    blur: np.ndarray  # (k,), of the edges, standard deviation in px
    edge_shift: np.ndarray  # (k,), by which dark gray values have grown, px; 0: a single circle
    proportion: np.ndarray  # (k,), of the first circles beyond the dot, to those of their print

    @property
    def size(self) -> np.ndarray:
        """Radii of circles with the areas of the dots, px, shape (k,)."""
        return frame.mean_radii(self.frames)

    @property
    def growth(self) -> np.ndarray:
        """By how much what is dark has grown in light, px, shape (k,)."""
        return growth_in_light(self.edge_shift, self.blur, self.contrast)

    @property
    def clearness(self) -> np.ndarray:
        """How whole outlines are, and how dark ink is, from 0 to 1, shape (k,)."""
        return self.share * (1 - self.contrast)

    def enlarged(self) -> Fit:
        """Return the same in px of the image of which it was fitted to a half."""
        return replace(
            self,
            frames=frame.enlarged(self.frames, 1),
            deviation=2 * self.deviation,
            covariance=4 * self.covariance,
            blur=2 * self.blur,
            edge_shift=2 * self.edge_shift,
        )

    def clearest(self, most: int | None = None) -> np.ndarray:
        """Return the indices of the clearest targets, these first, so many at the most."""
        return np.argsort(-self.clearness, kind='stable')[:most]


_NO_FRAMES, _NO_COVARIANCES = np.zeros((0, 3, 3)), np.zeros((0, 2, 2))
NO_FITS = Fit(
    *[_NO_FRAMES, np.zeros(0, int), *np.zeros((4, 0)), _NO_COVARIANCES, *np.zeros((3, 0))]
)
"""An empty record."""


def on_circles(
    angles: np.ndarray, radii: np.ndarray, group: np.ndarray, polarity: np.ndarray
) -> Outlines:
    """Return points on the circles of k targets, at angles in the frame, rad, and radii, (m,).

    Circles come in the order of their radii, in dot radii. The first point is on the outline of
    the target or its dot, and has its polarity; group 0 is the dot.
    """
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    spacing = 2 * np.pi * radii / (radii[:, None] == radii).sum(axis=1)
    points = radii[:, None] * normals
    return Outlines(points, normals, 1 / radii, spacing, radii, group, polarity)


def dot_circles(polarity: np.ndarray, rays: int) -> Outlines:
    """Return the edges of dots, `rays` points each; polarity (k,) is 1 for dark dots, else -1."""
    angles = 2 * np.pi * np.arange(rays) / rays
    of_points = np.repeat(np.asarray(polarity)[:, None], rays, axis=1)
    return on_circles(angles, np.ones(rays), np.zeros(rays, int), of_points)


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
    """Fit the ellipses of dots at `rays` points, as `fit_circles` does for `dot_circles`."""
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


def fit_circles_of_any_blur(
    gray: np.ndarray,
    frames: np.ndarray,
    circles: Outlines,
    *,
    reach: float | np.ndarray,
    projective: bool,
    rounds: int = 2,
) -> Fit:
    """Move frames onto the edges of circles as `fit_circles`, and those with soft edges once more.

    How soft edges are is known only when they have been measured. A step that is sharper than an
    edge is fitted to a part of it, at the wrong place. The shortest profiles, of 1 px, show the
    usual blur, and longer ones as much softer edges: beyond, the fit of a narrow ellipse is lost.
    Edges that are softer than profiles are measured in the image at half its size.
    """
    softest = np.clip(USUAL_BLUR * np.ravel(reach) * frame.ellipse_axes(frames)[1], *BLURS)
    fit = fit_circles(
        gray,
        frames,
        circles,
        reach=reach,
        projective=projective,
        rounds=rounds,
        softest=softest,
    )
    soft = np.flatnonzero((fit.blur > SOFT) & (fit.share >= ENOUGH))
    if not soft.size:
        return fit
    first = fit.select(soft)
    again = fit_circles(
        gray,
        first.frames,
        replace(circles, polarity=circles.polarity[soft]),
        reach=np.broadcast_to(reach, (len(frames), 1))[soft],
        projective=projective,
        rounds=_SOFT_ROUNDS,
        blur=first.blur,
        softest=softest[soft],
    )
    good = again.share >= ENOUGH
    fit = fit.replaced(soft[good], again.select(good))
    softer = np.flatnonzero((fit.blur >= SOFTEST) & (fit.share >= ENOUGH))
    if not softer.size:
        return fit
    again = fit_circles_of_any_blur(
        halved(gray, 1)[1],
        frame.enlarged(fit.frames[softer], -1),
        replace(circles, polarity=circles.polarity[softer]),
        reach=np.broadcast_to(reach, (len(frames), 1))[softer],
        projective=projective,
        rounds=_SOFT_ROUNDS,
    ).enlarged()
    good = again.share >= ENOUGH
    return fit.replaced(softer[good], again.select(good))


def fit_circles(
    gray: np.ndarray,
    frames: np.ndarray,
    circles: Outlines,
    *,
    reach: float | np.ndarray,
    projective: bool,
    rounds: int = 2,
    blur: np.ndarray | None = None,
    softest: float | np.ndarray = BLURS[1],
    covariances: bool = True,
    uneven: bool = False,
) -> Fit:
    """Move frames, shape (k, 3, 3) and right to about two pixels, onto the edges of circles.

    Edges within `reach` of a circle, dot radii, a number or of shape (k, 1), are measured `rounds`
    times in `gray`, float32 from 0 to 255. In a projective fit the circles have different radii,
    so that they determine the common centre; otherwise it is the centre of the ellipse. `blur`,
    shape (k,), is the standard deviation of the edges, px, as far as it is known, and `softest`
    the largest one that is tried. `uneven` light moves edges as noise does; the share is the dot's
    where less of the dot is in place.
    """
    blur = np.full(len(frames), USUAL_BLUR) if blur is None else blur
    kind = _kind(circles, projective=projective, uneven=uneven)
    moved = frames
    for _ in range(rounds):
        frames = moved
        fit = fit_edges(gray, frames, circles, kind, blur, reach)
        edges = fit.edges
        blur = np.clip(blur + median(edges.softness, edges.visible, 0.0), BLURS[0], softest)
        of_frame = fit.unknowns[:, : 7 if projective else 5]
        moved = frame.moved(frames, np.clip(of_frame, -_MAXIMUM_CHANGE, _MAXIMUM_CHANGE))
    seen, errors = fit.own.seen, fit.errors
    placed = seen & (fit.relative < _PLACED) & (np.abs(errors) < _PLACED_RADII)
    count = placed.sum(axis=1)
    shares = [_share(placed, edges.visible)]
    if uneven:
        # A band about another dot has most of its edges in place, but not those of the dot.
        dot = circles.group == 0
        shares.append(_share(placed[:, dot], edges.visible[:, dot]))
    squares = np.where(placed, errors * edges.scale, 0) ** 2
    covariance = np.full((len(frames), 2, 2), np.nan)
    if covariances:
        covariance = _covariance(fit, frames, circles, kind, projective)
    return Fit(
        frames=moved,
        polarity=circles.polarity[:, 0],
        contrast=fit.own.contrast,
        bright=median(np.maximum(edges.bright, 0), seen),
        share=np.min(shares, axis=0),
        deviation=np.sqrt(squares.sum(axis=1) / np.maximum(count, 1)),
        covariance=frame.centre_covariance(moved, covariance),
        blur=blur,
        edge_shift=fit.unknowns[:, -1] if projective else np.zeros(len(frames)),
        proportion=1 + fit.unknowns[:, 7] if projective else np.ones(len(frames)),
    )


def _share(placed: np.ndarray, visible: np.ndarray) -> np.ndarray:
    """Return the shares of the visible edges that are in place, shape (k,), both (k, m)."""
    return np.asarray(placed.sum(axis=1) / np.maximum(visible.sum(axis=1), 1))


def _kind(circles: Outlines, *, projective: bool, uneven: bool) -> EdgeKind:
    """Return what moves the edges of circles.

    The unknowns are the changes in the order of `frame.displacement_basis`. In a projective fit
    the scale of each group of circles, and the growth of ink, which the gamma of a camera causes,
    too, follow.
    """
    x, y = circles.points.T
    radii = np.hypot(x, y)
    basis, prior = frame.displacement_basis(np.arctan2(y, x), radii), np.full(5, WEAK_PRIOR)
    if projective:
        groups = np.arange(1, circles.group.max(initial=0) + 1)
        scales = np.where(circles.group[:, None] == groups, radii[:, None], 0)
        basis = np.concatenate([basis, scales], axis=1)
        of_scale = _PRIOR_LIT_SCALE if uneven else _PRIOR_SCALE
        deviations = [_PRIOR_PERSPECTIVE] * 2 + [of_scale] * len(groups) + [_PRIOR_SHIFT]
        prior = np.concatenate([prior, np.array(deviations) ** -2])
    else:
        basis = basis[:, :5]
    window = _light_window(circles)

    def smooth(edges: Edges, own: EdgeWeights, polarity: np.ndarray) -> LightSlope:
        prior = _LIGHT_PRIOR / edges.scale.mean(axis=1)
        return smooth_slopes(
            edges, polarity, own.weights, window, prior, _SHARPENED, _LIGHT_ROUNDS
        )

    relative_to: Literal['noise', 'light'] = 'light' if uneven else 'noise'
    return EdgeKind(basis, prior, smooth, relative_to, _MINIMUM_SPREAD, _ROUNDS)


def _covariance(
    of: EdgeFit, frames: np.ndarray, circles: Outlines, kind: EdgeKind, projective: bool
) -> np.ndarray:
    """Return the covariances of the centres, shape (k, 2, 2), squared dot radii."""
    edges, light = of.edges, of.light
    parts, used, *_ = kernels.edge_parts(
        kind.basis,
        circles.polarity,
        edges.scale,
        edges.sensitivity,
        of.normal,
        of.own.weights,
        of.relative,
        of.weights,
        of.robust,
        of.errors,
        light.errors,
        light.weights,
        light.totals,
        _light_window(circles),
        _MINIMUM_GAIN,
        NO_WEIGHT,
    )
    common = common_errors(used * of.errors * edges.scale, circles.line)
    covariance = edge_covariance(parts, used, edges.spacing, of.normal.shape[1], common)
    short = np.minimum(frame.mean_radii(frames) / _LONG, 1) ** 2
    if projective:
        dot = circles.group == 0
        uneven = unevenness(light.errors[:, dot], used[:, dot])
        variance = _OF_LIGHT * (uneven + _EVEN) * short
    else:
        variance = 1 + short * np.minimum((unevenness(light.errors, used) / _UNEVEN) ** 2, 1)
    return np.asarray(covariance * variance[:, None, None])


def _light_window(circles: Outlines) -> np.ndarray:
    return _window(circles.points.tobytes(), circles.line.tobytes())


@lru_cache(maxsize=8)  # up to two megabytes each; the same circles are fitted again and again
def _window(points: bytes, lines: bytes) -> np.ndarray:
    """Return the weights of the light at other points of the same circle, (m, m), from float64."""
    places, line = np.frombuffer(points).reshape(-1, 2), np.frombuffer(lines)
    lengths = (places**2).sum(axis=1)
    squares = lengths[:, None] + lengths - 2 * places @ places.T
    squares[line[:, None] != line] = np.inf
    window = np.where(squares < _FAR**2, np.exp(-0.5 * squares / _LIGHT_REACH**2), 0)
    window = (window / window.sum(axis=0)).astype(np.float32)
    window.flags.writeable = False
    return window
