"""Where the circles of targets have edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahf_ros.codes.ring import Family

_INNER_PART = 0.4  # of a sector, to either side; next to its ends the blur rounds an arc off


@dataclass(frozen=True, slots=True)
class Circles:
    """Points on the circles of k targets where edges are expected.

    The points of a circle are equally far apart and follow each other; circles come in the order
    of their radii.

    Attributes
    ----------
    angles, radii : ndarray of float64, shape (m,)
        In the frame, rad and dot radii.
    polarity : ndarray of int, shape (k, m)
        1 where the outside is brighter, -1 where it is darker, 0 where there is no edge.
    """

    angles: np.ndarray
    radii: np.ndarray
    polarity: np.ndarray

    @property
    def spacing(self) -> np.ndarray:
        """Distances from each point to the next on its circle, dot radii."""
        _, circle, count = np.unique(self.radii, return_inverse=True, return_counts=True)
        return 2 * np.pi * self.radii / count[circle]


def dot_circles(signs: np.ndarray, rays: int) -> Circles:
    """Return the edges of dots.

    Parameters
    ----------
    signs : ndarray of int, shape (k,)
        1 for a dark dot, -1 for a bright one.
    rays : int
        Number of points.
    """
    angles = 2 * np.pi * np.arange(rays) / rays
    return Circles(angles, np.ones(rays), np.repeat(np.asarray(signs)[:, None], rays, axis=1))


def ring_circles(
    words: np.ndarray,
    starts: np.ndarray,
    signs: np.ndarray,
    rays: int,
    samples: int,
    family: Family,
) -> Circles:
    """Return the edges of ring targets: round the dots and along the marked sectors.

    Parameters
    ----------
    words : ndarray of int64, shape (k,)
        Code words, in any rotation.
    starts : ndarray of float, shape (k,)
        Where in the frame the sector of the lowest bit starts, rad counter-clockwise from +x.
    signs : ndarray of int, shape (k,)
        1 for a dark target, -1 for a bright one.
    rays : int
        Number of points round the dot.
    samples : int
        Number of points on each edge of the band, a sector.
    family : Family
    """
    dot = dot_circles(signs, rays)
    count = family.bits * samples
    angles = 2 * np.pi * (np.arange(count) + 0.5) / count
    sector, place = np.divmod((angles - starts[:, None]) * family.bits / (2 * np.pi), 1)
    bits = words[:, None] >> sector.astype(np.int64) % family.bits & 1
    marked = np.where(np.abs(place - 0.5) < _INNER_PART, bits, 0) * signs[:, None]
    return Circles(
        np.concatenate([dot.angles, -angles, -angles]),
        np.concatenate([dot.radii, np.repeat([family.band_inner, family.band_outer], count)]),
        np.concatenate([dot.polarity, -marked, marked], axis=1),
    )
