"""What the detectors of targets of dots have in common: gsi and dots, and those as published."""

from pathlib import Path

import numpy as np
import pytest

from ahf_ros.families import create_detector
from ahf_ros.identification.filtering.homomorphic import HomomorphicFilter
from ahf_ros.identification.session import identify
from ahf_ros.prints.dots import DOTS_DESIGN
from ahf_ros.scenes.evaluation import score
from ahf_ros.scenes.scene import Rendering
from support.scenes import counted, errors, rendering

SCENES = {
    'gsi': {'width': 1000, 'height': 700, 'targets': 4, 'dot_radius': 6.0, 'seed': 3},
    'dots': {'width': 800, 'height': 600, 'targets': 6, 'dot_radius': 10.0, 'seed': 4},
}
SIX = """
family: six
unit: mm
dot_radius: 1.5
reference: centre
template:
  centre: [0, 0, 3]
  far: [0, 18, 3]
  left: [-14, -6, 3]
positions:
  0: [8, 8]
  1: [14, 0]
  2: [10, -10]
  3: [0, -12]
  4: [-10, 8]
  5: [10, 18]
rule: {dots: 3, minimum_distance: 6, first_own_number: 1}
"""
"""Three large dots and three small ones, after the description of Hattori's targets."""
EIGHT, TWO = (
    DOTS_DESIGN.read_text()
    .replace('"bits": 10', f'"bits": {bits}')
    .replace('"border_radius": 3.2', '"border_radius": 3.4')
    .replace('"family": "dots"', '"family": "mydots"')
    for bits in (8, 2)
)


def scene(family: str, **changes: object) -> Rendering:
    return rendering(family=family, **SCENES[family] | changes)


@pytest.mark.parametrize(
    ('family', 'changes', 'bound'),
    [
        ('gsi', {}, 0.02),
        ('gsi', {'polarity': 'bright'}, 0.02),
        ('gsi', {'tilt': 60.0, 'polarity': 'bright', 'focal_length': 4.0}, 0.05),
        ('gsi', {'tilt': 75.0, 'polarity': 'bright', 'focal_length': 8.0}, 0.2),
        ('gsi', {'dot_radius': 10.0, 'targets': 2}, 0.01),
        ('gsi', {'dot_radius': 3.0, 'sizes': '1, 2', 'targets': 6}, 0.05),
        ('gsi', {'light': 'stripe', 'dot_radius': 9.0, 'targets': 2}, 0.05),
        ('gsi', {'light': 'fringe', 'ambient': 0.12, 'polarity': 'bright'}, 0.05),
        ('dots', {}, 0.02),
        ('dots', {'polarity': 'bright'}, 0.02),
        ('dots', {'dot_radius': 5.0}, 0.05),
        ('dots', {'dot_radius': 3.75, 'radius_spread': 0.0, 'targets': 20}, 0.15),
        ('dots', {'dot_radius': 20.0, 'targets': 4}, 0.02),
        ('dots', {'tilt': 65.0, 'focal_length': 3.0, 'targets': 4}, 0.05),
        ('dots', {'blur': 1.5}, 0.05),
        ('dots', {'tilt': 40.0}, 0.02),
        ('dots', {'light': 'stripe', 'dot_radius': 14.0}, 0.05),
        ('dots', {'light': 'stripe', 'ambient': 0.12, 'dot_radius': 14.0}, 0.05),
        ('dots', {'light': 'lattice', 'ambient': 0.12, 'dot_radius': 14.0}, 0.1),
    ],
)
def test_targets_are_identified_and_placed(family: str, changes: dict, bound: float) -> None:
    shown = scene(family, **changes)
    found = create_detector(family=family)(shown.image)
    assert counted(shown, found) == (len(shown.targets), 0, 0)
    assert np.sqrt((errors(shown, found) ** 2).mean()) < bound
    assert [it.code for it in found] == [it.code for it in shown.targets]
    assert all(0.8 <= target.confidence <= 1 for target in found)


