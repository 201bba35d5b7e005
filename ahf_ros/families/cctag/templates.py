"""The ink of rings along the radius of a CCTag, and how much of a profile it explains."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ahf_ros import kernels
from ahf_ros.families.cctag.rays import ALONG, PROFILE
from ahf_ros.prints.cctag import CctagPrint

SIZE_STEP = 1.05
"""Ratio of radii that share templates."""
MAXIMUM_SHIFT = 0.45
"""Growth of ink, in narrow rings."""
MASK = 1.5
"""Standard deviation of the unsharp mask of a camera that sharpens, px."""

Edge = tuple[float, float, float, float]
"""Growth of ink and blur, px, sharpening, and the share of the contrast that is clipped.

Below 0 it is clipped from bright ink, otherwise from bright paper.
"""


_LEAST_TOTAL = 1e-9  # of squares of a weighted profile
_USUAL_EDGE: Edge = (0.0, 0.9, 0.0, 0.0)
DEFOCUSED = 0.6
"""Blur of an image that is out of focus, in narrow rings."""
CLIPPED = 0.25, 0.5
"""Shares of the contrast that over-exposure clips."""


def size_steps(size: np.ndarray) -> np.ndarray:
    """Return the steps of radii, px, int, of the shape of these."""
    return np.rint(np.log(np.maximum(size, 1.0)) / math.log(SIZE_STEP)).astype(int)


def by_value(values: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """Return the values of some integers, each with the indices where it is."""
    order = values.argsort(kind='stable')
    ordered = values[order]
    ends = [*(ordered[1:] != ordered[:-1]).nonzero()[0].tolist(), len(order) - 1]
    starts = [0, *(end + 1 for end in ends[:-1])]
    return [
        (int(ordered[start]), order[start : end + 1])
        for start, end in zip(starts, ends, strict=True)
        if len(order)
    ]


def less_lines(profiles: np.ndarray, every: int = 1) -> np.ndarray:
    """Return weighted profiles less straight lines, float32, shape (k, n)."""
    weight, line = _weights(every)
    weighted = profiles.astype(np.float32, copy=False) * weight
    weighted -= (weighted @ line) @ line.T
    return weighted


def shares_of(profiles: np.ndarray, of_rings: np.ndarray) -> np.ndarray:
    """Return the shares of profiles (k, n) that templates of rings (t, n) explain, shape (k, t).

    Both are weighted and less straight lines. Ink is below paper.
    """
    return np.minimum(profiles @ of_rings.T, 0) ** 2 / totals(profiles)[:, None]


def totals(profiles: np.ndarray) -> np.ndarray:
    """Return the sums of squares of weighted profiles (k, n), of which shares are, shape (k,)."""
    return np.maximum((profiles**2).sum(axis=1), np.float32(_LEAST_TOTAL))


@lru_cache
def _weights(every: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the weights of profiles, (n,), and a basis of weighted straight lines, (n, 2)."""
    along = PROFILE[::every]
    weight = np.sqrt(along / along.sum())
    line, _ = np.linalg.qr(np.stack([weight, along * weight], axis=1))
    return weight.astype(np.float32), line.astype(np.float32)


def _normalised(inks: np.ndarray, every: int) -> np.ndarray:
    """Return weighted inks less straight lines, with squares of a sum of 1, float32.

    Those that are clipped to one gray value explain nothing, whatever rounding leaves of them.
    """
    inks = less_lines(inks, every)
    return inks / np.sqrt(totals(inks))[:, None]


@lru_cache(maxsize=256)
def templates(
    family: CctagPrint, step: int, edges: tuple[Edge, ...], every: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Return the ink of all IDs with some edges, shape (t, n), and these edges, (e, 3)."""
    size, (signed, of_id) = SIZE_STEP**step, _shared_circles(family)
    most = MAXIMUM_SHIFT * family.narrow * size
    tried = np.array(list(dict.fromkeys((min(max(of[0], -most), most), *of[1:]) for of in edges)))
    inks = of_id @ _discs_along(signed, size, tried, every)
    return _normalised(_clipped(inks, tried[:, 3]), every), tried[:, :3]


@lru_cache
def _shared_circles(family: CctagPrint) -> tuple[np.ndarray, np.ndarray]:
    """Return the signed radii of all circles of a family, (c,), and which of them IDs have.

    The latter is 1 or 0, float32, shape (t, c). IDs share circles, so that there are few.
    """
    table = signed_circles(family, family.numbers)
    signed, inverse = np.unique(table.round(6), return_inverse=True)
    of_id = np.zeros((len(table), len(signed)), np.float32)
    np.put_along_axis(of_id, inverse.reshape(table.shape), 1.0, axis=1)
    return signed, of_id


@lru_cache(maxsize=256)
def discs(step: int, edges: tuple[Edge, ...] = (_USUAL_EDGE,), every: int = 1) -> np.ndarray:
    """Return the profiles of single discs of all radii, shape (t, n), as templates."""
    radii, tried = np.linspace(PROFILE[0], PROFILE[-1], 100)[3:-3], np.array(edges)
    inks = _discs_along(radii, SIZE_STEP**step, tried, every)
    return _normalised(_clipped(inks, tried[:, 3]), every)


def two_discs(profiles: np.ndarray, step: int) -> np.ndarray:
    """Return the shares of profiles that two discs of any radii and grays explain, shape (k,)."""
    of_discs = discs(step)
    along, alike = profiles @ of_discs.T, of_discs @ of_discs.T
    both = along[:, :, None] ** 2 + along[:, None] ** 2
    both -= 2 * alike * along[:, :, None] * along[:, None]
    shares: np.ndarray = (both / np.maximum(1 - alike**2, 1e-3)).max(axis=(1, 2))
    return shares / np.maximum((profiles**2).sum(axis=1), 1e-9)


def _discs_along(signed: np.ndarray, size: float, edges: np.ndarray, every: int) -> np.ndarray:
    """Return the ink of single circles (c,) along the profile, for edges (e, 4), (e, c, n)."""
    count, each = len(signed), np.repeat(edges[:, :3], len(signed), axis=0)
    circles, sizes = np.tile(signed, len(edges))[:, None], np.full(len(each), size)
    inks = kernels.cctag_rings(circles, sizes, *each.T, ALONG[::every], MASK)[0]
    return np.asarray(inks).reshape(len(edges), count, -1)


def _clipped(inks: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Return inks (e, t, n) less shares of the contrast (e,), one after the other, (e t, n).

    Below 0 it is less of ink and otherwise less of paper.
    """
    least = np.where(shares > 0, shares, -np.inf).astype(np.float32)[:, None, None]
    most = np.where(shares < 0, 1 + shares, np.inf).astype(np.float32)[:, None, None]
    return np.clip(inks, least, most).reshape(-1, inks.shape[2])


def rings_along(
    circles: np.ndarray,
    size: np.ndarray,
    shift: np.ndarray,
    blur: np.ndarray,
    sharpening: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Return the ink of signed circles (k, c) along the profile, (k, n), and its derivatives.

    These are by the radius, in radii of the target, by the shift, px, by ln of the blur and by the
    sharpening.
    """
    inks = kernels.cctag_rings(circles, size, shift, blur, sharpening, ALONG, MASK)
    return tuple(inks[:5])


def signed_circles(family: CctagPrint, ids: np.ndarray) -> np.ndarray:
    """Return the radii of the circles of IDs (k,), below 0 where paper fills them, (k, c)."""
    radii = family.radii(ids)
    return radii * (1 - 2 * (np.arange(radii.shape[1]) % 2))
