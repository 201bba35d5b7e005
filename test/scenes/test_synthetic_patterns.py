"""Patterns of light have the sizes they are named for, and fall off as light does."""

import math

import numpy as np
import pytest

from ahf_ros.scenes.camera import tilted_camera
from ahf_ros.scenes.patterns import LIGHT_NAMES, light_pattern, turned
from ahf_ros.scenes.radiance import rig_projector
from support.pictures.lights import EVERY_LIGHT, LIT


def shine(name: str, defocus: float = 0.5, seed: int = 0) -> np.ndarray:
    """Return the pattern at 1280 x 800 projector px."""
    v, u = np.mgrid[-400:400, -640:640].astype(np.float32)
    return light_pattern(name, defocus, np.random.default_rng(seed))(u, v)


def frequency(pattern: np.ndarray) -> float:
    """Return the strongest spatial frequency, 1 / projector px."""
    window = np.outer(np.hanning(800), np.hanning(1280))
    spectrum = np.abs(np.fft.rfft2((pattern - pattern.mean()) * window))
    row, column = np.unravel_index(spectrum.argmax(), spectrum.shape)
    return float(np.hypot(np.fft.fftfreq(800)[row], np.fft.rfftfreq(1280)[column]))


@pytest.mark.parametrize(
    ('name', 'period', 'lit'),
    [
        ('stripe', 26, 0.5),
        ('wide_stripe', 70, 0.5),
        ('fine_stripe', 14, 0.5),
        ('diagonal_stripe', 34, 0.5),
        ('lattice', 30, math.pi * 9**2 / 30**2),
        ('dense_lattice', 16, math.pi * 4.8**2 / 16**2),
        ('fringe', 40, 0.5),
    ],
)
def test_patterns_have_their_period_and_share_of_light(
    name: str, period: float, lit: float
) -> None:
    pattern = shine(name)
    assert 1 / frequency(pattern) == pytest.approx(period, rel=0.02)
    assert pattern.mean() == pytest.approx(lit, abs=0.02)


def test_diagonal_stripes_are_diagonal() -> None:
    pattern = shine('diagonal_stripe', seed=3)
    steps = [np.abs(np.diff(pattern > 0.5, axis=axis)).sum() for axis in (0, 1)]
    assert 0.6 < steps[0] / steps[1] < 1.7


@pytest.mark.parametrize('name', LIGHT_NAMES)
def test_patterns_lie_between_dark_and_full(name: str) -> None:
    pattern = shine(name)
    assert pattern.dtype == np.float32
    assert pattern.min() >= 0
    assert pattern.max() <= 1
    assert pattern.max() > 0.95
    assert pattern.min() == 1 if name == 'normal' else pattern.min() < 0.05


@pytest.mark.parametrize('name', LIGHT_NAMES[1:])
def test_seeds_move_the_light_and_repeat(name: str) -> None:
    first = shine(name, seed=1)
    assert np.array_equal(first, shine(name, seed=1))
    assert np.abs(first - shine(name, seed=2)).mean() > 0.05


def test_only_defocus_softens_edges() -> None:
    assert set(np.unique(shine('stripe', 0.0))) == {0.0, 1.0}
    soft = [
        ((values > 0.1) & (values < 0.9)).mean()
        for values in (shine('stripe', 0.5), shine('stripe', 1.0))
    ]
    assert soft[0] == pytest.approx(2 * 2.563 * 0.5 / 26, rel=0.1)
    assert soft[1] == pytest.approx(2 * soft[0], rel=0.1)


def test_shadows_are_hard_and_cover_a_part() -> None:
    pattern = shine('shadow')
    assert ((pattern > 0.1) & (pattern < 0.9)).mean() < 0.05
    assert 0.03 < (pattern < 0.5).mean() < 0.5


def test_three_spots_are_soft() -> None:
    pattern = shine('spots')
    assert 0.2 < (pattern > 0.5).mean() < 0.7
    assert np.abs(np.diff(pattern, axis=1)).max() < 0.03


def test_lights_of_the_benchmarks_are_there() -> None:
    assert set(EVERY_LIGHT) <= set(LIGHT_NAMES)
    assert {name for name, _ in LIT} == set(EVERY_LIGHT)
    assert len(set(LIT)) == len(LIT) == 28


def test_a_pattern_is_scaled_and_turned() -> None:
    v, u = np.mgrid[-400:400, -640:640].astype(np.float32)
    original = light_pattern('stripe', 0.5, np.random.default_rng(0))
    assert turned(original, 1.0, 0.0) is original
    larger = turned(original, 2.0, 0.0)(u, v)
    assert 1 / frequency(larger) == pytest.approx(2 * 26, rel=0.03)
    assert np.array_equal(larger, original(u / 2, v / 2))
    upright = turned(original, 1.0, math.pi / 2)(u, v)
    assert np.allclose(upright, original(v, -u), atol=1e-3)


@pytest.mark.parametrize('tilt', [0.0, 60.0])
@pytest.mark.parametrize('seed', range(4))
def test_the_projector_stands_aside_and_lights_the_origin(tilt: float, seed: int) -> None:
    generator = np.random.default_rng(seed)
    camera = tilted_camera(640, 480, 1000.0, math.radians(tilt), 0.0, generator)
    projector = rig_projector(camera.pose, 3.0, generator)
    assert projector.pose[:2, 2] == pytest.approx((0, 0))
    assert projector.irradiance(np.zeros(1), np.zeros(1)) == pytest.approx(1.0)
    steps = projector.homography @ np.array([[0, 1e-3], [0, 0], [1, 1]])
    moved = np.diff(steps[:2] / steps[2], axis=1)
    assert np.linalg.norm(moved) <= 1e-3 / 3.0 * 1.2
    rotation = np.column_stack(
        (camera.pose[:, :2], np.cross(camera.pose[:, 0], camera.pose[:, 1]))
    )
    eye = -rotation.T @ camera.pose[:, 2]
    angle = np.arccos(
        eye @ projector.position / np.linalg.norm(eye) / np.linalg.norm(projector.position)
    )
    assert 12 <= math.degrees(angle) <= 20


def test_light_falls_off_with_distance_and_obliquity() -> None:
    generator = np.random.default_rng(0)
    camera = tilted_camera(640, 480, 1000.0, 0.0, 0.0, generator)
    projector = rig_projector(camera.pose, 3.0, generator)
    x = np.array([0.0, 500.0])
    y = np.zeros(2)
    place = np.stack((x, y, np.zeros(2)), axis=1)
    towards = place - projector.position
    reach = np.linalg.norm(towards, axis=1)
    axis = -projector.position / np.linalg.norm(projector.position)
    expected = towards[:, 2] / reach**3 * (towards @ axis / reach) ** 4
    ratio = projector.irradiance(x, y)[1]
    assert ratio == pytest.approx(expected[1] / expected[0])
