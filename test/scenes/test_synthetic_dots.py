"""Prints of point-distributed targets and of rings of dots; ink that is gained, in any family."""

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.cli import main
from ahf_ros.files.truth_files import read_truth
from ahf_ros.prints.dots import dot_family
from ahf_ros.prints.families import print_in
from ahf_ros.prints.gsi import GSI_LIBRARY, point_family
from ahf_ros.prints.ring import family
from ahf_ros.scenes.camera import Camera, tilted_camera
from ahf_ros.scenes.covers import ink_cover
from ahf_ros.scenes.prints import Mark, print_mark
from ahf_ros.scenes.scene import SceneSettings, render
from support.square_markers import needs_square_markers

GSI, DOTS = point_family(), dot_family()
NUMBER = 18
STEP = 0.015  # of the samples, radii of the dot
ROUND = ('metashape12', 'metashape20', 'aicon14', 'gsi', 'dots', 'cctag3')


def camera(tilt: float = 0.0) -> Camera:
    return tilted_camera(400, 400, 2000.0, math.radians(tilt), 0.0, np.random.default_rng(1))


def printed(name: str, number: int, turn: float, radius: float, looking: Camera) -> np.ndarray:
    """Return the ink in each pixel under even light."""
    design = print_in(name).design
    cover = ink_cover(design.ink(design.word(number)), turn)
    image = np.zeros((400, 400), np.float32)
    mark = Mark(np.zeros(2), radius, design.proportions.reach, cover)
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
    assert GSI.proportions.quiet_zone == pytest.approx(GSI.reach / 1.5 + 1)
    for name in ('dots', 'metashape12'):
        assert print_in(name).design.proportions.quiet_zone == pytest.approx(4.2)
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


def ink_of(name: str, growth: float) -> np.ndarray:
    """Return where there is ink, on a grid that is the same for all growths."""
    printed = print_in(name).design
    half = printed.proportions.reach + 0.5
    along = np.arange(-half, half, STEP, dtype=np.float32)
    x, y = np.meshgrid(along, along[::-1])
    cover = ink_cover(printed.ink(printed.word(NUMBER)), 0.4, growth)
    return cover(x, y, np.eye(2, dtype=np.float32) * np.float32(STEP)) > 0.5


def reached(inked: np.ndarray, distance: float) -> np.ndarray:
    """Return what lies within a distance of ink."""
    ground = (~inked).astype(np.uint8)
    steps = cv2.distanceTransform(ground, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) - 0.5
    return steps * STEP < distance


@pytest.mark.parametrize(
    'name', [*ROUND, pytest.param('aruco_4x4_50', marks=needs_square_markers)]
)
def test_ink_grows_and_shrinks_by_the_same_length_on_every_edge(name: str) -> None:
    plain = ink_of(name, 0.0)
    for found, expected in (
        (ink_of(name, 0.15), reached(plain, 0.15)),
        (ink_of(name, -0.12), ~reached(~plain, 0.12)),
    ):
        changed = (expected != plain).sum()
        assert changed > 0.1 * plain.sum()
        # Where ink grows, sectors keep sharp corners.
        assert (found != expected).sum() < 0.08 * changed


def test_the_same_growth_leaves_holes_that_are_smaller() -> None:
    near = np.zeros((1, 2), np.float32)
    near[0] = 0.05, 0.25
    jacobian = np.eye(2, dtype=np.float32) * np.float32(STEP)
    for growth, inked in ((0.0, [0, 0]), (0.1, [0, 1]), (0.35, [1, 1])):
        cover = ink_cover(family('metashape12').ink(71, pinhole=0.3), 0.0, growth)
        assert cover(near, near * 0, jacobian)[0].tolist() == inked
