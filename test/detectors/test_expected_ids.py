"""IDs that are known to be there: what looks like paper on paper cannot turn one into another."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros import create_identifier
from ahf_ros.codes.ring import family
from ahf_ros.detectors import Expecting, create_detector
from ahf_ros.detectors.external.guarded import guarded
from ahf_ros.evaluation import RIGHT, WRONG, judge
from ahf_ros.target import Target
from benchmarks import occluders
from benchmarks.disturbances import far_apart
from benchmarks.exposure import Exposure
from benchmarks.sheets import target_sheet

FAMILY = family('metashape12')
IDS = far_apart(FAMILY, 3, 31)
IMAGE = np.zeros((8, 8), np.uint8)
PAPER_ON_PAPER = Exposure(occluder=occluders.over_sectors(2, 220.0, whole=True))


def kinds(targets, truth):
    """Return which reports are right, wrong and false."""
    return [verdict.kind for verdict in judge(truth, targets)]


@pytest.fixture(scope='module')
def covered():
    """Return photographs of targets under paper, with their truth."""
    sheets = [target_sheet(FAMILY.name, IDS, seed) for seed in (31, 32, 33)]
    return [(sheet.photograph(PAPER_ON_PAPER), sheet.truth) for sheet in sheets]


def test_no_two_ids_chosen_far_apart_look_alike_where_sectors_are_covered():
    assert len(IDS) > 5
    looks = {}
    for number in IDS:
        word = int(FAMILY.words[number - 1])
        for start in range(FAMILY.bits):
            window = sum(1 << (start + step) % FAMILY.bits for step in range(3))
            look = FAMILY.number(word & ~window)
            assert look is None or look not in looks or looks[look] == number
            looks[look] = number


def test_paper_on_paper_turns_one_id_into_another_unless_they_are_known(covered):
    blind = create_detector('ring')
    informed = blind.expecting(frozenset(IDS))
    of_blind = [kind for image, truth in covered for kind in kinds(blind(image), truth)]
    of_informed = [kind for image, truth in covered for kind in kinds(informed(image), truth)]
    assert of_blind.count(WRONG) > 0  # no trace is left to see
    assert set(of_informed) <= {RIGHT}
    assert of_informed


def test_expected_ids_reach_the_detector(covered):
    listed = ','.join(map(str, IDS))
    for image, truth in covered:
        found = create_identifier(expected_ids=listed, ahf=False).identify(image)
        assert WRONG not in kinds(found.targets, truth)


def test_ids_that_are_not_expected_are_never_read_as_expected_ones():
    sheet = target_sheet(FAMILY.name, IDS, 31)
    others = frozenset(range(1, len(FAMILY.words) + 1)) - frozenset(IDS)
    detector = create_detector('ring')
    assert isinstance(detector, Expecting)
    read = kinds(detector.expecting(others)(sheet.photograph(Exposure())), sheet.truth)
    assert read.count(RIGHT) == len(read) > 0


class Plugin:
    """A detector of another package that is told which IDs are expected."""

    name, family = 'mine', 'metashape12'

    def __init__(self, ids=()):
        self.ids = ids

    def __call__(self, image):
        return [Target(number, 1, 4.0, 4.0, 2.0, 2.0) for number in sorted(self.ids)]

    def expecting(self, ids):
        if 13 in ids:
            raise RuntimeError('not that one')
        return Plugin(ids)


def test_a_detector_of_another_package_is_told_the_ids():
    detector = guarded(Plugin(), 5.0)
    assert [it.id for it in detector.expecting(frozenset({7, 3}))(IMAGE)] == [3, 7]
    assert detector(IMAGE) == []
    with pytest.raises(ValueError, match=r"detector 'mine' failed.*not that one"):
        detector.expecting(frozenset({13}))
