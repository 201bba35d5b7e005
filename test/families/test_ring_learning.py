"""Families of rings learnt from photographs."""

import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.families.learning.rings import LearntFamily, learn_families, likely_rules
from ahf_ros.families.ring.bands import find_bands
from ahf_ros.files.image_files import read_image, write_image
from ahf_ros.prints.cyclic import smallest_rotation
from ahf_ros.prints.ring import conforming, family, ring_family
from ahf_ros.scenes.scene import Rendering, SceneSettings
from support.command_line import status
from support.photographs import PANEL, needs_photographs
from support.scenes import rendered

SCENE = SceneSettings(width=1100, height=800, targets=20, dot_radius=10, seed=4)


def shown(name: str, **changes: object) -> Rendering:
    return rendered(replace(SCENE, family=name, **changes))


def learnt(*images: np.ndarray) -> list[LearntFamily]:
    return learn_families(find_bands(images, DetectorSettings()))


@pytest.mark.parametrize(
    ('name', 'changes'),
    [
        ('cct10', {}),
        ('aicon14', {'edge_shift': 0.5, 'polarity': 'bright'}),
        ('metashape12', {'edge_shift': -0.5, 'radius_spread': 0.3}),
        ('metashape20', {'dot_radius': 12}),
    ],
)
def test_bits_radii_and_words_of_one_image(name: str, changes: dict) -> None:
    scene, code = shown(name, **changes), family(name)
    (found,) = learnt(scene.image)
    assert (found.bits, len(found.words)) == (code.bits, 20)
    assert found.band == pytest.approx(code.band, abs=0.03)
    assert sorted(found.words) == sorted(target.code for target in scene.targets)
    assert found.lead > 10
    printed = -1 if changes.get('polarity') == 'bright' else 1
    assert found.growth * printed == pytest.approx(changes.get('edge_shift', 0), abs=0.1)
    even = name != 'cct10'
    assert found.rules.get('parity') == ('even' if even else None)
    assert found.polarity == changes.get('polarity', 'dark')
    assert found.pinhole == pytest.approx(0.05, abs=0.04)


@pytest.mark.parametrize('gamma', [2.2, 1.0])
@pytest.mark.parametrize('polarity', ['dark', 'bright'])
def test_blur_does_not_move_the_edges_of_bands_about_small_dots(
    polarity: str, gamma: float
) -> None:
    changes = {'dot_radius': 5.5, 'edge_shift': 0.3, 'polarity': polarity, 'gamma': gamma}
    (found,) = learnt(shown('cct12', **changes).image)
    assert found.band == pytest.approx(family('cct12').band, abs=0.02)


def test_arcs_that_end_anywhere_are_no_family() -> None:
    bands = find_bands([shown('cct12').image], DetectorSettings())
    generator = np.random.default_rng(3)
    angles = np.arange(bands.ink.shape[1])
    for arcs in (1, 2, 3):
        borders = np.sort(generator.integers(0, len(angles), (len(bands.size), 2 * arcs)))
        ink = (angles[:, None] >= borders[:, None]).sum(axis=2) % 2
        assert learn_families(replace(bands, ink=ink.astype(float))) == []


@pytest.mark.lasting
def test_rules_that_few_words_cannot_tell_have_a_probability() -> None:
    (few,) = learnt(shown('metashape20', dot_radius=12, seed=1).image)
    assert all(rules['parity'] == 'even' for rules, _ in few.likely)
    assert {rules.get('opposite_pairs', 0) for rules, _ in few.likely} == {0, 1}
    (many,) = learnt(*(shown('aicon12', seed=seed).image for seed in (1, 2)))
    assert many.rules == {'parity': 'even', 'opposite_pairs': 1}
    assert many.likely[0][1] > 0.95


def drawn(bits: int, count: int, seed: int, **rules: object) -> np.ndarray:
    """Return different words drawn at random from those that follow rules."""
    every = np.arange(1, 1 << bits)
    every = every[(every == smallest_rotation(every, bits)) & conforming(every, bits, **rules)]
    return np.random.default_rng(seed).permutation(every)[:count]


@pytest.mark.lasting
def test_probabilities_of_rules_are_the_shares_of_right_ones() -> None:
    choices = [{'parity': 'even', 'opposite_pairs': 1}] * 2 + [{'parity': 'even'}] * 3
    said, right = [], []
    for seed, rules in enumerate(choices * 8):
        words = drawn(16, 20, seed, **rules)
        (best, probability), *others = likely_rules(words, np.zeros(len(words), bool), 16)
        assert sum(of for _, of in others) + probability <= 1 + 1e-9
        said.append(probability)
        right.append(best == rules)
    assert np.mean(right) == pytest.approx(np.mean(said), abs=0.15)


def test_the_first_words_of_a_family_do_not_limit_it_to_few_changes() -> None:
    words = family('metashape14').words[:30]
    assert 'changes' not in likely_rules(words, np.zeros(30, bool), 14)[0][0]


def test_a_word_that_was_misread_does_not_hide_a_rule() -> None:
    words = np.append(drawn(14, 30, 1, parity='even'), drawn(14, 1, 2, parity='odd'))
    sure = np.zeros(31, bool)
    assert likely_rules(words, sure, 14)[0][0]['parity'] == 'even'
    sure[30] = True
    assert 'parity' not in likely_rules(words, sure, 14)[0][0]


