"""What is seen of bands, against the formulas of one reading."""

import itertools
import math

import numpy as np
import pytest

from ahf_ros import kernels

OFFSET, WHITE = 8.0, 250.0
FLAT, FLAT_WHITE, MARK, TAIL, SHARE = 0.12, 0.03, 0.18, 0.3, 0.12
ANY, PLAIN, AT_ENDS = 0.22, 0.35, 0.25


def share(x: float) -> float:
    return math.erfc(-x / math.sqrt(2)) / 2


def density(x: float, deviation: float) -> float:
    return math.exp(-0.5 * (x / deviation) ** 2) / (deviation * math.sqrt(2 * math.pi))


def printed(
    ground: float, of_ground: float, inked: float, seen: float, contrast: float, dark: bool
) -> float:
    """Return the gray value of paper of which a share is ink, from ground with another share."""
    step = contrast if dark else 1 / contrast
    paper = ground / (1 + of_ground * (step - 1))
    ink = min(paper * step, seen) if not dark and seen >= WHITE else paper * step
    return paper + inked * (ink - paper)


def level(gray: float) -> float:
    return math.log(max(gray, 0) + OFFSET)


@pytest.mark.parametrize('seed', range(6))
def test_readings_lie_between_two_circles(seed: int) -> None:
    generator = np.random.default_rng(seed)
    i, c, m, k, r = 2, 1 + seed, 5, 3, 2
    gray = generator.uniform(0, 255, (i, c, m)).astype(np.float32)
    row, outermost = generator.integers(0, i, k), np.full(k, 4.0)
    for g in (1, m):
        radii = generator.uniform(0, 5, (k, r, g))
        values = kernels.gray_at(gray, row, 0.3, outermost, radii)
        for b, j, a in itertools.product(range(k), range(r), range(m)):
            at = radii[b, j, a % g]
            expected = np.interp(at, np.linspace(0.3, 4.0, c), gray[row[b], :, a])
            assert values[b, j, a] == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize('seed', range(6))
def test_shares_of_ink_are_those_that_blur_makes(seed: int) -> None:
    generator = np.random.default_rng(seed)
    k, r, m = 2, 2, 4
    plate = np.where(generator.random((k, m)) < 0.5, np.inf, generator.uniform(3, 5, (k, m)))
    dot, inner, outer = np.ones(k), np.full(k, 2.0), np.full(k, 3.0)
    blur = generator.uniform(0.05, 0.5, k)
    for g in (1, m):
        radii = generator.uniform(0.5, 4, (k, r, g))
        bare, marked = kernels.ink_shares(radii, plate, dot, inner, outer, blur)
        for b, j, a in itertools.product(range(k), range(r), range(m)):
            at = radii[b, j, a % g]
            beyond = 1 - share((plate[b, a] - at) / blur[b])
            rest = share((dot[b] - at) / blur[b]) + beyond
            band = share((outer[b] - at) / blur[b]) - share((inner[b] - at) / blur[b])
            assert bare[b, j, a] == pytest.approx(rest, abs=1e-6)
            assert marked[b, j, a] == pytest.approx(rest + band, abs=1e-6)


