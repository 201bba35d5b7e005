"""The kernels of pixels about CCTags, against loops in plain Python and differences."""

import math
from typing import Any

import numpy as np
import pytest

from ahf_ros import kernels
from ahf_ros.vision import frame

CIRCLES = np.array([1.0, -0.8, 0.65, -0.4])
MASK = 1.5


def scene(
    generator: np.random.Generator, edges: int, gamma: float, sharpening: float
) -> list[Any]:
    """Return the arguments of `cctag_pixels`: what is about a target of 4 px."""
    x, y = 13 + generator.uniform(-0.5, 0.5, 2)
    of_both = np.array([[x, y, 4.3, 3.6, generator.uniform(0, 3)], [x + 0.2, y, 4.0, 4.0, 0.0]])
    target, light = frame.affine_frames(*of_both.T)
    target[2, :2] = generator.normal(0, 0.01, 2)
    rows, columns = np.mgrid[:27, :27]
    known = np.hypot(columns - x, rows - y) < 5.5
    values = [generator.normal(0, 0.1), math.log(generator.uniform(0.5, 1)), -0.8, 0.1, -0.05]
    for _ in range(edges):
        values += [*generator.uniform([0, -0.5, -0.5, -1.5, -2], [6, 0.5, 0.5, 1.5, -0.5])]
    return [known, CIRCLES, light, 4.0, gamma, sharpening, MASK, target, np.array(values)]


def one_point(
    x: float, y: float, target: np.ndarray, light: np.ndarray, values: list[float]
) -> float:
    """Return sharp light on sharp print at a point."""
    shift, _, contrast, by_x, by_y, *edges = values
    to_plane = np.linalg.inv(target)
    u, v, scale = to_plane @ (x, y, 1)
    u, v = u / scale, v / scale
    radius, gradient = math.hypot(u, v), np.linalg.inv(frame.local_affine(target))
    growth = np.linalg.norm((u, v) @ gradient) / radius  # of the radius, by a px
    ink = 0.0
    for circle in CIRCLES:
        away = (abs(circle) - radius) / growth + np.sign(circle) * shift
        away = min(max(2 * away, -1.0), 1.0)
        ink += np.sign(circle) * (away * (2 - abs(away))) / 2
    u, v, scale = np.linalg.inv(light) @ (x, y, 1)
    u, v = u / scale, v / scale
    bright = math.exp(by_x * u + by_y * v)
    for i in range(0, len(edges), 5):
        direction, offset, curvature, height, width = edges[i : i + 5]
        across = math.cos(direction) * u + math.sin(direction) * v - offset
        along = math.cos(direction) * v - math.sin(direction) * u
        away = (across - curvature / 2 * (across**2 + along**2)) / math.exp(width)
        bright *= 1 + math.expm1(height) * (1 + math.erf(away / math.sqrt(2))) / 2
    return bright * (1 + contrast * ink)


def normal_weights(away: np.ndarray, width: float) -> np.ndarray:
    weights = np.exp(-0.5 * (away / width) ** 2)
    return weights / weights.sum(axis=1, keepdims=True)


def plainly(arguments: list[Any]) -> np.ndarray:
    known, _, light, _, gamma, sharpening, mask, target, values = arguments
    fine = np.arange(54) / 2
    sharp = np.array(
        [[one_point(x, y, target, light, values.tolist()) for x in fine] for y in fine]
    )
    rest = math.sqrt(math.exp(2 * values[1]) - 1 / 24)
    weights = normal_weights(np.arange(27)[:, None] - fine, rest)
    gray = (weights @ sharp @ weights.T) ** (1 / gamma)
    inner = np.arange(3, 24)
    weights = normal_weights(inner[:, None] - inner, mask)
    inner_gray = gray[3:24, 3:24]
    gray[3:24, 3:24] += sharpening * (inner_gray - weights @ inner_gray @ weights.T)
    return gray[known]


