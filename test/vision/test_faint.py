"""Parts of faint contrast: which they are, and how they are stretched."""

from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.vision.faint import INK, PAPER, TILE, faint_parts


def noisy(gray: np.ndarray, noise: float) -> np.ndarray:
    generator = np.random.default_rng(1)
    values = gray + noise * generator.standard_normal(gray.shape)
    return np.rint(np.clip(values, 0, 255)).astype(np.uint8)


def discs(paper: float, ink: float, height: int = 384, width: int = 512) -> np.ndarray:
    """Return blurred discs of ink on paper, one every 64 px."""
    gray = np.full((height, width), paper, np.float32)
    for y in range(30, height, 64):
        for x in range(30, width, 64):
            cv2.circle(gray, (x, y), 12, float(ink), -1)
    return cv2.GaussianBlur(gray, (0, 0), 0.8)


ROWS, COLUMNS = np.mgrid[:384, :512].astype(np.float32)


@pytest.mark.parametrize(
    ('gray', 'noise'),
    [
        (discs(220, 60), 1.0),
        (discs(130, 125), 2.0),
        (100 + COLUMNS / 16, 0.4),
        (100 + 20 * np.sin(ROWS / 20) * np.sin(COLUMNS / 30), 0.5),
        (np.full((384, 512), 128.0), 3.0),
        (np.full((1, 1), 128.0), 0.0),
    ],
    ids=['clear contrast', 'noise', 'gradient', 'soft spots', 'flat', 'one pixel'],
)
def test_nothing_is_stretched_without_clear_edges_of_faint_contrast(
    gray: Any, noise: float
) -> None:
    assert list(faint_parts(noisy(gray, noise))) == []


@pytest.mark.parametrize(('paper', 'ink'), [(130, 110), (250, 180), (40, 28), (110, 130)])
def test_faint_contrast_becomes_that_of_a_print(paper: int, ink: int) -> None:
    image = noisy(discs(paper, ink), 0.7)
    (part,) = faint_parts(image)
    assert (part.x, part.y, part.gray.shape) == (0, 0, image.shape)
    inside, outside = part.gray[27:34, 27:34], part.gray[55:60, 55:60]
    dark, bright = sorted([np.median(inside), np.median(outside)])
    assert dark == pytest.approx(INK, abs=15)
    assert bright == pytest.approx(PAPER, abs=15)
    same = [*faint_parts(image.astype(np.float32))]
    assert np.array_equal(same[0].gray, part.gray)


def test_only_the_faint_part_of_an_image_is_stretched() -> None:
    image = noisy(np.hstack([discs(220, 60), discs(150, 130), discs(220, 60)]), 0.7)
    (part,) = faint_parts(image)
    left, right = part.x, part.x + part.gray.shape[1]
    assert left % TILE == 0
    assert 512 - TILE <= left <= 512 + TILE
    assert 1024 - TILE <= right <= 1024 + TILE
    assert part.gray.shape[0] == 384


def test_a_hot_pixel_does_not_matter() -> None:
    image = noisy(discs(130, 110), 0.7)
    image[100, 200], image[300, 400] = 255, 0
    (part,) = faint_parts(image)
    assert np.median(part.gray[55:60, 55:60]) == pytest.approx(PAPER, abs=15)
