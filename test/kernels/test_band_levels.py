"""What levels say of bands, against the formulas of one reading."""

import itertools
import math

import numpy as np
import pytest

from ahf_ros import kernels
from support.plain_values import below

OFFSET, WHITE, LIGHT_EDGE, LEAST, MOST = 8.0, 250.0, 0.3, 0.05, 0.5
SHARE, ANY, PLAIN, PAPER, INK, UNLIKELY = 0.12, 0.22, 0.35, 0.05, 0.12, 2.5
MARK = 0.18
DECIDING = np.zeros(24)
DECIDING[[1, 2, 9, 10, 11]] = OFFSET, WHITE, LIGHT_EDGE, LEAST, MOST
DECIDING[[15, 17, 18, 19, 21, 22, 23]] = MARK, SHARE, ANY, PLAIN, PAPER, INK, UNLIKELY
BAND, RADII = (2.25, 3.5), np.array([0.5, 1.5, 1.8, 2.5, 2.8, 3.1, 3.3, 3.8, 4.1])
ANGLES = 6


def density(x: float, deviation: float) -> float:
    return math.exp(-0.5 * (x / deviation) ** 2) / (deviation * math.sqrt(2 * math.pi))


def level(gray: float) -> float:
    return math.log(max(gray, 0) + OFFSET)


