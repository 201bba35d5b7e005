"""Contradicting readings: resolved where one is clearly better, undecoded where none is."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ahf_ros.families.ring.confidence import rated
from ahf_ros.families.ring.contests import among_others, resolve
from ahf_ros.families.ring.decoding import Words
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.prints.ring import family
from support.ring import made_up

CODE = family('metashape12')
RADIUS = 10.0


def hypotheses(places: list[float], odds: list[float]) -> Hypotheses:
    count = len(places)
    return replace(
        Hypotheses.unread(made_up(places, radius=RADIUS), CODE),
        words=np.full(count, 71),
        marked=np.array(odds, float),
        seen=np.array(odds, float),
        confidence=np.ones(count),
    )


def resolved(
    places: Any, odds: Any, ids: list[int], confidence: Any
) -> tuple[list[int], list[bool]]:
    found = replace(hypotheses(places, odds), confidence=np.array(confidence, float))
    kept, certain = resolve(found, np.array(ids))
    return np.flatnonzero(kept).tolist(), certain.tolist()


APART, ONE_DOT = [50, 150], [50, 51]
SURE, FIRST = [True, True], [True, False]


@pytest.mark.parametrize(
    ('places', 'odds', 'ids', 'confidence', 'kept', 'certain'),
    [
        pytest.param(APART, [30, 20], [1, 2], SURE, [0, 1], SURE, id='dots apart'),
        pytest.param(ONE_DOT, [30, 5], [1, 2], SURE, [0], FIRST, id='two readings of a dot'),
        pytest.param(ONE_DOT, [30, 20], [1, 2], SURE, [0], [False, False], id='a contested dot'),
        pytest.param(ONE_DOT, [30, 20], [1, 1], SURE, [0], FIRST, id='readings that agree'),
        pytest.param(ONE_DOT, [30, 20], [1, 2], FIRST, [0], FIRST, id='an uncertain rival'),
        pytest.param(APART, [30, 29], [1, 1], FIRST, [0, 1], FIRST, id='an uncertain claim'),
    ],
)
def test_readings_that_contradict_each_other(
    places: Any, odds: list[int], ids: list[int], confidence: Any, kept: list[int], certain: Any
) -> None:
    assert resolved(places, odds, ids, confidence) == (kept, certain)


@pytest.mark.parametrize(
    ('seen', 'marked', 'leads'),
    [
        ((156, 108), (156, 346), True),
        ((61, 59), (712, 301), True),
        ((250, 253), (1415, 1440), False),
    ],
)
def test_of_two_readings_of_a_dot_only_one_may_know_its_levels(
    seen: tuple[int, int], marked: tuple[int, int], leads: bool
) -> None:
    """As measured in pictures; the surer one of the last two, which is covered, is wrong."""
    found = replace(hypotheses(ONE_DOT, seen), marked=np.array(marked, float))
    assert resolve(found, np.array([1, 2]))[1].tolist() == [leads, False]


def test_of_two_claims_to_an_id_the_clearly_surer_one_stays() -> None:
    places, odds, ids = [50, 150, 250], [30, 20, 10], [1, 2, 1]
    assert resolved(places, odds, ids, [0.99, 0.98, 0.8])[1] == [True, True, False]
    assert resolved(places, odds, ids, [0.9, 0.8, 0.76])[1] == [False, True, False]


def test_two_targets_beyond_doubt_that_have_one_id_were_printed_twice() -> None:
    assert resolved(APART, [217, 86], [1, 1], [0.999, 0.955])[1] == [False, False]


def test_sectors_of_a_band_that_was_read_are_no_dots() -> None:
    """2.9 radii away, between the edges of the band."""
    places = [50, 50 + 2.9 * RADIUS]
    assert resolved(places, [30, 20], [1, 1], [True, False])[0] == [0]
    assert resolved(places, [30, 20], [1, 1], [False, False])[0] == [0, 1]


@pytest.mark.parametrize(
    ('apart', 'confidence', 'on_top'),
    [
        (55, [0.99, 0.9], [True, False]),
        (55, [0.99, 0.98], [False, False]),
        (70, [0.99, 0.9], [True, True]),
    ],
)
def test_of_two_targets_whose_bands_overlap_only_the_surer_one_is_certain(
    apart: int, confidence: list[float], on_top: list[bool]
) -> None:
    places = [50, 50 + apart]
    assert resolved(places, [90, 80], [1, 2], confidence)[1] == on_top
    assert resolved(places, [90, 80], [1, 2], [True, False])[1] == [True, False]


def certain_among(
    words: list[int], foreign: list[int], confidence: Any = 0.93, deviation: float = 0.1
) -> int:
    """Return how many readings of words stay certain beside bands of no word.

    The edges of these have a standard deviation, px.
    """
    count, every = len(words), [*words, *foreign]
    found = hypotheses([80 * it for it in range(len(every))], [50] * len(every))
    is_word = np.arange(len(every)) < count
    found = replace(
        found,
        words=CODE.words[every],
        confidence=np.append(np.broadcast_to(confidence, count), np.zeros(len(foreign))),
        coded=np.where(is_word, 5.0, -15.0),
        deviation=np.where(is_word, 0.1, deviation) / RADIUS,
    )
    return int(among_others(found).certain.sum())


def test_spots_of_a_lattice_are_no_other_family_however_many_there_are() -> None:
    """Their neighbours are all where those of the next spot are."""
    targets, spots = list(range(14)), [20, 21, 22] * 30
    assert certain_among(targets, spots) == 14
    assert certain_among(targets, list(range(14, 104))) == 0


def test_edges_that_are_no_ellipses_are_mostly_those_of_light() -> None:
    """As those of fringes are: a whole image of targets was lost beside 14 of them."""
    measured = [0.83, 0.87, 0.89, 0.88, 0.92, 0.93, 0.85, 0.87, 0.75, 0.91]
    fringes = list(range(20, 34))
    assert certain_among(list(range(10)), fringes, measured, deviation=1.5) == 9  # but 0.75
    targets, bands = list(range(14)), list(range(14, 104))
    assert certain_among(targets, bands, deviation=1.5) == 14
    assert certain_among(targets, bands, deviation=0.3) == 0
    assert certain_among(targets[:1], bands, deviation=1.5) == 0


def test_one_word_in_several_places_does_not_speak_for_itself() -> None:
    """As a letter of a page does."""
    assert certain_among([1, 2, 3, 4], list(range(20, 26))) == 4
    assert certain_among([1, 1, 1, 1], list(range(20, 26))) == 0


def test_parts_of_finds_stay_in_order() -> None:
    found = hypotheses([50, 150, 250], [3, 2, 1])
    parts = [found.select(np.array([2])), found.select(np.array([0, 1]))]
    assert Hypotheses.joined(parts).marked.tolist() == [1, 3, 2]


def test_readings_are_taken_over_where_they_belong() -> None:
    fit, better = made_up([10.0, 20.0], share=0.8), made_up([20.5])
    unread = Hypotheses.unread(fit, CODE)
    assert not unread.words.any() and not unread.confidence.any()
    assert np.isnan(unread.print_growth).all()
    words = replace(
        Words.none(1, 120),
        words=np.array([71]),
        margin=np.array([13.0]),
        marked=np.array([150.0]),
        coded=np.array([20.0]),
        seen=np.array([100.0]),
        hidden=np.arange(120)[None] < 12,
    )
    found = unread.replaced(np.array([1]), rated(Hypotheses.of(better, words, CODE)))
    assert found.words.tolist() == [0, 71]
    assert found.frames[:, 0, 2].tolist() == [10.0, 20.5]
    assert found.share.tolist() == [0.8, 1.0]
    assert found.margin.tolist() == [0.0, 13.0]
    assert found.hidden.tolist() == [0.0, 0.1]
    assert found.deviation.tolist() == [0.05, 0.05]  # dot radii
    assert found.print_growth[1] == pytest.approx(-0.3, abs=0.5)
    assert found.confidence[0] == 0 and found.confidence[1] > 0.9
    assert fit.frames[1, 0, 2] == 20.0  # what was given is not changed
    assert not unread.words.any()


def test_centres_on_the_dots_of_others() -> None:
    found = hypotheses([50, 150], [2, 1])
    near = hypotheses([58, 162], [2, 1])
    assert near.on_dots(found.frames).tolist() == [True, False]
    assert found.on_dots(found.frames[:0]).tolist() == [False, False]
