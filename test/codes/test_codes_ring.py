"""Tables, directions and distances of the ring code families (METHOD.md, section 5)."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.codes.cyclic import smallest_rotation
from ahf_ros.codes.ring import FAMILY_NAMES, family, sectors, words_of_print


@pytest.mark.parametrize(
    ('name', 'size', 'first'),
    [
        ('metashape12', 161, [71, 75, 77, 83]),
        ('metashape14', 561, [135, 139, 141, 147]),
        ('metashape16', 2001, [263, 267, 269, 275]),
        ('metashape20', 26013, [1031, 1035, 1037, 1043]),
        ('aicon12', 147, [65, 71, 75, 77]),
        ('aicon14', 516, [129, 135, 139, 141]),
    ],
)
def test_tables_have_the_published_size_and_first_words(
    name: str, size: int, first: list[int]
) -> None:
    table = family(name)
    assert table.words.size == size
    assert [table.word(number) for number in (1, 2, 3, 4)] == first


@pytest.mark.parametrize('name', FAMILY_NAMES)
def test_words_are_canonical_ascending_and_of_even_parity(name: str) -> None:
    table = family(name)
    assert (np.diff(table.words) > 0).all()
    assert (smallest_rotation(table.words, table.bits) == table.words).all()
    assert all(bin(word).count('1') % 2 == 0 for word in table.words[:500].tolist())


@pytest.mark.parametrize('name', FAMILY_NAMES)
def test_every_rotation_of_a_word_has_its_number(name: str) -> None:
    table = family(name)
    for number in (1, 2, table.words.size // 2, table.words.size):
        word = f'{table.word(number):0{table.bits}b}'
        rotations = [word[step:] + word[:step] for step in range(table.bits)]
        assert {table.number(int(rotated, 2)) for rotated in rotations} == {number}


def test_words_outside_the_family_have_no_number() -> None:
    table = family('metashape12')
    assert [table.number(word) for word in (0, 1, 65, 4095, 4096, -1)] == [None] * 6
    assert family('aicon12').number(65) == 1


def test_sectors_are_read_least_significant_bit_first() -> None:
    read = sectors(0b000001000111, 12)
    assert read.dtype == bool
    assert np.flatnonzero(read).tolist() == [0, 1, 2, 6]


def test_forty_five_percent_of_random_words_are_valid() -> None:
    table = family('metashape12')
    valid = np.isin(smallest_rotation(np.arange(4096), 12), table.words)
    assert valid.mean() == pytest.approx(0.45, abs=0.005)


@pytest.mark.parametrize('name', FAMILY_NAMES)
def test_every_word_has_a_neighbour_at_distance_two(name: str) -> None:
    table = family(name)
    bits = table.bits
    pairs = np.array([(1 << a) | (1 << b) for a in range(bits) for b in range(a)])
    words = table.words[:500]
    neighbours = smallest_rotation(words[:, None] ^ pairs, bits)
    valid = np.isin(neighbours, table.words) & (neighbours != words[:, None])
    assert valid.any(axis=1).all()
    single = smallest_rotation(words[:, None] ^ (1 << np.arange(bits)), bits)
    assert not np.isin(single, table.words).any()


def test_smallest_rotation_keeps_shapes() -> None:
    words = np.array([[0b1000, 0b0110], [0b1010, 0b1111]])
    assert smallest_rotation(words, 4).tolist() == [[0b0001, 0b0011], [0b0101, 0b1111]]
    assert smallest_rotation(0b100, 3).shape == ()


def test_tables_are_cached_and_read_only() -> None:
    assert family('aicon14') is family('aicon14')
    with pytest.raises(ValueError, match='read-only'):
        family('aicon14').words[0] = 0


@pytest.mark.parametrize('number', [0, -1, 162])
def test_a_number_outside_the_table_is_refused(number: int) -> None:
    with pytest.raises(ValueError, match=rf'number is {number}, .*metashape12 from 1 to 161'):
        family('metashape12').word(number)


def test_an_unknown_family_is_refused() -> None:
    with pytest.raises(ValueError, match=r"family is 'metashape13', .*metashape12, .*aicon14"):
        family('metashape13')


def outline(name: str, word: int) -> list[bool]:
    """Return the band of a word, some samples a degree, from its first mark on."""
    code = family(name)
    samples = [bit for bit in sectors(word, code.bits) for _ in range(1680 // code.bits)]
    starts = [i for i in range(1680) if samples[i] and not samples[i - 1]]
    return min(samples[i:] + samples[:i] for i in starts)


def test_opposite_quarters_are_a_word_of_three_families() -> None:
    words = {'metashape12': 455, 'metashape16': 3855, 'metashape20': 31775}
    for name, word in words.items():
        assert words_of_print(name, word) == words
        assert outline(name, word) == outline('metashape12', 455)


@pytest.mark.parametrize('name', [name for name in FAMILY_NAMES if name != 'metashape20'])
def test_all_other_words_are_prints_of_their_own(name: str) -> None:
    words = family(name).words.tolist()
    shared = [word for word in words if words_of_print(name, word) != {name: word}]
    assert shared == {'metashape12': [455], 'metashape16': [3855]}.get(name, [])
