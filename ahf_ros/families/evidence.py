"""What targets say of their families, where many are looked for."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable

from ahf_ros.base.target import UNDECODED, Target, UndecodedTarget

_CERTAIN = 1e-3  # probability that a target is wrong, below which it counts for no more
_CLEAR = 6.0  # decimal logarithm of the odds on a family that is there beyond doubt

Reading = tuple[str, int, float]
"""Family, ID and confidence of a target."""


def reading_of(target: Target) -> Reading:
    """Return what a target is read as, also where its family is not settled."""
    if isinstance(target, UndecodedTarget) and target.is_unsettled:
        return target.likely_family, target.likely_id, target.confidence
    return target.family, target.id, target.confidence


def evidence(readings: Iterable[Reading]) -> dict[str, list[float]]:
    """Return the decimal logarithms of the odds that readings are right, by family."""
    surest: defaultdict[tuple[str, int], float] = defaultdict(float)
    for family, number, confidence in readings:
        if number != UNDECODED:
            surest[family, number] = max(surest[family, number], confidence)
    by_family: defaultdict[str, list[float]] = defaultdict(list)
    for (family, _), confidence in surest.items():
        by_family[family].append(-math.log10(max(1 - confidence, _CERTAIN)))
    return by_family


def is_clear(found: Iterable[Target]) -> bool:
    """Return whether targets leave no doubt that their families are there."""
    shown = evidence(map(reading_of, found)).values()
    return bool(shown) and all(sum(odds) > _CLEAR for odds in shown)
