"""Edges and their fits, against formulas of whole arrays, and with any values in any place."""

import numpy as np
import pytest

from ahf_ros import kernels
from ahf_ros.vision import profiles

SEEDS = range(6)
STRANGE = np.array([0.0, -0.0, 1.0, -1.0, 1e-300, 1e300, np.inf, -np.inf, np.nan])


def sizes(seed: int) -> tuple[np.random.Generator, int, int]:
    """Return a generator and two sides, some of them 1."""
    generator = np.random.default_rng(seed)
    return generator, 1 + seed % 3, int(generator.choice([1, 2, 9, 40]))


def strange(generator: np.random.Generator, *shape: int) -> np.ndarray:
    """Return numbers that formulas must bear."""
    return np.where(
        generator.random(shape) < 0.5,
        generator.choice(STRANGE, shape),
        generator.normal(size=shape),
    )


def solved(rows: np.ndarray, weights: np.ndarray, values: np.ndarray, prior: np.ndarray) -> tuple:
    """Return the normal matrix and the unknowns of weighted least squares."""
    normal = rows.T @ (weights[:, None] * rows) + np.diag(prior)
    return normal, np.linalg.solve(normal, rows.T @ (weights * values))


def lower_median(values: np.ndarray, selected: np.ndarray, empty: float = 1.0) -> float:
    ordered = sorted(values[selected].tolist())
    return ordered[(len(ordered) - 1) // 2] if ordered else empty


@pytest.mark.parametrize('seed', SEEDS)
def test_medians_are_those_of_sorted_values(seed: int) -> None:
    generator, k, m = sizes(seed)
    values = generator.integers(0, 1 + 5 * seed, (k, m)).astype(float)
    selected = generator.random((k, m)) < 0.6
    medians, _ = kernels.selected_medians(values, selected, 7.0)
    for i in range(k):
        assert medians[i] == lower_median(values[i], selected[i], 7.0)
    kernels.selected_medians(strange(generator, k, m), selected, 7.0)


@pytest.mark.parametrize('seed', SEEDS)
def test_linear_models_are_those_of_normal_equations(seed: int) -> None:
    generator, k, m = sizes(seed)
    n, rounds = 1 + seed % 5, 1 + seed % 3
    values, weights = generator.normal(size=(k, m)), generator.random((k, m))
    basis, prior = generator.normal(size=(m, n)), np.full(n, 0.1)
    unknowns, residuals, *_ = kernels.linear_fits(values, weights, basis, prior, 0.7, rounds)
    for i in range(k):
        robust = weights[i]
        for _ in range(rounds):
            _, expected = solved(basis, robust, values[i], prior)
            rest = values[i] - basis @ expected
            robust = weights[i] / (1 + (rest / 0.7) ** 2) ** 2
        assert unknowns[i] == pytest.approx(expected, rel=1e-9, abs=1e-12)
        assert residuals[i] == pytest.approx(rest, rel=1e-9, abs=1e-12)
    of = (strange(generator, *shape) for shape in ((k, m), (k, m), (m, n)))
    kernels.linear_fits(*of, prior, 0.7, rounds)


@pytest.mark.parametrize('seed', SEEDS)
def test_points_move_as_the_frame_does(seed: int) -> None:
    generator, k, m = sizes(seed)
    frames = generator.normal(size=(k, 3, 3)) + 20 * np.eye(3)
    points, angles = generator.normal(size=(m, 2)), generator.random(m) * 7
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    curvature, spacing = generator.random(m), generator.random(m)
    images, outwards, scale, distance, _ = kernels.edge_points(
        frames, points, normals, curvature, spacing, 1e-9
    )
    step = 1e-6
    for i, j in np.ndindex(k, m):
        n = normals[j]
        moved = [points[j], points[j] + step * n, points[j] + step * np.array([-n[1], n[0]])]
        x, out, along = ((of := frames[i] @ [*to, 1])[:2] / of[2] for to in moved)
        along = (along - x) / step
        length = np.hypot(*along)
        assert images[i, j] == pytest.approx(x)
        assert outwards[i, j] == pytest.approx([along[1] / length, -along[0] / length], abs=1e-4)
        assert distance[i, j] == pytest.approx(spacing[j] * length, rel=1e-4)
        expected = max((out - x) / step @ outwards[i, j], 1e-9)
        assert scale[i, j] == pytest.approx(expected, rel=1e-3, abs=1e-6)
    kernels.edge_points(strange(generator, k, 3, 3), points, normals, curvature, spacing, 1e-9)


@pytest.mark.parametrize('seed', SEEDS)
def test_profiles_are_as_long_as_reach_and_image_allow(seed: int) -> None:
    generator, k, m = sizes(seed)
    points, normals = generator.random((k, m, 2)) * 30, generator.normal(size=(k, m, 2))
    polarity, scale = generator.integers(-1, 2, (k, m)), generator.random((k, m)) * 9
    reach, enough, widths = np.full(k, 0.5), np.full(k, 3.0), np.array([0.0, 1, 2, 4])
    blurs, right, bottom = generator.integers(0, 5, k), 30.0, 25.0
    of_widths = scale, reach, enough, blurs, widths, right, bottom
    groups = kernels.profile_groups(points, normals, polarity, *of_widths)
    for i, j in np.ndindex(k, m):
        fit = [w for w in range(4) if widths[w] <= min(0.5 * scale[i, j], 3)]
        width = max(fit) if polarity[i, j] else 0
        ends = points[i, j] + widths[width] * np.outer([-1, 1], normals[i, j])
        if (ends < 0).any() or (ends > [right, bottom]).any():
            width = 0
        assert groups[i, j] == 4 * blurs[i] + width
    at = strange(generator, k, m, 2), strange(generator, k, m, 2), polarity
    groups = kernels.profile_groups(*at, strange(generator, k, m), *of_widths[1:])
    assert 0 <= groups.min() <= groups.max() < 20


def between(gray: np.ndarray, x: float, y: float) -> float:
    """Return a value between pixels; beyond the border the nearest one counts."""
    height, width = gray.shape
    x, y = min(max(x, 0), width - 1), min(max(y, 0), height - 1)
    left, top = int(x), int(y)
    right, below = min(left + 1, width - 1), min(top + 1, height - 1)
    upper = gray[top, left] + (x - left) * (gray[top, right] - gray[top, left])
    lower = gray[below, left] + (x - left) * (gray[below, right] - gray[below, left])
    return float(upper + (y - top) * (lower - upper))


@pytest.mark.parametrize('seed', SEEDS)
def test_steps_are_fitted_about_the_best_offset(seed: int) -> None:
    generator, k, m = sizes(seed)
    shape = [(1, 1), (1, 7), (30, 40)][seed % 3]
    gray = (generator.random(shape) * 255).astype(np.float32)
    points = generator.random((k, m, 2)) * np.array(shape)[::-1]
    normals = generator.normal(size=(k, m, 2))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    polarity = generator.choice([-1, 1], (k, m))
    spacing, curvature, blur = np.full((k, m), 2.0), generator.random((k, m)) / 9, np.full(k, 0.8)
    groups = generator.integers(-1, 5, (k, m))
    widths, filters = np.array([0.0, 1, 2, 3]), np.array([-1, 0, 1, 2])  # but for the last
    search, parts, known = profiles._step_filters_of([97, 100])
    along = np.linspace(-1, 1, 13)
    at = points, normals, polarity, spacing, curvature, blur
    of_steps = widths, filters, along, search, parts, known, 0.8, 1.0
    *of_edges, visible = kernels.fit_steps(gray, *at, groups, *of_steps)
    edges = np.array(of_edges)
    for i, j in np.ndindex(k, m):
        group = min(max(groups[i, j], 0), 3)
        assert visible[i, j] == (group in (1, 2))
        if group not in (1, 2):
            assert not edges[:, i, j].any()
            continue
        across = polarity[i, j] * normals[i, j]
        beside = 0.5 * np.array([-across[1], across[0]])
        middles = points[i, j] + np.multiply.outer(widths[group] * along, across)
        profile = np.array(
            [(between(gray, *(at + beside)) + between(gray, *(at - beside))) / 2 for at in middles]
        )
        first, second, contrast = (profile @ search[group - 1]).reshape(3, -1)
        explained = np.where(contrast > 0, first**2 + second**2, -1)
        best = int(explained.argmax())
        if np.sort(explained)[-2] > explained[best] * (1 - 1e-4):
            continue  # as good as another one
        low, high, moved, light, soft, *rest = profile @ parts[group - 1, best]
        offset, reach, sensitivity = known[group - 1, :, best]
        offset += min(max(-moved / max(high - low, 1), -reach), reach)
        inside = (0.8**2 + 0.5**2) / 2 * curvature[i, j]
        assert edges[:, i, j] == pytest.approx(
            [
                polarity[i, j] * offset + inside,
                low,
                high,
                polarity[i, j] * light / max(high, 1),
                sensitivity,
                -soft / max(high - low, 1),
                np.sqrt(np.mean(np.square(rest))),
            ],
            rel=2e-3,
            abs=2e-3,
        )
    at = strange(generator, k, m, 2), strange(generator, k, m, 2), *at[2:]
    wild = np.clip(strange(generator, *shape), -1e38, 1e38).astype(np.float32)
    kernels.fit_steps(wild, *at, groups, *of_steps)


def drawn_edges(generator: np.random.Generator, k: int, m: int) -> tuple[np.ndarray, ...]:
    """Return dark and bright gray values, residuals, and which edges are visible."""
    dark = 60 + 20 * generator.normal(size=(k, m))
    bright = dark + 90 + 30 * generator.normal(size=(k, m))
    return dark, bright, generator.random((k, m)) * 3, generator.random((k, m)) < 0.9


@pytest.mark.parametrize('seed', SEEDS)
def test_edges_are_weighted_by_those_of_their_outline(seed: int) -> None:
    generator, k, m = sizes(seed)
    dark, bright, residual, visible = edges = drawn_edges(generator, k, m)
    numbers = 8.0, 1.4826, 0.3, 1.5, 0.01, 0.4, 0.3, 1.0
    seen, weights, contrast, _ = kernels.edge_weights(*edges, *numbers)
    for i in range(k):
        step = np.log((np.maximum(bright[i], 0) + 8) / (np.maximum(dark[i], 0) + 8))
        usual = lower_median(step, visible[i])
        own = visible[i] & (step > 0.3 * usual) & (step > 0)
        ratio = np.maximum(dark[i], 0) / np.maximum(bright[i], 1)
        middle = lower_median(ratio, own)
        error = np.abs(ratio - middle)
        error /= 1.5 * max(1.4826 * lower_median(error, own), 0.01)
        excess = np.maximum(residual[i] / max(lower_median(residual[i], own), 0.3) - 1, 0) / 0.4
        assert np.array_equal(seen[i], own)
        assert contrast[i] == middle
        assert weights[i] == pytest.approx(own / (1 + error**2) / (1 + excess**2))
    kernels.edge_weights(*(strange(generator, k, m) for _ in range(3)), visible, *numbers)


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('lines', [1, 3])
def test_slopes_of_light_are_smoothed_along_lines(seed: int, lines: int) -> None:
    generator, k, n = sizes(seed)
    slopes = generator.normal(0, 0.02, (k, lines, n))
    polarity, weights = generator.integers(-1, 2, slopes.shape), generator.random(slopes.shape)
    weights[generator.random(slopes.shape) < 0.3] = 0
    window = generator.random((n, n)).astype(np.float32)
    window[generator.random((n, n)) < 0.3] = 0
    prior, rounds = 1 + generator.random(k), 1 + seed % 3
    numbers = prior, 0.03, 0.002, 3.0, rounds, 1e-9
    errors, smooth, used, totals, *_ = kernels.light_slopes(
        slopes, polarity, weights, window, *numbers
    )
    for i in range(k):
        common = (weights * polarity * slopes)[i].sum() / max(weights[i].sum(), 1e-9)
        belief = prior[i] * (1 + (common / 0.03) ** 2) ** 2
        for line in range(lines):
            own, first = slopes[i, line] - common * polarity[i, line], weights[i, line]
            seen = first > 0
            usual = lower_median(np.abs(own - lower_median(own, seen)), seen)
            robust = first
            for _ in range(rounds):
                weight, total = robust, robust @ window + belief
                expected = (robust * own) @ window / total
                error = (own - expected) / (3 * max(usual, 0.002))
                robust = first / (1 + error**2)
            assert used[i, line] == pytest.approx(weight, rel=1e-4, abs=1e-6)
            assert totals[i, line] == pytest.approx(total, rel=1e-4)
            assert smooth[i, line] == pytest.approx(expected, rel=1e-4, abs=1e-6)
            assert errors[i, line] == pytest.approx(own - expected, rel=1e-4, abs=1e-6)
    kernels.light_slopes(strange(generator, k, lines, n), polarity, weights, window, *numbers)


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize('kind', ['noise', 'light', 'px'])
def test_outlines_are_fitted_by_reweighted_least_squares(seed: int, kind: str) -> None:
    generator, k, m = sizes(seed)
    dark, bright, _, seen = drawn_edges(generator, k, m)
    offset, slope = generator.normal(size=(2, k, m))
    sensitivity, own, scale = generator.random((3, k, m))
    scale = 5 + scale
    polarity, n = generator.choice([-1, 1], (k, m)), 1 + seed % 3
    basis, grown = generator.normal(size=(m, n)), seed % 2
    prior, uneven, rounds = np.full(n + grown, 0.3), 0.1 * (kind == 'light'), 1 + seed % 4
    edges = offset, sensitivity, slope, dark, bright, scale, polarity, seen, own
    numbers = 0.8, uneven, 1.0, 1.4826, 3.0, 0.5, kind == 'px', rounds
    fitted = kernels.outline_fits(*edges, basis, prior, *numbers)[:6]
    for i in range(k):
        displacement = (offset[i] - sensitivity[i] * slope[i]) / scale[i]
        noise = 0.8 / np.maximum(bright[i] - dark[i], 1) / scale[i]
        rows = np.concatenate([basis, (polarity[i] / scale[i])[:, None]], axis=1)[:, : n + grown]
        deviation, robust = np.hypot(noise, uneven / scale[i]), own[i]
        for _ in range(rounds):
            normal, unknowns = solved(rows, robust / deviation**2, displacement, prior)
            errors = displacement - rows @ unknowns
            if uneven:
                usual = 1.4826 * lower_median(np.abs(errors), seen[i])
                light = max(usual**2 - lower_median(noise, seen[i]) ** 2, 0)
                deviation = np.sqrt(noise**2 + light)
            relative = np.abs(errors) * (scale[i] if kind == 'px' else 1 / deviation)
            relative /= 3 * max(1.4826 * lower_median(relative, seen[i]), 0.5)
            robust = own[i] / (1 + relative**2) ** 2
        weights, robust = own[i] / deviation**2, robust / deviation**2
        expected = unknowns, normal, errors, relative, weights, robust
        for found, of in zip(fitted, expected, strict=True):
            assert found[i] == pytest.approx(of, rel=1e-6, abs=1e-9)
    wild = (strange(generator, k, m) for _ in range(6))
    kernels.outline_fits(*wild, polarity, seen, own, basis, prior, *numbers)


@pytest.mark.parametrize('seed', SEEDS)
def test_parts_of_centres_are_what_errors_add(seed: int) -> None:
    generator, k, m = sizes(seed)
    n, m = 2 + seed % 3, m + 6
    basis, polarity = generator.normal(size=(m, n)), generator.choice([-1, 1], (k, m))
    equations = np.eye(n + 1) + 0.1
    of_edges = scale, sensitivity, *of_fit = 1 + generator.random((10, k, m))
    own, relative, weights, robust, errors, slope_errors, slope_weights, totals = of_fit
    window = generator.random((m, m)).astype(np.float32)
    parts, used, *_ = kernels.edge_parts(
        basis, polarity, *of_edges[:2], [equations] * k, *of_fit, window, 0.2, 1e-9
    )
    for i in range(k):
        square = relative[i] ** 2
        gain = (weights[i] * (1 - 3 * square) / (1 + square) ** 3).sum() / robust[i].sum()
        rows = np.concatenate([basis, (polarity[i] / scale[i])[:, None]], axis=1)
        influence = np.linalg.inv(equations)[:2] @ rows.T * robust[i] / max(gain, 0.2)
        of_slopes = influence * sensitivity[i] / scale[i] / totals[i]
        of_light = of_slopes @ window.T * slope_weights[i] * slope_errors[i]
        assert parts[i] == pytest.approx(influence * errors[i] - of_light, rel=1e-4, abs=1e-5)
        assert used[i] == pytest.approx(own[i] / (1 + square) ** 2)


@pytest.mark.parametrize('seed', SEEDS)
def test_neighbours_have_errors_in_common(seed: int) -> None:
    generator, k, m = sizes(seed)
    errors, outline = generator.normal(size=(k, m)), generator.integers(0, 2, m).astype(float)
    growth = kernels.errors_in_common(errors, outline, 3, 1e-12)
    parts, weights = generator.normal(size=(k, 2, m)), generator.random((k, m))
    spacing = generator.random((k, m)) * 3
    covariance = kernels.edge_covariances(parts, weights, spacing, 5.0, growth, 1.9, 10.0, 1e-9)
    for i in range(k):
        expected = 1.0
        for steps in (1, 2, 3):
            same = outline[steps:] == outline[:-steps]
            products = (errors[i, steps:] * errors[i, :-steps])[same].sum()
            expected += 2 * (1 - steps / 4) * products / (errors[i] ** 2).sum()
        assert growth[i] == pytest.approx(max(expected, 1))
        distance = np.maximum(spacing[i] / 1.9, 0.1)
        alike = 1 + sum(2 * np.maximum(1 - steps * distance, 0) for steps in range(1, 10))
        squares = (weights[i] ** 2 * alike).sum()
        count = weights[i].sum() ** 2 / squares
        shared = max(squares / (weights[i] ** 2).sum(), 1)
        free = count / max(count - 5, 1) * max(growth[i] / shared, 1)
        assert covariance[i] == pytest.approx(free * (parts[i] * alike) @ parts[i].T)
    none = kernels.edge_covariances(parts, 0 * weights, spacing, 5.0, growth, 1.9, 10.0, 1e-9)
    assert (none == 0).all()
    wild = strange(generator, k, 2, m), strange(generator, k, m), strange(generator, k, m)
    kernels.edge_covariances(*wild, 5.0, growth, 1.9, 10.0, 1e-9)
