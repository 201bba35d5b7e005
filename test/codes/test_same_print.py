"""Words of different families that have the same print."""

from __future__ import annotations

import pytest

from ahf_ros.codes.ring import FAMILY_NAMES, family, sectors
from ahf_ros.codes.same_print import fewest_sectors, words_of_print


def outline(name: str, word: int) -> list[bool]:
    """Return the band of a word, a sample a degree and a half, from its first mark on."""
    code = family(name)
    samples = [bit for bit in sectors(word, code.bits) for _ in range(1680 // code.bits)]
    starts = [i for i in range(1680) if samples[i] and not samples[i - 1]]
    return min(samples[i:] + samples[:i] for i in starts)


def test_opposite_quarters_are_a_word_of_three_families():
    words = {'metashape12': 455, 'metashape16': 3855, 'metashape20': 31775}
    for name, word in words.items():
        assert words_of_print(name, word) == words
        assert outline(name, word) == outline('metashape12', 455)


@pytest.mark.parametrize('name', [name for name in FAMILY_NAMES if name != 'metashape20'])
def test_all_other_words_are_prints_of_their_own(name):
    words = [int(word) for word in family(name).words]
    shared = [word for word in words if len(words_of_print(name, word)) > 1]
    assert shared == {'metashape12': [455], 'metashape16': [3855]}.get(name, [])


def test_a_print_has_fewest_sectors():
    assert fewest_sectors(0b0000111100001111, 16) == (4, 0b0101)
    assert fewest_sectors(0b000001000111, 12) == (12, 71)
    assert fewest_sectors(0b001100001111, 12)[0] == 6
