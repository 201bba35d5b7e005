"""Ring targets through an equidistant fisheye lens, which bends the circles of a target."""

import cv2
import numpy as np
import pytest

from ahf_ros.families import create_detector
from ahf_ros.prints.ring import family
from support.ring import inked

FOCAL_LENGTH, SIZE, RADIUS = 600.0, 1600, 20.0  # px; of a dot on the axis
PAPER, INK = 0.75, 0.06  # reflectances
FINE = 6  # rays across a pixel
AROUND = 4  # targets in an image
MIDDLE = (SIZE - 1) / 2

Shown = tuple[int, float, float]


def through_fisheye(degrees: float, seed: int) -> tuple[np.ndarray, list[Shown]]:
    """Return an image of targets so far off the axis, with their IDs and centres, px.

    Targets stand across their lines of sight, tilted by up to 17 degrees.
    """
    generator, code = np.random.default_rng(seed), family('metashape12')
    image, shown = np.full((SIZE, SIZE), PAPER), []
    off, half = np.radians(degrees), round(5 * RADIUS)
    rays = (np.arange(2 * half * FINE) + 0.5) / FINE - 0.5
    for number in range(AROUND):
        about = 2 * np.pi * (number + generator.uniform(-0.2, 0.2)) / AROUND
        outwards = np.array([np.cos(about), np.sin(about), 0.0])
        sight = np.sin(off) * outwards + [0, 0, np.cos(off)]
        normal = sight + generator.uniform(-0.3, 0.3, 3)
        normal /= np.linalg.norm(normal)
        along = np.cross(normal, sight + generator.normal(size=3))
        along /= np.linalg.norm(along)
        across = np.cross(normal, along)
        x, y = MIDDLE + FOCAL_LENGTH * off * outwards[:2]
        left, top = int(x) - half, int(y) - half
        right, down = np.meshgrid(left + rays - MIDDLE, top + rays - MIDDLE)
        far = np.hypot(right, down)
        bent = np.sin(far / FOCAL_LENGTH) / far
        seen = np.stack([right * bent, down * bent, np.cos(far / FOCAL_LENGTH)], axis=-1)
        on_print = seen * ((sight @ normal) / (seen @ normal))[..., None] - sight
        on_print *= FOCAL_LENGTH / RADIUS
        index = 37 * number + seed
        ink = inked(on_print @ along, on_print @ across, code.words[index], code)
        share = ink.reshape(2 * half, FINE, 2 * half, FINE).mean(axis=(1, 3))
        image[top : top + 2 * half, left : left + 2 * half] += (INK - PAPER) * share
        shown.append((index + 1, x, y))
    light = cv2.GaussianBlur(image, (0, 0), 0.7)
    gray = 255 * light ** (1 / 2.2) + generator.normal(0, 1.5, image.shape)
    return np.clip(np.rint(gray), 0, 255).astype(np.uint8), shown


@pytest.mark.parametrize('degrees', [35, 50, 65])
def test_targets_are_read_far_off_the_axis(degrees: float) -> None:
    image, shown = through_fisheye(degrees, 7)
    found = {target.id: target for target in create_detector(family='metashape12')(image)}
    assert sorted(found) == sorted(name for name, _, _ in shown)
    for name, x, y in shown:
        assert np.hypot(found[name].x - x, found[name].y - y) < 0.04  # measured: up to 0.03
