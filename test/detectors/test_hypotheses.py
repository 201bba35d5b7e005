"""Contradicting readings: resolved where one is clearly better, undecoded where none is."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.codes.ring import family
from ahf_ros.detectors.ring.confidence import FEATURES
from ahf_ros.detectors.ring.decoding import Readings
from ahf_ros.detectors.ring.hypotheses import (
    Hypotheses,
    resolve_dots,
    resolve_ids,
    resolve_overlaps,
)
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit

CODE = family('metashape12')
RADIUS = 10.0


def hypotheses(places: list[tuple[float, float]], margins: list[float]) -> Hypotheses:
    count = len(places)
    frames = frame.affine_frames(*np.array(places).T, RADIUS, RADIUS, 0.0)
    return Hypotheses(
        frames=frames,
        covariance=np.tile(np.eye(2), (count, 1, 1)),
        share=np.ones(count),
        words=np.full(count, 71),
        margin=np.array(margins),
        features=np.zeros((count, FEATURES)),
        confidence=np.ones(count),
        families=np.full(count, CODE, object),
        sharpness=np.full(count, 5.0),
        polarity=np.ones(count, int),
        starts=np.zeros(count),
        blur=np.full(count, 0.8),
    )


def resolved(places, margins, ids, certain=None):
    certain = np.ones(len(places), bool) if certain is None else np.array(certain)
    found = hypotheses(places, margins)
    kept, uncontested = resolve_dots(found, np.array(ids), certain, found.reach)
    return kept.tolist(), uncontested.tolist()


def test_dots_apart_are_all_kept():
    kept, uncontested = resolved([(50, 50), (150, 50)], [30, 20], [1, 2])
    assert kept == [0, 1]
    assert uncontested == [True, True]


def test_of_two_readings_of_a_dot_the_first_is_kept():
    assert resolved([(50, 50), (51, 50)], [30, 5], [1, 2]) == ([0], [True, False])


def test_two_readings_of_a_dot_that_are_alike_in_evidence_contest_it():
    assert resolved([(50, 50), (51, 50)], [30, 20], [1, 2]) == ([0], [False, False])


def test_two_readings_of_a_dot_that_say_the_same_agree():
    assert resolved([(50, 50), (51, 50)], [30, 20], [1, 1]) == ([0], [True, False])


def test_an_uncertain_reading_contests_nothing():
    result = resolved([(50, 50), (51, 50)], [30, 20], [1, 2], [True, False])
    assert result == ([0], [True, False])


def test_sectors_of_a_band_that_was_read_are_no_dots():
    """2.9 radii away, between the edges of the band."""
    in_band = (50 + 2.9 * RADIUS, 50)
    assert resolved([(50, 50), in_band], [30, 20], [1, 1], [True, False])[0] == [0]
    assert resolved([(50, 50), in_band], [30, 20], [1, 1], [False, False])[0] == [0, 1]


def test_of_two_claims_to_an_id_the_clearly_better_one_stays():
    places = [(50, 50), (150, 50), (250, 50)]
    certain = np.ones(3, bool)
    clear = resolve_ids(hypotheses(places, [30, 20, 10]), np.array([1, 2, 1]), certain)
    assert clear.tolist() == [True, True, False]
    unclear = resolve_ids(hypotheses(places, [30, 20, 16]), np.array([1, 2, 1]), certain)
    assert unclear.tolist() == [False, True, False]
    assert certain.all()


@pytest.mark.parametrize(
    ('apart', 'margins', 'on_top'),
    [
        (55, [90, 50], [True, False]),
        (55, [90, 80], [False, False]),
        (70, [90, 50], [True, True]),
    ],
)
def test_of_two_targets_whose_bands_overlap_only_the_clearly_better_one_is_certain(
    apart, margins, on_top
):
    found = hypotheses([(50, 50), (50 + apart, 50)], margins)
    assert resolve_overlaps(found, np.ones(2, bool)).tolist() == on_top
    assert resolve_overlaps(found, np.array([False, True])).tolist() == [False, True]


def test_uncertain_claims_do_not_count():
    found = hypotheses([(50, 50), (150, 50)], [30, 29])
    certain = resolve_ids(found, np.array([1, 1]), np.array([True, False]))
    assert certain.tolist() == [True, False]


def test_parts_of_finds_stay_in_order():
    found = hypotheses([(50, 50), (150, 50), (250, 50)], [3, 2, 1])
    parts = [found.select(np.array([2])), found.select(np.array([0, 1]))]
    assert Hypotheses.joined(parts).margin.tolist() == [1, 3, 2]


def test_readings_are_taken_over_where_they_belong():
    fit = Fit(
        frames=frame.affine_frames([10.0, 20.0], 5.0, 4.0, 3.0, 0.0),
        polarity=np.ones(2, int),
        contrast=np.full(2, 0.3),
        bright=np.full(2, 200.0),
        share=np.array([0.8, 0.9]),
        deviation=np.full(2, 0.1),
        covariance=np.tile(np.eye(2), (2, 1, 1)),
        blur=np.full(2, 0.8),
    )
    unread = Hypotheses.unread(fit, CODE)
    assert not unread.words.any() and not unread.confidence.any()
    better = Fit(
        frames=frame.affine_frames([20.5], 5.0, 4.0, 3.0, 0.0),
        polarity=np.ones(1, int),
        contrast=np.full(1, 0.3),
        bright=np.full(1, 200.0),
        share=np.array([1.0]),
        deviation=np.full(1, 0.02),
        covariance=0.1 * np.eye(2)[None],
        blur=np.full(1, 0.8),
    )
    one = np.ones(1)
    readings = Readings(
        words=np.array([71]),
        start=0 * one,
        margin=13 * one,
        support=100 * one,
        contradiction=0 * one,
        explained=np.ones((1, 4)),
        unexplained=0 * one,
        hidden=np.zeros((1, 120), bool),
        price=0 * one,
        plausible=one > 0,
    )
    dot, whole = unread.select(np.array([1])), np.zeros(1, bool)
    found = unread.replaced(np.array([1]), Hypotheses.read(readings, better, dot, whole))
    assert found.words.tolist() == [0, 71]
    assert found.frames[:, 0, 2].tolist() == [10.0, 20.5]
    assert found.share.tolist() == [0.8, 1.0]
    assert found.margin.tolist() == [0.0, 100.0]
    assert found.confidence[0] == 0 and found.confidence[1] > 0.9
    foreign = Hypotheses.read(readings, better, dot, ~whole)
    assert (foreign.words[0], foreign.confidence[0]) == (71, 0.0)
    assert fit.frames[1, 0, 2] == 20.0  # what was given is not changed
    assert not unread.words.any()
