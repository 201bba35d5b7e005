"""Lists of families, and the IDs that families have."""

import json
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.families import DetectorSettings
from ahf_ros.prints import ring
from ahf_ros.prints.dots import DOTS_DESIGN
from ahf_ros.prints.families import (
    FAMILY_NAMES,
    FamilyPrint,
    check_numbers,
    print_in,
    prints_in,
    prints_of,
)
from ahf_ros.prints.gsi import GSI_LIBRARY
from ahf_ros.scenes.scene import SceneSettings
from support import ROOT
from support.command_line import python


def test_a_family_of_a_new_vendor_is_shipped_as_a_file_alone(tmp_path: Path) -> None:
    copy = tmp_path / 'ahf_ros'
    shutil.copytree(ROOT / 'ahf_ros', copy, ignore=shutil.ignore_patterns('__pycache__'))
    folder = copy / 'prints' / 'ring_families'
    made = json.loads((folder / 'aicon12.json').read_text()) | {
        'family': 'strange',
        'band': [2, 4],
    }
    (folder / 'strange.json').write_text(json.dumps(made))
    says = (
        f'import sys; sys.path.insert(0, {str(tmp_path)!r}); from ahf_ros.prints import ring; '
        'print(ring.RING_NAMES[-1], ring.family("strange").band)'
    )
    done = python('-c', says)
    assert done.stdout.split(maxsplit=1) == ['strange', '(2.0, 4.0)\n'], done.stderr


def test_families_keep_their_order() -> None:
    assert list(prints_in('aicon14')) == ['aicon14']
    assert list(prints_in('aicon14, metashape12')) == ['aicon14', 'metashape12']
    several = 'aruco_4x4_250', 'gsi', 'metashape12', 'aruco_4x4_50'
    assert tuple(prints_in(','.join(several))) == several
    assert tuple(prints_in('auto')) == FAMILY_NAMES


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
def test_lists_that_make_no_sense_are_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        prints_in(text)


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
    assert tuple(prints_in(text)) == names
    assert DetectorSettings(family=text).family == ','.join(names)
    if len(names) == 1:
        assert SceneSettings(family=text, targets=0).family == names[0]


def test_ids_that_no_family_has_are_named() -> None:
    two = prints_in('metashape12, aicon14').values()
    check_numbers('expected_ids', [1, 161, 500], two)
    with pytest.raises(ValueError) as caught:
        check_numbers('expected_ids', [162, 517, 0, 3], two)
    assert str(caught.value) == (
        'expected_ids has 0, 517, accepted are IDs of metashape12 from 1 to 161, aicon14 from 1 '
        'to 516'
    )
    with pytest.raises(ValueError, match=r'has 77, 78, .*, 86 and 15 more, accepted'):
        check_numbers('expected_ids', range(1, 102), prints_in('dots').values())


def test_every_number_is_that_of_a_word() -> None:
    assert 505 in print_in('gsi').design.all_ids
    for name in ring.FAMILY_NAMES:
        family = ring.family(name)
        assert [family.number(int(word)) for word in family.words[:9]] == list(range(1, 10))
        assert len(family.all_ids) == family.words.size


def test_every_ring_code_is_another_one_in_a_mirror() -> None:
    for name in ('metashape12', 'metashape14', 'aicon12', 'aicon14'):
        family = ring.family(name)
        mirrored = [family.mirrored(int(word)) for word in family.words]
        assert sorted(mirrored) == family.all_ids
        again = [family.mirrored(family.word(number)) for number in mirrored]
        assert again == family.all_ids
        symmetric = np.mean(np.array(mirrored) == again)
        assert 0.15 < symmetric < 0.4
    assert print_in('gsi').mirrored(1) is None


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
    assert list(prints_in('mine, metashape12', files)) == ['mine', 'metashape12']
    assert list(prints_in('gsi, wide, mine', files)) == ['gsi', 'wide', 'mine']
    # The file of rings of dots takes the place of the usual design.
    every = [name for name in FAMILY_NAMES if name != 'dots']
    found = prints_in('auto', files)
    assert list(found) == [*every, 'mine', 'wide']
    assert [found[name].kind for name in ('mine', 'wide', 'gsi')] == ['ring', 'dots', 'gsi']
    mine = found['mine'].design
    assert isinstance(mine, ring.RingPrint) and mine.band == (1.42, 1.87)
    assert print_in('metashape12', files).design is ring.family('metashape12')
    assert print_in('Mine', files).design is mine
    check_numbers('ids', [1, 2], [found['mine']])


