"""GSI's targets: design, values, and libraries as data files (METHOD.md, section 6)."""

import json
import os
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.families.learning.points import library_text, with_codes
from ahf_ros.prints.gsi import GSI_LIBRARY, Rule, point_family, positions_of, valid_words, value_of

KNOWN = {
    1: (3, 6, 8),
    2: (1, 7, 8),
    18: (4, 6, 14),
    133: (1, 5, 15),
    134: (2, 5, 15),
    135: (1, 6, 15),
    136: (2, 6, 15),
    137: (3, 6, 15),
    138: (4, 6, 15),
    505: (7, 17, 28),
}
GSI = point_family()
PLACES = dict(zip(GSI.position_numbers.tolist(), map(tuple, GSI.positions), strict=True))


def written(folder: Path, old: str, new: str) -> Path:
    """Return a copy of the library in which a text is another one."""
    text = GSI_LIBRARY.read_text().replace('"7": [15, 23]', '"7": [15, 23.1]')
    assert text.count(old) == 1
    path = folder / 'mine.json'
    path.write_text(text.replace(old, new))
    return path


def line_of(path: Path, text: str) -> int:
    return 1 + next(n for n, line in enumerate(path.read_text().splitlines()) if text in line)


def test_the_numbers_that_are_public() -> None:
    for number, positions in KNOWN.items():
        assert GSI.word(number) == value_of(positions) == sum(2**it for it in positions)
        assert GSI.number(GSI.word(number)) == number
    assert GSI.listed == {number: value_of(it) for number, it in KNOWN.items()}


def test_all_other_numbers_cannot_be_taken_for_those_of_gsi() -> None:
    own = np.setdiff1d(GSI.numbers, list(KNOWN))
    assert own.min() > 10000
    assert len(np.unique(GSI.numbers)) == len(GSI.numbers) == len(np.unique(GSI.words)) == 1484
    assert all(GSI.number(GSI.word(number)) == number for number in own[::50].tolist())
    with pytest.raises(ValueError, match='number is 3, accepted is one of the 1484 IDs of gsi'):
        GSI.word(3)
    assert GSI.number(7) is None


def test_distances_of_11_mm_leave_the_numbers_of_codes_that_surveys_suggest() -> None:
    words = valid_words(PLACES, Rule(3, 11.0, GSI.rule.groups))
    assert len(words) == 756
    assert sum(max(positions_of(word)) <= 14 for word in words.tolist()) == 140


def test_the_positions_are_two_groups_that_mirror_each_other() -> None:
    first, second = GSI.rule.groups
    assert {PLACES[number] for number in first} == {PLACES[number][::-1] for number in second}
    assert all(PLACES[number][1] > PLACES[number][0] for number in first)
    for word in GSI.words.tolist():
        split = sorted(len(group & set(positions_of(word))) for group in GSI.rule.groups)
        assert split == [1, 2]


def test_c_e_and_a_lie_on_a_line_and_e_is_the_centre() -> None:
    a, _, c, _, e = GSI.template
    assert np.cross(np.append(e - c, 0), np.append(a - c, 0))[2] == 0
    assert GSI.places[GSI.reference].tolist() == [0, 0]
    assert GSI.reach == pytest.approx(np.hypot(18.5, 11.5) + 1.5)


def test_no_dots_of_any_code_overlap() -> None:
    for word in GSI.words.tolist():
        dots = np.concatenate([GSI.template, GSI.positions[GSI.decoding_dots(word)]])
        assert min(np.hypot(*(a - b)) for a, b in combinations(dots, 2)) > 7


def test_a_library_is_the_same_after_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / 'copy.json'
    path.write_text(library_text(GSI))
    copy = point_family(str(path))
    assert np.array_equal(copy.words, GSI.words) and np.array_equal(copy.numbers, GSI.numbers)
    assert np.array_equal(copy.places, GSI.places) and copy.rule == GSI.rule
    assert json.loads(path.read_text())['codes'] == json.loads(GSI_LIBRARY.read_text())['codes']


def test_a_number_that_is_learnt_moves_no_other(tmp_path: Path) -> None:
    word = GSI.word(10500)
    more = with_codes(GSI, {77: word})
    path = tmp_path / 'more.json'
    path.write_text(library_text(more))
    read = point_family(str(path))
    assert read.number(word) == 77
    assert read.word(10499) == GSI.word(10499) and read.word(10501) == GSI.word(10501)
    assert with_codes(GSI, {20000: word}).rule.first_own_number == 100001


def test_yaml_and_radii_of_single_dots(tmp_path: Path) -> None:
    path = tmp_path / 'mine.yaml'
    path.write_text(
        'family: six\nunit: mm\ndot_radius: 1\nreference: a\n'
        'template: {a: [0, 0, 2], b: [10, 0, 2], c: [0, 14, 2], d: [10, 12, 2]}\n'
        'positions:\n  0: [5, 0]\n  1: [5, 6]\n  2: [5, 12]\n'
        'rule: {dots: 2}\n'
        'codes:\n  7: [0, 1]\n  9: [1, 2]\n'
    )
    family = point_family(str(path))
    assert family.template_radii.tolist() == [2, 2, 2, 2]
    assert family.position_radii.tolist() == [1, 1, 1]
    assert dict(zip(family.numbers.tolist(), family.words.tolist(), strict=True)) == {7: 3, 9: 6}


