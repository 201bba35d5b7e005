"""Where ring targets have edges: round the dot and along the marked sectors of the band."""

from __future__ import annotations

import numpy as np

from ahf_ros.prints.ring import RingPrint
from ahf_ros.vision.circle_fit import on_circles
from ahf_ros.vision.edge_fit import Outlines

REACH = 0.45
"""Distance from an expected edge to look for it, dot radii: less than half a gap.

Half of it leaves small dots less to measure than they have, twice as much reaches the band.
"""

RAYS = 48
"""About a dot that is measured; half of them, where it only is looked for."""

_INNER_PART = 0.4  # of a sector, to either side; next to its ends the blur rounds an arc off


def reach_of(family: RingPrint) -> float:
    """Return how far to look for the edges of a target, dot radii: not to the next edge."""
    inner, outer = family.band
    return min(REACH, (inner - 1) / 2, (outer - inner) / 2)


def target_circles(
    words: np.ndarray,
    starts: np.ndarray,
    polarity: np.ndarray,
    samples: int,
    family: RingPrint,
) -> Outlines:
    """Return the edges of k targets, with some points a sector on each edge of the band.

    See `decoding.Words` for words and starts. The polarity is 1 for a dark target, else -1.
    """
    count = family.bits * samples
    angles = 2 * np.pi * (np.arange(count) + 0.5) / count
    sector, depth = np.divmod((angles - starts[:, None]) * family.bits / (2 * np.pi), 1)
    bits = words[:, None] >> sector.astype(np.int64) % family.bits & 1
    marked = np.where(np.abs(depth - 0.5) < _INNER_PART, bits, 0) * polarity[:, None]
    counts = [RAYS, count, count]
    return on_circles(
        np.concatenate([2 * np.pi * np.arange(RAYS) / RAYS, -angles, -angles]),
        np.repeat([1.0, family.band_inner, family.band_outer], counts),
        np.repeat([0, 1, 1], counts),
        np.concatenate([np.repeat(polarity[:, None], RAYS, axis=1), -marked, marked], axis=1),
    )