def test_a_usual_design_that_a_file_replaces_is_called_as_the_file_says(files: str) -> None:
    assert print_in('dots', files) == print_in('wide', files)
    assert list(prints_in('gsi, dots', files)) == ['gsi', 'wide']
    settings = DetectorSettings(family='dots', family_file=files)
    assert (settings.family, settings.families) == ('wide', ('wide',))
    assert SceneSettings(family='dots', family_file=files, targets=0).family == 'wide'


def test_records_of_families_go_to_other_processes_without_their_prints(files: str) -> None:
    settings = DetectorSettings(family='mine, metashape12', family_file=files)
    assert settings.prints['mine'].design is settings.prints['mine'].design
    sent = pickle.loads(pickle.dumps(settings))
    assert (sent, hash(sent)) == (settings, hash(settings))
    assert not any('design' in vars(of) for of in sent.prints.values())
    assert sent.prints['mine'].reach == 1.87
    assert len(pickle.dumps(settings)) < 1500


def test_settings_keep_what_a_file_said_when_they_were_made(files: str) -> None:
    path = Path(files.split(',')[0])
    before = DetectorSettings(family='mine', family_file=str(path))
    path.write_text(RINGS.replace('1.87', '1.95'))
    after = DetectorSettings(family='mine', family_file=str(path))
    assert (before.prints['mine'].reach, after.prints['mine'].reach) == (1.87, 1.95)
    assert before != after


def test_the_reach_of_a_target_is_in_semi_axes_of_its_ellipse() -> None:
    assert print_in('metashape12').reach == 3.5
    assert print_in('aruco_4x4_50').reach == pytest.approx(2**0.5)
    assert FamilyPrint('cctag3', 'cctag').reach == 1


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
        prints_in(text, files)


@pytest.mark.parametrize('library', [DOTS_DESIGN, GSI_LIBRARY])
def test_a_file_that_changes_is_read_again(library: Path, tmp_path: Path) -> None:
    file, design = tmp_path / 'mine.json', json.loads(library.read_text())
    file.write_text(json.dumps(design | {'family': 'mine'}))
    first = prints_of(str(file))
    assert list(first) == ['mine']
    assert prints_of(str(file))['mine'] is first['mine']
    file.write_text(json.dumps(design | {'family': 'another'}))
    assert list(prints_of(str(file))) == ['another']


def test_colours_of_families(files: str, tmp_path: Path) -> None:
    bright = tmp_path / 'bright.yaml'
    bright.write_text(RINGS.replace('mine', 'white') + 'polarity: bright\n')
    every = f'{files}, {bright}'
    assert DetectorSettings(family='white', family_file=every).polarities == (-1,)
    for names in ('white, mine', 'wide', 'gsi', 'metashape12', 'aruco_4x4_50'):
        assert DetectorSettings(family=names, family_file=every).polarities == (1, -1)


def test_files_that_do_not_fit_are_refused(files: str, tmp_path: Path) -> None:
    with pytest.raises(
        ValueError, match=r"rings\.yaml, line 1: family is 'mine', accepted is a n"
    ):
        prints_of(f'{files}, {tmp_path / "rings.yaml"}')
    assert print_in('gsi', files) is print_in('gsi')
    with pytest.raises(ValueError, match=r'missing\.yaml cannot be read'):
        prints_in('mine', 'missing.yaml')
    named = tmp_path / 'named.yaml'
    named.write_text(RINGS.replace('mine', 'cct12'))
    with pytest.raises(ValueError, match="family is 'cct12', accepted is a name that no other"):
        prints_of(str(named))
    for text in ('auto', 'mine,metashape12'):
        with pytest.raises(ValueError, match=f"family is '{text}', accepted is one family"):
            print_in(text, files)
