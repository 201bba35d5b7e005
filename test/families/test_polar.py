"""Polar images of targets: gray values, how far they reach, and the usual levels of the ground."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from ahf_ros.families.ring.polar import PolarImages, angles_of, on_dark_ground, polar_images
from ahf_ros.vision import frame
from ahf_ros.vision.image import SATURATED
from support.ring import measured

BAND = (2.25, 3.5)
ANGLES = 60


def polar(image: np.ndarray, polarity: int = 1, *, covers: bool = True) -> PolarImages:
    """Return the polar image of a dot of 12 px at (60, 60)."""
    gray = np.minimum(image, 255).astype(np.float32)
    dot = measured(gray, [60.0], [60.0], 12.0, polarity)
    return polar_images(gray, dot, BAND, ANGLES, covers=covers)


def usual_levels(image: np.ndarray) -> tuple[float, float]:
    """Return between which levels the ground of a target in the middle of an image is usual."""
    of = polar(image)
    return float(of.shade[0]), float(of.glare[0])


Y, X = np.mgrid[:121, :121].astype(np.float32)
DOT = np.where(np.hypot(X - 60, Y - 60) < 12, 45.0, 180.0)
AWAY = np.hypot(X - 95, Y - 60)
SMALL, HALF = 8.0, 3.7  # radius of the dot of a plate, px, and half the plate's side, dot radii
FRAME = np.array([[[SMALL, 0, 60], [0, SMALL, 60], [0, 0, 1]]])


def test_what_is_bright_with_soft_borders_is_glare_and_with_sharp_ones_light() -> None:
    assert 185 < usual_levels(DOT)[1] < 200
    assert usual_levels(DOT + 150 * np.exp(-0.5 * (AWAY / 12) ** 2))[1] < 220
    assert usual_levels(np.where(AWAY < 20, 1.4, 1.0) * DOT)[1] == 256
    assert usual_levels(DOT + 210)[1] == np.inf


def test_what_is_dark_on_a_small_part_of_the_ground_covers_it() -> None:
    assert 160 < usual_levels(DOT)[0] < 175
    assert 160 < usual_levels(np.where(AWAY < 15, 0.5, 1.0) * DOT)[0] < 175
    assert usual_levels(np.where(X < 55, 0.5, 1.0) * DOT)[0] <= 0


def test_what_is_bright_on_a_small_part_of_dark_ground_covers_it() -> None:
    bright = np.where(np.hypot(X - 60, Y - 60) < 12, 180.0, 45.0)
    covered, half = (np.where(of, 2.5, 1.0) * bright for of in (AWAY < 15, X < 55))
    lit = bright + 40 * np.exp(-0.5 * (AWAY / 12) ** 2)
    turned = np.arctan2(Y - 60, X - 60)
    three, spots = (np.where(np.cos(n * turned) > 0.6, 2.5, 1.0) * bright for n in (3, 6))
    assert 46 < polar(three, -1).shade[0] < 60
    assert 46 < polar(covered, -1).shade[0] < 60
    assert polar(covered, -1, covers=False).shade[0] == np.inf
    assert [float(polar(it, -1).shade[0]) for it in (bright, half, lit, spots)] == [np.inf] * 4


def test_circles_are_read_between_two_others() -> None:
    of = polar(DOT)
    radii = np.linspace(0.3, of.outermost[0], of.gray.shape[1])
    rising = np.broadcast_to(radii.astype(np.float32)[:, None], of.gray.shape)
    slope = replace(of, gray=rising)
    for radius in (0.3, 1.234, of.outermost[0] - 0.01):
        assert slope.at(np.array([[radius]])) == pytest.approx(radius, abs=1e-5)


def test_polar_images_at_the_right_border() -> None:
    image = polar(np.where(np.hypot(X - 60, Y - 60) < 12, 50, 200)[:, :100])
    assert image.contrast[0] == pytest.approx(0.25, abs=0.05)
    assert image.size[0] == pytest.approx(12, abs=0.3)
    assert image.at(np.array([[0.6]])) == pytest.approx(50, abs=2)
    assert image.at(np.array([[2.0]]))[0][image.reach >= sum(BAND) / 2] == pytest.approx(
        200, abs=2
    )
    # Counter-clockwise as seen, from +x: first out of the image, then in it, then out of it again.
    for radius in (sum(BAND) / 2, BAND[1]):
        inside = 60 + radius * 12 * np.cos(angles_of(ANGLES)) < 99
        assert ((image.reach[0] >= radius) == inside).mean() > 0.95


def test_ink_under_light() -> None:
    paper = np.array([[100.0, 40.0]])
    dark, bright = (
        replace(polar(DOT), contrast=np.array([0.25]), polarity=np.array([of])) for of in (1, -1)
    )
    assert dark.inked(paper, paper).tolist() == [[25.0, 10.0]]
    assert bright.inked(paper, paper).tolist() == [[400.0, 160.0]]
    # Of ink that is brighter than white the camera says only that it is white.
    white = np.array([[SATURATED, 150.0]])
    assert bright.inked(paper, white).tolist() == [[SATURATED, 160.0]]


@pytest.mark.parametrize('shift', [0.0, -0.8])
def test_the_contrast_of_a_small_dot_is_that_of_its_ink(shift: float) -> None:
    dot = cv2.GaussianBlur(
        np.where(np.hypot(X - 60, Y - 60) < 5 + shift, 50.0, 200.0), (0, 0), 0.8
    )
    gray = dot.astype(np.float32)
    seen = measured(gray, [60.0], [60.0], 5.0 + shift)
    printed = frame.scaled(seen.frames, np.array([5 / (5 + shift)]))
    of = replace(seen, frames=printed, edge_shift=np.array([shift]))
    assert polar_images(gray, of, BAND, ANGLES).contrast[0] == pytest.approx(0.27, abs=0.03)


@pytest.mark.parametrize('turn', [None, 0.0, 20.0, 45.0])
def test_a_plate_ends_as_a_disc_or_as_a_square(turn: float | None) -> None:
    """Its stripes of light are as wide as a rim, and nine times as bright as the shadow."""
    x, y = (X - 60) / SMALL, (Y - 60) / SMALL
    angle = np.deg2rad(turn or 0)
    across, along = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    away = np.hypot(x, y) if turn is None else np.maximum(np.abs(across), np.abs(along))
    white = (np.hypot(x, y) < 1) | (away > HALF)
    light = np.where((X + 0.4 * Y) % 24 < 12, 1.0, 0.11)
    gray = (light * np.where(white, 200.0, 14.0)).astype(np.float32)
    dots = measured(gray, [60.0], [60.0], SMALL, polarity=-1)
    dots = replace(dots, contrast=np.array([0.07]), frames=FRAME)
    plate = on_dark_ground(polar_images(gray, dots, BAND, ANGLES), BAND).plate[0]
    angles = angles_of(ANGLES) - angle
    shape = 1.0 if turn is None else np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    ends = HALF / shape
    seen = ends < BAND[1] + 0.8
    assert plate[seen] == pytest.approx(np.broadcast_to(ends, plate.shape)[seen], abs=0.3)


def test_dark_ground_that_does_not_end_has_no_plate() -> None:
    light = np.where((X + 0.4 * Y) % 24 < 12, 1.0, 0.11)
    gray = (light * np.where(np.hypot(X - 60, Y - 60) < 12, 200.0, 14.0)).astype(np.float32)
    dots = measured(gray, [60.0], [60.0], 12.0, polarity=-1)
    assert np.isinf(on_dark_ground(polar_images(gray, dots, BAND, ANGLES), BAND).plate).all()
