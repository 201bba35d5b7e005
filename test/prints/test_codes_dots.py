"""Rings of dots: words and design (METHOD.md, section 7)."""

from pathlib import Path

import numpy as np
import pytest

from ahf_ros.prints.dots import DOTS_DESIGN, dot_family, smallest_bracelet

DOTS = dot_family()


def test_there_are_76_bracelets_of_ten_dots() -> None:
    assert DOTS.words.size == 76
    every = np.unique(smallest_bracelet(np.arange(1024), 10))
    assert every.size == 78
    assert np.setdiff1d(every, DOTS.words).tolist() == [0, 1023]
    assert [DOTS.word(number) for number in (1, 2, 3, 76)] == [1, 3, 5, 511]


def test_rotations_and_reflections_have_one_number() -> None:
    for number in range(1, 77):
        word = f'{DOTS.word(number):010b}'
        turned = [word[step:] + word[:step] for step in range(10)]
        turned += [of[::-1] for of in turned]
        assert {DOTS.number(int(of, 2)) for of in turned} == {number}


def test_words_that_are_no_code_have_no_number() -> None:
    assert [DOTS.number(word) for word in (0, 1023, 1024, -1)] == [None] * 4
    with pytest.raises(ValueError, match='number is 77, accepted is an ID of dots from 1 to 76'):
        DOTS.word(77)


def test_the_design_is_that_of_the_data_file_and_can_be_replaced(tmp_path: Path) -> None:
    assert (DOTS.bits, DOTS.dot_circle, DOTS.dot_radius) == (10, 1.8, 0.32)
    assert (DOTS.ground_radius, DOTS.border_radius) == (2.6, 3.2)
    path = tmp_path / 'mine.json'
    path.write_text(DOTS_DESIGN.read_text().replace('"bits": 10', '"bits": 8'))
    assert dot_family(str(path)).words.size == 28


@pytest.mark.parametrize(
    ('old', 'new', 'told'),
    [
        ('"dot_radius": 0.32', '"dot_radius": 0.6', r'line 6: dot_radius is 0\.6, .*overlap'),
        ('"dot_circle": 1.8', '"dot_circle": 1.2', r'line 5: dot_circle .*clear of the disc'),
        ('"ground_radius": 2.6', '"ground_radius": 2.1', 'line 7: .*clear of the dots'),
        ('"border_radius": 3.2', '"border_radius": 2.6', 'line 8: border_radius'),
        ('"bits": 10', '"bits": 2.5', r'line 4: bits is 2\.5, accepted is an integer'),
        ('"bits": 10,', '', 'a mapping with the field bits'),
    ],
)
def test_what_is_wrong_with_a_design_is_named(
    tmp_path: Path, old: str, new: str, told: str
) -> None:
    path = tmp_path / 'mine.json'
    path.write_text(DOTS_DESIGN.read_text().replace(old, new))
    with pytest.raises(ValueError, match=told):
        dot_family(str(path))
