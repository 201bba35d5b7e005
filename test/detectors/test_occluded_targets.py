"""Whole sheets of covered, glossy, cut and foreign targets: what is reported is right."""

from __future__ import annotations

import pytest

from ahf_ros.detectors import DetectorSettings, create_detector
from ahf_ros.evaluation import RIGHT, judge
from benchmarks import occluders
from benchmarks.exposure import Exposure
from benchmarks.sheets import random_numbers, target_sheet

COUNT = 18

SIGHTS = {
    'black over 1 sector': (Exposure(occluder=occluders.over_sectors(1, 61)), 15),
    'gray over 1 sector': (Exposure(occluder=occluders.over_sectors(1, 128)), 15),
    'gray over 2 sectors': (Exposure(occluder=occluders.over_sectors(2, 128)), 5),
    'gray finger': (Exposure(occluder=occluders.finger(2.0, 128)), 12),
    'white spot': (Exposure(occluder=occluders.disc(1.0, 220)), 4),
    'highlight': (Exposure(glare=occluders.highlight(1.0, 200)), 10),
}
"""Disturbances, and how many targets of a sheet are identified at least."""


def reported(exposure, name='metashape12', read_as=None):
    """Return the targets identified on a sheet, and how many of them are right."""
    numbers = random_numbers(name, COUNT, 31)[0]
    sheet = target_sheet(name, numbers, 31)
    detect = create_detector('ring', settings=DetectorSettings(family=read_as or name))
    targets = detect(sheet.photograph(exposure))
    kinds = [verdict.kind for verdict in judge(sheet.truth, targets)]
    return targets, kinds.count(RIGHT)


@pytest.mark.parametrize('sight', SIGHTS)
def test_what_is_covered_costs_targets_and_gives_no_wrong_one(sight):
    exposure, minimum = SIGHTS[sight]
    targets, right = reported(exposure)
    assert len(targets) == right
    assert right >= minimum


@pytest.mark.parametrize('read_as', ['metashape14', 'metashape16', 'metashape20', 'aicon12'])
def test_targets_of_another_family_are_not_reported(read_as):
    targets, right = reported(Exposure(), read_as=read_as)
    assert not right
    assert not targets
