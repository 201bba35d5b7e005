"""Ring targets whose data files tell more of their print."""

from pathlib import Path

import numpy as np
import pytest

from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.families.ring.detector import find_hypotheses
from ahf_ros.prints.cyclic import smallest_rotation
from ahf_ros.prints.ring import ring_family
from ahf_ros.scenes.evaluation import score
from ahf_ros.scenes.scene import Rendering, SceneSettings, render
from ahf_ros.vision.image import as_gray

MINE = 'family: mine\nbits: 10\nband: {band}\nwords: all\n{more}'


def described(folder: Path, more: str = '', band: object = (2.2, 3.2)) -> str:
    """Return the path of a data file."""
    file = folder / 'mine.yaml'
    file.write_text(MINE.format(band=list(band), more=more))
    return str(file)


def shown(file: str, **changes: object) -> Rendering:
    scene = {'width': 900, 'height': 640, 'targets': 12, 'dot_radius': 10, 'seed': 5} | changes
    return render(SceneSettings(family='mine', family_file=file, **scene))


def test_a_bright_family_is_rendered_and_found_bright(tmp_path: Path) -> None:
    file = described(tmp_path, 'polarity: bright\n')
    scene = shown(file)
    assert np.median(scene.image) < 90
    right = score(scene, create_detector(family='mine', family_file=file)(scene.image))
    assert (right.right, right.wrong, right.false_positives) == (12, 0, 0)
    dark = shown(file, polarity='dark')
    assert create_detector(family='mine', family_file=file)(dark.image) == []
    forced = create_detector(family='mine', family_file=file, polarity='dark')(dark.image)
    assert score(dark, forced).right == 12


@pytest.mark.lasting
@pytest.mark.parametrize(
    'circles', ['[[3.7, 4.2]]', '[[1.4, 1.8]]', '[[4.2, 5], [5.5, 5.7]]'], ids=str
)
@pytest.mark.parametrize('light', ['normal', 'stripe'])
def test_further_circles_do_not_disturb(tmp_path: Path, circles: str, light: str) -> None:
    file = described(tmp_path, f'circles: {circles}\n')
    scene = shown(file, light=light, targets=6)
    found = score(scene, create_detector(family='mine', family_file=file)(scene.image))
    assert found.right >= 5
    assert found.wrong == 0


@pytest.mark.parametrize('band', [(1.8, 3.2), (2.2, 2.8)])
def test_a_free_band_is_measured(tmp_path: Path, band: tuple[float, float]) -> None:
    (tmp_path / 'printed').mkdir()
    scene = shown(described(tmp_path / 'printed', band=band))
    file = described(tmp_path, band=([1.8, 2.2], [2.8, 3.2]))
    found = score(scene, create_detector(family='mine', family_file=file)(scene.image))
    exact = create_detector(family='mine', family_file=f'{tmp_path}/printed/mine.yaml')
    assert (found.right, found.wrong) == (12, 0)
    errors = [
        np.hypot(*np.transpose(of.errors)) for of in (found, score(scene, exact(scene.image)))
    ]
    assert np.sqrt(np.mean(errors[0] ** 2)) < np.sqrt(np.mean(errors[1] ** 2)) + 0.01


def test_hypotheses_are_of_the_family_as_described(tmp_path: Path) -> None:
    file = described(tmp_path, band=([1.8, 2.2], [2.8, 3.2]))
    settings = DetectorSettings(family='mine', family_file=file)
    read = find_hypotheses(as_gray(shown(file).image), settings)
    assert read.certain.sum() == 12
    assert {code.bounds for code in read.families} == {((1.8, 2.2), (2.8, 3.2))}


@pytest.mark.parametrize('radius', [8.0, 24.0])
def test_a_single_mark_of_many_sectors_is_read(tmp_path: Path, radius: float) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text('family: mine\nbits: 24\nband: [2, 3]\nwords: [1, 11, 27]\n')
    scene = shown(str(file), targets=3, dot_radius=radius)
    found = create_detector(family='mine', family_file=str(file))(scene.image)
    assert 1 in ring_family(str(file)).words
    assert sorted(it.id for it in found) == [1, 2, 3]


@pytest.mark.lasting
@pytest.mark.parametrize(('light', 'least'), [('normal', 10), ('lattice', 6)])
def test_sectors_that_blur_mixes_are_read(tmp_path: Path, light: str, least: int) -> None:
    generator = np.random.default_rng(4)
    words = np.unique(smallest_rotation(generator.integers(1, (1 << 24) - 1, 40), 24)).tolist()
    file = tmp_path / 'mine.yaml'
    file.write_text(f'family: mine\nbits: 24\nband: [1.6, 2.2]\nwords: {words}\n')
    changes = {'dot_radius': 6.4, 'edge_shift': -0.5, 'polarity': 'dark', 'light': light}
    scene = shown(str(file), **changes)
    found = score(scene, create_detector(family='mine', family_file=str(file))(scene.image))
    assert found.right >= least
    assert found.wrong == found.false_positives == 0


@pytest.mark.lasting
@pytest.mark.parametrize(
    ('bits', 'band', 'radius'), [(22, (1.8, 2.7), 6.2), (24, (1.41, 2.0), 7.8)]
)
def test_bright_sectors_and_gaps_little_wider_than_blur_are_read(
    tmp_path: Path, bits: int, band: tuple[float, float], radius: float
) -> None:
    generator = np.random.default_rng(5)
    words = generator.integers(1, (1 << bits) - 1, 40)
    words = np.unique(smallest_rotation(words, bits)).tolist()
    file = tmp_path / 'mine.yaml'
    file.write_text(f'family: mine\nbits: {bits}\nband: {list(band)}\nwords: {words}\n')
    changes = {'dot_radius': radius, 'edge_shift': -0.5, 'polarity': 'bright'}
    scene = shown(str(file), **changes)
    found = score(scene, create_detector(family='mine', family_file=str(file))(scene.image))
    assert found.right >= 8
    assert found.wrong == found.false_positives == 0
