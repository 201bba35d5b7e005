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

from ahf_ros import kernels
from ahf_ros.vision.edge_errors import EdgeWeights, LightSlope, weigh_edges
from ahf_ros.vision.profiles import USUAL_BLUR, Edges, OutlinePoints, measure_outlines
from ahf_ros.vision.robust import NORMAL

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
    of_outlines = outlines.points, outlines.normals, outlines.curvature, outlines.spacing
    points, normals, *sizes = kernels.edge_points(frames, *of_outlines, _NO_LENGTH)
    return OutlinePoints(points, normals, outlines.polarity, *sizes)


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
    found = kernels.outline_fits(
        edges.offset,
        edges.sensitivity,
        light.slope,
        edges.dark,
        edges.bright,
        edges.scale,
        outlines.polarity,
        own.seen,
        own.weights,
        kind.basis,
        kind.prior,
        _NOISE,
        _UNEVEN_LIGHT if kind.relative_to == 'light' else 0.0,
        _MINIMUM_STEP,
        NORMAL,
        _OUTLIER,
        kind.minimum,
        kind.relative_to == 'px',
        kind.rounds,
    )
    return EdgeFit(edges, own, light, *found[:6])
