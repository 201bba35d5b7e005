"""CCTags: the radii of their circles, and their IDs."""

import numpy as np
import pytest

from ahf_ros.prints import CCTAG_NAMES
from ahf_ros.prints.cctag import circle_family
from ahf_ros.prints.families import print_in
from ahf_ros.prints.selection import select_ids


@pytest.mark.parametrize(
    ('name', 'number', 'percent'),
    [
        ('cctag3', 0, [90, 80, 70, 60, 50]),
        ('cctag3', 4, [90, 80, 65, 55, 45]),
        ('cctag3', 31, [85, 70, 55, 40, 25]),
        ('cctag4', 0, [92, 84, 76, 68, 60, 52, 44]),
        ('cctag4', 42, [92, 80, 72, 60, 52, 40, 32]),
        ('cctag4', 127, [88, 76, 64, 52, 40, 28, 16]),
    ],
)
def test_radii_are_those_of_the_published_tables(
    name: str, number: int, percent: list[int]
) -> None:
    (radii,) = circle_family(name).radii(np.array([number]))
    assert 100 * radii == pytest.approx([100, *percent])


@pytest.mark.parametrize(('name', 'count'), [*zip(CCTAG_NAMES, (32, 128), strict=True)])
def test_every_id_has_circles_of_its_own(name: str, count: int) -> None:
    code = circle_family(name)
    assert print_in(name).design.all_ids == list(range(count))
    assert len(np.unique(code.radii(code.numbers).round(3), axis=0)) == count
    for number in (-1, count):
        with pytest.raises(ValueError, match=f'number is {number}, .* {name} from 0 to'):
            code.word(number)


def test_a_set_of_ids_that_differ_in_many_rings_is_selected() -> None:
    ids = select_ids(print_in('cctag4').design, range(128), 8)
    assert min(bin(one ^ other).count('1') for one in ids for other in ids if one != other) >= 3
