"""Targets as witnesses of a movement: a pattern of light may look like a scene that moved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.imaging.movement import Displacement
from ahf_ros.target import UNDECODED, Target

_MINIMUM = 3  # targets that are in both images
_SHARE = 0.5  # of a displacement: targets that moved less stayed where they were
_MAXIMUM = 0.3  # px, by which light moves the centres of targets that stayed
_SIGNIFICANT = 4.0  # standard deviations of the median, a movement
_MEDIAN = 1.4826 * 1.2533  # from the median deviation to the deviation of the median of one


def targets_moved(
    moved: Displacement, before: Sequence[Target], after: Sequence[Target]
) -> bool | None:
    """Return whether targets moved that two images show; None if too few of them tell.

    Only targets count that are where the displacement was seen.
    """
    others = {it.key: it for it in after if it.id != UNDECODED}
    shifts = np.array(
        [
            (others[it.key].x - it.x, others[it.key].y - it.y)
            for it in before
            if it.key in others and moved.covers(it.x, it.y)
        ]
    )
    if len(shifts) < _MINIMUM:
        return None
    middle = np.median(shifts, axis=0)
    spread = np.median(np.abs(shifts - middle), axis=0) * _MEDIAN / np.sqrt(len(shifts))
    length, limit = np.hypot(*middle), min(_SHARE * np.hypot(moved.x, moved.y), _MAXIMUM)
    deviation = np.hypot(*spread)
    if length > limit:
        return True if length > _SIGNIFICANT * deviation else None
    return False if deviation < limit else None
