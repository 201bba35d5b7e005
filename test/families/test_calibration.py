"""What is stated of rings of dots, of which the detector is surer than it is right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.base.target import Target
from ahf_ros.families.dots.calibration import KNOTS, stated, sure_of
from ahf_ros.families.undecoded import undecoded


def states(sure: np.ndarray) -> np.ndarray:
    target = Target(7, 71, 1.0, 2.0, 3.0, 3.0)
    found = stated([replace(target, confidence=it) for it in sure.tolist()])
    return np.array([it.confidence for it in found])


def test_no_decision_changes_and_nothing_is_stated_that_the_detector_is_not_sure_of() -> None:
    sure = np.array([0.0, 0.01, 0.02, 0.3, 0.5, 0.8, 0.95, 0.97, 0.99, 0.9999, 1.0])
    probable = states(sure)
    assert (np.diff(probable) > 0).all()
    assert (probable <= sure + 1e-12).all()
    beyond = (sure < KNOTS[0]) | (sure >= KNOTS[-1])
    assert probable[beyond] == pytest.approx(sure[beyond])
    assert sure_of(probable) == pytest.approx(sure)


def test_the_likely_id_of_an_undecoded_target_has_its_probability_and_no_id_none() -> None:
    target = Target(7, 71, 1.0, 2.0, 3.0, 3.0, confidence=0.5)
    uncertain = undecoded(target)
    unread = undecoded(replace(target, confidence=0.01))
    likely, unlikely = stated([uncertain, unread])
    assert likely == replace(uncertain, confidence=states(np.array([0.5]))[0])
    assert unlikely == unread
