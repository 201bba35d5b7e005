"""The P2-invariant of five points, three of them on a line, as Wang et al. use it.

Wang et al., Remote Sens. 2022, 14, 5377, section 2.2. A cross ratio depends on the order of its
points. J does not: it takes the same value for all six cross ratios of four points.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def p2_invariant(ratio: Any) -> np.ndarray:
    """Return J of cross ratios.

    J = J2 / J1, with

        J1 = (l^6 - 3 l^5 + 3 l^4 - l^3 + 3 l^2 - 3 l + 1) / (l^2 (l - 1)^2),
        J2 = (2 l^6 - 6 l^5 + 9 l^4 - 8 l^3 + 9 l^2 - 6 l + 2) / (l^2 (l - 1)^2).

    Parameters
    ----------
    ratio : array_like of float
        Cross ratios l, of any order of their points.

    Returns
    -------
    ndarray of float64, shape of `ratio`
        From 2 to 14/5; NaN where l is not finite.

    Examples
    --------
    >>> float(p2_invariant(2.0))
    2.8
    """
    value = np.asarray(ratio, np.float64)
    with np.errstate(all='ignore'):
        # A cross ratio and its inverse have the same J; powers of the smaller do not overflow.
        value = np.where(np.abs(value) > 1, 1 / value, value)
    first = np.polyval([1, -3, 3, -1, 3, -3, 1], value)
    second = np.polyval([2, -6, 9, -8, 9, -6, 2], value)
    invariant: np.ndarray = second / first
    return invariant


def area_cross_ratio(pivot: Any, points: Any) -> np.ndarray:
    """Return the cross ratio of the lines from a pivot to four points, by areas of triangles.

    Parameters
    ----------
    pivot : array_like of float, shape (..., 2)
    points : array_like of float, shape (..., 4, 2)

    Returns
    -------
    ndarray of float64, shape (...)
        Infinite or NaN where three of the points are collinear with the pivot.
    """
    arms = np.asarray(points, np.float64) - np.asarray(pivot, np.float64)[..., None, :]
    one, two, three, four = np.moveaxis(arms, -2, 0)

    def area(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        twice: np.ndarray = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
        return twice

    with np.errstate(divide='ignore', invalid='ignore'):
        ratio = area(one, three) * area(two, four) / (area(one, four) * area(two, three))
    return np.asarray(ratio)


def template_invariant(points: Any) -> np.ndarray:
    """Return the P2-invariant of five template points, three of them collinear.

    It is the larger one of those at the two points that are not on the line; the others have
    none.

    Parameters
    ----------
    points : array_like of float, shape (..., 5, 2)
        A, B, C, D, E, with C, E, A on a line. Exchanging B and D changes nothing.

    Returns
    -------
    ndarray of float64, shape (...)
        2.474 for the printed design of GSI.
    """
    a, b, c, d, e = np.moveaxis(np.asarray(points, np.float64), -2, 0)
    at_d = area_cross_ratio(d, np.stack([b, c, e, a], axis=-2))
    at_b = area_cross_ratio(b, np.stack([d, c, e, a], axis=-2))
    return np.fmax(p2_invariant(at_d), p2_invariant(at_b))
