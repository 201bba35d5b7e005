"""What several filters identified in one image, settled by how many of them agree.

A filter that is best for the whole image may hide a target that another one shows. Light that
makes a detector read a wrong ID does so through few filters, and not always the same ID.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ahf_ros.target import UNDECODED, Target, sorted_targets

_REACH = 0.5  # of the semi-major axis, within which two places are one
_LEAST_REACH = 2.0  # the same, px
_FEWEST = 2  # filters that have to agree where the best one does not show a target
_CLEARLY = 2  # times the filters for a contradicting claim


@dataclass(slots=True)
class _Claim:
    """An ID at a place."""

    target: Target  # from the best filter that shows it
    first: int  # that filter
    filters: set[int] = field(default_factory=set)

    def near(self, other: Target) -> bool:
        """Return whether another target is at the same place."""
        reach = max(_REACH * self.target.semi_major, _LEAST_REACH)
        return bool(np.hypot(other.x - self.target.x, other.y - self.target.y) < reach)


def fused(results: Sequence[Sequence[Target]]) -> list[Target]:
    """Return the union of what was identified through several filters.

    A target counts that the best filter shows, or at least two others, unless a claim that
    contradicts it, another ID at its place or its ID at another place, has more than half as many
    filters. Of two such claims none counts.

    Parameters
    ----------
    results : sequence of sequence of Target
        What each filter showed, the best one first. Targets without an ID are left out.

    Returns
    -------
    list of Target
        Sorted by ID; each as the best of the filters shows it that do.
    """
    claims: list[_Claim] = []
    of_number: dict[int, list[_Claim]] = {}
    for place, targets in enumerate(results):
        for target in targets:
            if target.id == UNDECODED:
                continue
            same = [claim for claim in of_number.get(target.id, []) if claim.near(target)]
            if not same:
                same = [_Claim(target, place)]
                claims.append(same[0])
                of_number.setdefault(target.id, []).append(same[0])
            same[0].filters.add(place)
    kept = [
        claim.target
        for claim in claims
        if (claim.first == 0 or len(claim.filters) >= _FEWEST)
        and all(
            len(claim.filters) >= _CLEARLY * len(other.filters)
            for other in claims
            if other is not claim
            and (other.target.id == claim.target.id or claim.near(other.target))
        )
    ]
    return sorted_targets(kept)
