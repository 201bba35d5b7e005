"""Contradicting readings: the first owns what they claim, or only one that clearly leads."""

from __future__ import annotations

import doctest

from ahf_ros.detectors import claims
from ahf_ros.target import UNDECODED, Target


def test_examples():
    results = doctest.testmod(claims)
    assert results.attempted and not results.failed


def test_of_targets_each_place_and_each_id_has_one():
    first = Target(7, 7, 50.0, 50.0, 10.0, 10.0, 0.0, confidence=0.99)
    same_place = Target(8, 8, 60.0, 50.0, 10.0, 10.0, 0.0, confidence=0.98)
    same_id = Target(7, 7, 200.0, 50.0, 10.0, 10.0, 0.0, confidence=0.97)
    driven_out = Target(8, 8, 300.0, 50.0, 10.0, 10.0, 0.0, confidence=0.96)
    dots = [Target(UNDECODED, 0, x, 50.0, 10.0, 10.0, 0.0) for x in (201.0, 301.0, 400.0)]
    found = [*dots, driven_out, same_id, same_place, first]
    assert claims.best_targets(found, 2.0) == [first, driven_out, dots[0], dots[2]]
    assert claims.best_targets(found) == [first, same_place, *dots]
