"""The ends of arcs: at the borders of sectors for words, anywhere for other arcs."""

from __future__ import annotations

import numpy as np

from ahf_ros.codes.ring import family
from ahf_ros.detectors import DetectorSettings
from ahf_ros.detectors.ring.detector import find_hypotheses
from benchmarks.disturbed import Targets
from benchmarks.exposure import Exposure
from benchmarks.lookalikes import LOOKALIKES
from benchmarks.sheets import Sheet, mark_sheet

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
