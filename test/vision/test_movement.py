"""Movement between images of one scene, in light that changes."""

from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.base.target import Target
from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.vision.movement import Displacement, displacement, find_edges, targets_moved

LARGE = {'width': 640, 'height': 480, 'targets': 6, 'dot_radius': 16.0, 'phases': 4, 'seed': 5}
SMALL = {'width': 800, 'height': 600, 'dot_radius': 6.0}


@cache
def images(light: str = 'normal', ambient: float = 0.3) -> list[np.ndarray]:
    scene = SceneSettings(**LARGE, light=light, ambient=ambient)
    return [render(scene, phase).image for phase in range(3)]


def shifted(image: np.ndarray, x: float, y: float) -> np.ndarray:
    moved = np.array([[1, 0, x], [0, 1, y]], float)
    return cv2.warpAffine(
        image, moved, image.shape[::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )


LIGHTS = [('normal', 0.3), ('stripe', 0.02), ('lattice', 0.3), ('fringe', 0.3), ('shadow', 0.3)]


@pytest.mark.lasting
@pytest.mark.parametrize(('light', 'ambient'), LIGHTS)
def test_light_that_moves_is_no_movement_and_a_scene_that_moves_is(
    light: str, ambient: float
) -> None:
    first, *others = images(light, ambient)
    edges = find_edges(first)
    assert [displacement(edges, other) for other in others] == [None, None]
    for x, y in ((0.6, 0.3), (5.0, -3.0)):
        moved = displacement(edges, shifted(others[0], x, y))
        assert moved is not None
        assert np.hypot(moved.x - x, moved.y - y) < 0.15


def test_a_tenth_of_a_pixel_is_seen_in_even_light() -> None:
    first, second, _ = images()
    moved = displacement(find_edges(first), shifted(second, 0.1, 0.0))
    assert moved is not None
    assert moved.exceeds(0.05)
    assert moved.deviation < 0.01
    assert str(moved).startswith('0.1')


def test_an_object_that_moves_alone_is_noticed() -> None:
    first, second, _ = images()
    second = np.hstack([shifted(second, 0.9, 0.0)[:, :320], second[:, 320:]])
    moved = displacement(find_edges(first), second)
    assert moved is not None
    assert abs(moved.x - 0.9) < 0.2


def test_large_displacements_are_found_in_a_smaller_image() -> None:
    first, second, _ = images()
    moved = displacement(find_edges(first), shifted(second, 42.0, -25.0))
    assert moved is not None
    assert np.hypot(moved.x - 42, moved.y + 25) < 2


@pytest.mark.parametrize(
    ('changes', 'phase'),
    [
        ({'targets': 16, 'light': 'fine_stripe', 'phases': 4, 'seed': 5}, 2),
        ({'targets': 12, 'light': 'lattice', 'ambient': 0.02, 'phases': 8, 'seed': 11}, 1),
    ],
    ids=['fine stripes by half their period', 'a lattice in the dark'],
)
def test_light_that_is_like_itself_elsewhere_is_no_movement(
    changes: dict[str, float | str] | dict[str, int | str], phase: int
) -> None:
    scene = SceneSettings(**SMALL, **changes)
    first, second = (render(scene, of).image for of in (0, phase))
    assert displacement(find_edges(first), second) is None


@pytest.mark.parametrize('size', [(16, 16), (40, 60)])
def test_images_without_edges_do_not_move(size: tuple[int, int]) -> None:
    flat = np.full(size, 90, np.uint8)
    flat[0, 0] = 91
    assert displacement(find_edges(flat), flat) is None


def test_other_pixel_types_are_accepted() -> None:
    first, second, _ = images()
    edges = find_edges(first.astype(np.uint16) * 16)
    assert displacement(edges, second.astype(np.float32)) is None


PLACES = np.random.default_rng(0).uniform(0, 100, (9, 2))


def targets(x: float, noise: float) -> list[Target]:
    places = PLACES + np.random.default_rng(1).normal(0, noise, PLACES.shape)
    return [Target(number, 0, px + x, py, 5.0, 5.0) for number, (px, py) in enumerate(places)]


@pytest.mark.parametrize(
    ('moved', 'shift', 'noise', 'told'),
    [
        (Displacement(0.9, 0.1, 0.05), 0.0, 0.05, False),
        (Displacement(0.9, 0.1, 0.05), 0.9, 0.05, True),
        (Displacement(-0.4, 0.4, 0.05), 0.6, 0.05, True),
        (Displacement(0.1, 0.0, 0.01), 0.1, 0.005, True),
        (Displacement(0.1, 0.0, 0.01), 0.0, 0.3, None),
        (Displacement(0.9, 0.1, 0.05, (0, 0, 10, 10)), 0.9, 0.05, None),
    ],
)
def test_targets_tell_a_movement_or_too_few_do(
    moved: Any, shift: float, noise: float, told: bool | None
) -> None:
    assert targets_moved(moved, targets(0.0, 0.0), targets(shift, noise)) is told
