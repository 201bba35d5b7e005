"""Light inside a target, predicted from the light around its marks."""

import cv2
import numpy as np
import pytest

from ahf_ros.families.ring.light import predicted_light
from ahf_ros.families.ring.polar import angles_of
from ahf_ros.vision.frame import affine_frames

BAND = (2.25, 3.5)
SIDE, CENTRE, RADIUS = 140, 70.3, 12.0  # px
ANGLES = angles_of(60)
RADII = np.array([0.3, 0.6, 2.5, 2.9, 3.25])
Y, X = np.mgrid[0:SIDE, 0:SIDE]
SLANTED = X * np.cos(0.5) + Y * np.sin(0.5)


def wave(along: np.ndarray, period: float) -> np.ndarray:
    """Return a wave from 0 to 1."""
    return np.asarray((1 + np.cos(2 * np.pi * along / period)) / 2)


LIGHTS = {
    'even': (np.full((SIDE, SIDE), 180.0), 0.001),
    'edge of a shadow': (np.where(X > 80, 200.0, 60.0), 0.001),
    'fringe': (40 + 160 * wave(SLANTED, 15), 0.03),
    'stripes': (np.where(wave(SLANTED, 15) > 0.5, 200.0, 40.0), 0.04),
    'lattice': (40 + 160 * wave(X, 14) * wave(Y, 14), 0.07),
}
"""Gray values of paper, and the usual error of ln that their prediction may have."""


def predicted(light: np.ndarray, contrast: float = 0.25) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of predicted light on a target, of ln, and how far it is known, (d, m)."""
    away = np.hypot(X - CENTRE, Y - CENTRE) / RADIUS
    sector = np.arctan2(Y - CENTRE, X - CENTRE) // (np.pi / 6)
    inked = (away < 1) | ((away > BAND[0]) & (away < BAND[1]) & (sector % 2 == 0))
    shown, paper = (
        cv2.GaussianBlur(of.astype(np.float32), (0, 0), 0.7)
        for of in (np.where(inked, contrast * light, light), light)
    )
    frames = affine_frames([CENTRE], [CENTRE], [RADIUS], [RADIUS], [0.0])
    found, spread = predicted_light(shown, frames, np.zeros(1), ANGLES, RADII, BAND)
    x, y = (
        (CENTRE + RADIUS * np.outer(RADII, of(ANGLES))).astype(np.float32)
        for of in (np.cos, np.sin)
    )
    truth = cv2.remap(paper, x, y, cv2.INTER_LINEAR)
    return np.log((found[0] + 8) / (truth + 8)), spread[0]


@pytest.mark.parametrize('name', LIGHTS)
def test_light_that_repeats_itself_is_known_below_the_marks(name: str) -> None:
    light, usual = LIGHTS[name]
    errors, spread = predicted(light)
    assert np.median(np.abs(errors)) < usual
    assert np.isfinite(spread).all()
    assert np.sqrt(np.mean((errors / spread) ** 2)) < 1


def test_the_ink_of_a_target_does_not_change_its_light() -> None:
    light, _ = LIGHTS['lattice']
    dark, faint = (predicted(light, contrast)[0] for contrast in (0.1, 0.9))
    # Ground keeps away from edges, but for what blur carries over.
    assert np.abs(dark - faint).max() < 0.02


def test_light_without_any_order_is_not_known_and_says_so() -> None:
    generator = np.random.default_rng(0)
    spots = cv2.GaussianBlur(generator.normal(size=(SIDE, SIDE)), (0, 0), 4.0)
    light = 60 + 100 * np.clip(0.5 + 8 * spots, 0, 1)
    errors, spread = predicted(light)
    assert np.median(spread) > 0.25
    known = np.isfinite(spread)
    assert np.sqrt(np.mean((errors[known] / spread[known]) ** 2)) == pytest.approx(1, abs=0.5)


def test_targets_do_not_touch_each_other() -> None:
    generator = np.random.default_rng(1)
    gray = generator.uniform(20, 220, (200, 300)).astype(np.float32)
    x, y, radius = np.array([80.0, 150, 220]), np.array([90.0, 100, 110]), np.array([9.0, 11, 13])
    frames = affine_frames(x, y, radius, radius, 0 * x)
    lift = np.array([0.0, 20.0, 0.0])
    together = predicted_light(gray, frames, lift, ANGLES, RADII, BAND)
    for index in range(3):
        one = slice(index, index + 1)
        alone = predicted_light(gray, frames[one], lift[one], ANGLES, RADII, BAND)
        assert together[0][one] == pytest.approx(alone[0], rel=1e-3)
    none = predicted_light(gray, frames[:0], lift[:0], ANGLES, RADII, BAND)
    assert none[0].shape == none[1].shape == (0, 5, 60)
