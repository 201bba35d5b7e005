"""Dots that detectors of several kinds look for in one image, found once for all of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.vision.dots import Dots
from ahf_ros.vision.frame import circle_outlines, ellipse_axes
from ahf_ros.vision.log_edges import mask_of

_BEYOND = 1.1  # times a bound of the radius, by how much dots may be beyond it
_EXPLAINED = 0.5  # share of the outline of a dot within explained ones


@dataclass(slots=True)
class CommonSearch:
    """Dots that were found in an image.

    The first detector that searches does so for all: between the bounds of all, but outside of
    what it has explained itself.

    Attributes
    ----------
    min_radius : float
        The smallest minimum of all detectors, px.
    polarities : sequence of int
        Those of all detectors.
    """

    min_radius: float
    polarities: Sequence[int]
    found: Dots | None = None

    def select(self, which: Callable[[np.ndarray], np.ndarray]) -> CommonSearch:
        """Return the search with some of its dots, by a mask (k,) of their frames (k, 3, 3)."""
        found = self.found
        return replace(self, found=found.select(which(found.frames)) if found else None)


def dots_in_common(
    common: CommonSearch | None,
    search: Callable[..., Dots],
    min_radius: float,
    max_radius: float,
    polarities: Sequence[int],
    explained: Sequence[np.ndarray] | np.ndarray = (),
) -> Dots:
    """Return the dots that a search finds for one detector, which may share it with others.

    Explained outlines, px, have the shape (m, 2) each. Shared dots may be a little beyond the
    bounds of the radius.
    """
    if common is None:
        return search(min_radius, max_radius, polarities, explained=explained)
    if common.found is None:
        low = min(min_radius, common.min_radius)
        common.found = search(low, max_radius, common.polarities, explained=explained)
    found = common.found
    major = ellipse_axes(found.frames)[0]
    of_size = (major * _BEYOND >= min_radius) & (major <= max_radius * _BEYOND)
    found = found.select(of_size & np.isin(found.polarity, polarities))
    return found.select(~_within(found, explained))


def _within(dots: Dots, outlines: Sequence[np.ndarray] | np.ndarray) -> np.ndarray:
    """Return whether dots lie within outlines, shape (k,)."""
    points = np.rint(circle_outlines(dots.frames, np.ones(len(dots.frames)))).astype(int)
    points = np.maximum(points, 0)
    width, height = points.reshape(-1, 2).max(axis=0, initial=0) + 1
    inside = mask_of(outlines, (height, width))[points[..., 1], points[..., 0]]
    return inside.mean(axis=1) > _EXPLAINED