@pytest.mark.parametrize('shares', [(), (0.25, 0.5, 0.75)])
@pytest.mark.parametrize('seed', range(12))
def test_levels_are_compared_by_their_densities(seed: int, shares: tuple[float, ...]) -> None:
    generator = np.random.default_rng(seed)
    k, d = 3, len(RADII)
    alike = generator.choice([5, 60])
    light = (150 + generator.normal(0, alike, (k, d, ANGLES))).clip(1).astype(np.float32)
    levels = light * generator.choice([0.3, 1.0], light.shape) + generator.normal(
        0, 5, light.shape
    )
    levels = levels.clip(0, 255).astype(np.float32)
    spread = generator.choice([0.02, 0.2, np.inf], light.shape).astype(np.float32)
    reach = generator.choice([3.0, np.inf], (k, ANGLES), p=[0.2, 0.8])
    edges = np.array(BAND) + generator.uniform(-0.1, 0.1, (k, 2))
    size, blur, noise = (generator.uniform(*of, k) for of in ((5, 20), (0.5, 2), (1, 5)))
    polarity, contrast = generator.choice([-1.0, 1.0], k), generator.uniform(0.2, 0.5, k)
    shade, glare = generator.choice([0, 80.0], k), generator.choice([200, 256, np.inf], k)
    weight, every = np.float32(generator.uniform(0.2, 1, k)), np.float32([0, *shares, 1])
    brightest = np.where(polarity < 0, generator.choice([0, 60, 220], k), 0)
    of_looks = 0 * size, size, blur, polarity, contrast, noise, shade, glare, brightest
    looks_of = np.stack(of_looks, axis=1)
    looks, dot, lit, covered, *_ = kernels.level_evidence(
        *(levels, light, spread, RADII, BAND, edges, reach, looks_of, weight, every, DECIDING)
    )
    in_band = (BAND[0] < RADII) & (BAND[1] > RADII)
    halves = (RADII > 1) & (sum(BAND) / 2 > RADII), sum(BAND) / 2 < RADII
    gap = np.flatnonzero(halves[0] & ~in_band)
    beyond = int(np.flatnonzero(halves[1] & ~in_band)[0])
    for b in range(k):
        step = contrast[b] if polarity[b] > 0 else 1 / contrast[b]
        places = list(itertools.product(range(d), range(ANGLES)))

        def printed(j: int, a: int, share: float, b: int = b, step: float = step) -> float:
            ink, seen = light[b, j, a] * step, levels[b, j, a]
            ink = min(ink, seen) if polarity[b] < 0 and seen >= WHITE else ink
            return float(light[b, j, a] + share * (ink - light[b, j, a]))

        ground = {
            half: [j for j in range(d) if halves[half][j] and not in_band[j]] for half in (0, 1)
        }
        seen, errors, widths, odds_of = {}, {}, {}, {}
        for j, a in places:
            here = float(levels[b, j, a])
            told = here < WHITE or polarity[b] < 0 or np.isinf(glare[b])
            seen[j, a] = np.isfinite(spread[b, j, a]) and told and RADII[j] <= reach[b, a]
            for half in (0, 1):
                if halves[half][j] and any(levels[b, it, a] >= glare[b] for it in ground[half]):
                    seen[j, a] = False
            known = float(spread[b, j, a]) if np.isfinite(spread[b, j, a]) else 1.0
            part = [below((it - RADII[j]) * size[b] / blur[b]) for it in edges[b]]
            share = 1.0 if RADII[j] < 1 else part[1] - part[0]
            paper, ink = float(light[b, j, a]), printed(j, a, share)
            of_noise = noise[b] / (here + OFFSET)
            gain = ink / max(paper, 1) * (paper + OFFSET) / (ink + OFFSET)
            width = math.sqrt(PAPER**2 + of_noise**2 + known**2)
            ink_width = math.sqrt(INK**2 + of_noise**2 + (known * gain) ** 2)
            mixed_width = math.hypot(ink_width, SHARE * (level(ink) - level(paper)))
            densities = [density(level(here) - level(paper), width)]

            def in_the_dark(
                part: float,
                gray: float,
                b: int = b,
                here: float = here,
                of_ground: float = known * (paper + OFFSET),
            ) -> float:
                usual, most = min(gray, part * brightest[b]), part * brightest[b]
                of_light = min(part * of_ground / contrast[b], most)
                error = math.sqrt(of_light**2 + noise[b] ** 2 + (MARK * usual) ** 2)
                return (here + OFFSET) * density(here - usual, error) if brightest[b] else 0

            for of in shares:
                mixed = printed(j, a, share * of)
                of_part = density(level(here) - level(mixed), mixed_width)
                densities.append(max(of_part, in_the_dark(share * of, mixed)))
            inked = density(level(here) - level(ink), ink_width)
            densities.append(max(inked, in_the_dark(share, ink)))
            errors[j, a], widths[j, a], odds_of[j, a] = (
                level(here) - level(paper),
                width,
                densities,
            )
        told_ground = [it for it in places if seen[it] and it[0] in ground[0] + ground[1]]
        outside = sum(abs(errors[it]) > UNLIKELY * widths[it] for it in told_ground)
        surprise = min(max(outside / max(len(told_ground), 1), LEAST), MOST)
        assert lit[b] == pytest.approx(surprise)
        near = [(j, a) for j, a in places if j in [*gap, beyond]]
        usual = np.median([level(levels[b, j, a]) for j, a in near])
        uneven = np.mean(
            [
                (level(levels[b, j, a]) - usual) ** 2
                > LIGHT_EDGE**2 + 4 * (noise[b] / (levels[b, j, a] + OFFSET)) ** 2
                for j, a in near
            ]
        )
        even = LEAST / min(max(uneven, LEAST), MOST)
        of_dot, expected = 0.0, np.zeros((2, len(every), ANGLES))
        for j, a in places:
            of_gap = np.mean([level(levels[b, it, a]) for it in gap])
            between = abs(level(levels[b, beyond, a]) - of_gap) < LIGHT_EDGE
            darker = (of_gap - level(light[b, j, a])) * polarity[b] > LIGHT_EDGE
            doubt = max(surprise, even) if in_band[j] and between and darker else surprise
            anything = PLAIN * odds_of[j, a][0] + (1 - PLAIN) * ANY
            odds = [
                seen[j, a] * weight[b] * math.log(((1 - doubt) * of + doubt * ANY) / anything)
                for of in odds_of[j, a]
            ]
            of_dot += odds[-1] - odds[0] if RADII[j] < 1 else 0
            for half in (0, 1):
                if halves[half][j]:
                    expected[half, :, a] += odds if in_band[j] else odds[0]
        assert dot[b] == pytest.approx(of_dot, abs=1e-3)
        assert looks[b] == pytest.approx(expected, abs=1e-3)
        for half, a in itertools.product((0, 1), range(ANGLES)):
            sign, on_ground = polarity[b], levels[b, ground[half], a]
            assert covered[b, half, a] == any(sign * on_ground <= sign * shade[b])


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_no_value_leads_beyond_an_array(value: float) -> None:
    for d in (1, 4):
        rows, deciding = np.full((1, d, 3), value), np.full(24, value)
        looks, *_ = kernels.level_evidence(
            *(rows, rows, rows, np.full(d, value), [value, value], np.full((1, 2), value)),
            *(np.full((1, 3), value), np.full((1, 9), value), [value], [0, 1], deciding),
        )
        assert looks.shape == (1, 2, 2, 3)
