"""The kernels of rays of CCTags, against loops in plain Python."""

import math
from typing import Any

import numpy as np
import pytest

from ahf_ros import kernels

ANGLES = 2 * np.pi * np.arange(8) / 8
DIRECTIONS = np.stack([np.cos(ANGLES), np.sin(ANGLES)])
RADII = np.linspace(0.06, 1.3, 72)
LIMITS = (1.0, 254.0), 255.0, 0.02, 0.58
OF_RAYS = 0.2, 0.35, 1.4826, 0.003, 40, 0.05


def gray_at(gray: np.ndarray, x: float, y: float) -> float:
    """Return an interpolated gray value, beyond the border that of the nearest place."""
    height, width = gray.shape
    x, y = min(max(x, 0), width - 1), min(max(y, 0), height - 1)
    left, top = min(int(x), width - 2), min(int(y), height - 2)
    across, down = np.array([1 - x + left, x - left]), np.array([1 - y + top, y - top])
    return float(down @ gray[top : top + 2, left : left + 2] @ across)


def some_frame(generator: np.random.Generator, x: float) -> np.ndarray:
    frame = np.array([[12.0, 1, x], [-1, 11, 20], [0, 0, 1]])
    frame[2, :2] = generator.normal(0, 0.02, 2)
    return frame


def lit(gray: np.ndarray, frames: Any, lights: Any, slopes: Any) -> tuple[Any, ...]:
    known, count = RADII[::2], len(frames)
    heights, edges = np.pad(slopes, ((0, 0), (0, 3))), np.zeros((count, 3, 5))
    slope = np.tile(np.sin(known), (count, 1))
    of_light = [0.1] * count, [0.004] * count, slope, known, 4.0
    places = frames, DIRECTIONS, RADII, lights
    return kernels.cctag_lit(gray, *places, heights, edges, *of_light, *LIMITS)[:4]


def test_rays_are_lit_as_by_plain_loops() -> None:
    generator = np.random.default_rng(5)
    gray = generator.uniform(20, 200, (40, 41))
    frames, lights = (
        np.array([some_frame(generator, x) for x in places]) for places in ((20, 33), (21, 32))
    )
    slopes = generator.normal(0, 0.5, (2, 2))  # its edges are those of other light
    values, *_, apart = lit(gray, frames, lights, slopes)
    assert not apart.any()
    for k, a in np.ndindex(2, len(ANGLES)):
        seen, ln = np.zeros((2, len(RADII)))
        for j, radius in enumerate(RADII):
            place = frames[k] @ (*(DIRECTIONS[:, a] * radius), 1)
            seen[j] = gray_at(gray, *(place[:2] / place[2]))
            x, y, scale = np.linalg.solve(lights[k], place)
            ln[j] = slopes[k] @ (x / scale, y / scale)
        slope = np.interp(RADII, RADII[::2], np.sin(RADII[::2]))
        seen /= np.exp(ln + np.gradient(ln, RADII[1] - RADII[0]) * 0.004 * slope)
        np.testing.assert_allclose(values[k, a], seen / seen.mean(), rtol=2e-3)


def rays(values: np.ndarray, inks: Any, rounds: int, *clipping: Any) -> tuple[Any, ...]:
    unclipped = np.zeros_like(values), np.zeros_like(values), np.zeros(len(values), np.int32)
    around = np.sin(np.outer(np.arange(values.shape[1]), np.arange(7)))
    known = *(clipping or unclipped), *inks, RADII, around, rounds, 3.0
    return kernels.cctag_rays(values, *known, *OF_RAYS)[:8]


def some_inks(generator: np.random.Generator) -> np.ndarray:
    phases = generator.uniform(0, 6, (5, 2, 1))
    return np.asarray(np.sin(phases + np.linspace(2, 9, 5)[:, None, None] * RADII))


