"""Codes of targets, by the evidence at all of their places."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ahf_ros.codes.gsi import PointFamily
from ahf_ros.detectors.gsi.evidence import Evidence
from ahf_ros.features.array_record import ArrayRecord

_MOST_FOR, _MOST_AGAINST = 8.0, 6.0  # that one place may say on whether there is a target
_GREATEST_MARGIN = 14.0  # of one code over the next, beyond which it says no more
_CLEAREST = 20.0  # that it may say for a dot on which one


@dataclass(frozen=True, slots=True)
class Readings(ArrayRecord):
    """What k groups of dots were read as.

    Attributes
    ----------
    words : ndarray of int64, shape (k,)
        Value of the best code.
    margin : ndarray of float64, shape (k,)
        Evidence for it over that for the second best, in ln.
    support : ndarray of float64, shape (k,)
        Evidence for a target with this code: for its dots, and against dots at all other places,
        as a share of the most there may be.
    weakest : ndarray of float64, shape (k,)
        The second lowest evidence for one of its dots, as light may hide one.
    """

    words: np.ndarray
    margin: np.ndarray
    support: np.ndarray
    weakest: np.ndarray


def read_codes(evidence: Evidence, scale: np.ndarray, family: PointFamily) -> Readings:
    """Return the codes that the evidence speaks for.

    Parameters
    ----------
    evidence : Evidence
        Of k groups.
    scale : ndarray of float64, shape (k,)
        Radius of the dots in that of the printed design. What is seen at places nearer to dots
        than two radii is these dots, and tells nothing new.
    family : PointFamily
    """
    count = len(family.template)
    limited = np.clip(evidence.ratio, -_MOST_AGAINST, _MOST_FOR)
    template, positions = limited[:, :count], limited[:, count:]
    incidence = _incidence(family)
    scores = np.clip(evidence.ratio[:, count:], -_MOST_AGAINST, _CLEAREST) @ incidence.T
    rows, best = np.arange(len(scores)), scores.argmax(axis=1)
    highest = scores[rows, best]
    scores[rows, best] = highest - _GREATEST_MARGIN
    margin = highest - scores.max(axis=1)
    marked = incidence[best] > 0
    empty = ~marked & ~_covered(marked, scale, family)
    of_dots = np.concatenate([template, np.where(marked, positions, _MOST_FOR)], axis=1)
    against = np.where(empty, -positions, 0.0).sum(axis=1)
    dots = template.sum(axis=1) + np.where(marked, positions, 0.0).sum(axis=1)
    empty &= evidence.inside[:, count:]
    most = (count + marked.sum(axis=1)) * _MOST_FOR + empty.sum(axis=1) * _MOST_AGAINST
    return Readings(
        family.words[best],
        margin,
        (dots + against) / most,
        np.sort(of_dots, axis=1)[:, 1],
    )


def _covered(marked: np.ndarray, scale: np.ndarray, family: PointFamily) -> np.ndarray:
    """Return which positions lie within two radii of a dot, shape (k, positions)."""
    count, places, radii = len(family.template), family.places, family.radii
    gaps = np.hypot(*(places[:, None] - places[count:]).transpose(2, 0, 1))
    near = gaps / (radii[:, None] + radii[count:]) < scale[:, None, None]
    shown = np.concatenate([np.ones((len(marked), count), bool), marked], axis=1)
    covered: np.ndarray = (near & shown[:, :, None]).any(axis=1)
    return covered


@lru_cache(maxsize=8)
def _incidence(family: PointFamily) -> np.ndarray:
    """Return which positions each code has dots at, 0 or 1, shape (codes, positions)."""
    bits = family.words[:, None] >> family.position_numbers & 1
    return bits.astype(np.float64)
