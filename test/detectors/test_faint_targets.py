"""Ring targets of faint contrast and over-exposed ones, by the whole path of the detector."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from ahf_ros.codes.ring import FAMILY_NAMES, family
from ahf_ros.detectors import DetectorSettings, create_detector
from ahf_ros.detectors.ring.detector import find_hypotheses, read_image
from ahf_ros.evaluation import Score, score
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import TrueTarget
from benchmarks.exposure import Exposure
from benchmarks.lookalikes import other_sectors
from benchmarks.sheets import Sheet, mark_sheet, target_sheet

NUMBERS = np.array([3, 50, 101, 140])


@lru_cache
def sheet(name: str = 'metashape12', bright: bool = False) -> Sheet:
    return target_sheet(name, NUMBERS, 1, columns=2, bright=bright)


def scored(image: np.ndarray, truth: list[TrueTarget], name: str = 'metashape12') -> Score:
    return score(truth, create_detector('ring', settings=DetectorSettings(family=name))(image))


@pytest.mark.parametrize('bright', [False, True], ids=['dark', 'bright'])
@pytest.mark.parametrize(
    ('levels', 'precision'),
    [
        ((130, 110, 1.5), 0.1),
        ((130, 115, 1.0), 0.1),
        ((130, 120, 0.7), 0.1),
        ((130, 125, 0.5), 0.15),
        ((240, 200, 1.0), 0.05),
        ((90, 60, 1.0), 0.05),
    ],
)
def test_faint_targets_are_identified(levels, precision, bright):
    of = sheet(bright=bright)
    figures = scored(of.photograph(Exposure(levels=levels)), of.truth)
    assert (figures.right, figures.wrong, figures.false_positives) == (4, 0, 0)
    assert np.sqrt(np.mean(np.square(figures.errors))) < precision


@pytest.mark.parametrize('name', FAMILY_NAMES)
def test_faint_targets_of_every_family(name):
    of = sheet(name)
    figures = scored(of.photograph(Exposure(levels=(160, 140, 1.0))), of.truth, name)
    assert (figures.right, figures.wrong, figures.false_positives) == (4, 0, 0)


@pytest.mark.parametrize('light', [3.0, 4.0])
def test_over_exposed_targets_are_identified(light):
    of = sheet()
    figures = scored(of.photograph(Exposure(light=light)), of.truth)
    assert (figures.right, figures.wrong, figures.false_positives) == (4, 0, 0)
    assert np.abs(figures.errors).max() < 0.05


@pytest.mark.parametrize('light', ['normal', 'stripe', 'lattice'])
def test_an_image_of_clear_targets_is_read_once(light):
    scene = SceneSettings(width=700, height=500, targets=6, dot_radius=18.0, seed=5, light=light)
    image, settings = render(scene).image, DetectorSettings()
    once, found = read_image(image, settings), find_hypotheses(image, settings)
    assert np.array_equal(found.frames, once.frames)
    assert np.array_equal(found.confidence, once.confidence)
    assert once.certain.sum() >= 6


def test_faint_and_clear_targets_in_one_image():
    of = sheet()
    clear, faint = of.photograph(Exposure()), of.photograph(Exposure(levels=(150, 130, 1.0)))
    image, settings = np.hstack([clear, np.full_like(clear, 140), faint]), DetectorSettings()
    once, found = read_image(image, settings), find_hypotheses(image, settings)
    first = len(once.frames)
    assert np.array_equal(found.frames[:first], once.frames)
    added = found.frames[first:, :2, 2]
    centres = np.array([(it.x + 2 * clear.shape[1], it.y) for it in of.truth])
    away = np.linalg.norm(centres[:, None] - added, axis=2).min(axis=1)
    assert away.max() < 0.2
    assert added[:, 0].min() > clear.shape[1]


def test_faint_marks_that_are_no_targets_stay_unread():
    generator = np.random.default_rng(4)
    inks = [other_sectors(family('metashape12'), generator) for _ in range(6)]
    image = mark_sheet(inks, 1).photograph(Exposure(levels=(130, 110, 1.0)))
    clear = mark_sheet(inks, 1).photograph(Exposure())
    assert scored(image, []).false_positives <= scored(clear, []).false_positives
