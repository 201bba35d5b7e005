"""Ellipses in logarithmic images, against the formulas of one ray."""

import numpy as np
import pytest

from ahf_ros import kernels

COUNTED = -0.3, 0.6
WINDOW = 2.0, 0.3, 0.5
PLACES = np.linspace(-1.15, 1.15, 13)
FLAT, UNIT = -0.05, 1000.0
SHAPES = [(1, 1), (1, 9), (9, 1), (40, 50)]


def rays(count: int) -> np.ndarray:
    angles = 2 * np.pi * np.arange(count) / count
    return np.array([np.cos(angles), np.sin(angles)])


def at(image: np.ndarray, frame: np.ndarray, ray: np.ndarray, radius: float) -> float:
    """Return the value on a circle of a target, of the nearest pixel beyond the border.

    As in `cv2.remap`, places are those of 32 in a pixel, and values are whole numbers.
    """
    height, width = image.shape
    along = (frame[:, 0] * ray[0] + frame[:, 1] * ray[1]).astype(np.float32)
    x, y, scale = along * np.float32(radius) + frame[:, 2].astype(np.float32)
    x, y = min(max(x / scale, 0), width - 1), min(max(y / scale, 0), height - 1)
    left, top = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
    across, down = (np.floor((of - first) * 32 + 0.5) / 32 for of, first in ((x, left), (y, top)))
    part = image[top : top + 2, left : left + 2].astype(float)
    over, under = (row[0] + across * (row[-1] - row[0]) for row in part[[0, -1]])
    return float(np.floor(over + down * (under - over) + 0.5))


def dots(seed: int, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return an image, frames of ellipses in its middle, and the scale of their steps.

    Beyond a border, steps would be equal at several places.
    """
    generator = np.random.default_rng(seed)
    log = generator.normal(3500, 150, shape).astype(np.int16)
    frames = np.zeros((4, 3, 3))
    frames[:, :2, :2] = np.eye(2) * generator.uniform(2, 8) + generator.normal(0, 0.5, (4, 2, 2))
    frames[:, :2, 2], frames[:, 2, 2] = generator.uniform(14, 26, (4, 2)), 1
    return log, frames, generator.choice([-1, 1], 4) / UNIT


def edge(
    log: np.ndarray, frame: np.ndarray, ray: np.ndarray, scale: float, gray: bool
) -> tuple[float, float, float]:
    """Return how far the strongest step is outside, this step, and half of the window."""
    size = np.sqrt(abs(frame[0, 0] * frame[1, 1] - frame[0, 1] * frame[1, 0]))
    half = min(max(2 / size, 0.3), 0.5)
    values = np.array([at(log, frame, ray, 1 + place * half) for place in PLACES])
    if gray:
        values = np.exp((values - values.max()) / UNIT)
    values = values.astype(np.float32)  # so that equal steps are equal, and thresholds the same
    steps = (values[2:] - values[:-2]) * np.float32(scale)
    steps = np.clip(steps, *np.float32((-1, 1) if gray else COUNTED)).astype(float)
    best = min(max(int(steps.argmax()), 1), len(steps) - 2)
    before, step, after = steps[best - 1 : best + 2]
    shift = 0.5 * (before - after) / min(before - 2 * step + after, FLAT)
    shift = min(max(shift, -1), 1) * (PLACES[1] - PLACES[0])
    return half * (PLACES[best + 1] + shift), step, half


@pytest.mark.parametrize('shape', SHAPES)
@pytest.mark.parametrize('seed', range(2))
def test_the_best_of_all_outlines_and_sizes_is_found(seed: int, shape: tuple[int, int]) -> None:
    log, frames, scale = dots(seed, shape)
    generator, radii = np.random.default_rng(seed), np.geomspace(2, 9, 22)
    frames[:, :2, 2] += generator.uniform(-20, 20, (4, 2))
    outlines, least = generator.normal(0, 6, (5, 24)), generator.uniform(0, 19, 5)
    bins = np.rint(outlines).astype(np.int32)
    best, scores = kernels.best_outlines(
        log, frames[:, :2, 2], scale, rays(24), radii, bins, outlines - bins, least, COUNTED
    )
    for (x, y), sign, (shape_of, size), score in zip(
        frames[:, :2, 2], scale, best, scores, strict=True
    ):
        of_all = np.full((5, 20), -1.0)
        steps = np.zeros((24, 20))
        frame = np.array([[1, 0, x], [0, 1, y], [0, 0, 1]])
        for j, ray in enumerate(rays(24).T):
            seen = np.array([at(log, frame, ray, radius) for radius in radii])
            steps[j] = np.clip((seen[2:] - seen[:-2]) * sign, *COUNTED)
        for i, a in np.ndindex(of_all.shape):
            distance = np.abs(outlines[i, :, None] + a - np.arange(20))
            if a >= least[i]:
                of_all[i, a] = (np.clip(1.5 - distance, 0, 1) * steps).sum() / 24
        assert score == pytest.approx(of_all.max(), abs=1e-4)
        assert of_all[shape_of, size] == pytest.approx(of_all.max(), abs=1e-4)


@pytest.mark.parametrize('shape', [(1, 1), (40, 50)])
@pytest.mark.parametrize('count', [1, 16, 32, 64])
def test_ellipses_move_onto_the_strongest_steps(count: int, shape: tuple[int, int]) -> None:
    log, frames, scale = dots(count, shape)
    x, y = rays(count)
    basis = np.stack([x, y, np.ones(count), x * x - y * y, 2 * x * y], axis=1)
    of_steps, prior, inlier = (COUNTED, FLAT, 0.1, 0.15), np.full(5, 1e-3), (0.06, 0.4)
    moved, shares = kernels.moved_ellipses(
        log, frames, scale, (x, y), basis, PLACES, WINDOW, *of_steps, 0.06, 3, prior, inlier
    )
    for b, frame in enumerate(frames):
        edges = [edge(log, frame, ray, scale[b], False) for ray in rays(count).T]
        away, steps, (half, *_) = (np.array(of) for of in zip(*edges, strict=True))
        weights = np.clip(steps / max(np.sort(steps)[count // 2], 0.1), 0, 1) * (steps > 0.1)
        (change,), (errors,), *_ = kernels.linear_fits([away], [weights], basis, prior, 0.06, 3)
        across, down, size, stretch, shear = np.clip(change, -half, half)
        linear = np.array([[size + stretch, shear], [shear, size - stretch]]) + np.eye(2)
        middle = frame[:2, :2] @ [across, down] + frame[:2, 2]
        expected = np.column_stack([frame[:2, :2] @ linear, middle])
        assert moved[b, :2] == pytest.approx(expected, abs=1e-4)
        near = max(0.06, 0.4 / np.sqrt(abs(np.linalg.det(frame[:2, :2]))))
        clear = np.mean((np.abs(errors) < near) & (steps > 0.15))
        assert shares[b] == pytest.approx(clear, abs=1.01 / count)


@pytest.mark.parametrize('shape', [(1, 1), (40, 50)])
@pytest.mark.parametrize('seed', range(2))
def test_sizes_are_those_in_gray_values(seed: int, shape: tuple[int, int]) -> None:
    log, frames, scale = dots(seed, shape)
    sizes = kernels.gray_sizes(log, frames, scale * UNIT, rays(16), PLACES, WINDOW, UNIT, FLAT)
    for frame, sign, size in zip(frames, scale * UNIT, sizes, strict=True):
        away = [edge(log, frame, ray, sign, True)[0] for ray in rays(16).T]
        assert size == pytest.approx(1 + np.median(away), abs=1e-3)
