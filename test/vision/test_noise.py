"""The noise of an image is told from edges of light."""

import cv2
import numpy as np
import pytest

from ahf_ros.vision.frame import affine_frames
from ahf_ros.vision.noise import reading_noise
from ahf_ros.vision.sampling import sample_circles

FRAMES = affine_frames(np.array([60.0, 75.3]), 60.0, 6.0, 5.0, 0.4)
ROWS, COLUMNS = np.indices((140, 140))


def striped(direction: float, period: float = 9.5) -> np.ndarray:
    """Return stripes of light, bright as 230 and dark as 30, through a lens that blurs 0.8 px."""
    across = COLUMNS * np.cos(direction) + ROWS * np.sin(direction)
    light = np.where(across % period < period / 2, 230.0, 30.0)
    return cv2.GaussianBlur(light, (0, 0), 0.8)


@pytest.mark.parametrize('deviation', [2.0, 5.0])
def test_noise_is_what_interpolated_values_have(deviation: float) -> None:
    noise = np.random.default_rng(1).normal(0, deviation, ROWS.shape)
    gray = (120 + noise).astype(np.float32)
    angles, radii = np.linspace(0, 2 * np.pi, 60), np.linspace(0.5, 4, 8)
    interpolated = sample_circles(gray, FRAMES, angles, radii).std(axis=(1, 2))
    assert reading_noise(gray, FRAMES, 4.4) == pytest.approx(interpolated, rel=0.2)


@pytest.mark.parametrize('direction', [0.0, 0.12, 0.5, np.pi / 4, 1.4])
def test_steps_of_light_are_hardly_noise(direction: float) -> None:
    noise = np.random.default_rng(2).normal(0, 2, ROWS.shape)
    even, lit = 120 + noise, striped(direction) + noise
    usual, seen = (reading_noise(of.astype(np.float32), FRAMES, 4.4) for of in (even, lit))
    assert (seen < usual + 0.02 * 200).all()
    rounded = np.clip(np.rint(lit), 0, 255).astype(np.uint8)
    assert reading_noise(rounded, FRAMES, 4.4) == pytest.approx(seen, rel=0.1)


def test_targets_at_the_border_have_the_noise_of_what_is_seen() -> None:
    noise = np.random.default_rng(3).normal(120, 3, (40, 40)).astype(np.float32)
    corner = affine_frames(np.array([0.0]), 0.0, 6.0, 6.0, 0.0)
    assert reading_noise(noise, corner, 4.4) == pytest.approx([2.0], rel=0.35)
    assert reading_noise(noise, FRAMES[:0], 4.4).shape == (0,)
