"""Reading bands: the right word under every light, its margin, and what makes it certain."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from ahf_ros.codes.ring import FAMILY_NAMES, canonical, family
from ahf_ros.detectors.ring.band_evidence import band_evidence
from ahf_ros.detectors.ring.band_samples import sample_bands
from ahf_ros.detectors.ring.confidence import FEATURES, confidence, confidence_features
from ahf_ros.detectors.ring.decoding import Readings, decode, sector_angles
from ahf_ros.detectors.ring.evidence import MarkAppearance
from ahf_ros.detectors.ring.occluded_decoding import decode_occluded
from ahf_ros.features import frame
from ahf_ros.features.circle_fit import Fit
from ahf_ros.synthetic.scene import Rendering, SceneSettings, render

SMALL = SceneSettings(width=800, height=600, targets=6, dot_radius=18.0, seed=7)

rendered = lru_cache(render)


def marks_of(rendering: Rendering, count: int) -> MarkAppearance:
    """Return how the marks of a scene look, from what it was rendered with."""
    scene = rendering.settings
    polarity = 1 if scene.polarity == 'dark' else -1
    contrast = scene.black ** (1 / scene.gamma)
    bright = np.percentile(rendering.image, 90 if polarity > 0 else 99)
    return MarkAppearance(
        np.full(count, polarity),
        np.full(count, contrast),
        np.full(count, bright),
        np.full(count, 0.8),
    )


def decoded(
    gray: np.ndarray, frames: np.ndarray, marks: MarkAppearance, name: str, occluded: bool = False
) -> Readings:
    code = family(name)
    angles = sector_angles(code, 10)
    samples = sample_bands(gray, frames, marks.blur, angles, code)
    evidence = band_evidence(samples, marks, frames, code)
    readings = decode(samples, evidence, marks, code)
    if not occluded:
        return readings
    return decode_occluded(samples, evidence, readings, marks, frames, code)


def read(rendering: Rendering, occluded: bool = False) -> Readings:
    """Read the bands of a scene in the frames that are true, but for their perspective."""
    values = [(of.x, of.y, of.semi_major, of.semi_minor, of.angle) for of in rendering.targets]
    frames = frame.affine_frames(*np.array(values).T)
    gray = rendering.image.astype(np.float32)
    name = rendering.settings.family
    return decoded(gray, frames, marks_of(rendering, len(frames)), name, occluded)


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
@pytest.mark.parametrize('name', FAMILY_NAMES)
def test_words_are_read_in_their_direction(name, polarity):
    rendering = rendered(replace(SMALL, family=name, polarity=polarity))
    readings = read(rendering)
    codes, numbers = canonical(readings.words, family(name))
    assert codes.tolist() == [target.code for target in rendering.targets]
    assert numbers.tolist() == [target.id for target in rendering.targets]
    assert readings.margin.min() > 10
    assert readings.plausible.all()


@pytest.mark.parametrize('light', ['stripe', 'lattice', 'fringe', 'shadow'])
def test_light_changes_the_margin_and_not_the_words(light):
    rendering = rendered(replace(SMALL, light=light))
    readings = read(rendering)
    _, numbers = canonical(readings.words, family(SMALL.family))
    assert numbers.tolist() == [target.id for target in rendering.targets]
    assert readings.margin.min() > 3


def test_dark_spots_at_the_edge_of_an_unmarked_sector_contradict_the_word():
    rendering = rendered(SMALL)
    clean = read(rendering)
    assert clean.contradiction.max() < 0.5

    target, start, bits = rendering.targets[0], clean.start[0], family(SMALL.family).bits
    unmarked = next(b for b in range(bits) if not clean.words[0] >> b & 1)
    away = start + 2 * np.pi * (unmarked + 0.5) / bits
    x = target.x + 2.4 * target.semi_major * np.cos(away)
    y = target.y - 2.4 * target.semi_major * np.sin(away)
    rows, columns = np.indices(rendering.image.shape)
    spot = np.hypot(columns - x, rows - y) < 0.35 * target.semi_major
    readings = read(replace(rendering, image=np.where(spot, np.uint8(60), rendering.image)))

    assert readings.words.tolist() == clean.words.tolist()
    assert readings.contradiction[0] > 3
    assert readings.contradiction[1:].tolist() == clean.contradiction[1:].tolist()


def test_a_band_of_plain_paper_is_no_word():
    gray = np.full((200, 200), 200, np.float32)
    frames = frame.affine_frames([100], [100], [15], [15], [0])
    marks = MarkAppearance(np.array([1]), np.array([0.25]), np.array([200.0]), np.array([0.8]))
    readings = decoded(gray, frames, marks, 'metashape12')
    assert not readings.plausible.any()


def test_no_band_no_reading():
    gray = np.full((50, 60), 200, np.float32)
    nothing = MarkAppearance(np.zeros(0, int), np.zeros(0), np.zeros(0), np.zeros(0))
    readings = decoded(gray, np.zeros((0, 3, 3)), nothing, 'aicon14')
    assert len(readings.words) == len(readings.plausible) == 0


def test_some_of_the_readings():
    readings = read(rendered(SMALL))
    some = readings.select(np.array([4, 1]))
    assert some.words.tolist() == readings.words[[4, 1]].tolist()
    assert some.explained.tolist() == readings.explained[[4, 1]].tolist()


def test_confidence_is_a_probability_that_grows_with_the_evidence():
    def of(readings, share=1.0, deviation=0.05):
        fit = Fit(
            frame.affine_frames(np.zeros(6), 0, 12, 12, 0),
            polarity=np.ones(6, int),
            contrast=np.full(6, 0.25),
            bright=np.full(6, 200.0),
            share=np.full(6, share),
            deviation=np.full(6, deviation),
            covariance=np.tile(1e-4 * np.eye(2), (6, 1, 1)),
            blur=np.full(6, 0.8),
        )
        features = confidence_features(readings, fit)
        assert features.shape == (6, FEATURES)
        return confidence(features)

    readings = read(rendered(SMALL), occluded=True)
    sure = of(readings)
    assert (sure > 0.9).all()
    assert (sure <= 1).all()
    for worse in (
        of(replace(readings, margin=readings.margin / 10)),
        of(replace(readings, explained=readings.explained / 2)),
        of(readings, share=0.5),
        of(replace(readings, unexplained=readings.unexplained + 40)),
        of(replace(readings, support=-readings.support)),
    ):
        assert (worse >= 0).all()
        assert (worse < sure).all()
    for no_better in (
        of(replace(readings, contradiction=readings.contradiction + 20)),
        of(replace(readings, hidden=~readings.hidden)),
        of(readings, deviation=0.5),
    ):
        assert (no_better <= sure).all()


@pytest.mark.parametrize('light', ['normal', 'stripe', 'lattice', 'spots'])
def test_light_hides_nothing(light):
    rendering = rendered(replace(SMALL, light=light))
    readings = read(rendering, occluded=True)
    _, numbers = canonical(readings.words, family(SMALL.family))
    assert numbers.tolist() == [target.id for target in rendering.targets]
    assert readings.margin.min() > 3
    assert (readings.support > 0).all()
    assert not readings.hidden.any()


def test_what_is_hidden_is_found_and_says_nothing_about_the_word():
    rendering = rendered(SMALL)
    clean = read(rendering, occluded=True)
    target, start, bits = rendering.targets[0], clean.start[0], family(SMALL.family).bits
    rows, columns = np.indices(rendering.image.shape)
    x, y = (columns - target.x) / target.semi_major, (target.y - rows) / target.semi_major
    sector = (np.arctan2(y, x) - start) % (2 * np.pi) / (2 * np.pi) * bits
    for first in range(0, bits, 3):
        inside = (sector > first + 0.3) & (sector < first + 1.7) & (np.hypot(x, y) > 1.5)
        covered = np.where(inside & (np.hypot(x, y) < 4.2), np.uint8(128), rendering.image)
        readings = read(replace(rendering, image=covered), occluded=True)
        assert readings.words.tolist() == clean.words.tolist()
        angles = readings.hidden.shape[1]
        of_angle = (np.arange(angles) + 0.5) * bits / angles
        turned = (of_angle - start * bits / (2 * np.pi)) % bits
        middle = (turned > first + 0.5) & (turned < first + 1.5)
        assert readings.hidden[0][middle].all()
        assert not readings.hidden[0][(turned < first) | (turned > first + 2)].any()
        assert not readings.hidden[1:].any()


def test_arcs_that_no_word_has_are_not_explained():
    clean = read(rendered(replace(SMALL, family='metashape14')), occluded=True)
    other = rendered(replace(SMALL, family='metashape14'))
    wrong = read(replace(other, settings=SMALL), occluded=True)
    assert clean.unexplained.max() < 3
    assert wrong.unexplained.min() > 10


def test_canonical_words_and_their_ids():
    table = family('aicon12')
    word = table.word(3)
    rotated = np.array([word, word >> 1 | (word & 1) << 11, table.word(147)])
    codes, numbers = canonical(rotated, table)
    assert codes.tolist() == [word, word, table.word(147)]
    assert numbers.tolist() == [3, 3, 147]
