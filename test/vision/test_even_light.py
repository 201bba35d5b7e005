"""Seams of light between the patterns of a stack."""

import cv2
import numpy as np
import pytest

from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.vision.even_light import even_light


def lit(reflectance: np.ndarray, period: int = 24) -> list[np.ndarray]:
    """Return a print under four soft patterns that overlap only a little, with noise."""
    generator = np.random.default_rng(7)
    columns = np.arange(reflectance.shape[1]) % period
    images = []
    for phase in range(4):
        distance = np.abs((columns - phase * period / 4 + period / 2) % period - period / 2)
        light = 0.02 + np.clip((period / 8 + 0.3 - distance) / 2 + 0.5, 0, 1)
        gray = (reflectance * light) ** (1 / 2.2) * 0.9
        noise = generator.normal(0, 0.004, gray.shape)
        images.append(np.clip(gray + noise, 0, 1).astype(np.float32))
    return images


@pytest.mark.parametrize(('ground', 'ink', 'left'), [(0.8, 0.05, 0.5), (0.05, 0.8, 1.0)])
def test_seams_go_and_the_print_stays(ground: float, ink: float, left: float) -> None:
    reflectance = np.full((360, 480), ground)
    for x in range(40, 480, 80):
        cv2.circle(reflectance, (x, 180), 24, ink, -1)
    images = lit(reflectance)
    even, largest = even_light(images), np.maximum.reduce(images)
    free = cv2.erode((reflectance == ground).astype(np.uint8), np.ones((9, 9))) > 0

    def unevenness(image: np.ndarray) -> float:
        return float(image[free].std() / image[free].mean())

    assert unevenness(even) < left * unevenness(largest)
    inside = cv2.erode((reflectance == ink).astype(np.uint8), np.ones((9, 9))) > 0
    contrast = [float(image[inside].mean() / image[free].mean()) for image in (even, largest)]
    assert contrast[0] == pytest.approx(contrast[1], rel=0.1)


def test_even_light_stays_as_it_is() -> None:
    scene = SceneSettings(width=320, height=240, targets=3, dot_radius=8, phases=3)
    images = [render(scene, phase).image.astype(np.float32) / 255 for phase in range(3)]
    largest = np.maximum.reduce(images)
    assert np.abs(even_light(images) / largest - 1).mean() < 0.02


def test_one_image_and_black_images_are_no_obstacle() -> None:
    image = render(SceneSettings(width=64, height=48, targets=0)).image.astype(np.float32) / 255
    assert np.isfinite(even_light([image])).all()
    assert np.isfinite(even_light([image, np.zeros_like(image)])).all()
