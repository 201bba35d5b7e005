"""Tables, directions and distances of the ring code families (METHOD.md, section 5)."""

import json
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.prints import RING_NAMES
from ahf_ros.prints.cyclic import smallest_rotation
from ahf_ros.prints.ring import (
    FAMILY_NAMES,
    RingPrint,
    family,
    ring_family,
    sectors,
    words_of_print,
    words_of_prints,
)


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


def words_by_name(name: str, word: int) -> dict[str, int]:
    words = words_of_print(family(name), word, tuple(map(family, FAMILY_NAMES)))
    return {code.name: of_code for code, of_code in words.items()}


def test_opposite_quarters_are_a_word_of_three_families() -> None:
    words = {'metashape12': 455, 'metashape16': 3855, 'metashape20': 31775}
    for name, word in words.items():
        assert words_by_name(name, word) == words
        assert outline(name, word) == outline('metashape12', 455)


@pytest.mark.parametrize('name', [name for name in FAMILY_NAMES if name != 'metashape20'])
def test_all_other_words_are_prints_of_their_own(name: str) -> None:
    code, families = family(name), tuple(map(family, FAMILY_NAMES))
    prints = words_of_prints(code, code.words, families)
    words = code.words.tolist()
    shared = [word for word, of in zip(words, prints, strict=True) if of != {code: word}]
    assert shared == {'metashape12': [455], 'metashape16': [3855]}.get(name, [])


def test_cct_numbers_are_the_words_that_its_programs_print() -> None:
    sizes = [family(f'cct{bits}').words.size for bits in range(8, 17)]
    assert sizes == [34, 58, 106, 186, 350, 630, 1180, 2190, 4114]  # necklaces, less two
    table = family('cct12')
    assert table.number(0b000001110001) == 71
    assert table.word(71) == 0b000001110001
    assert sorted(table.numbers) == sorted(table.words)
    assert words_of_print(family('aicon12'), 65, (table,)) == {table: 65}


FAMILY = {'family': 'mine', 'bits': 12, 'band': [2, 3], 'words': 'all'}


def described(folder: Path, **fields: object) -> RingPrint:
    """Return a family of a data file, whose fields are None where they are missing."""
    content = {name: value for name, value in (FAMILY | fields).items() if value is not None}
    path = folder / 'family.yaml'
    path.write_text('\n'.join(f'{name}: {json.dumps(it)}' for name, it in content.items()))
    return ring_family(str(path))


def test_a_data_file_gives_rules_tables_and_numbers(tmp_path: Path) -> None:
    vendor = described(tmp_path, words={'parity': 'even', 'above': 65}, band=[2.25, 3.5])
    assert vendor.words.tolist() == family('metashape12').words.tolist()
    assert vendor.band == (2.25, 3.5)
    assert described(tmp_path, words={'parity': 'odd'}).words.tolist()[:3] == [1, 7, 11]
    few = described(tmp_path, words={'changes': 2})
    assert few.words.tolist() == [(1 << marks) - 1 for marks in range(1, 12)]
    assert described(tmp_path, words={'opposite_pairs': 5}).words.tolist() == [2015, 2047]
    table = described(tmp_path, words=None, codes={'101': 71, '7': 3})
    assert (table.words.tolist(), table.numbers.tolist()) == ([3, 71], [7, 101])
    assert [table.word(number) for number in (7, 101)] == [3, 71]
    assert table.ids(np.array([6, 71 << 1, 5])).tolist() == [7, 101, 0]
    with pytest.raises(ValueError, match='number is 8, accepted is an ID of mine from 7 to 101'):
        table.word(8)
    listed = described(tmp_path, words=[0b1000, 71], numbers={'direction': 'clockwise'})
    assert (listed.words.tolist(), listed.numbers.tolist()) == ([1, 71], [1, 113])
    both = {'direction': 'clockwise', 'first_bit': 'highest'}
    assert described(tmp_path, words=[71], numbers=both).numbers.tolist() == [71]


