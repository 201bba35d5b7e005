"""Prints of point-distributed targets and of rings of dots."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.cli import main
from ahf_ros.codes.designs import proportions
from ahf_ros.codes.dots import dot_family
from ahf_ros.codes.gsi import GSI_LIBRARY, point_family
from ahf_ros.interchange.truth_files import read_truth
from ahf_ros.synthetic.camera import Camera, tilted_camera
from ahf_ros.synthetic.designs import designs
from ahf_ros.synthetic.prints import Mark, print_mark
from ahf_ros.synthetic.scene import SceneSettings, render

GSI, DOTS = point_family(), dot_family()


def camera(tilt: float = 0.0) -> Camera:
    return tilted_camera(400, 400, 2000.0, math.radians(tilt), 0.0, np.random.default_rng(1))


def printed(family: str, number: int, turn: float, radius: float, looking: Camera) -> np.ndarray:
    """Return the ink in each pixel under even light."""
    design = designs(family, 0.0)[1](number, turn, 0.0)
    image = np.zeros((400, 400), np.float32)
    mark = Mark(np.zeros(2), radius, design.reach, design.cover)
    print_mark(image, np.ones_like(image), mark, looking, 1.0, 0.7)
    return image


@pytest.mark.parametrize('tilt', [0.0, 60.0])
def test_dots_are_where_the_design_has_them(tilt: float) -> None:
    looking, turn, radius = camera(tilt), 0.4, 8.0
    ink = printed('gsi', 18, turn, radius, looking)
    x, y = (GSI.places[[0, 1, 2, 3, 4, 5 + 3, 5 + 5, 5 + 13]] / GSI.dot_radius).T
    wall = radius * np.stack(
        [x * math.cos(turn) - y * math.sin(turn), -x * math.sin(turn) - y * math.cos(turn)], axis=1
    )
    count, _, _, centroids = cv2.connectedComponentsWithStats((ink > 0.5).astype(np.uint8))
    assert count == 1 + 8
    gaps = np.hypot(*(looking.project(wall)[:, None] - centroids[None, 1:]).transpose(2, 0, 1))
    assert gaps.min(axis=1).max() < 0.4
    assert len(set(gaps.argmin(axis=1))) == 8


def test_b_to_d_is_counter_clockwise_as_seen() -> None:
    rendering = render(SceneSettings(width=400, height=400, targets=1, family='gsi', dot_radius=6))
    (target,) = rendering.targets
    assert target.code == GSI.word(target.id)
    dark = (rendering.image < rendering.image.max() / 2).astype(np.uint8)
    _, _, _, centroids = cv2.connectedComponentsWithStats(dark)
    dots = (centroids[1:] - (target.x, target.y)) * [1, -1]
    design = GSI.places[[0, 1, 2, 3, 4, *(5 + GSI.decoding_dots(target.code))]]
    gaps = []
    for turn in np.linspace(0, 2 * math.pi, 1000):
        rotation = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        for mirror in (1, -1):
            turned = target.semi_major / GSI.dot_radius * (design * [1, mirror]) @ rotation
            gap = np.hypot(*(turned[:, None] - dots[None]).transpose(2, 0, 1)).min(axis=1).max()
            gaps.append((gap, mirror))
    assert min(gaps)[1] == 1 and min(gaps)[0] < 1


def test_the_ink_of_a_target_is_that_of_its_eight_dots() -> None:
    ink = printed('gsi', 505, 1.0, 7.0, camera())
    assert ink.sum() == pytest.approx(8 * math.pi * 49, rel=2e-3)


def test_a_ring_of_dots_has_its_dots_counter_clockwise() -> None:
    looking, radius = camera(), 20.0
    number, turn = 20, 0.3
    ink = printed('dots', number, turn, radius, looking)
    x, y = looking.project(np.zeros((1, 2)))[0]
    angles = turn + 2 * math.pi * np.arange(10) / 10
    columns = np.float32(x + DOTS.dot_circle * radius * np.cos(angles))[None]
    rows = np.float32(y - DOTS.dot_circle * radius * np.sin(angles))[None]
    read = cv2.remap(ink, columns, rows, cv2.INTER_LINEAR)[0] > 0.5
    assert (read @ (1 << np.arange(10))) == DOTS.word(number)
    border = DOTS.border_radius**2 - DOTS.ground_radius**2
    count = bin(DOTS.word(number)).count('1')
    expected = math.pi * radius**2 * (1 + border + count * DOTS.dot_radius**2)
    assert ink.sum() == pytest.approx(expected, rel=2e-3)


def test_sizes_are_mixed_in_equal_numbers() -> None:
    scene = SceneSettings(
        width=1200,
        height=900,
        targets=6,
        family='gsi',
        dot_radius=5,
        radius_spread=0,
        sizes='1, 2',
    )
    sizes = sorted(target.semi_major for target in render(scene).targets)
    assert sizes == pytest.approx([5, 5, 5, 10, 10, 10], rel=0.02)


def test_steep_views_can_be_rendered() -> None:
    scene = SceneSettings(
        width=900, height=600, targets=3, family='gsi', dot_radius=5, tilt=80, focal_length=8
    )
    for target in render(scene).targets:
        assert target.semi_major / target.semi_minor > 4


def test_targets_are_as_far_apart_as_they_are_wide() -> None:
    assert proportions('gsi').quiet_zone == pytest.approx(GSI.reach / 1.5 + 1)
    for name in ('dots', 'metashape12'):
        assert proportions(name).quiet_zone == pytest.approx(4.2)
    with pytest.raises(ValueError, match=r'targets is 60, accepted is an integer from 0 to 4 '):
        SceneSettings(width=800, height=600, targets=60, family='gsi', dot_radius=7)
    with pytest.raises(ValueError, match="sizes is '1, x', accepted are numbers from"):
        SceneSettings(sizes='1, x')


def test_the_command_renders_families_from_data_files(tmp_path: Path) -> None:
    file = tmp_path / 'mine.json'
    file.write_text(GSI_LIBRARY.read_text().replace('10001', '50001'))
    size = ['--width', '500', '--height', '400', '--targets', '1', '--dot-radius', '5']
    arguments = ['render', str(tmp_path), '--family', 'gsi', '--family-file', str(file), *size]
    assert main(arguments) == 0
    ((target,),) = read_truth(tmp_path / 'truth.csv').values()
    assert target.id > 50000