@pytest.mark.parametrize('shares', [(), (0.25, 0.5, 0.75)])
@pytest.mark.parametrize('seed', range(6))
def test_steps_are_compared_by_their_densities(seed: int, shares: tuple[float, ...]) -> None:
    generator = np.random.default_rng(seed)
    k, m = 3, 6
    ground, band = generator.uniform(0, 260, (2, k, 2, m)).astype(np.float32)
    parts = generator.uniform(0, 1, (4, k, 2, m)).astype(np.float32)
    counts = generator.uniform(0, 1, (k, 2, m)).astype(np.float32)
    contrast, dark = generator.uniform(0.1, 0.6, k).astype(np.float32), np.arange(k) % 2 == 0
    noise = generator.uniform(1, 5, k).astype(np.float32)
    glare, lit = np.float32([200, 256, np.inf]), generator.uniform(0.05, 0.5, k).astype(np.float32)
    every = np.float32([0, *shares, 1])
    looks, typical = kernels.step_evidence(
        *(ground, band, *parts, counts, every, contrast, dark, noise, glare, lit),
        *(OFFSET, WHITE, FLAT, FLAT_WHITE, MARK, TAIL, SHARE, ANY, PLAIN, AT_ENDS),
    )
    for b, side, a in itertools.product(range(k), range(2), range(m)):
        here, beside = float(band[b, side, a]), float(ground[b, side, a])
        bare, marked, bare_here, marked_here = parts[:, b, side, a].astype(float)
        ink_of = here, float(contrast[b]), bool(dark[b])
        blank = printed(beside, bare, bare_here, *ink_of)
        ink = printed(beside, marked, marked_here, *ink_of)
        white = min(ground[b, :, a]) >= WHITE and glare[b] <= WHITE
        of_noise, of_ground = (noise[b] / (it + OFFSET) for it in (here, beside))
        spread = math.sqrt((FLAT_WHITE if white else FLAT) ** 2 + of_noise**2 + of_ground**2)
        paper = density(level(here) - level(blank), spread)
        mark = level(ink) - level(beside)
        more = (level(here) - level(ink)) * np.sign(mark)
        of_ink = of_ground * ink / max(beside, 1) * (beside + OFFSET) / (ink + OFFSET)
        known = of_noise**2 + of_ink**2
        low, high = math.sqrt(MARK**2 + known), math.sqrt(TAIL**2 + known)
        width = high if more > 0 else low
        inked = density(more, width) * 2 * width / (low + high)
        if beside >= glare[b] and -abs(mark) < more < 0:
            inked = max(inked, 1 / max(abs(mark), FLAT))
        anything = PLAIN * paper + (1 - PLAIN) * ANY
        width = math.sqrt(MARK**2 + (SHARE * mark) ** 2 + known)
        densities, doubts = [paper], [lit[b]]
        for part in shares:
            on_ground, on_band = bare + part * (marked - bare), part * (marked_here - bare_here)
            mixed = printed(beside, on_ground, bare_here + on_band, *ink_of)
            densities.append(density(level(here) - level(mixed), width))
            doubts.append(max(lit[b], AT_ENDS))
        told = here < WHITE or not dark[b] or np.isinf(glare[b])
        weight = counts[b, side, a] if told else 0
        for s, (of, doubt) in enumerate(zip([*densities, inked], [*doubts, lit[b]], strict=True)):
            odds = weight * math.log(((1 - doubt) * of + doubt * ANY) / anything)
            assert looks[b, side, s, a] == pytest.approx(odds, abs=2e-4)
        for index, (of, beneath) in enumerate(
            [(spread, density(0, spread)), ((low + high) / 2, density(mark, spread))]
        ):
            plain = PLAIN * beneath + (1 - PLAIN) * ANY
            odds = math.log(((1 - lit[b]) * density(0, of) + lit[b] * ANY) / plain)
            odds = (1 - lit[b]) * odds + lit[b] * math.log(lit[b] / (1 - PLAIN))
            wanted = weight * odds if shares else 0
            assert typical[b, side, index, a] == pytest.approx(wanted, abs=2e-4)


@pytest.mark.parametrize('seed', range(12))
def test_covers_are_dark_ground_that_is_no_shadow(seed: int) -> None:
    generator = np.random.default_rng(seed)
    k, m, edge, least = 3, 8, 0.3, 0.2
    ground, band = generator.uniform(0, 120, (2, k, 2, m)).astype(np.float32)
    lit = np.maximum(ground, generator.uniform(0, 120, (k, 2, m)).astype(np.float32))
    marked, visible = generator.random((2, k, 2, m)) < np.reshape([0.2, 0.8], (2, 1, 1, 1))
    shade, contrast = np.full(k, 60, np.float32), np.full(k, 0.3, np.float32)
    dark = np.arange(k) % 2 == 0
    covered = kernels.covered_ground(
        *(ground, band, lit, marked, visible, shade, contrast, dark, OFFSET, WHITE, edge, least)
    )
    for b in range(k):

        def ink(seen: float, b: int = b) -> float:
            return printed(shade[b], 0, 1, seen, contrast[b], dark[b])

        places = list(itertools.product(range(2), range(m)))
        dim = {it: visible[b][it] and lit[b][it] <= shade[b] for it in places}
        shadowed = sum(
            dim[it] and marked[b][it] and band[b][it] < ink(band[b][it]) for it in places
        )
        if shadowed > least * sum(dim.values()):
            dim = dict.fromkeys(places, False)
        alike = {
            (name, it): abs(level(of[b][it]) - level(ink(lit[b][it]))) < edge
            for it in places
            for name, of in (('ground', ground), ('band', band))
        }
        for side, a in places:
            other = 1 - side, a
            across = alike['band', (0, a)] and alike['band', (1, a)]
            hidden = dim[other] and alike['ground', other] and across
            assert covered[b, side, a] == (dim[side, a] or hidden)


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


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_no_value_leads_beyond_an_array(value: float) -> None:
    gray = np.full((1, 3, 4), value, np.float32)
    radii = np.full((2, 1, 4), value)
    values = kernels.gray_at(gray, np.array([-5, 99]), value, np.full(2, value), radii)
    assert values.shape == (2, 1, 4)
    finite = kernels.gray_at(np.ones_like(gray), np.array([-5, 99]), 0.3, np.full(2, 0.3), radii)
    assert (finite == 1).all()