def test_a_data_file_tells_the_print(tmp_path: Path) -> None:
    plain = described(tmp_path)
    assert (plain.pinhole, plain.polarity, plain.circles) == (0.0, 'both', ())
    assert (plain.bounds, plain.reach) == (None, 3.0)
    other = described(
        tmp_path,
        pinhole=0.1,
        polarity='bright',
        circles=[[4, 4.5], [1.3, 1.5]],
        band=[2, [3, 3.4]],
    )
    assert (other.pinhole, other.polarity, other.reach) == (0.1, 'bright', 4.5)
    assert other.circles == ((4.0, 4.5), (1.3, 1.5))
    assert other.bounds == ((2.0, 2.0), (3.0, 3.4))
    assert other.band == (2.0, pytest.approx(3.2))
    assert family('metashape12').pinhole == 0.05


def test_prints_with_other_circles_are_other_prints(tmp_path: Path) -> None:
    (tmp_path / 'circled').mkdir()
    plain = described(tmp_path)
    circled = described(tmp_path / 'circled', circles=[[4, 4.5]])
    assert words_of_print(plain, 71, (plain, circled, family('aicon12'))).keys() == {
        plain,
        family('aicon12'),
    }


@pytest.mark.parametrize(
    ('fields', 'message'),
    [
        ({'bits': 40}, 'line 2: bits is 40, accepted is an integer from 6 to 24'),
        ({'band': [3, 2]}, r'line 3: band is \[3, 2\], accepted is two radii that grow'),
        ({'band': [2]}, r'line 3: band is \[2\], accepted is its inner and outer radius'),
        ({'words': []}, r'line 4: words is \[\], accepted is a rule that some word follows'),
        ({'words': {'above': 4000}}, 'accepted is a rule that some word follows'),
        ({'words': {'parity': 'none'}}, "line 4: words.parity is 'none', accepted is even or odd"),
        ({'words': {'same': 1}}, r'line 4: words.same is 1, accepted is one of the fields parity'),
        ({'words': [71, 3, 142]}, r'words\[2\] is 142, accepted is a word that is no rotation'),
        ({'words': [4096]}, r'words\[0\] is 4096, accepted is an integer from 1 to 4095'),
        ({'bits': 9, 'words': {'opposite_pairs': 1}}, 'where the number of bits is odd'),
        ({'words': None}, "family is 'mine', accepted is a family with either the field words or"),
        ({'codes': {'1': 71}}, 'accepted is a family with either the field words or the field'),
        ({'words': None, 'codes': {'x': 71}}, 'codes.x is 71, accepted is a word whose name is'),
        ({'words': None, 'codes': {}}, 'accepted is a mapping of one ID at least to its word'),
        ({'words': None, 'codes': {'1': 3, '2': 6}}, 'codes.2 is 6, accepted is a word that is'),
        ({'numbers': 'mine'}, "line 5: numbers is 'mine', accepted is rank, or a mapping with"),
        ({'numbers': {'first_bit': 'x'}}, "first_bit is 'x', accepted is lowest or highest"),
        ({'family': ''}, "line 1: family is '', accepted is a text"),
        (
            {'words': None, 'codes': {'1': 71, '01': 3}},
            r'codes\.01 is 3, accepted is one word for',
        ),
        ({'band': [[2.2, 1.8], 3]}, r'line 3: band\[0\] is .*, accepted is a radius in radii of'),
        ({'band': [[1.8, 2.9], [2.8, 3]]}, 'line 3: band is .*, accepted is two radii that grow'),
        ({'pinhole': 0.7}, 'line 5: pinhole is 0.7, accepted is a radius from 0 to 0.5 radii of'),
        ({'polarity': 'white'}, "polarity is 'white', accepted is dark or bright or both"),
        ({'circles': [4, 5]}, r'line 5: circles\[0\] is 4, accepted is two radii that grow'),
        ({'circles': [[2.5, 3.5]]}, r'circles\[0\] is .*, accepted is two radii .*, clear of all'),
        ({'circles': [[4, 5], [4.5, 6]]}, r'circles\[1\] is .* clear of all other ink'),
        ({'circles': [[5, 4]]}, r'circles\[0\] is .*, accepted is two radii that grow'),
    ],
)
def test_data_files_that_describe_no_family_are_refused(
    tmp_path: Path, fields: dict, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        described(tmp_path, **fields)


@pytest.mark.parametrize('name', RING_NAMES)
def test_data_files_are_named_as_their_families(name: str) -> None:
    assert family(name).name == name
