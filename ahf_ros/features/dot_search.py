"""The dots of an image, found with their ellipses under any light.

`whole_dots` takes the outlines that an edge follows all the way round: fast, and enough where the
light is even. `voted_dots` finds the others, whose outlines the edges of light interrupt, in what
is left of the edges when explained objects are hidden: round ones, those seen at up to 70
degrees, and those out of focus. `propose_dots` does both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.candidates import find_candidates
from ahf_ros.features.dots import Dots, distinct
from ahf_ros.features.ellipses import fit_ellipses, resized
from ahf_ros.features.log_edges import LOG_SCALE
from ahf_ros.features.outlines import whole_outlines
from ahf_ros.features.pyramid import ImagePyramid
from ahf_ros.features.small_dots import small_dots

_SMALL = 12.0  # radius up to which dots are looked for as blobs, px
_SMALLER = 0.8  # of the smallest radius, of a blob whose edge is blurred
_MARGIN = 0.4  # width of the margin round a dot whose outline is whole, dot radii


def whole_dots(
    pyramid: ImagePyramid, min_radius: float, max_radius: float, polarities: Sequence[int]
) -> Dots:
    """Return the dots with a whole outline.

    Parameters
    ----------
    pyramid : ImagePyramid
    min_radius, max_radius : float
        Bounds of the semi-major axis, px.
    polarities : sequence of int
        1 to find dark dots, -1 to find bright ones.

    Returns
    -------
    Dots
        Without duplicates, in px of the image, to about half a pixel.
    """
    dots = whole_outlines(pyramid.edges[0], min_radius / 2, max_radius / 2)
    dots = resized(pyramid.logs[1], dots.select(np.isin(dots.polarity, polarities)))
    return distinct(replace(dots, frames=frame.enlarged(dots.frames, 1)))


def voted_dots(
    pyramid: ImagePyramid,
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    explained: Sequence[np.ndarray] | np.ndarray = (),
) -> Dots:
    """Return the dots that many gradients point away from, whether their outline is whole or not.

    Parameters
    ----------
    pyramid : ImagePyramid
    min_radius, max_radius : float
        Bounds of the radius, px; dots that are a little smaller or larger may be among those
        returned.
    polarities : sequence of int
        1 to find dark dots, -1 to find bright ones.
    explained : sequence of ndarray of float, each of shape (m, 2)
        Outlines of objects that are known already, px of the image. Edges inside do not vote.

    Returns
    -------
    Dots
        Without duplicates, those with the largest share first, in px of the image. Centres are
        known to about two tenths of a pixel, radii to half a pixel and the blur.
    """
    candidates = find_candidates(pyramid.edges, min_radius, max_radius, polarities, explained)
    return distinct(fit_ellipses(pyramid.logs, candidates))


def propose_dots(
    pyramid: ImagePyramid,
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    explained: Sequence[np.ndarray] | np.ndarray = (),
) -> Dots:
    """Return the dots of an image at any tilt up to 70 degrees, sharp or not.

    Parameters
    ----------
    pyramid : ImagePyramid
        Of an image, or of an octave of it.
    min_radius, max_radius : float
        Bounds of the semi-major axis, px; dots that are a little smaller or larger may be among
        those returned.
    polarities : sequence of int
        1 to find dark dots, -1 to find bright ones.
    explained : sequence of ndarray of float, each of shape (m, 2)
        Outlines of objects that are known already, px of the image. Interrupted dots are not
        looked for inside.

    Returns
    -------
    Dots
        No two of them the same, those with the largest share first, in px of the image. Centres
        are known to about two tenths of a pixel, radii to half a pixel and the blur.
    """
    whole = whole_dots(pyramid, min_radius, max_radius, polarities)
    return distinct(
        Dots.joined(
            [whole, _others(pyramid, whole, min_radius, max_radius, polarities, explained)]
        )
    )


def _others(
    pyramid: ImagePyramid,
    whole: Dots,
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    explained: Sequence[np.ndarray] | np.ndarray,
) -> Dots:
    """Return the dots that votes find outside of whole ones."""
    outlines = frame.circle_outlines(whole.frames, np.full(len(whole.frames), 1 + _MARGIN))
    known = [*outlines, *explained]
    return voted_dots(pyramid, min_radius, max_radius, polarities, explained=known)


def with_other_dots(
    pyramid: ImagePyramid,
    whole: Dots,
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    explained: Sequence[np.ndarray] | np.ndarray = (),
) -> Dots:
    """Return dots with a whole outline, and those without one.

    Parameters
    ----------
    pyramid : ImagePyramid
    whole : Dots
        As `whole_dots` gives them.
    min_radius, max_radius : float
        Bounds of the semi-major axis, px.
    polarities : sequence of int
        1 to find dark dots, -1 to find bright ones.
    explained : sequence of ndarray of float, each of shape (m, 2)
        Outlines of objects that are known already, px of the image. No others are looked for
        inside.

    Returns
    -------
    Dots
        No two of them the same.
    """
    found = [whole, _others(pyramid, whole, min_radius, max_radius, polarities, explained)]
    if min_radius < _SMALL:
        low, high = _SMALLER * min_radius, min(max_radius, _SMALL)
        small = small_dots(pyramid.logs[0], low, high, polarities, LOG_SCALE, explained)
        found.append(small)
    return distinct(Dots.joined(found))
