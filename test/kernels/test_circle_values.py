"""Polar images and what they show, against the formulas of one point."""

import numpy as np
import pytest

from ahf_ros import kernels
from support.plain_values import at

LIFT = np.float32([0, 40, 80])


@pytest.mark.parametrize('shape', [(1, 1), (1, 9), (7, 1), (30, 40)])
@pytest.mark.parametrize('seed', range(3))
def test_circles_are_sampled_between_pixels(seed: int, shape: tuple[int, int]) -> None:
    generator = np.random.default_rng(seed)
    image = generator.uniform(-5, 255, shape).astype(np.float32)
    frames = np.tile(np.eye(3), (3, 1, 1)) + generator.normal(0, 0.003, (3, 3, 3))
    frames[:, :2, :2] *= 6
    frames[:, :2, 2] = generator.uniform(0, 30, (3, 2))
    angles, radii = np.arange(70) / 70 * 2 * np.pi, np.sort(generator.uniform(0, 2, (3, 4)))
    directions = np.array([np.cos(angles), np.sin(angles)])
    values, reach = kernels.circle_values(image, frames, directions, radii, LIFT[:3])
    for b in range(3):
        for a in range(70):
            lift, shown = LIFT[b], np.inf
            for j, radius in enumerate(radii[b]):
                x, y, scale = frames[b] @ [*(radius * directions[:, a]), 1]
                value = lift + (1 - lift / 255) * max(at(image, x / scale, y / scale), 0)
                assert values[b, j, a] == pytest.approx(value, abs=0.05)
                inside = 0 <= x / scale <= shape[1] - 1 and 0 <= y / scale <= shape[0] - 1
                if not inside and np.isinf(shown):
                    shown = radii[b, j - 1] if j else 0.0
            assert reach[b, a] == pytest.approx(shown)


@pytest.mark.parametrize('shape', [(1, 1), (1, 9), (7, 1), (30, 40)])
def test_images_of_whole_numbers_are_sampled_on_circles(shape: tuple[int, int]) -> None:
    generator = np.random.default_rng(shape[1])
    image = generator.integers(-100, 156, shape).astype(np.int16)
    frames = np.tile(np.eye(3), (4, 1, 1)) + generator.normal(0, 0.003, (4, 3, 3))
    frames[:, :2, :2] *= 4
    frames[:, :2, 2] = generator.uniform(0, 30, (4, 2))
    angles, radii = np.arange(70) / 70 * 2 * np.pi, generator.uniform(0, 2, (4, 3))
    directions = np.array([np.cos(angles), np.sin(angles)])
    values, inside = kernels.short_values(image, frames, directions, radii, 10.0)
    for b in range(4):
        whole = True
        for a, j in np.ndindex(70, 3):
            x, y, scale = frames[b] @ [*(radii[b, j] * directions[:, a]), 1]
            value = at(image, x / scale, y / scale)
            # Places are those of 32 in a pixel, values whole numbers.
            assert 10 * values[b, a, j] == pytest.approx(value, abs=0.5 + 255 / 32)
            whole &= 0 <= x / scale <= shape[1] - 1 and 0 <= y / scale <= shape[0] - 1
        assert inside[b] == whole
    if min(shape) > 20:
        assert inside.any() and not inside.all()


@pytest.mark.parametrize('shape', [(1, 2), (3, 3), (20, 30)])
def test_noise_is_measured_by_second_differences(shape: tuple[int, int]) -> None:
    generator = np.random.default_rng(shape[0])
    image = generator.integers(0, 255, shape).astype(np.float32)
    frames = np.tile(np.eye(3), (2, 1, 1))
    frames[:, :2, 2] = generator.uniform(2, 20, (2, 2)).round()
    points = generator.integers(-4, 5, (2, 90)).astype(float)
    medians, _ = kernels.second_differences(image, frames, points)
    if min(shape) < 3:
        assert medians.tolist() == [0, 0]
        return
    height, width = shape
    for b in range(2):
        sizes = []
        for x, y in (frames[b, :2, 2:] + points).T.astype(int):
            left, top = min(max(x - 1, 0), width - 3), min(max(y - 1, 0), height - 3)
            part = image[top : top + 3, left : left + 3]
            sizes.append(abs(np.array([1, -2, 1]) @ part @ [1, -2, 1]))
        assert medians[b] == pytest.approx(np.median(sizes))


@pytest.mark.parametrize('seed', range(6))
def test_circles_beyond_an_outline_vote_for_it(seed: int) -> None:
    generator = np.random.default_rng(seed)
    i, c, m, s, k = 2, 2 + seed, 3, 4, 3
    gray = generator.integers(0, 4, (i, c, m)).astype(np.float32)
    row, white = generator.integers(0, i, k), np.full((k, m), 2, np.float32)
    radii, least = np.tile(np.arange(1.0, c + 1), (k, 1)), generator.uniform(0, 4, k)
    beyond = generator.integers(0, c + 1, (s, m))
    votes, outermost, _ = kernels.ground_votes(gray, row, white, radii, least, beyond)
    for b in range(k):
        signs = np.sign(gray[row[b]] - 2) * (radii[b] >= least[b])[:, None]
        assert outermost[b] == signs[-1].sum()
        for shape in range(s):
            counted = sum(signs[c - beyond[shape, a] :, a].sum() for a in range(m))
            assert votes[b, shape] == (counted if outermost[b] > 0 else 0)


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf, 1e30])
def test_no_value_leads_beyond_an_image(value: float) -> None:
    image, frames = np.ones((3, 4), np.float32), np.full((1, 3, 3), value)
    directions, radii = np.ones((2, 5)), np.ones((1, 2))
    for shape in ((1, 1), (3, 4)):
        values, _ = kernels.circle_values(
            image[: shape[0], : shape[1]], frames, directions, radii, LIFT[:1]
        )
        assert (values == 1).all()
        sizes, _ = kernels.second_differences(image[: shape[0], : shape[1]], frames, directions)
        assert sizes.tolist() == [0]
