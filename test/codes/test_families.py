"""Lists of families, and the IDs that families have."""

from __future__ import annotations

import numpy as np
import pytest

from ahf_ros.codes import ring
from ahf_ros.codes.families import (
    LISTED,
    check_numbers,
    families_in,
    mirrored_number,
    numbers_of,
)


def test_families_keep_their_order():
    assert families_in('aicon14') == ('aicon14',)
    assert families_in('aicon14, metashape12') == ('aicon14', 'metashape12')
    assert families_in('gsi') == ('gsi',)
    assert families_in('auto') == ring.FAMILY_NAMES


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('', r"family is '', accepted is one of metashape12, .*; several of .*; or auto for all"),
        (
            'tag36h11',
            r"family is 'tag36h11', accepted is apriltag_36h11, which is most like",
        ),
        ('DICT_4X4_50', r"'DICT_4X4_50', accepted is aruco_4x4_50, which is most like it"),
        (',', r"family is ',', which names '', accepted is one of"),
        ('metashape12,', r"which names '', accepted is one of"),
        ('metashape12,ring12', r"'metashape12,ring12', which names 'ring12', accepted is one of"),
        ('auto,aicon12', r"which names 'auto', accepted is one of"),
        ('aicon12, aicon14, aicon12', r'names aicon12 twice, accepted is each family once'),
        (
            'metashape12,aruco_4x4_50',
            r'metashape12 is read by the detector ring and aruco_4x4_50 by the detector aruco; '
            r'accepted are families of one detector',
        ),
        ('gsi,dots', r'gsi is read by the detector gsi and dots by the detector dots'),
        (
            'aruco_4x4_50,aruco_4x4_250',
            r'targets of aruco_4x4_50 and aruco_4x4_250 have the same print; accepted is one',
        ),
        (
            'aruco_4x4_50,aruco_5x5_50',
            r'the detector aruco reads one family; accepted are several',
        ),
        ('apriltag_16h5,apriltag_36h11', r'the detector apriltag reads one family'),
    ],
)
def test_lists_that_make_no_sense_are_refused(text, message):
    with pytest.raises(ValueError, match=message):
        families_in(text)


def test_ring_families_with_the_same_print_are_refused(monkeypatch):
    usual = ring.family

    def same(name: str) -> ring.Family:
        return usual('metashape14' if name == 'metashape12' else name)

    monkeypatch.setattr(ring, 'family', same)
    with pytest.raises(ValueError, match='metashape14 and metashape12 have the same print'):
        families_in('metashape14,metashape12')


def test_ids_that_no_family_has_are_named():
    check_numbers('expected_ids', [1, 161, 500], ('metashape12', 'aicon14'), '')
    with pytest.raises(ValueError) as caught:
        check_numbers('expected_ids', [162, 517, 0, 3], ('metashape12', 'aicon14'), '')
    assert str(caught.value) == (
        'expected_ids has 0, 517, accepted are IDs of metashape12 from 1 to 161, aicon14 from 1 '
        'to 516'
    )
    with pytest.raises(ValueError, match=r'has 77, 78, .*, 86 and 15 more, accepted'):
        check_numbers('expected_ids', range(1, 102), ('dots',), '')


def test_every_number_is_that_of_a_word():
    assert 505 in numbers_of('gsi')
    for name in LISTED:
        family = ring.family(name)
        assert [family.number(int(word)) for word in family.words[:9]] == list(range(1, 10))
        assert len(numbers_of(name)) == family.words.size


def test_every_ring_code_is_another_one_in_a_mirror():
    for name in ('metashape12', 'metashape14', 'aicon12', 'aicon14'):
        family = ring.family(name)
        mirrored = [mirrored_number(name, int(word)) for word in family.words]
        assert sorted(mirrored) == list(numbers_of(name))
        again = [mirrored_number(name, family.word(number)) for number in mirrored]
        assert again == list(numbers_of(name))
        symmetric = np.mean(np.array(mirrored) == again)
        assert 0.15 < symmetric < 0.4
    assert mirrored_number('gsi', 1) is None
    assert mirrored_number('', 71) is None