def test_equations_are_those_of_plain_loops() -> None:
    generator = np.random.default_rng(7)
    inks = some_inks(generator)
    values = 1 - 0.3 * inks[0][:, None] + generator.normal(0, 0.05, (2, 8, 72))
    weight, model, errors, gain, found, variance, normal, right = rays(values, inks, 2)
    assert (gain == 1).all()
    np.testing.assert_allclose(model + errors, values, atol=1e-6)
    for k in range(2):
        ink, slope, *others = inks[:, k]
        changes = np.stack([slope, slope * RADII, slope * RADII**2, *others], axis=1)
        matrix, vector = np.zeros((10, 10)), np.zeros(10)
        for a in range(8):
            line = np.stack([np.ones(72), ink], axis=1)
            root = np.sqrt(weight[k, a])[:, None]
            paper, contrast = np.linalg.lstsq(root * line, root[:, 0] * values[k, a])[0]
            np.testing.assert_allclose(found[k, a], contrast, rtol=1e-4)
            np.testing.assert_allclose(model[k, a], paper + contrast * ink, atol=1e-4)
            around = np.zeros((6, 10))
            around[[0, 0, 1, 1, 1, 2, 2], range(7)] = -np.sin(a * np.arange(7))
            around[[3, 4, 5], [7, 8, 9]] = 1
            by = root * (contrast * changes @ around)
            by -= root * line @ np.linalg.lstsq(root * line, by)[0]
            matrix, vector = matrix + by.T @ by, vector + by.T @ (root[:, 0] * errors[k, a])
        np.testing.assert_allclose(normal[k], matrix, atol=1e-3 * matrix.max())
        np.testing.assert_allclose(right[k], vector, atol=1e-3 * np.abs(vector).max())
        mean = (weight[k] * errors[k] ** 2).sum() / weight[k].sum()
        assert variance[k] == pytest.approx(mean, rel=1e-4)


def test_weights_lose_outliers_and_rays_of_another_contrast() -> None:
    generator = np.random.default_rng(9)
    inks = some_inks(generator)
    values = 1 - 0.3 * inks[0][:, None] + generator.normal(0, 0.01, (2, 8, 72))
    values[:, 2, 20] += 0.4
    values[:, 5] = 1 + 0.3 * inks[0]
    share = rays(values, inks, 2)[0] / RADII.astype(np.float32)
    assert (share[:, 2, 20] < 0.01).all() and (share[:, 5] < 0.01).all()
    assert (np.median(share, axis=2)[:, [0, 1, 3, 4]] > 0.7).all()


def test_a_ray_that_is_clipped_is_what_it_was() -> None:
    inks = some_inks(np.random.default_rng(11))
    values = np.repeat(1 - 0.3 * inks[0][:, None], 8, axis=1)
    highest = np.full_like(values, 1.15)
    clipping = highest, np.zeros_like(values), np.ones(2, np.int32)
    _, model, errors, gain, found, *_ = rays(np.minimum(values, highest), inks, 0, *clipping)
    assert 0.1 < 1 - gain.mean() < 0.5
    np.testing.assert_allclose(found, -0.3, atol=0.02)
    np.testing.assert_allclose(model, values, atol=0.02)
    assert np.abs(errors).max() < 0.02


def test_gray_values_that_are_clipped_are_counted() -> None:
    gray = np.full((40, 41), 100.0)
    gray[:20] = 255
    frame = np.array([[[12.0, 0, 20.5], [0, 12, 20.5], [0, 0, 1]]])
    _, highest, mixed, apart = lit(gray, frame, frame, np.zeros((1, 2)))
    assert apart[0] == round(0.58 / (12 * (RADII[1] - RADII[0])))
    np.testing.assert_allclose(highest[0, 2], 2.55, rtol=1e-5)  # below it is as bright all along
    away = apart[0] * 12 * (RADII[1] - RADII[0])
    down = (20.5 + 12 * RADII) % 1
    np.testing.assert_allclose(mixed[0, 2], down * (1 - down) / away**2, atol=1e-3)


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf, 1e30])
def test_bad_values_end(bad: float) -> None:
    gray, one = np.full((3, 1), bad), np.full((1, 3, 3), bad)
    kernels.cctag_lit(
        *(gray, one, [[1.0], [0.0]], [bad], one, np.full((1, 5), bad), np.full((1, 3, 5), bad)),
        *([bad], [bad], [[bad]], [bad], 4.0, *LIMITS),
    )
    lit(np.full((40, 41), 255.0), one, one, np.zeros((1, 2)))
    values, inks = np.full((2, 8, 72), bad), np.full((5, 2, 72), bad)
    for apart in (0, 1, 1 << 30, -1):
        rays(values, inks, 2, values, values, np.full(2, apart, np.int32))
    tiny = np.ones((1, 1, 1))
    known = tiny, tiny, np.ones(1, np.int32), *np.ones((5, 1, 1)), [1.0], np.ones((1, 7)), 2, 3.0
    kernels.cctag_rays(tiny, *known, *OF_RAYS)