@pytest.mark.parametrize(
    ('family', 'changes', 'least', 'bound'),
    [('gsi', {'dot_radius': 9.0, 'targets': 2}, 2, 0.05), ('dots', {'dot_radius': 14.0}, 4, 0.1)],
)
def test_places_come_from_the_image_as_received(
    family: str, changes: dict, least: int, bound: float
) -> None:
    shown = scene(family, light='stripe', **changes)
    detector = create_detector(family=family)
    found = detector(HomomorphicFilter(shown.image).filtered(1.2, 0.4))
    assert len(found) >= least
    refined = detector.refine(shown.image, found)
    assert [target.id for target in refined] == [target.id for target in found]
    assert np.hypot(*errors(shown, refined).T).max() < bound
    assert detector.refine(shown.image, []) == []


@pytest.mark.parametrize(
    ('family', 'changes', 'bound'),
    [
        ('gsi', {}, 0.3),
        ('gsi', {'polarity': 'bright'}, 0.3),
        ('gsi', {'tilt': 50.0, 'polarity': 'bright'}, 0.3),
        ('dots', {}, 0.15),
        ('dots', {'dot_radius': 3.8}, 0.15),
        ('dots', {'dot_radius': 14.0}, 0.15),
        ('dots', {'polarity': 'bright'}, 0.15),
        ('dots', {'tilt': 50.0}, 0.35),  # with the bias of the ellipse under perspective
    ],
)
def test_even_light_is_enough_for_the_published_methods(
    family: str, changes: dict, bound: float
) -> None:
    shown = scene(family, **changes)
    found = create_detector(f'{family}_published', family=family)(shown.image)
    assert counted(shown, found) == (len(shown.targets), 0, 0)
    assert score(shown, found).rmse[2] < bound
    assert [it.code for it in found] == [it.code for it in shown.targets]
    assert all(0 < target.confidence <= 1 for target in found)


@pytest.mark.lasting
@pytest.mark.parametrize(
    ('family', 'changes', 'options', 'least'),
    [
        (
            'gsi',
            {'ambient': 0.12, 'dot_radius': 9.0, 'targets': 1, 'width': 700, 'height': 500},
            {'population': 8, 'max_evaluations': 24},
            1,
        ),
        ('dots', {}, {}, 4),
    ],
)
def test_stripes_defeat_the_published_methods_and_ahf_brings_the_targets_back(
    family: str, changes: dict, options: dict, least: int
) -> None:
    shown = scene(family, light='stripe', **changes)
    detector = create_detector(f'{family}_published', family=family)
    without = score(shown, detector(shown.image)).right
    expected = len(shown.targets)
    found = identify(shown.image, detector=detector, expected_targets=expected, **options)
    assert found.filter.applied
    assert score(shown, found).right >= max(3 * without, least)


@pytest.mark.parametrize(
    ('family', 'own', 'text', 'changes'),
    [
        ('gsi', 'six', SIX, {'width': 900, 'dot_radius': 5.0, 'seed': 2}),
        ('dots', 'mydots', EIGHT, {'seed': 5}),
    ],
)
def test_a_design_of_ones_own_is_printed_and_identified(
    tmp_path: Path, family: str, own: str, text: str, changes: dict
) -> None:
    path = tmp_path / 'own.yaml'
    path.write_text(text)
    shown = scene(family, family_file=str(path), **changes)
    found = create_detector(family=own, family_file=str(path))(shown.image)
    assert {it.family for it in found} == {own}
    assert counted(shown, found) == (len(shown.targets), 0, 0)
    assert [it.code for it in found] == [it.code for it in shown.targets]
    assert np.hypot(*errors(shown, found).T).max() < 0.05


@pytest.mark.parametrize(
    ('name', 'text', 'message'),
    [
        ('gsi', SIX.replace('  left: [-14, -6, 3]\n', ''), 'line 6: template .*3 to 12 names'),
        ('gsi_published', SIX, "the family is 'six', accepted by gsi_published is one"),
        ('dots', TWO, r'own\.yaml, line 4: bits is 2'),
        ('dots_published', TWO, r'own\.yaml, line 4: bits is 2'),
    ],
)
def test_a_bad_design_is_refused_when_the_detector_is_made(
    tmp_path: Path, name: str, text: str, message: str
) -> None:
    path = tmp_path / 'own.yaml'
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        create_detector(name, family=name.partition('_')[0], family_file=str(path))
