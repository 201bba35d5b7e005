"""Edges measured in gray values, on profiles across the outlines of targets.

Across each point of an outline a blurred step is fitted to the gray values. Besides the offset of
the step, the fit gives its levels, the slope of the light beside it and what it leaves
unexplained, which tell later how much weight the edge deserves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.features.circles import Circles
from ahf_ros.features.sampling import sample_lines, within
from ahf_ros.features.step_fit import ALONG, BLUR_STEP, HALF_WIDTHS, fit_steps

USUAL_BLUR = 0.8
"""Standard deviation of a step, px: a sharp lens, the area of a pixel and the interpolation."""

BLURS = (0.5, 4.0)
"""Sharpest and softest step that is fitted, standard deviation in px."""

CORRELATION = 1.9
"""Distance along an edge from where on the errors of profiles are independent, px."""

_ENOUGH, _ENOUGH_BLURS = 3.0, 2.5  # half width of a profile, px, or deviations of the step
_MAXIMUM_ASIDE = 0.8  # of the two lines of a profile, from its middle, px


@dataclass(frozen=True, slots=True)
class OutlinePoints:
    """Where the outlines of k targets have edges, at m points each.

    Attributes
    ----------
    points, normals : ndarray of float64, shape (k, m, 2)
        In px; normals point outwards and have the length 1.
    polarity : ndarray of int, shape (k, m)
        1 where the outside is brighter, -1 where it is darker, 0 where there is no edge.
    scale : ndarray of float64, shape (k, m)
        px a unit of the outline (the dot radius of a ring target), across the edge.
    spacing : ndarray of float64, shape (k, m)
        Distance from one point to the next along the edge, px.
    curvature : ndarray of float64, shape (k, m)
        Of the outline, 1/px, positive where its centre lies inside.
    """

    points: np.ndarray
    normals: np.ndarray
    polarity: np.ndarray
    scale: np.ndarray
    spacing: np.ndarray
    curvature: np.ndarray


@dataclass(frozen=True, slots=True)
class Edges:
    """The edges of k targets at m points each, shape (k, m) all.

    Attributes
    ----------
    offset : ndarray of float64
        Distance of the edge from the outline, outwards, px.
    dark, bright : ndarray of float64
        Gray values beside it.
    slope : ndarray of float64
        Slope of the light outwards, as a share of it, 1/px.
    sensitivity : ndarray of float64
        How far a slope of the light moves the offset outwards, px^2.
    softness : ndarray of float64
        Blur of the edge minus the blur of the step, standard deviations in px.
    residual : ndarray of float64
        Root mean square of what step, slope and blur do not explain, gray values.
    scale : ndarray of float64
        As in `OutlinePoints`, as is the next.
    spacing : ndarray of float64
    visible : ndarray of bool
        Whether an edge is expected and its profile lies in the image; what was measured is 0
        elsewhere.
    """

    offset: np.ndarray
    dark: np.ndarray
    bright: np.ndarray
    slope: np.ndarray
    sensitivity: np.ndarray
    softness: np.ndarray
    residual: np.ndarray
    scale: np.ndarray
    spacing: np.ndarray
    visible: np.ndarray


def edge_points(frames: np.ndarray, circles: Circles) -> OutlinePoints:
    """Return where the circles of targets have edges, for frames (k, 3, 3)."""
    radii = circles.radii
    radial = np.stack([np.cos(circles.angles), np.sin(circles.angles)])
    tangential = np.stack([-radial[1], radial[0]])
    images = frames[:, :, :2] @ (radii * radial) + frames[:, :, 2:]
    depth = images[:, 2:]
    points = images[:, :2] / depth
    outwards, along = (
        (moved[:, :2] - points * moved[:, 2:]) / depth
        for moved in (frames[:, :, :2] @ radial, frames[:, :, :2] @ tangential)
    )
    stretch = np.hypot(along[:, 0], along[:, 1])
    area = outwards[:, 0] * along[:, 1] - outwards[:, 1] * along[:, 0]
    return OutlinePoints(
        points=points.transpose(0, 2, 1),
        normals=np.stack([along[:, 1], -along[:, 0]], axis=2) / stretch[..., None],
        polarity=circles.polarity,
        scale=area / stretch,
        spacing=circles.spacing * stretch,
        curvature=area / (radii * stretch**3),
    )


def measure_edges(
    gray: np.ndarray,
    frames: np.ndarray,
    circles: Circles,
    blur: np.ndarray,
    reach: float | np.ndarray,
) -> Edges:
    """Fit blurred steps to the gray values across circles.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    frames : ndarray of float64, shape (k, 3, 3)
    circles : Circles
    blur : ndarray of float64, shape (k,)
        Standard deviation of the steps, px. A wrong one costs precision, and moves nothing.
    reach : float or ndarray of float, shape (k, 1)
        How far from a circle to look, dot radii.
    """
    return measure_outlines(gray, edge_points(frames, circles), blur, reach)


def measure_outlines(
    gray: np.ndarray, outlines: OutlinePoints, blur: np.ndarray, reach: float | np.ndarray
) -> Edges:
    """Fit blurred steps to the gray values across the outlines of k targets.

    Parameters
    ----------
    gray : ndarray of float32, shape (height, width)
        Gray values from 0 to 255.
    outlines : OutlinePoints
    blur : ndarray of float64, shape (k,)
        Standard deviation of the steps, px. A wrong one costs precision, and moves nothing.
    reach : float or ndarray of float, shape (k, 1)
        How far from an outline to look, in its units.
    """
    aside = np.minimum(outlines.spacing / 4, _MAXIMUM_ASIDE)
    enough = np.maximum(_ENOUGH, _ENOUGH_BLURS * blur)[:, None]
    which = np.searchsorted(HALF_WIDTHS, np.minimum(reach * outlines.scale, enough), 'right') - 1
    which[outlines.polarity == 0] = 0
    ends = HALF_WIDTHS[which, None] * outlines.normals
    for end in (outlines.points - ends, outlines.points + ends):
        which[~within(end, gray.shape)] = 0
    blurs = np.rint(np.clip(blur, *BLURS) / BLUR_STEP).astype(int)
    groups = (which + len(HALF_WIDTHS) * blurs[:, None]).ravel()
    chosen = np.flatnonzero(which)
    chosen = chosen[np.argsort(groups[chosen], kind='stable')]
    fitted = fit_steps(_profiles(gray, outlines, aside, which, chosen), groups[chosen])
    fitted[[0, 3]] *= outlines.polarity.ravel()[chosen]
    steps = np.zeros((len(fitted), which.size))
    steps[:, chosen] = fitted
    # On a curve, the blur and the chord between the two lines of a profile lie inside.
    inside = (blur[:, None] ** 2 + aside**2) / 2 * outlines.curvature
    steps[0] += np.where(which > 0, inside, 0.0).ravel()
    measured = steps.reshape(len(steps), *which.shape)
    return Edges(*[*measured, outlines.scale, outlines.spacing, which > 0])


def _profiles(
    gray: np.ndarray,
    outlines: OutlinePoints,
    aside: np.ndarray,
    which: np.ndarray,
    chosen: np.ndarray,
) -> np.ndarray:
    """Return profiles through some points, each the mean of two lines, shape (n, samples).

    Parameters
    ----------
    gray, outlines
        As for `measure_outlines`.
    aside : ndarray of float64, shape (k, m)
        Distance of the two lines from the points, px.
    which : ndarray of int, shape (k, m)
        Indices of the half widths.
    chosen : ndarray of int, shape (n,)
        Indices of the points, of k m.
    """
    points, normals = (of.reshape(-1, 2)[chosen] for of in (outlines.points, outlines.normals))
    across = outlines.polarity.ravel()[chosen, None] * normals  # from dark to bright
    beside = aside.ravel()[chosen, None] * across[:, ::-1] * [-1, 1]
    middles = np.concatenate([points - beside, points + beside])
    directions = HALF_WIDTHS[which.ravel()[chosen], None] * across
    lines = sample_lines(gray, middles, np.concatenate([directions] * 2), ALONG)
    profiles: np.ndarray = lines[: len(points)] + lines[len(points) :]
    profiles /= 2
    return profiles
