"""Fusion of what several filters show in one image, by how many of them agree.

The best filter for the whole image may hide a target that another one shows. If the light makes a
detector read a wrong ID, it does so through few filters, and the wrong ID varies.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ahf_ros.target import UNDECODED, Target, sorted_targets

_REACH = 0.5  # semi-major axes; targets that are closer are at the same place
_MINIMUM_REACH = 2.0  # px, for dots so small that noise moves their centres further
_MINIMUM_FILTERS = 2  # that must agree on a target that the best filter does not show
_MAJORITY = 2  # times the filters of any contradicting claim: two to one


@dataclass(slots=True)
class _Claim:
    """An ID at a place."""

    target: Target  # through the best filter that shows it
    first: int  # index of that filter
    filters: set[int] = field(default_factory=set)

    def near(self, other: Target) -> bool:
        """Return whether another target is at the same place."""
        reach = max(_REACH * self.target.semi_major, _MINIMUM_REACH)
        return bool(np.hypot(other.x - self.target.x, other.y - self.target.y) < reach)


def fused(results: Sequence[Sequence[Target]]) -> list[Target]:
    """Return the targets on which filters agree.

    A target counts if the best filter or at least two others show it, and if twice as many filters
    show it as any contradicting claim: another ID at its place, or its ID at another place.

    Parameters
    ----------
    results : sequence of sequence of Target
        What each filter showed, the best filter first. Undecoded targets are ignored.

    Returns
    -------
    list of Target
        Sorted by ID; each as the best of its filters shows it.
    """
    claims: list[_Claim] = []
    by_key: dict[tuple[str, int], list[_Claim]] = {}
    for index, targets in enumerate(results):
        for target in targets:
            if target.id == UNDECODED:
                continue
            same = [claim for claim in by_key.get(target.key, []) if claim.near(target)]
            if not same:
                same = [_Claim(target, index)]
                claims.append(same[0])
                by_key.setdefault(target.key, []).append(same[0])
            same[0].filters.add(index)
    kept = [
        claim.target
        for claim in claims
        if (claim.first == 0 or len(claim.filters) >= _MINIMUM_FILTERS)
        and all(
            len(claim.filters) >= _MAJORITY * len(other.filters)
            for other in claims
            if other is not claim
            and (other.target.key == claim.target.key or claim.near(other.target))
        )
    ]
    return sorted_targets(kept)
