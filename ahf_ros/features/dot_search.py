"""The dots of an image, found with their ellipses under any light.

`whole_dots` takes the outlines that an edge follows all the way round: fast, and enough where the
light is even. `voted_dots` finds the others, whose outlines the edges of light interrupt, in what
is left of the edges when explained objects are hidden: round ones, those seen at up to 70
degrees, and those out of focus.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.features import frame
from ahf_ros.features.candidates import find_candidates
from ahf_ros.features.dots import NO_DOTS, Dots, distinct
from ahf_ros.features.ellipses import fit_ellipses, resized
from ahf_ros.features.outlines import whole_outlines
from ahf_ros.features.pyramid import ImagePyramid

_LEVELS = 2  # whose edges may follow a whole outline; those of the second are less noisy


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
    found = [NO_DOTS]
    for level, edges in enumerate(pyramid.edges[:_LEVELS], start=1):
        dots = whole_outlines(edges, min_radius / 2**level, max_radius / 2**level)
        dots = resized(pyramid.logs[level], dots.select(np.isin(dots.polarity, polarities)))
        frames = frame.enlarged(dots.frames, level)
        # The finer outline of a dot is the better one.
        found.append(replace(dots, frames=frames, share=dots.share / level))
    return distinct(Dots.joined(found))


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
