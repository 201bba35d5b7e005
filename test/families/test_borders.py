"""The ends of arcs: at the borders of sectors for words, anywhere for other arcs."""

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.families.ring.contests import among_others
from ahf_ros.families.ring.detector import find_hypotheses
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.prints.ring import family
from support.pictures.disturbed import Targets
from support.pictures.exposure import Exposure
from support.pictures.lookalikes import LOOKALIKES
from support.pictures.sheets import Sheet, mark_sheet

SETTINGS = DetectorSettings(family='metashape12')


def odds(sheet: Sheet) -> np.ndarray:
    """Return the log odds of words against arcs of any length, of the dots that were read."""
    found = find_hypotheses(sheet.photograph(Exposure()), SETTINGS)
    return found.coded[found.words > 0]


def test_arcs_of_words_end_where_sectors_do() -> None:
    (sheet,) = Targets('metashape12', 24, 3).sheets()
    found = odds(sheet)
    assert len(found) == 24
    assert (found > 1).all()  # measured: 2.8 to 13.4
    assert np.median(found) > 4


def test_other_arcs_end_anywhere() -> None:
    generator = np.random.default_rng(3)
    inks = [LOOKALIKES['random arcs'](family('metashape12'), generator) for _ in range(24)]
    found = odds(mark_sheet(inks, 3))
    assert np.median(found) < -10  # measured: -29


@pytest.mark.lasting
@pytest.mark.parametrize('name', ['metashape12', 'aicon14'])
def test_marks_of_no_family_are_not_reported(name: str) -> None:
    generator = np.random.default_rng(35)
    kinds = [draw for kind, draw in LOOKALIKES.items() if kind != 'clutter']
    inks = [draw(family(name), generator) for _ in range(9) for draw in kinds]
    assert not create_detector(family=name)(mark_sheet(inks, 35).photograph(Exposure()))


def test_a_word_among_arcs_has_to_be_clear() -> None:
    generator = np.random.default_rng(6)
    arcs = [LOOKALIKES['random arcs'](family('metashape12'), generator) for _ in range(24)]
    foreign = find_hypotheses(mark_sheet(arcs, 6).photograph(Exposure()), SETTINGS)
    (sheet,) = Targets('metashape12', 1, 6).sheets()
    target = find_hypotheses(sheet.photograph(Exposure()), SETTINGS)
    target = target.select(target.certain)
    clear, doubtful = (replace(target, confidence=np.array([of])) for of in (0.998, 0.9))
    for word, reported in ((clear, True), (doubtful, False)):
        assert among_others(word).confidence == word.confidence
        found = among_others(Hypotheses.joined([word, foreign]))
        assert found.certain[0] == reported
    doubts = Hypotheses.joined([replace(clear, confidence=np.array([0.98]))] + [doubtful] * 4)
    assert doubts.certain.all()
    assert not among_others(Hypotheses.joined([doubts, foreign])).certain.any()
