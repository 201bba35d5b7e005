"""Which words compete for a band, and by how much they differ."""

import numpy as np
import pytest

from ahf_ros.families.ring.codewords import COMPETITORS, best_words, likeliest_bits, prior
from ahf_ros.families.words import margins
from ahf_ros.prints.cyclic import rotated_words
from ahf_ros.prints.ring import canonical, family, sectors

PHASES = 4


def evidence(word: int, bits: int, phase: int, strength: float = 8.0) -> np.ndarray:
    """Return what the sectors of one band say that shows a word at one phase."""
    says = np.zeros((1, PHASES, bits))
    says[0, phase] = np.where(sectors(word, bits), strength, -strength)
    return says


def test_a_band_without_ones_is_not_read_nor_is_none() -> None:
    for says in (evidence(0, 12, 0), np.zeros((0, 10, 12))):
        words, phases = best_words(says, 0 * says, family('metashape12'))
        assert words.shape == phases.shape == (len(says), COMPETITORS)
        assert not words.any()
        assert not phases.any()


def test_an_invalid_word_gives_the_nearest_valid_ones() -> None:
    code = family('metashape12')
    odd = int(code.words[20]) ^ 1 << 11
    says = evidence(odd, 12, 1)
    words, phases = best_words(says, 0 * says, code)
    there = phases[0] == 1
    differ = np.array([int(word ^ odd).bit_count() for word in words[0, there].tolist()])
    assert differ[:2].tolist() == [1, 1]
    assert len(set(canonical(words[0, :2], code)[1].tolist())) == 2


def test_the_margin_is_that_over_another_id_and_not_over_a_rotation() -> None:
    code = family('metashape12')
    word, other = code.word(30), code.word(31)
    turned = word >> 1 | (word & 1) << 11
    words = np.array([[word, turned, other], [word, turned, turned]])
    scores = np.array([[9.0, 8.0, 3.0], [9.0, 8.0, 7.0]])
    ids = canonical(words, code)[1]
    assert margins(ids, scores, np.zeros(2, int)).tolist() == [6.0, 2.0]


@pytest.mark.parametrize('name', ['metashape12', 'metashape20'])
def test_an_expected_word_competes_however_little_speaks_for_it(name: str) -> None:
    code = family(name)
    shown, expected = code.word(100), code.word(5)
    says = evidence(shown, code.bits, 0)
    assert expected not in canonical(best_words(says, 0 * says, code)[0][0], code)[0]
    words, _ = best_words(says, 0 * says, code, frozenset({5}))
    assert expected in canonical(words[0], code)[0]
    before = prior(np.array([shown, expected]), code, frozenset({5}))
    assert before[1] == 0 > before[0]
    assert not prior(np.array([shown, expected]), code, frozenset()).any()


def test_the_likeliest_bits_are_those_of_all_that_have_most_evidence() -> None:
    ones, pairs = np.random.default_rng(6).normal(size=(2, 40, 7))
    every = np.arange(1 << 7)[:, None] >> np.arange(7) & 1
    scores = ones @ every.T + pairs @ (every & np.roll(every, 1, axis=1)).T
    bits, highest = likeliest_bits(ones, pairs)
    assert np.allclose(highest, scores.max(axis=1))
    assert np.array_equal(bits, every[scores.argmax(axis=1)])


@pytest.mark.parametrize('name', ['cct16', 'metashape20'])
def test_of_many_words_those_near_to_the_evidence_compete(name: str) -> None:
    code = family(name)
    says = np.random.default_rng(8).normal(0, 3, (20, PHASES, code.bits))
    words, phases = best_words(says, 0 * says, code)
    assert (code.ids(words) > 0).all()
    assert [len(np.unique(of)) for of in words] == [COMPETITORS] * len(words)
    every = np.unique([rotated_words(code.words, turn, code.bits) for turn in range(code.bits)])
    shown = (every >> np.arange(code.bits)[:, None] & 1).astype(np.float32)
    highest = (says.astype(np.float32) @ shown).max(axis=(1, 2))
    of_best = says[np.arange(20), phases[:, 0]] * (words[:, :1] >> np.arange(code.bits) & 1)
    assert of_best.sum(axis=1) == pytest.approx(highest, abs=0.02)
