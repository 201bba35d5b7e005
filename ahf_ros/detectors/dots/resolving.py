"""One target for each place and each ID."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from ahf_ros.target import UNDECODED, Target

_Target = TypeVar('_Target', bound=Target)


def best_of_each(targets: Sequence[_Target], reach: float) -> list[_Target]:
    """Return the most certain target of each place and each ID, decoded ones first.

    Parameters
    ----------
    targets : sequence of Target
    reach : float
        Radius of a target, in that of its disc; no other lies in it.
    """
    order = sorted(targets, key=lambda it: (it.id == UNDECODED, -it.confidence, it.y, it.x))
    x, y, radius = np.array([(it.x, it.y, reach * it.semi_minor) for it in order]).reshape(-1, 3).T
    kept: list[int] = []
    ids: set[int] = set()
    for index, target in enumerate(order):
        distance = np.hypot(x[kept] - x[index], y[kept] - y[index])
        apart = bool((distance > np.minimum(radius[kept], radius[index])).all())
        if apart and target.id not in ids - {UNDECODED}:
            kept.append(index)
            ids.add(target.id)
    return [order[index] for index in kept]
