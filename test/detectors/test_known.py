"""What is known of an image while its targets are read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.codes.ring import family
from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.detectors.ring.known import NOTHING_KNOWN, Explained, Prior
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit

CODE = family('metashape12')


def read(certain: bool, radius: float = 10.0, share: float = 1.0) -> Hypotheses:
    """Return a dot, and that its word is certain or not."""
    one = np.ones(1)
    dot = Fit(
        frames=frame.affine_frames(100 * one, 50 * one, radius * one, radius * one, 0 * one),
        polarity=one.astype(int),
        contrast=one / 4,
        bright=200 * one,
        share=share * one,
        deviation=one / 50,
        covariance=np.eye(2)[None],
        blur=0.7 * one,
        edge_shift=0 * one,
    )
    return replace(Hypotheses.unread(dot, CODE), confidence=one * certain)


def test_certain_targets_are_explained_with_their_bands_and_whole_dots_without() -> None:
    target = Explained.by(read(True, share=0.5))
    dot = Explained.by(read(False))
    assert (target.certain.tolist(), dot.certain.tolist()) == ([True], [False])
    assert np.allclose(target.sizes, 10 * (CODE.band_outer + 0.45))
    assert np.allclose(dot.sizes, 14.5)
    assert len(Explained.by(read(False, share=0.5)).frames) == 0
    both = Explained.joined([target, dot])
    assert [len(both.outlines_in(level)) for level in (0, 3, 4, 6)] == [2, 2, 1, 0]
    assert np.allclose(both.outlines_in(0), both.outlines)


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
