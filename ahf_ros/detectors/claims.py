"""Which of several readings owns a dot, an ID, a place.

A detector says which readings are rivals, that is, cannot both be right. Here it is decided
between them: the better one is the owner, or only one that clearly leads counts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from ahf_ros.target import UNDECODED, Target

Rivals = Callable[[int], np.ndarray]
"""From the index of a claim to which of k claims are its rivals, ndarray of bool, shape (k,).

The claim itself may be among them. The relation need not be mutual.
"""

_Target = TypeVar('_Target', bound=Target)


def owners(count: int, rivals: Rivals) -> np.ndarray:
    """Return which of `count` claims, the best first, are no rival of an owner before them.

    ndarray of bool, shape (k,).
    """
    owning = np.ones(count, bool)
    for index in range(count):
        if owning[index]:
            owning[index + 1 :] &= ~rivals(index)[index + 1 :]
    return owning


def leading(
    scores: np.ndarray,
    certain: np.ndarray,
    rivals: Rivals,
    times: float,
    lead: float = np.inf,
) -> np.ndarray:
    """Return which certain claims have at least some times the score of any certain rival.

    A lead over it is as good. Arrays have the shape (k,).
    """
    ahead = certain.copy()
    for index in np.flatnonzero(certain).tolist():
        others = certain & rivals(index)
        others[index] = False
        enough = np.minimum(times * scores[others], scores[others] + lead)
        ahead[index] = (scores[index] >= enough).all()
    return ahead


def best_targets(targets: Sequence[_Target], reach: float = 0.0) -> list[_Target]:
    """Return the most certain target of each place and each print, decoded ones first.

    A print is an ID of a family in one polarity, see `Target.print`. No other lies in the reach of
    a target, in radii of its dot. Where that is 0 only prints count.
    """
    order = sorted(targets, key=lambda it: (it.id == UNDECODED, -it.confidence, it.y, it.x))
    x, y, minor = np.array([(it.x, it.y, it.semi_minor) for it in order]).reshape(-1, 3).T
    radii, decoded = reach * minor, np.array([it.id != UNDECODED for it in order], bool)
    prints: dict[tuple[str, int, int], int] = {}
    of_print = np.array([prints.setdefault(it.print, len(prints)) for it in order], int)

    def rivals(index: int) -> np.ndarray:
        near = np.hypot(x - x[index], y - y[index]) < np.minimum(radii, radii[index])
        return near | decoded & (of_print == of_print[index])

    owning = owners(len(order), rivals)
    return [target for target, owns in zip(order, owning, strict=True) if owns]
