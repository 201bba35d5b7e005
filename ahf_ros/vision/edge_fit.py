"""Prints fitted to their edges in the original image, whatever the outlines are.

A small change of a frame moves edges by amounts that are linear in it; so do the scales of parts
of a print, and the growth of ink. Robust weighted least squares bring all edges of a target onto
those that are measured. Edges of light that cross a target do not look like its own: the gray
values beside them have another ratio, the profile is not a step, or it does not lie on an outline.
They lose their weight. A slope of the light, which would move all edges to the same side, is taken
from the profiles and corrected for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ahf_ros.vision.edge_errors import EdgeWeights, LightSlope, weigh_edges
from ahf_ros.vision.profiles import USUAL_BLUR, Edges, OutlinePoints, measure_outlines
from ahf_ros.vision.robust import median, reweight, spread

WEAK_PRIOR = 1e-6
"""Inverse variance of an unknown of which nothing is known, so that it can be solved for."""

_NOISE = np.sqrt(2 * np.sqrt(np.pi) * USUAL_BLUR)
# Error of an edge, px, in its height, where gray values of 255 have an error of 1; the fit scales
# it to what it finds.
_UNEVEN_LIGHT = 0.1  # error of edges that light causes, in the first round, px
_MINIMUM_STEP = 1.0  # gray values, that the error of an edge is computed from
_OUTLIER = 3.0  # times the usual distance from an outline that quarters the weight
_NO_LENGTH = 1e-9  # px, instead of the image of an outline that has none


@dataclass(frozen=True, slots=True)
class Outlines:
    """Points on the outlines of the prints of k targets, where edges are expected.

    They lie in the plane of the print, whose origin is the centre. Those of a line follow each
    other, equally far apart. Lines of a group may have a scale of their own, known about as well
    as a print is, or be left out together.
    """

    points: np.ndarray  # float64, (m, 2)
    normals: np.ndarray  # float64, (m, 2), outwards, of length 1
    curvature: np.ndarray  # float64, (m,), positive where its centre lies inside
    spacing: np.ndarray  # float64, (m,), distances from each point to the next
    line: np.ndarray  # (m,), equal for the points of a line
    group: np.ndarray  # int, (m,)
    polarity: np.ndarray  # int, (k, m), 1 where the outside is brighter, -1 darker, 0 for no edge


def edge_points(frames: np.ndarray, outlines: Outlines) -> OutlinePoints:
    """Return where the outlines of targets with frames (k, 3, 3) have edges in the image."""
    normals = outlines.normals.T
    images = frames[:, :, :2] @ outlines.points.T + frames[:, :, 2:]
    depth = images[:, 2:]
    points = images[:, :2] / depth
    outwards, along = (
        (moved[:, :2] - points * moved[:, 2:]) / depth
        for moved in (frames[:, :, :2] @ of for of in (normals, [-normals[1], normals[0]]))
    )
    stretch = np.maximum(np.hypot(along[:, 0], along[:, 1]), _NO_LENGTH)
    area = outwards[:, 0] * along[:, 1] - outwards[:, 1] * along[:, 0]
    return OutlinePoints(
        points=points.transpose(0, 2, 1),
        normals=np.stack([along[:, 1], -along[:, 0]], axis=2) / stretch[..., None],
        polarity=outlines.polarity,
        scale=np.maximum(area / stretch, _NO_LENGTH),
        spacing=outlines.spacing * stretch,
        curvature=outlines.curvature * area / stretch**3,
    )


@dataclass(frozen=True, slots=True)
class EdgeKind:
    """What moves the edges of a kind of print, and how its own are told from others."""

    basis: np.ndarray  # (m, n), how far unknowns move edges outwards, units of the print
    prior: np.ndarray  # (n,) or, with the growth of ink in px, (n + 1,): inverse variances
    smooth: Callable[[Edges, EdgeWeights, np.ndarray], LightSlope]
    """Returns the light across edges, from their weights and their polarity."""

    relative_to: Literal['noise', 'light', 'px']
    """What errors are outliers by: of noise alone, of noise and what light adds, or of px."""

    minimum: float  # error that counts as usual, in that
    rounds: int  # of robust least squares


@dataclass(frozen=True, slots=True)
class EdgeFit:
    """Unknowns that bring outlines onto the edges of k targets, and what they come from."""

    edges: Edges
    own: EdgeWeights
    light: LightSlope
    model: _Model
    unknowns: np.ndarray  # (k, n)
    normal: np.ndarray  # (k, n, n)
    errors: np.ndarray  # (k, m), of edges, outwards, units of the print
    relative: np.ndarray  # (k, m), 1 for an error that leaves a quarter of the weight
    weights: np.ndarray  # (k, m), of edges without outliers, and...
    robust: np.ndarray  # ... what errors leave of them


def fit_edges(
    gray: np.ndarray,
    frames: np.ndarray,
    outlines: Outlines,
    kind: EdgeKind,
    blur: np.ndarray,
    reach: float | np.ndarray,
) -> EdgeFit:
    """Fit the outlines of targets, whose frames are right to about two pixels, to their edges.

    Edges within `reach` of an outline, units of the print, a number or of shape (k, 1), are
    measured in `gray`, float32 from 0 to 255. The standard deviations of edges, `blur`, are px of
    shape (k,). Where errors are relative to light, it moves edges as noise does, so that those in
    the light do not outweigh those in shadow by the square of their contrast.
    """
    edges = measure_outlines(gray, edge_points(frames, outlines), blur, reach)
    own = weigh_edges(edges)
    light = kind.smooth(edges, own, outlines.polarity)
    displacement = (edges.offset - edges.sensitivity * light.slope) / edges.scale
    of_noise = _NOISE / np.maximum(edges.bright - edges.dark, _MINIMUM_STEP) / edges.scale
    lit, in_px = kind.relative_to == 'light', kind.relative_to == 'px'
    usual_noise = median(of_noise, own.seen)[:, None] if lit else 0.0
    # Noise moves edges in shadow, light moves all of them.
    deviation = np.hypot(of_noise, _UNEVEN_LIGHT / edges.scale) if lit else of_noise

    def solve(weights: np.ndarray) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
        nonlocal deviation
        unknowns, normal = model.solve(displacement, weights / deviation**2)
        errors = displacement - model.displacement(unknowns)
        if lit:
            usual = spread(np.abs(errors), own.seen, 0.0)
            deviation = np.hypot(of_noise, np.sqrt(np.maximum(usual**2 - usual_noise**2, 0)))
        sizes = np.abs(errors)
        return (unknowns, normal, errors), sizes * edges.scale if in_px else sizes / deviation

    def scale(sizes: np.ndarray) -> np.ndarray:
        return _OUTLIER * spread(sizes, own.seen, kind.minimum)

    model = _Model(kind, outlines.polarity, edges.scale)
    (unknowns, normal, errors), relative, robust = reweight(solve, own.weights, scale, kind.rounds)
    weights, robust = (of / deviation**2 for of in (own.weights, robust))
    return EdgeFit(edges, own, light, model, unknowns, normal, errors, relative, weights, robust)


class _Model:
    """How unknowns move the edges of k targets outwards; the last may be the growth of ink."""

    def __init__(self, kind: EdgeKind, polarity: np.ndarray, scale: np.ndarray) -> None:
        self._shared, self._prior = kind.basis, np.diag(kind.prior)
        grown = len(kind.prior) - kind.basis.shape[1]
        self._own = (polarity / scale)[..., None][..., :grown]
        products = kind.basis[:, :, None] * kind.basis[:, None]
        self._products = products.reshape(len(kind.basis), -1)

    def normal(self, weights: np.ndarray) -> np.ndarray:
        """Return the normal matrices of weighted least squares, shape (k, n, n)."""
        count, known = len(weights), self._shared.shape[1]
        weighted = (weights[..., None] * self._own).transpose(0, 2, 1)
        mixed = weighted @ self._shared
        normal = np.empty((count, *self._prior.shape))
        normal[:, :known, :known] = (weights @ self._products).reshape(count, known, known)
        normal[:, known:, :known] = mixed
        normal[:, :known, known:] = mixed.transpose(0, 2, 1)
        normal[:, known:, known:] = weighted @ self._own
        return normal + self._prior

    def solve(self, values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the unknowns, shape (k, n), and the normal matrices of weighted least squares."""
        normal, weighted = self.normal(weights), weights * values
        own = (weighted[..., None] * self._own).sum(axis=1)
        right = np.concatenate([weighted @ self._shared, own], axis=1)
        return np.linalg.solve(normal, right[..., None])[..., 0], normal

    def displacement(self, unknowns: np.ndarray) -> np.ndarray:
        """Return how far unknowns, shape (k, n), move the edges, shape (k, m)."""
        known = self._shared.shape[1]
        own = (self._own @ unknowns[:, known:, None])[..., 0]
        return unknowns[:, :known] @ self._shared.T + own

    def influence(self, normal: np.ndarray) -> np.ndarray:
        """Return what weighted displacements do to the translation, shape (k, 2, m)."""
        known = self._shared.shape[1]
        inverse = np.linalg.inv(normal)[:, :2]
        own = inverse[:, :, known:] @ self._own.transpose(0, 2, 1)
        return inverse[:, :, :known] @ self._shared.T + own

    def rows(self) -> np.ndarray:
        """Return how far each unknown moves the edges, shape (k, m, n)."""
        shared = np.broadcast_to(self._shared, (len(self._own), *self._shared.shape))
        return np.concatenate([shared, self._own], axis=2)
