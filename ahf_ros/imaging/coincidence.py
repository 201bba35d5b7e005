"""The displacement at which the edges of two images coincide, with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SIGNIFICANT = 6.0
"""Number of standard deviations from zero at which a displacement counts as movement."""

MINIMUM_EDGES = 60
"""Number of edges that coincide, for a displacement to be measured."""

WINDOW = 2
"""Maximum distance of an edge from its place along its normal, px."""

PEAK = 1.5
"""Ratio of coincidences in a peak to those beside it, or in another peak."""

_BINS = 4  # per px, of displacements along a normal
_NEAR = 0.75  # px, a displacement that is refined
_RING = 1.25  # px, distance from a peak at which it has fallen
_STEPS = 8  # of the robust fit
_DIRECTIONS = 12  # of normals, which count alike: light has few, prints have many
_STRIPED = 2.5  # ratio of edges in a direction to the median of all directions
_ENOUGH = 120  # edges of other directions
_UNEVEN = 0.1  # px, systematic error where no edge of the first image coincides


@dataclass(frozen=True, slots=True)
class Displacement:
    """A displacement of a scene between two images.

    Attributes
    ----------
    x, y : float
        In px.
    deviation : float
        Standard deviation of its length, px.
    """

    x: float
    y: float
    deviation: float

    def exceeds(self, minimum: float) -> bool:
        """Return whether it is longer than a minimum, and significant."""
        return bool(np.hypot(self.x, self.y) > max(minimum, SIGNIFICANT * self.deviation))

    def __str__(self) -> str:
        """Return the length with its standard deviation."""
        return f'{np.hypot(self.x, self.y):.2f} px (standard deviation {self.deviation:.3f} px)'


def measured(normals: np.ndarray, found: np.ndarray) -> Displacement | None:
    """Return the displacement at which edges coincide, None where none stands out.

    Parameters
    ----------
    normals : ndarray of float32, shape (n, 2)
        Unit normals of the edges.
    found : ndarray of float32, shape (n, m)
        Where along its normal each edge is seen again, px; NaN where it is not.
    """
    if len(normals) < MINIMUM_EDGES:
        return None
    weights = direction_weights(normals)
    peak = _peak(normals, weights, _seen(found))
    return None if peak is None else _refined(normals, weights, found, peak)


def direction_weights(normals: np.ndarray) -> np.ndarray:
    """Return weights of edges, 1 on average, with which all directions count alike.

    Directions with many times more edges than others are stripes of light. They and their
    neighbours are left out where enough edges remain.

    Parameters
    ----------
    normals : ndarray, shape (n, 2)
        Unit normals of the edges.
    """
    angles = np.arctan2(normals[:, 1], normals[:, 0])
    classes = np.floor((angles / (2 * np.pi) + 0.5) * _DIRECTIONS).astype(int) % _DIRECTIONS
    counts = np.bincount(classes, minlength=_DIRECTIONS)
    least = len(normals) / (4 * _DIRECTIONS)
    weights: np.ndarray = 1 / np.maximum(counts, least)[classes]
    striped = counts > _STRIPED * np.median(counts)
    striped |= np.roll(striped, 1) | np.roll(striped, -1)
    if counts[~striped].sum() >= _ENOUGH:
        weights[striped[classes]] = 0.0
    return weights / weights.mean()


def _seen(found: np.ndarray) -> np.ndarray:
    """Return whether an edge is seen again near each displacement, shape (n, bins)."""
    edges, bins = len(found), 2 * (WINDOW + 1) * _BINS + 1
    seen = np.zeros((edges, bins), bool)
    rows, columns = np.nonzero(~np.isnan(found))
    middle = np.rint((found[rows, columns] + WINDOW + 1) * _BINS).astype(int)
    for beside in (-1, 0, 1):
        seen[rows, np.clip(middle + beside, 0, bins - 1)] = True
    return seen


def _coincidences(
    normals: np.ndarray, weights: np.ndarray, seen: np.ndarray, shifts: np.ndarray
) -> np.ndarray:
    """Return how many edges are seen again at each displacement, shape (shifts,)."""
    bins = np.rint((normals @ shifts.T + WINDOW + 1) * _BINS).astype(int)
    return np.array([weights @ np.take_along_axis(seen, of[:, None], 1)[:, 0] for of in bins.T])


def _peak(normals: np.ndarray, weights: np.ndarray, seen: np.ndarray) -> np.ndarray | None:
    """Return the displacement of most coincidences, None where none stands out."""
    side = np.arange(-_NEAR, _NEAR + 0.1, 1 / _BINS)
    grid = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    counts = _coincidences(normals, weights, seen, grid)
    best = grid[counts.argmax()]
    angles = np.arange(12) * (np.pi / 6)
    ring = best + _RING * np.stack((np.cos(angles), np.sin(angles)), 1)
    beside = _coincidences(normals, weights, seen, ring)
    enough = counts.max() >= max(MINIMUM_EDGES, PEAK * beside.max())
    return best if enough else None


def _refined(
    normals: np.ndarray, weights: np.ndarray, found: np.ndarray, start: np.ndarray
) -> Displacement:
    """Return a displacement fitted to the coincidences around it, robustly."""
    shift, width = start.astype(float), 0.5
    variance, share = np.inf, 0.0
    for _ in range(_STEPS):
        off = found - (normals @ shift).astype(np.float32)[:, None]
        off = np.where(np.isnan(off), np.inf, off)
        nearest = np.take_along_axis(off, np.abs(off).argmin(1)[:, None], 1)[:, 0]
        close = np.abs(nearest) < width
        if close.sum() < MINIMUM_EDGES:
            break
        rest, of = nearest[close], normals[close]
        robust = weights[close] * (1 - (rest / width) ** 2) ** 2
        normal_matrix = (of * robust[:, None]).T @ of
        shift += np.linalg.solve(normal_matrix, (of * robust[:, None]).T @ rest)
        spread = 1.4826 * float(np.median(np.abs(rest)))
        inverse = np.linalg.inv(normal_matrix)
        middle = (of * robust[:, None] ** 2).T @ (of * robust[:, None] ** 0)
        variance = spread**2 * float(np.trace(inverse @ middle @ inverse))
        share = float(weights[close].sum() / weights.sum())
        width = max(min(width, 4 * spread), 0.1)
    deviation = float(np.sqrt(variance + (_UNEVEN * (1 - share)) ** 2))
    return Displacement(float(shift[0]), float(shift[1]), deviation)
