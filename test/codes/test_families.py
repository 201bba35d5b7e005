"""Lists of families, and the IDs that families have."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.codes import ring
from ahf_ros.codes.dots import DOTS_DESIGN
from ahf_ros.codes.families import (
    FAMILY_NAMES,
    check_numbers,
    code_family,
    colours_of,
    families_in,
    families_of,
    family_in,
    kind_of,
    mirrored_number,
    numbers_of,
)
from ahf_ros.codes.gsi import GSI_LIBRARY
from ahf_ros.detectors import DetectorSettings
from ahf_ros.synthetic.scene import SceneSettings


def test_families_keep_their_order():
    assert families_in('aicon14') == ('aicon14',)
    assert families_in('aicon14, metashape12') == ('aicon14', 'metashape12')
    assert families_in('gsi') == ('gsi',)
    several = 'aruco_4x4_250', 'gsi', 'metashape12', 'aruco_4x4_50'
    assert families_in(','.join(several)) == several
    assert families_in('auto') == FAMILY_NAMES


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        (
            '',
            r"family is '', accepted is one of metashape12, .*; several of these, .*; or auto for",
        ),
        ('tag36h9', r"family is 'tag36h9', accepted is apriltag_36h1[01], which is most like"),
        ('DICT_4X4_5', r"'DICT_4X4_5', accepted is aruco_4x4_50, which is most like it"),
        (',', r"family is ',', which names '', accepted is one of"),
        ('metashape12,', r"which names '', accepted is one of"),
        ('metashape12,ring12', r"'metashape12,ring12', which names 'ring12', accepted is one of"),
        ('auto,aicon12', r"which names 'auto', accepted is one of"),
        ('aicon12, aicon14, aicon12', r'names aicon12 twice, accepted is each family once'),
        ('metashape12,tag36h11,gsi,apriltag_36h11', r'names apriltag_36h11 twice, accepted is'),
        ('metashape12,tag36h9', r"which names 'tag36h9', accepted is apriltag_36h1[01]"),
    ],
)
def test_lists_that_make_no_sense_are_refused(text, message):
    with pytest.raises(ValueError, match=message):
        families_in(text)


@pytest.mark.parametrize(
    ('text', 'names'),
    [
        ('Metashape12, AICON14', ('metashape12', 'aicon14')),
        ('tag36h11', ('apriltag_36h11',)),
        ('36h11', ('apriltag_36h11',)),
        ('4x4_50,DICT_4X4_250,tag16h5', ('aruco_4x4_50', 'aruco_4x4_250', 'apriltag_16h5')),
        ('DICT_APRILTAG_16h5', ('apriltag_16h5',)),
        ('DICT_6X6_250', ('aruco_6x6_250',)),
        ('DICT_ARUCO_MIP_36h12', ('aruco_mip_36h12',)),
        ('aruco-original', ('aruco_original',)),
    ],
)
def test_names_may_be_written_as_other_programs_do(text: str, names: tuple[str, ...]) -> None:
    assert families_in(text) == names
    assert DetectorSettings(family=text).family == ','.join(names)
    if len(names) == 1:
        assert SceneSettings(family=text, targets=0).family == names[0]


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
    for name in ring.FAMILY_NAMES:
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


RINGS = 'family: mine\nbits: 10\nband: [1.42, 1.87]\nwords: {changes: 6}\n'


@pytest.fixture
def files(tmp_path: Path) -> str:
    """Return a list of two files, of rings and of rings of dots."""
    rings, dots = tmp_path / 'rings.yaml', tmp_path / 'dots.json'
    rings.write_text(RINGS)
    design = json.loads(DOTS_DESIGN.read_text())
    dots.write_text(json.dumps(design | {'family': 'wide', 'border_radius': 3.5}))
    return f'{rings}, {dots}'


def test_files_describe_more_families(files: str) -> None:
    assert families_in('mine, metashape12', files) == ('mine', 'metashape12')
    assert families_in('gsi, wide, mine', files) == ('gsi', 'wide', 'mine')
    # The file of rings of dots takes the place of the usual design.
    every = [name for name in FAMILY_NAMES if name != 'dots']
    assert families_in('auto', files) == (*every, 'mine', 'wide')
    assert [kind_of(name, files) for name in ('mine', 'wide', 'gsi')] == ['ring', 'dots', 'gsi']
    assert code_family('mine', files).band == (1.42, 1.87)
    assert code_family('wide', files) is code_family('dots', files)
    assert code_family('metashape12', files) is ring.family('metashape12')
    assert family_in('Mine', files) == 'mine'
    check_numbers('ids', [1, 2], ('mine',), files)


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('min', "family is 'min', accepted is mine, which is most like it"),
        ('wide,dots', 'names dots twice'),
        ('mine,mine', 'names mine twice'),
    ],
)
def test_names_that_no_file_describes_are_refused(files: str, text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        families_in(text, files)


@pytest.mark.parametrize('library', [DOTS_DESIGN, GSI_LIBRARY])
def test_a_file_that_changes_is_read_again(library: Path, tmp_path: Path) -> None:
    file, design = tmp_path / 'mine.json', json.loads(library.read_text())
    file.write_text(json.dumps(design | {'family': 'mine'}))
    first = families_of(str(file))
    assert list(first) == ['mine']
    assert families_of(str(file))['mine'] is first['mine']
    file.write_text(json.dumps(design | {'family': 'another'}))
    assert list(families_of(str(file))) == ['another']


def test_colours_of_families(files: str, tmp_path: Path) -> None:
    bright = tmp_path / 'bright.yaml'
    bright.write_text(RINGS.replace('mine', 'white') + 'polarity: bright\n')
    every = f'{files}, {bright}'
    assert colours_of(['white'], every) == 'bright'
    for names in (['white', 'mine'], ['wide'], ['gsi'], ['metashape12'], ['aruco_4x4_50']):
        assert colours_of(names, every) == 'both'


def test_files_that_do_not_fit_are_refused(files: str, tmp_path: Path) -> None:
    with pytest.raises(
        ValueError, match=r"rings\.yaml, line 1: family is 'mine', accepted is a n"
    ):
        families_of(f'{files}, {tmp_path / "rings.yaml"}')
    with pytest.raises(ValueError, match=r"family is 'his', .* describes mine, wide; accepted is"):
        code_family('his', files)
    assert code_family('gsi', files) is code_family('gsi')
    with pytest.raises(ValueError, match=r'missing\.yaml cannot be read'):
        families_in('mine', 'missing.yaml')
    named = tmp_path / 'named.yaml'
    named.write_text(RINGS.replace('mine', 'cct12'))
    with pytest.raises(ValueError, match="family is 'cct12', accepted is a name that no other"):
        families_of(str(named))
    for text in ('auto', 'mine,metashape12'):
        with pytest.raises(ValueError, match=f"family is '{text}', accepted is one family"):
            family_in(text, files)
