"""Movement between images of one scene, in light that changes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from ahf_ros.imaging.movement import displacement, find_edges
from ahf_ros.synthetic.scene import SceneSettings, render

SCENE = {'width': 640, 'height': 480, 'targets': 6, 'dot_radius': 16.0}


def images(light: str, ambient: float, count: int = 3) -> list[np.ndarray]:
    scene = SceneSettings(**SCENE, light=light, ambient=ambient, phases=4, seed=5)
    return [render(scene, phase).image for phase in range(count)]


def shifted(image: np.ndarray, x: float, y: float) -> np.ndarray:
    moved = np.array([[1, 0, x], [0, 1, y]], float)
    return cv2.warpAffine(
        image, moved, image.shape[::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )


LIGHTS = [('normal', 0.3), ('stripe', 0.02), ('lattice', 0.3), ('fringe', 0.3), ('shadow', 0.3)]


@pytest.mark.parametrize(('light', 'ambient'), LIGHTS)
def test_light_that_moves_is_no_movement_and_a_scene_that_moves_is(light, ambient):
    first, *others = images(light, ambient)
    edges = find_edges(first)
    assert [displacement(edges, other) for other in others] == [None, None]
    for x, y in ((0.6, 0.3), (5.0, -3.0)):
        moved = displacement(edges, shifted(others[0], x, y))
        assert moved is not None
        assert np.hypot(moved.x - x, moved.y - y) < 0.15


def test_a_tenth_of_a_pixel_is_seen_in_even_light():
    first, second, _ = images('normal', 0.3)
    moved = displacement(find_edges(first), shifted(second, 0.1, 0.0))
    assert moved is not None
    assert moved.exceeds(0.05)
    assert moved.deviation < 0.01
    assert str(moved).startswith('0.1')


def test_an_object_that_moves_alone_is_noticed():
    first, second, _ = images('normal', 0.3)
    second[:, :320] = shifted(second, 0.9, 0.0)[:, :320]
    moved = displacement(find_edges(first), second)
    assert moved is not None
    assert abs(moved.x - 0.9) < 0.2


def test_large_displacements_are_found_in_a_smaller_image():
    first, second, _ = images('normal', 0.3)
    moved = displacement(find_edges(first), shifted(second, 42.0, -25.0))
    assert moved is not None
    assert np.hypot(moved.x - 42, moved.y + 25) < 2


def test_fine_stripes_that_move_by_half_their_period_are_no_movement():
    scene = SceneSettings(
        width=800, height=600, targets=16, dot_radius=6, light='fine_stripe', phases=4, seed=5
    )
    first, second = (render(scene, phase).image for phase in (0, 2))
    assert displacement(find_edges(first), second) is None


def test_a_lattice_that_moves_in_the_dark_is_no_movement():
    scene = SceneSettings(
        width=800,
        height=600,
        targets=12,
        dot_radius=6,
        light='lattice',
        ambient=0.02,
        phases=8,
        seed=11,
    )
    first, second = (render(scene, phase).image for phase in (0, 1))
    assert displacement(find_edges(first), second) is None


@pytest.mark.parametrize('size', [(16, 16), (40, 60)])
def test_images_without_edges_do_not_move(size):
    flat = np.full(size, 90, np.uint8)
    flat[0, 0] = 91
    assert displacement(find_edges(flat), flat) is None


def test_other_pixel_types_are_accepted():
    first, second, _ = images('normal', 0.3)
    edges = find_edges(first.astype(np.uint16) * 16)
    assert displacement(edges, second.astype(np.float32)) is None