@pytest.mark.parametrize(
    ('old', 'new', 'told'),
    [
        ('[4, 6, 14]', '[4, 6, 6]', r'codes\.18 is \[4, 6, 6\], .*3 different positions'),
        ('[4, 6, 14]', '[4, 6]', r'codes\.18 is \[4, 6\], .*list of 3 different positions'),
        ('[4, 6, 14]', '[4, 6, 29]', r'codes\.18 .*; 29 is none'),
        ('[4, 6, 14]', '[4, 6, "a"]', r"codes\.18\[2\] is 'a', .*an integer from 0 to 31"),
        ('[4, 6, 14]', '[6, 3, 8]', r'codes\.18 .*a code other than that of number 1'),
        ('[4, 6, 14]', '[6, 7, 14]', r'codes\.18 .*dots do not overlap, as 6 and 7 do'),
        ('"505": ', '"eighteen": ', r'codes\.eighteen .*ID of at least 0 as'),
        ('"5": [11, 26]', '"5": [11.5, 12]', r'positions\.5 .*clear of the template dot E'),
        ('"5": [11, 26]', '"5": [4, 26]', r'positions\.5 .*other than that of position 4'),
        ('"5": [11, 26]', '"5": [11]', r'positions\.5 is \[11\], .*\[x, y\] or'),
        ('"5": [11, 26]', '"5": [11, .nan]', r'positions\.5\[1\] is nan'),
        ('"B": [11, 0]', '"B": [2, 0]', r'template .*dots that do not overlap'),
        ('"reference": "E"', '"reference": "F"', r"reference is 'F', .*one of A, B, C, D, E"),
        ('"dot_radius": 1.5', '"dot_radius": 0', r'dot_radius is 0, .*a length above 0'),
        ('"dot_radius": 1.5', '"dot_radius": 6', r'template .*dots that do not overlap'),
        ('"dots": 3', '"dots": 40', r'rule\.dots is 40, .*from 1 to 28'),
        ('7.25', '2', r'rule .*minimum_distance of at least 3'),
        ('10001', '500', r'rule .*first_own_number above the numbers of all codes'),
        ('"unit"', '"units"', r'units .*one of the fields family'),
    ],
)
def test_what_is_wrong_with_a_library_is_named(
    tmp_path: Path, old: str, new: str, told: str
) -> None:
    path = written(tmp_path, old, new)
    with pytest.raises(ValueError, match=told) as error:
        point_family(str(path))
    named = int(str(error.value).split('line ')[1].split(':')[0])
    first_lines = {'rule is': '"rule"', 'template is': '"template"'}
    of_block = [line for field, line in first_lines.items() if field in str(error.value)]
    assert named == line_of(path, *(of_block or [new]))
    assert str(path) in str(error.value)


def test_two_codes_of_one_number_and_broken_files_name_their_line(tmp_path: Path) -> None:
    path = written(tmp_path, '"2": [1, 7, 8]', '"1": [1, 7, 8]')
    with pytest.raises(ValueError, match=rf'line {line_of(path, "[1, 7, 8]")}: .*is there twice'):
        point_family(str(path))
    path = written(tmp_path, '"E": [11.5, 11.5]', '"E": [11.5, 11.5')
    with pytest.raises(ValueError, match=r'line \d+: .*; accepted is JSON or YAML'):
        point_family(str(path))
    (tmp_path / 'empty.json').write_text('')
    with pytest.raises(ValueError, match='the file is None, accepted is a mapping'):
        point_family(str(tmp_path / 'empty.json'))
    with pytest.raises(ValueError, match=r'nowhere\.json cannot be read'):
        point_family(str(tmp_path / 'nowhere.json'))
    (tmp_path / 'bytes.json').write_bytes(b'\xff\xfe\x00')
    with pytest.raises(ValueError, match=r'bytes\.json is not a text'):
        point_family(str(tmp_path / 'bytes.json'))


def test_files_that_never_end_are_refused(tmp_path: Path) -> None:
    lines = ['a0: &a0 [1, 2]']
    lines += [f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 9)}]' for n in range(1, 30)]
    (tmp_path / 'bomb.yaml').write_text('\n'.join(lines))
    with pytest.raises(ValueError, match=r'bomb\.yaml, line \d+: an alias stands for this part'):
        point_family(str(tmp_path / 'bomb.yaml'))
    os.mkfifo(tmp_path / 'queue.yaml')
    for path in (tmp_path / 'queue.yaml', Path('/dev/zero')):
        with pytest.raises(ValueError, match=rf'{path} cannot be read: it is a'):
            point_family(str(path))


def test_dots_on_one_line_are_no_template(tmp_path: Path) -> None:
    path = tmp_path / 'line.yaml'
    path.write_text(
        'family: line\ndot_radius: 1\nreference: a\n'
        'template: {a: [0, 0], b: [10, 0], c: [20, 0], d: [40, 0]}\n'
        'positions: {1: [5, 9]}\nrule: {dots: 1}\ncodes: {1: [1]}\n'
    )
    with pytest.raises(ValueError, match=r'line 4: template .* do not lie on one line'):
        point_family(str(path))
