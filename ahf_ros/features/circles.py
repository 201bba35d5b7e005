"""Where the circles of targets have edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Circles:
    """Points on the circles of k targets where edges are expected.

    The points of a circle are equally far apart and follow each other; circles come in the order
    of their radii.

    Attributes
    ----------
    angles, radii : ndarray of float64, shape (m,)
        In the frame, rad and dot radii.
    group : ndarray of int, shape (m,)
        0 on the dot, which has the scale of the frame. Circles of the same group from 1 on share
        a scale relative to the dot that is known about as well as a print is.
    polarity : ndarray of int, shape (k, m)
        1 where the outside is brighter, -1 where it is darker, 0 where there is no edge. The
        first point is on the outline of the target or its dot, and has its polarity.
    """

    angles: np.ndarray
    radii: np.ndarray
    group: np.ndarray
    polarity: np.ndarray

    @property
    def spacing(self) -> np.ndarray:
        """Distances from each point to the next on its circle, dot radii."""
        last = np.flatnonzero(np.diff(self.radii, append=np.inf))
        count = np.diff(last, prepend=-1)
        return 2 * np.pi * self.radii / np.repeat(count, count)


def dot_circles(polarity: np.ndarray, rays: int) -> Circles:
    """Return the edges of dots.

    Parameters
    ----------
    polarity : ndarray of int, shape (k,)
        1 for a dark dot, -1 for a bright one.
    rays : int
        Number of points.
    """
    angles = 2 * np.pi * np.arange(rays) / rays
    of_points = np.repeat(np.asarray(polarity)[:, None], rays, axis=1)
    return Circles(angles, np.ones(rays), np.zeros(rays, int), of_points)
