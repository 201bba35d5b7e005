import numpy as np
import pytest

from ahf_ros.codes.ring import FAMILY_NAMES, family, sectors
from ahf_ros.detectors.ring.codewords import COMPETITORS, best_words, margins

PHASES = 4


def evidence(word, bits, phase, strength=8.0):
    """Return what sectors and borders say of one band that shows a word at one phase."""
    ones = sectors(word, bits)
    single = np.zeros((1, PHASES, bits))
    single[0, phase] = np.where(ones, strength, -strength)
    return single, np.zeros_like(single), np.zeros_like(single)


def read(parts, of_family):
    """Return the best words, their phases and their margins."""
    words, phases, scores = best_words(*parts, of_family)
    best = np.zeros(len(words), int)
    return words[:, 0], phases[:, 0], margins(words, scores, best, of_family)


@pytest.mark.parametrize('name', FAMILY_NAMES)
@pytest.mark.parametrize('index', [0, 7, -1])
def test_clear_evidence_gives_the_word_its_phase_and_a_margin(name, index):
    of_family = family(name)
    word = int(of_family.words[index])
    rotated = (word << 3 | word >> (of_family.bits - 3)) & (1 << of_family.bits) - 1
    words, phases, margin = read(evidence(rotated, of_family.bits, 2), of_family)
    assert of_family.number(int(words[0])) == of_family.number(word)
    assert phases[0] == 2
    # The nearest other word differs in two sectors, whose evidence turns round.
    assert margin[0] == pytest.approx(16.0)


def test_a_band_without_ones_is_not_read():
    of_family = family('metashape12')
    words, _, margin = read(evidence(0, 12, 0), of_family)
    assert words[0] == 0
    assert margin[0] == 0


def test_an_invalid_word_gives_the_nearest_valid_one_without_a_margin():
    of_family = family('metashape12')
    odd = int(of_family.words[20]) ^ 1 << 11
    words, _, margin = read(evidence(odd, 12, 1), of_family)
    assert of_family.number(int(words[0])) is not None
    assert margin[0] == pytest.approx(0.0)


def test_borders_decide_where_sectors_are_silent():
    of_family = family('metashape12')
    word = of_family.word(30)
    ones = sectors(word, 12)
    single, onto, off = evidence(word, 12, 0)
    silent = int(np.flatnonzero(ones)[0])
    single[0, 0, silent] = 0
    before, after = ones[silent - 1], ones[(silent + 1) % 12]
    onto[0, 0, silent - 1] = -6.0 if before else 6.0
    off[0, 0, silent] = -6.0 if after else 6.0
    words, _, margin = read((single, onto, off), of_family)
    assert of_family.number(int(words[0])) == 30
    assert margin[0] > 1


def test_bands_do_not_touch_each_other():
    of_family = family('aicon14')
    parts = [evidence(of_family.word(number), 14, number % PHASES) for number in (3, 200, 516)]
    together = best_words(*(np.concatenate(part) for part in zip(*parts, strict=True)), of_family)
    for index, part in enumerate(parts):
        alone = best_words(*part, of_family)
        for values, of_one in zip(together, alone, strict=True):
            assert values[index].tolist() == of_one[0].tolist()


def test_no_band_at_all():
    words, phases, scores = best_words(*np.zeros((3, 0, 10, 12)), family('metashape12'))
    assert words.shape == phases.shape == scores.shape == (0, COMPETITORS)
