"""The kernels of light about CCTags, against loops in plain Python."""

import math
from typing import Any

import numpy as np
import pytest

from ahf_ros import kernels

ANGLES = 2 * np.pi * np.arange(16) / 16
RADII = np.linspace(0.1, 1.3, 12)
DIRECTIONS = np.stack([np.cos(ANGLES), np.sin(ANGLES)])
PLACES = DIRECTIONS[:, :, None] * RADII
AROUND = np.stack([*PLACES / RADII, *PLACES])
DEVIATIONS = 0.3, 0.3, 0.4, 0.3
WIDTH = 0.12


def step(x: float, y: float, edge: np.ndarray, width: float) -> float:
    """Return the step of ln of light at a point, in the height of an edge."""
    direction, offset, curvature, height, own = edge
    across = math.cos(direction) * x + math.sin(direction) * y - offset
    along = math.cos(direction) * y - math.sin(direction) * x
    away = (across - curvature / 2 * (across**2 + along**2)) / (width * math.exp(own))
    share = (1 + math.erf(away / math.sqrt(2))) / 2
    return math.log(1 + math.expm1(height) * share) / height


def some_edges(generator: np.random.Generator, count: int) -> np.ndarray:
    return generator.uniform([0, -0.6, -0.5, 0.5, -0.3], [6, 0.6, 0.5, 1.5, 0.3], (count, 3, 5))


def test_light_is_that_of_plain_loops() -> None:
    generator = np.random.default_rng(3)
    heights = generator.normal(0, 1, (2, 5))
    heights[0, 3] = 0.0
    edges, slope = some_edges(generator, 2), generator.normal(0, 1, (2, 12))
    blur, widths = np.array([0.01, 0.02]), [WIDTH, 0.2]
    plain, mixed = kernels.cctag_light(PLACES, heights, edges, widths, blur, slope)
    for k in range(2):
        expected = np.zeros((16, 12))
        for place in np.ndindex(16, 12):
            x, y = PLACES[(slice(None), *place)]
            expected[place] = heights[k, :2] @ (x, y)
            for height, edge in zip(heights[k, 2:], edges[k], strict=True):
                expected[place] += height * step(x, y, edge, widths[k])
        change = np.gradient(expected, axis=1) * blur[k] * slope[k]
        np.testing.assert_allclose(plain[k], expected, atol=1e-4)
        np.testing.assert_allclose(mixed[k], change, atol=1e-4)


def fit(values: np.ndarray, edges: np.ndarray, number: int, rounds: int) -> tuple[Any, ...]:
    count = len(values)
    weight = np.full(values.shape, 1 / values[0].size)
    known = values, weight, np.ones((count, 12)), np.full(count, WIDTH), np.full(count, 1e4)
    others = rounds, 1e-3, DEVIATIONS, 1e-5, 0.2, 1.2, 2.5
    return kernels.cctag_edges(*known, edges, number, PLACES, AROUND, *others)[:4]


@pytest.mark.parametrize('number', [0, 1, 3])
def test_heights_are_those_of_least_squares(number: int) -> None:
    generator = np.random.default_rng(number)
    values, edges = generator.normal(0, 1, (3, 16, 12)), some_edges(generator, 3)
    kept, heights, rest, variance = fit(values, edges, number, 0)
    assert (kept[:, :number] == edges[:, :number]).all() and not kept[:, number:].any()
    for k in range(3):
        steps = np.zeros((number, 16, 12))
        for e, a, b in np.ndindex(steps.shape):
            x, y = PLACES[:, a, b]
            steps[e, a, b] = step(x, y, edges[k, e], WIDTH)
        basis = np.concatenate([PLACES, -AROUND, steps])
        basis = (basis - basis.mean(axis=1, keepdims=True)).reshape(len(basis), -1)
        changing = (values[k] - values[k].mean(axis=0)).ravel()
        normal = basis @ basis.T / changing.size + 1e-7 * np.eye(len(basis))
        normal[range(2, 6), range(2, 6)] += 1e-3
        found = np.linalg.solve(normal, basis @ changing / changing.size)
        np.testing.assert_allclose(heights[k, : len(found)], found, atol=2e-3)
        left = changing - found @ basis
        np.testing.assert_allclose(rest[k].ravel(), left, atol=2e-3)
        assert variance[k] == pytest.approx((left**2).mean() + 1e-5, rel=1e-3)


def test_an_edge_settles_where_it_is() -> None:
    true = np.zeros((1, 3, 5))
    true[0, 0] = 0.7, 0.2, 0.3, 1.2, 0.1
    values = np.zeros((1, 16, 12))
    for a, b in np.ndindex(16, 12):
        x, y = PLACES[:, a, b]
        values[0, a, b] = 1.2 * step(x, y, true[0, 0], WIDTH)
    start = true + np.array([0.15, 0.1, -0.2, 0.0, 0.0])
    found, heights, _, variance = fit(values, start * (true != 0).any(axis=2)[..., None], 1, 12)
    np.testing.assert_allclose(found[0, 0, :3], true[0, 0, :3], atol=0.02)
    assert heights[0, 6] == pytest.approx(1.2, abs=0.05)
    assert variance[0] < 3e-5


@pytest.mark.parametrize('bad', [math.nan, math.inf, -math.inf, 1e30])
def test_bad_values_end(bad: float) -> None:
    values, edges = np.ones((1, 16, 12)), np.ones((1, 3, 5))
    fit(np.full_like(values, bad), edges, 3, 2)
    fit(values, np.full_like(edges, bad), 3, 2)
    fit(values, edges, 99, 2)
    one = np.ones((1, 1, 1))
    of_one = one, one, [[1.0]], [1.0], [1.0], edges, 3, np.ones((2, 1, 1)), np.ones((4, 1, 1))
    kernels.cctag_edges(*of_one, 2, 1e-3, DEVIATIONS, 1e-5, 0.2, 1.2, 2.5)
    kernels.cctag_light(np.ones((2, 1, 1)), np.ones((1, 5)), edges, [bad], [bad], [[1.0]])
