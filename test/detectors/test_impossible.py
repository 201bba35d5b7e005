"""Words with levels that no light explains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.codes.ring import family
from ahf_ros.detectors.ring.band_samples import BandSamples
from ahf_ros.detectors.ring.decoding import bits_at
from ahf_ros.detectors.ring.evidence import MarkAppearance
from ahf_ros.detectors.ring.impossible import are_impossible

FAMILY = family('metashape12')
WORD, PHASE, PER_SECTOR = 0b000001000111, 3, 10
MARKED, UNMARKED = 1, 4  # sectors of that word
PAPER, CONTRAST, SHADOW = 200.0, 0.25, 0.25
FRAMES = np.diag([20.0, 20.0, 1.0])[None]


def marks(polarity: int = 1) -> MarkAppearance:
    return MarkAppearance(
        np.array([polarity]), np.array([CONTRAST]), np.array([PAPER]), np.array([0.8])
    )


def seen(polarity: int = 1, lit: int | None = None) -> BandSamples:
    """Return the samples of the word; half of the ground lies in shadow, and so does all ink.

    Parameters
    ----------
    polarity : int
        1 for dark marks.
    lit : int, optional
        Sector on which light falls, but for one angle within it.
    """
    angles = FAMILY.bits * PER_SECTOR
    bits = bits_at(np.array([WORD]), np.array([PHASE]), PER_SECTOR, FAMILY)[0]
    bright = np.full(angles, PAPER * SHADOW)
    if lit is not None:
        bright[PHASE + lit * PER_SECTOR + np.arange(PER_SECTOR - 4)] = PAPER
    band = np.where(bits == (polarity > 0), CONTRAST * bright, bright)[None]
    ground = np.where(np.arange(angles) % 2, PAPER, PAPER * SHADOW)[None]
    ground = ground if polarity > 0 else CONTRAST * ground
    return BandSamples(
        inner_ground=ground,
        inner_band=band,
        outer_band=band,
        outer_ground=ground,
        band=np.stack([band] * 3),
        gap=np.stack([ground] * 2),
        dot=np.stack([band] * 2),
        on_edges=np.stack([(band + ground) / 2] * 2),
        beside=np.array([[0.13]]),
        visible=np.ones((2, 1, angles), bool),
    )


def impossible(
    samples: BandSamples, word: int, polarity: int = 1, hidden: np.ndarray | bool = False
) -> bool:
    nowhere = np.zeros((1, FAMILY.bits * PER_SECTOR), bool)
    words, phases = np.array([word]), np.array([PHASE])
    of = are_impossible(samples, words, phases, nowhere | hidden, marks(polarity), FRAMES, FAMILY)
    return bool(of[0])


@pytest.mark.parametrize('polarity', [1, -1])
@pytest.mark.parametrize('lit', [None, MARKED, UNMARKED])
def test_the_word_that_is_there_is_possible(polarity, lit):
    assert not impossible(seen(polarity, lit), WORD, polarity)


@pytest.mark.parametrize('polarity', [1, -1])
def test_ground_is_not_darker_than_in_the_deepest_shadow(polarity):
    if polarity > 0:
        samples, word = seen(lit=MARKED), WORD & ~(1 << MARKED)
    else:
        samples, word = seen(-1, lit=UNMARKED), WORD | 1 << UNMARKED
    assert impossible(samples, word, polarity)


@pytest.mark.parametrize('polarity', [1, -1])
def test_a_mark_is_not_brighter_than_in_the_brightest_light(polarity):
    if polarity > 0:
        samples, word = seen(lit=UNMARKED), WORD | 1 << UNMARKED
    else:
        samples, word = seen(-1, lit=MARKED), WORD & ~(1 << MARKED)
    assert impossible(samples, word, polarity)


def test_what_light_explains_is_possible():
    # The ground in shadow is as bright as a mark in the light.
    assert not impossible(seen(), WORD | 1 << UNMARKED)


def test_what_is_hidden_says_nothing():
    angles = np.arange(FAMILY.bits * PER_SECTOR) - PHASE
    hidden = (angles // PER_SECTOR == MARKED)[None]
    assert not impossible(seen(lit=MARKED), WORD & ~(1 << MARKED), hidden=hidden)


def test_noise_is_no_contradiction():
    samples, noisy = seen(lit=MARKED), np.random.default_rng(0)
    dim = {
        name: getattr(samples, name) * 0.02
        for name in ('inner_ground', 'inner_band', 'outer_band', 'outer_ground', 'band', 'gap')
    }
    dim = {name: np.maximum(of + noisy.normal(0, 1.2, of.shape), 0) for name, of in dim.items()}
    assert not impossible(replace(samples, **dim), WORD & ~(1 << MARKED))
