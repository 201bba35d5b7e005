"""Which of several readings owns a dot, an ID, a place.

A detector says which readings are rivals, that is, cannot both be right. Here it is decided
between them: the better one is the owner, or only one that clearly leads counts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.families.undecoded import undecoded

Rivals = Callable[[np.ndarray], np.ndarray]
"""From the indices of n claims to which of k claims are rivals of each, ndarray of bool, (n, k).

A claim may be among its own. The relation need not be mutual.
"""

_AT_ONCE = 2**16  # pairs of claims, which bounds the memory
_SURER = 3.0  # times as sure of its word as a rival, from which a claim leads
_BEYOND_DOUBT = 20.0  # times as likely right as wrong, from which none is surer of its ID

_Target = TypeVar('_Target', bound=Target)


def owners(count: int, rivals: Rivals) -> np.ndarray:
    """Return which of `count` claims, the best first, are no rival of an owner before them.

    ndarray of bool, shape (k,).
    """
    owning = np.ones(count, bool)
    for part in _parts(np.arange(count), count):
        left = part[owning[part]]
        for index, of_claim in zip(left.tolist(), rivals(left), strict=True):
            if owning[index]:
                owning[index + 1 :] &= ~of_claim[index + 1 :]
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
    every = np.flatnonzero(certain)
    ahead, enough = certain.copy(), np.minimum(times * scores[every], scores[every] + lead)
    for part in _parts(every, len(scores)):
        others = rivals(part)[:, every] & (part[:, None] != every)
        ahead[part] = (~others | (scores[part, None] >= enough)).all(axis=1)
    return ahead


def _parts(claims: np.ndarray, count: int) -> list[np.ndarray]:
    """Return some claims in parts whose pairs with all of so many are few enough."""
    size = max(_AT_ONCE // max(count, 1), 1)
    return [claims[start : start + size] for start in range(0, len(claims), size)]


def within(frames: np.ndarray, reach: np.ndarray) -> Rivals:
    """Return which centres of frames, (k, 3, 3), lie within the reach of one, (k,)."""
    x, y = frames[:, :2, 2].T
    return lambda of: np.hypot(x - x[of, None], y - y[of, None]) < reach[of, None]


def surer(sure: np.ndarray, certain: np.ndarray, rivals: Rivals) -> np.ndarray:
    """Return which certain claims, (k,), are much surer than all certain rivals."""
    return leading(sure, certain, rivals, _SURER)


def sole_owners(confidence: np.ndarray, certain: np.ndarray, alike: Rivals) -> np.ndarray:
    """Return which certain claims, (k,), are much surer of their ID than all others to the same.

    One of two that have an ID is wrong, unless it was printed twice: both are then beyond doubt,
    and none is the owner.
    """
    sure = np.minimum(1 / (1 - confidence + np.finfo(float).eps), _BEYOND_DOUBT)
    return surer(sure, certain, alike)


def best_targets(targets: Sequence[_Target], reach: float = 0.0) -> list[_Target]:
    """Return the most certain target of each place and each print, decoded ones first.

    A print is an ID of a family in one polarity, see `Target.print`. No other lies in the reach of
    a target, in radii of its dot. Where that is 0 only prints count.
    """
    order, decoded = _by_certainty(targets, 0.0)
    near, alike = _places_and_prints(order, reach)
    owning = owners(len(order), lambda it: near(it) | decoded & alike(it))
    return [target for target, owns in zip(order, owning, strict=True) if owns]


def best_of_places(targets: Sequence[_Target], reach: float) -> list[_Target]:
    """Return the most certain target of each place, whatever the prints are."""
    order, _ = _by_certainty(targets, 0.0)
    near, _ = _places_and_prints(order, reach)
    owning = owners(len(order), near)
    return [target for target, owns in zip(order, owning, strict=True) if owns]


def reported(
    targets: Sequence[Target],
    reach: float,
    certain: float,
    *,
    everything: bool = False,
    contested: bool = False,
) -> list[Target]:
    """Return the best target of each place, without its ID where this is in doubt.

    Targets have their likeliest ID. One that is less confident than `certain` is undecoded, and
    so is a certain one whose print another one has, too; see `sole_owners` and `undecoded`. The
    former are reported if `everything` is, the latter if `contested` ones are, too.
    """
    order, decoded = _by_certainty(targets, certain)
    near, alike = _places_and_prints(order, reach)
    owning = owners(len(order), near)
    sole = sole_owners(np.array([it.confidence for it in order]), owning & decoded, alike)
    found: list[Target] = []
    for target, of_place, of_print, is_certain in zip(order, owning, sole, decoded, strict=True):
        if of_print:
            found.append(target)
        elif of_place and (everything or (contested and is_certain)):
            found.append(undecoded(target, 'contested' if is_certain else 'uncertain'))
    return found


def _by_certainty(targets: Sequence[_Target], certain: float) -> tuple[list[_Target], np.ndarray]:
    """Return targets, decoded and certain ones first, and which are, bool, shape (k,)."""

    def is_certain(target: Target) -> bool:
        return target.id != UNDECODED and target.confidence >= certain

    order = sorted(targets, key=lambda it: (not is_certain(it), -it.confidence, it.y, it.x))
    return order, np.array([is_certain(it) for it in order], bool)


def _places_and_prints(targets: Sequence[Target], reach: float) -> tuple[Rivals, Rivals]:
    """Return which targets have the place of one, and which have its print."""
    x, y, minor = np.array([(it.x, it.y, it.semi_minor) for it in targets]).reshape(-1, 3).T
    radii = reach * minor
    prints: dict[tuple[str, int, int], int] = {}
    of_print = np.array([prints.setdefault(it.print, len(prints)) for it in targets], int)

    def near(of: np.ndarray) -> np.ndarray:
        away = np.hypot(x - x[of, None], y - y[of, None])
        return np.asarray(away < np.minimum(radii, radii[of, None]))

    return near, lambda of: of_print == of_print[of, None]