@pytest.mark.parametrize('edges', [0, 1, 3])
@pytest.mark.parametrize(('gamma', 'sharpening'), [(1.0, 0.0), (2.2, 0.0), (1.0, 0.7)])
def test_pixels_are_those_of_plain_loops(edges: int, gamma: float, sharpening: float) -> None:
    generator = np.random.default_rng(edges)
    arguments = scene(generator, edges, gamma, sharpening)
    shown = kernels.cctag_pixels(*arguments, n=int(arguments[0].sum()))[0]
    np.testing.assert_allclose(shown, plainly(arguments), atol=3e-4 * shown.max())


@pytest.mark.parametrize(('gamma', 'sharpening'), [(1.0, 0.0), (2.2, 0.7)])
def test_derivatives_are_those_of_differences(gamma: float, sharpening: float) -> None:
    arguments = scene(np.random.default_rng(5), 2, gamma, sharpening)
    count = {'n': int(arguments[0].sum())}
    of_all = kernels.cctag_pixels(*arguments, **count)[1]
    assert (of_all[:, 22:] == 0).all()
    for index, derivative in enumerate(of_all[:, :22].T):
        both = []
        for step in (-3e-3, 3e-3):
            *others, target, values = arguments
            change = np.zeros(22)
            change[index] = step
            target = frame.moved(target[None], change[None, :7])[0]
            both.append(kernels.cctag_pixels(*others, target, values + change[7:], **count)[0])
        difference = (both[1] - both[0]) / 6e-3
        size = np.abs(difference).max()
        assert np.abs(derivative - difference).max() < 0.1 * size + 2e-3, index


def fit(arguments: list[Any], seen: np.ndarray) -> tuple[Any, ...]:
    """Return what `cctag_fit` does without bounds, from those arguments."""
    *_, values = arguments
    bound = np.full(len(values), np.inf)
    known = np.zeros(5), np.full(5, 10.0), np.ones(5), 1e4 * np.eye(2), 1e-6, (0.2, 0.0)
    others = 1.48, 0.05, 10.0, 4, 1e-3, 1e-4, 1e-3, 10.0, 0.02, 0.05, 2.0, 16.0, math.inf
    most = 0.08, 0.3, 0.17
    return kernels.cctag_fit(
        seen, *arguments, -bound, bound, *most, *known, [16.0, *[6.0] * 11], *others
    )


@pytest.mark.parametrize('edges', [0, 2])
def test_what_forms_pixels_is_found_again(edges: int) -> None:
    arguments = scene(np.random.default_rng(11), edges, 1.0, 0.0)
    *others, target, values = arguments
    target[2, :2] = 0.0
    seen = kernels.cctag_pixels(*arguments, n=int(arguments[0].sum()))[0] * 100
    moved = frame.moved(target[None], np.array([[0.05, -0.04, 0.03, 0.02, 0.0, 0.0, 0.0]]))[0]
    start = values + np.resize([0.1, 0.1, 0.1, 0.02], len(values))
    place, found, shown, covariance, cost, *_ = fit(
        [*others, moved, start], seen.astype(np.float32)
    )
    np.testing.assert_allclose(place, target, atol=0.02)
    np.testing.assert_allclose(found[:3], values[:3], atol=0.02)
    np.testing.assert_allclose(shown, seen, atol=1.0)
    assert (np.linalg.eigvalsh(covariance[: 12 + 5 * edges, : 12 + 5 * edges]) > 0).all()
    assert 0 <= cost[0] < 50


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf, 1e30])
def test_bad_values_end(bad: float) -> None:
    arguments = scene(np.random.default_rng(2), 1, 2.2, 0.5)
    seen = np.ones(int(arguments[0].sum()), np.float32)
    for index in (1, 2, 3, 4, 5, 7, 8):
        changed = list(arguments)
        changed[index] = np.full(np.shape(changed[index]), bad)
        fit(changed, seen)
    fit(arguments, np.full(len(seen), bad, np.float32))
    fit([np.ones((1, 1), bool), *arguments[1:]], np.ones(3, np.float32))
    fit([np.ones((40, 1), bool), *arguments[1:]], np.ones(1, np.float32))
