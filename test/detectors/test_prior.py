"""What certain targets tell about the others of an image."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.detectors.ring.known import NOTHING_KNOWN, Prior


def test_few_certain_targets_tell_nothing_but_which_ids_are_expected() -> None:
    assert Prior.after(frozenset(), np.array([0.8, 0.8])) == NOTHING_KNOWN
    assert Prior.after(frozenset({7}), np.zeros(0)) == Prior(frozenset({7}))


def test_the_shift_of_certain_targets_is_probably_that_of_the_others() -> None:
    alike = Prior.after(frozenset(), np.array([0.8, 0.82, 0.78, 0.8, 5.0]))
    assert alike.shift == pytest.approx(0.8)
    assert alike.deviation < NOTHING_KNOWN.deviation
    apart = Prior.after(frozenset(), np.array([-1.5, -0.5, 0.4, 1.6]))
    assert apart.deviation == NOTHING_KNOWN.deviation
    assert apart.deviation > alike.deviation > 0  # not all are lit and printed alike
