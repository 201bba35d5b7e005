"""CCTags are identified, and nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.detectors import create_detector
from ahf_ros.synthetic.scene import Rendering
from support.scenes import counted, rendering

SIZE = {'width': 640, 'height': 480, 'targets': 8, 'dot_radius': 14.0, 'seed': 2}


def scene(family: str = 'cctag3', **changes: object) -> Rendering:
    return rendering(**SIZE | {'family': family} | changes)


def errors(shown: Rendering, found: list) -> np.ndarray:
    """Return the errors of the centres of the targets that were found, px, shape (k, 2)."""
    places = {target.id: (target.x, target.y) for target in shown.targets}
    return np.array([(it.x - places[it.id][0], it.y - places[it.id][1]) for it in found])


@pytest.mark.parametrize(
    ('family', 'changes', 'limit'),
    [
        ('cctag3', {}, 0.02),
        ('cctag4', {}, 0.02),
        ('cctag3', {'polarity': 'bright'}, 0.02),
        ('cctag3', {'dot_radius': 10.0}, 0.03),
        ('cctag3', {'dot_radius': 60.0, 'targets': 4}, 0.02),
        ('cctag3', {'tilt': 40.0, 'dot_radius': 20.0, 'targets': 6}, 0.03),
        ('cctag3', {'edge_shift': 0.5}, 0.03),
        ('cctag3', {'edge_shift': -0.5, 'dot_radius': 24.0, 'targets': 4}, 0.03),
        ('cctag3', {'light': 'stripe', 'ambient': 0.3, 'dot_radius': 20.0, 'targets': 6}, 0.05),
    ],
)
def test_targets_are_identified_where_they_are(family: str, changes: dict, limit: float) -> None:
    shown = scene(family, **changes)
    found = create_detector(family=family)(shown.image)
    count = len(shown.targets)
    assert counted(shown, found) == (count, 0, 0)
    assert np.sqrt((errors(shown, found) ** 2).mean()) < limit
    assert all(target.code == target.id and target.family == family for target in found)


def test_the_growth_of_ink_is_reported() -> None:
    shown = scene(edge_shift=0.4, gamma=1.0, dot_radius=20.0, targets=6)
    found = create_detector(family='cctag3')(shown.image)
    assert [target.edge_shift for target in found] == pytest.approx([0.4] * 6, abs=0.1)


@pytest.mark.parametrize('family', ['metashape12', 'aicon14', 'dots'])
@pytest.mark.parametrize('light', ['normal', 'lattice'])
def test_targets_of_other_families_are_none(family: str, light: str) -> None:
    shown = scene(family, dot_radius=8.0, targets=4, light=light, ambient=0.3)
    for name in ('cctag3', 'cctag4'):
        assert create_detector(family=name)(shown.image) == []


def test_refinement_finds_the_place_again() -> None:
    shown = scene()
    detector = create_detector(family='cctag3')
    found = detector(shown.image)
    moved = [replace(target, x=target.x + 0.5, y=target.y - 0.4) for target in found]
    refined = detector.refine(shown.image, moved)
    assert np.abs(errors(shown, refined)).max() < 0.05