def test_two_families_in_two_images_are_told_apart() -> None:
    first, second = learnt(shown('cct12').image, shown('cct10', targets=12).image)
    assert [(it.bits, len(it.words)) for it in (first, second)] == [(12, 20), (10, 12)]
    assert [set(it.bands.image.tolist()) for it in (first, second)] == [{0}, {1}]


def test_families_of_the_same_band_are_told_apart_by_their_borders() -> None:
    image = np.hstack([shown('cct12').image, shown('cct14').image])
    assert sorted((it.bits, len(it.words)) for it in learnt(image)) == [(12, 20), (14, 20)]


def test_few_targets_and_images_without_any_are_no_family() -> None:
    assert learnt(shown('cct10', targets=4).image) == []
    assert learnt(shown('dots', targets=2).image, shown('gsi', targets=0).image) == []
    assert len(find_bands([], DetectorSettings()).size) == 0


@pytest.mark.lasting
@needs_photographs
def test_the_family_of_photographs() -> None:
    (found,) = learnt(*map(read_image, sorted(PANEL.glob('*.png'))[:4]))
    code = family('aicon14')
    assert found.bits == 14
    assert found.band == pytest.approx(code.band, abs=0.04)
    assert found.rules['parity'] == 'even'
    assert np.mean(code.ids(found.words) > 0) > 0.99


def test_the_command_writes_a_family_that_the_detector_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = shown('metashape12')
    write_image(tmp_path / 'a.png', scene.image)
    output = tmp_path / 'mine.yaml'
    assert status('learn-family', tmp_path / 'a.png', '-o', output) == 0
    said = capsys.readouterr().err
    assert '20 targets in 1 of 1 images, 12 bits' in said
    assert re.search(r'words: {"parity": "even"} \(probability [01]\.\d\d\)', said)
    assert re.search(r'band 2\.2\d to 3\.\d+, dark, pinhole 0\.0\d, ink', said)
    assert 'metashape12 has all of these words and about this band' in said
    code = ring_family(str(output))
    assert (code.name, code.polarity) == ('mine', 'dark')
    assert 0 < code.pinhole < 0.1
    assert conforming(code.words, 12, parity='even').all()
    assert cv2.imread(str(tmp_path / 'mine.png')).shape[1] == 6 * 182
    targets = create_detector(family='mine', family_file=str(output))(scene.image)
    assert sorted(it.id for it in targets) == sorted(it.code for it in scene.targets)


def test_the_command_writes_two_families_and_says_what_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_image(tmp_path / 'a.png', shown('cct12').image)
    write_image(tmp_path / 'b.png', shown('cct10').image)
    (tmp_path / 'c.png').write_bytes(b'nothing')
    output = tmp_path / 'out' / 'rings.yaml'
    output.parent.mkdir()
    assert status('learn-family', tmp_path, '-o', output, '--name', 'mine') == 1
    said = capsys.readouterr().err
    assert 'c.png' in said
    files = sorted(output.parent.glob('*.yaml'))
    assert [file.name for file in files] == ['rings.yaml', 'rings_2.yaml']
    assert sorted(ring_family(str(file)).name for file in files) == ['mine', 'mine_2']


@pytest.mark.parametrize(
    ('name', 'message'),
    [
        ('gsi', r'0 dots with a concentric band .* in 1 images; 5 of one family'),
        ('dots', r'0 dots with a concentric band .* in 1 images; 5 of one family'),
        ('cct10', r'2 dots with a concentric band of sectors in 1 images; 5 of one family'),
    ],
)
def test_the_command_says_that_there_is_no_family(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, message: str
) -> None:
    write_image(tmp_path / 'a.png', shown(name, targets=2).image)
    assert status('learn-family', tmp_path / 'a.png', '-o', tmp_path / 'mine.yaml') == 1
    assert re.search(message, capsys.readouterr().err)
    assert not (tmp_path / 'mine.yaml').exists()


def test_one_target_and_no_photographs_are_no_family(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / 'mine.yaml'
    write_image(tmp_path / 'a.png', shown('cct10', targets=1).image)
    assert status('learn-family', tmp_path / 'a.png', '-o', output) == 1
    assert '1 dots with a concentric band of sectors in 1 images' in capsys.readouterr().err
    (tmp_path / 'a.png').write_bytes(b'nothing')
    assert status('learn-family', tmp_path / 'a.png', '-o', output) == 1
    assert 'no photograph was read, accepted is one at least' in capsys.readouterr().err
    assert not output.exists()


def test_photographs_and_point_lists_are_not_learnt_together(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert status('learn-family', 'a.png', 'b.csv', '-o', tmp_path / 'mine.yaml') != 0
    assert "sources are 2 with 'b.csv', accepted are photographs, or" in capsys.readouterr().err


@pytest.mark.parametrize(
    ('name', 'message'),
    [
        ('cct10', 'a.png: 20 dots with a band of 10 sectors: --family cct10\n'),
        ('aicon12', 'a.png: 20 dots with a band of 12 sectors: --family aicon12 or cct12\n'),
        ('mine', 'a.png: 20 dots with a band of 9 sectors that no known family has: `ahf learn-'),
    ],
)
def test_rings_of_another_family_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, message: str
) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text('family: mine\nbits: 9\nband: [1.6, 2.4]\nwords: all\n')
    scene = shown(name, family_file=str(file)) if name == 'mine' else shown(name)
    write_image(tmp_path / 'a.png', scene.image)
    assert status('identify', tmp_path / 'a.png', '--family', 'metashape12') == 0
    said = capsys.readouterr().err
    assert 'targets of metashape12 were looked for' in said
    assert message in said
