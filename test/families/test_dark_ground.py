"""Bright ring targets on dark squares and discs that end where the band does, on white paper."""

import cv2
import numpy as np
import pytest

from ahf_ros.families import create_detector
from ahf_ros.prints.ring import family
from ahf_ros.scenes.bent.picture import render_bent
from ahf_ros.scenes.evaluation import score
from support.pictures.bent import settings
from support.ring import inked

WHITE, BLACK = 0.7, 0.05  # reflectances
RADIUS, PITCH = 6.5, 11  # of dots, px, and between targets, in such radii
SQUARE = 1.06  # half of its side over the radius of the band
FINE = 8  # samples across a pixel
ROWS, COLUMNS = 3, 4
VELVET, EXPOSURE, SHADOW = 0.002, 0.05, 0.12  # reflectance; shares of the light


def sheet(reflectance: float, radius: float) -> tuple[np.ndarray, list[np.ndarray], np.ndarray]:
    """Return bare ground, its parts for a target each, and the places along one, px."""
    side = round(PITCH * radius) * FINE
    ground = np.full((ROWS * side, COLUMNS * side), reflectance)
    rows = ground.reshape(ROWS, side, COLUMNS, side).swapaxes(1, 2)
    return (
        ground,
        [part for row in rows for part in row],
        (np.arange(side) + 0.5 - side / 2) / FINE,
    )


def exposed(sheet: np.ndarray) -> np.ndarray:
    """Return the light that falls on the pixels of a camera."""
    rows, columns = np.array(sheet.shape) // FINE
    light = sheet.reshape(rows, FINE, columns, FINE).mean(axis=(1, 3))
    return cv2.GaussianBlur(light, (0, 0), 0.8)


def photograph(
    seed: int, radius: float = RADIUS, strength: float = 0.8, halo: float = 1.2
) -> tuple[np.ndarray, list[int]]:
    """Return an image as of a phone, which sharpens, of turned targets, and their IDs."""
    generator, code = np.random.default_rng(seed), family('cct12')
    paper, parts, across = sheet(WHITE, radius)
    numbers = generator.choice(len(code.words), len(parts), replace=False)
    for part, number in zip(parts, numbers, strict=True):
        turn, (right, down) = generator.uniform(0, 2 * np.pi), generator.uniform(-2, 2, 2)
        x, y = np.meshgrid((across - right) / radius, (across - down) / radius)
        x, y = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
        dark = np.maximum(np.abs(x), np.abs(y)) < SQUARE * code.band[1]
        part[dark & ~inked(x, y, code.words[number], code)] = BLACK
    gray = 255 * exposed(paper) ** (1 / 2.2)
    gray += strength * (gray - cv2.GaussianBlur(gray, (0, 0), halo))
    gray += generator.normal(0, 1.5, gray.shape)
    shown = sorted(code.numbers[of] for of in numbers)
    return np.clip(np.rint(gray), 0, 255).astype(np.uint8), shown


def at_night(seed: int, radius: float = 5.0) -> tuple[np.ndarray, list[int]]:
    """Return a dark, noisy image of targets on black, each partly in shadow, and their IDs."""
    generator, code = np.random.default_rng(seed), family('aicon14')
    velvet, parts, across = sheet(VELVET, radius)
    numbers = generator.choice(len(code.words), len(parts), replace=False)
    x, y = np.meshgrid(across / radius, across / radius)
    for part, number in zip(parts, numbers, strict=True):
        turn, shade = generator.uniform(0, 2 * np.pi, 2)
        turned = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
        part[inked(*turned, code.words[number], code)] = WHITE
        part[x * np.cos(shade) + y * np.sin(shade) > 1] *= SHADOW
    gray = 255 * (EXPOSURE * exposed(velvet)) ** (1 / 2.2)
    gray += generator.normal(0, 4, gray.shape)
    shown = sorted(code.numbers[of] for of in numbers)
    return np.clip(np.rint(gray), 0, 255).astype(np.uint8), shown


def test_targets_are_read_whose_dark_ground_ends() -> None:
    image, numbers = photograph(5)
    found = [target.id for target in create_detector(family='cct12')(image)]
    assert sorted(found) == numbers


def test_small_targets_are_read_whose_dark_ground_is_uneven_by_sharpening() -> None:
    """A halo of some gray values is as high a step as ink in the logarithm of dark ground."""
    detector, read, shown = create_detector(family='cct12'), 0, 0
    for seed in range(5, 9):
        image, numbers = photograph(seed, radius=4.5, strength=1.2, halo=1.6)
        found = [target.id for target in detector(image)]
        assert set(found) <= set(numbers)
        read, shown = read + len(found), shown + len(numbers)
    assert read >= 0.9 * shown


def test_marks_in_shadow_are_no_ground_though_black_ground_tells_of_none() -> None:
    """Five of 180 targets were read as words without the marks that lie in shadow."""
    detector, read, wrong = create_detector(family='aicon14'), 0, 0
    for seed in range(5, 20):
        image, numbers = at_night(seed)
        found = {target.id for target in detector(image)}
        read, wrong = read + len(found & set(numbers)), wrong + len(found - set(numbers))
    assert read >= 160
    assert wrong <= 1


@pytest.mark.lasting
@pytest.mark.parametrize(
    ('light', 'radius', 'least'), [('stripe 0.12', 6, 44), ('fine_stripe 0.12', 10, 46)]
)
def test_they_are_read_under_stripes(light: str, radius: int, least: int) -> None:
    """Ink in the light is as bright as paper in shadow; 18 and 20 were read."""
    picture = render_bent(settings('metashape12', 'bright', light, radius, 402, 54))
    found = create_detector(family='metashape12')(picture.image)
    seen = score(picture.targets, found)
    assert seen.right >= least
    assert seen.wrong <= 2
