"""What is seen of bands, against the formulas of one reading."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

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
    radii = generator.uniform(0, 5, (k, r))
    values = kernels.gray_at(gray, row, 0.3, outermost, radii)
    for b, j, a in itertools.product(range(k), range(r), range(m)):
        expected = np.interp(radii[b, j], np.linspace(0.3, 4.0, c), gray[row[b], :, a])
        assert values[b, j, a] == pytest.approx(expected, rel=1e-5)


# In the order of the C file.
LIMITS = {
    **{'innermost': 0.3, 'offset': OFFSET, 'white': WHITE},
    **{'beside': 2.6, 'soft': 1.0, 'least': 0.13, 'most': 0.36, 'first': 0.3, 'second': 0.75},
    **{'edge': 0.3, 'least doubt': 0.05, 'most doubt': 0.5, 'marked': 0.2},
    **{'flat': FLAT, 'flat white': FLAT_WHITE, 'mark': MARK, 'tail': TAIL, 'share': SHARE},
    **{'any': ANY, 'plain': PLAIN, 'at ends': AT_ENDS},
    **{'of levels, paper': 0, 'ink': 0, 'unlikely': 0},
}
DECIDING = np.array(list(LIMITS.values()))
OUTERMOST, CIRCLES, ANGLES = 4.0, 30, 8
CIRCLE_RADII = np.linspace(0.3, OUTERMOST, CIRCLES)


@dataclass
class Band:
    """One band: its polar image, how it looks, and its edges."""

    gray: np.ndarray
    reach: np.ndarray
    plate: np.ndarray
    looks: np.ndarray  # outermost, size, blur, polarity, contrast, noise, shade, glare, brightest
    edges: np.ndarray
    weight: float

    @staticmethod
    def random(generator: np.random.Generator) -> Band:
        plates = generator.uniform(2, 4.5, ANGLES)
        looks = [
            *(OUTERMOST, generator.uniform(3, 20), generator.uniform(0.5, 2)),
            *(generator.choice([-1, 1]), generator.uniform(0.1, 0.6), generator.uniform(1, 5)),
            *(generator.choice([0, 80, 150]), generator.choice([200, 256, np.inf])),
        ]
        top = generator.choice([100, 200, 260])
        band = Band(
            gray=generator.uniform(0, top, (CIRCLES, ANGLES)).astype(np.float32),
            reach=np.where(generator.random(ANGLES) < 0.7, np.inf, 3.0),
            plate=np.where(generator.random(ANGLES) < 0.3, plates, np.inf),
            looks=np.array(looks),
            edges=np.array([1.0, generator.uniform(1.8, 2.2), generator.uniform(2.6, 3)]),
            weight=generator.uniform(0.2, 1),
        )
        of_ink = generator.choice([0, 60, 220]) if band.looks[3] < 0 else 0
        band.looks = np.append(band.looks, of_ink)
        return band

    def gray_at(self, radius: float, angle: int) -> float:
        return float(np.interp(radius, CIRCLE_RADII, self.gray[:, angle].astype(float)))

    def lit(self) -> float:
        """Return the probability of an edge of light between neighbours."""
        dot, inner, _ = self.edges
        edges = 0
        for a in range(ANGLES):
            near, far = (
                self.gray_at(dot + LIMITS[name] * (inner - dot), a) for name in ('first', 'second')
            )
            noise = sum((self.looks[5] / (max(of, 0) + OFFSET)) ** 2 for of in (near, far))
            edges += (level(near) - level(far)) ** 2 > LIMITS['edge'] ** 2 + 4 * noise
        return min(max(edges / ANGLES, LIMITS['least doubt']), LIMITS['most doubt'])

    def read(self, side: int, a: int) -> tuple[list[float], float]:
        """Return gray values and shares of ink on ground and on the band, and what counts."""
        (_, size, blur), (dot, inner, outer) = self.looks[:3], self.edges
        beside = (LIMITS['beside'] + max(blur - LIMITS['soft'], 0)) / size
        beside = min(max(beside, LIMITS['least']), LIMITS['most'])
        within = min(beside, 0.45 * (outer - inner))
        ground = outer + beside if side else inner - min(beside, 0.5 * (inner - dot))
        if side:
            ground = min(ground, (self.plate[a] + outer) / 2)
        band = outer - within if side else inner + within
        read = []
        for at in (ground, band):
            bare = share((dot - at) * size / blur) + share((at - self.plate[a]) * size / blur)
            of_band = share((outer - at) * size / blur) - share((inner - at) * size / blur)
            read += [self.gray_at(at, a), bare, bare + of_band]
        shown = self.reach[a] >= max(ground, band) and (not side or self.plate[a] > outer)
        return read, self.weight * shown

    def odds(
        self, side: int, a: int, shares: tuple[float, ...]
    ) -> tuple[list[float], list[float]]:
        """Return the evidence for shares of ink, and what paper and ink give on average."""
        *_, polarity, contrast, noise, _, glare, brightest = self.looks
        lit, dark = self.lit(), bool(polarity > 0)
        (beside, bare, marked, here, bare_here, marked_here), counts = self.read(side, a)
        ink_of = here, float(np.float32(contrast)), dark
        blank = printed(beside, bare, bare_here, *ink_of)
        ink = printed(beside, marked, marked_here, *ink_of)
        darker = min(self.read(of, a)[0][0] for of in (0, 1))
        white = darker >= WHITE and glare <= WHITE
        of_noise, of_ground = (noise / (it + OFFSET) for it in (here, beside))
        spread = math.sqrt((FLAT_WHITE if white else FLAT) ** 2 + of_noise**2 + of_ground**2)
        paper = density(level(here) - level(blank), spread)
        mark = level(ink) - level(beside)
        more = (level(here) - level(ink)) * np.sign(mark)
        gain = printed(max(beside, 1), marked, marked_here, *ink_of) / max(beside, 1)
        of_ink = of_ground * gain * (beside + OFFSET) / (ink + OFFSET)
        known = of_noise**2 + of_ink**2
        low, high = math.sqrt(MARK**2 + known), math.sqrt(TAIL**2 + known)
        width = high if more > 0 else low
        inked = density(more, width) * 2 * width / (low + high)
        if beside >= glare and -abs(mark) < more < 0:
            inked = max(inked, 1 / max(abs(mark), FLAT))

        def in_the_dark(part: float, gray: float) -> float:
            usual, most = min(gray, part * brightest), part * brightest
            of_light = min(part * noise / contrast, most)
            error = math.sqrt(of_light**2 + noise**2 + (MARK * usual) ** 2)
            return (here + OFFSET) * density(here - usual, error) if brightest else 0

        inked = max(inked, in_the_dark(1, ink))
        anything = PLAIN * paper + (1 - PLAIN) * ANY
        width = math.sqrt(MARK**2 + (SHARE * mark) ** 2 + known)
        densities, doubts = [paper], [lit]
        for part in shares:
            on_ground, on_band = bare + part * (marked - bare), part * (marked_here - bare_here)
            mixed = printed(beside, on_ground, bare_here + on_band, *ink_of)
            of_part = density(level(here) - level(mixed), width)
            densities.append(max(of_part, in_the_dark(part, mixed)))
            doubts.append(max(lit, AT_ENDS))
        told = here < WHITE or not dark or np.isinf(glare)
        weight = counts if told else 0
        looks = [
            weight * math.log(((1 - doubt) * of + doubt * ANY) / anything)
            for of, doubt in zip([*densities, inked], [*doubts, lit], strict=True)
        ]
        typical = []
        for of, beneath in [
            (spread, density(0, spread)),
            ((low + high) / 2, density(mark, spread)),
        ]:
            plain = PLAIN * beneath + (1 - PLAIN) * ANY
            odds = math.log(((1 - lit) * density(0, of) + lit * ANY) / plain)
            typical.append(weight * ((1 - lit) * odds + lit * math.log(lit / (1 - PLAIN))))
        return looks, typical

    def covered(self, ink_over_paper: np.ndarray) -> np.ndarray:
        """Return where something covers the ground, (2, m), from the evidence, (2, m)."""
        *_, polarity, contrast, _, shade, _, _ = self.looks
        dark, step = bool(polarity > 0), contrast if polarity > 0 else 1 / contrast
        places = list(itertools.product(range(2), range(ANGLES)))
        ground, band, lit, seen = {}, {}, {}, {}
        for it in places:
            (ground[it], _, marked, band[it], _, _), counts = self.read(*it)
            lit[it] = max(ground[it], ground[it] / (1 + marked * (step - 1)))
            seen[it] = counts > 0

        def ink(by: float) -> float:
            return printed(shade, 0, 1, by, contrast, dark)

        sign = 1 if dark else -1
        dim = {it: seen[it] and sign * lit[it] <= sign * shade for it in places}
        shadowed = sum(
            dim[it] and ink_over_paper[it] > 0 and sign * band[it] < sign * ink(band[it])
            for it in places
        )
        if shadowed > LIMITS['marked'] * sum(dim.values()):
            dim = dict.fromkeys(places, False)
        alike = {
            (name, it): abs(level(of[it]) - level(ink(lit[it]))) < LIMITS['edge']
            for it in places
            for name, of in (('ground', ground), ('band', band))
        }
        found = np.zeros((2, ANGLES), bool)
        for side, a in places:
            other = 1 - side, a
            across = alike['band', (0, a)] and alike['band', (1, a)]
            found[side, a] = dim[side, a] or (dim[other] and alike['ground', other] and across)
        return found


def stacked(bands: list[Band]) -> tuple[np.ndarray, ...]:
    """Return bands as the kernels take them, up to their edges."""
    images = np.stack([of.gray for of in bands[::-1]])
    rows = np.arange(len(bands))[::-1].copy()
    of_bands = (
        np.stack([getattr(of, name) for of in bands]) for name in ('reach', 'plate', 'looks')
    )
    return images, rows, *of_bands


@pytest.mark.parametrize('shares', [(), (0.25, 0.5, 0.75)])
@pytest.mark.parametrize('seed', range(8))
def test_steps_are_compared_by_their_densities(seed: int, shares: tuple[float, ...]) -> None:
    generator = np.random.default_rng(seed)
    bands = [Band.random(generator) for _ in range(4)]
    edges, weight = np.stack([of.edges for of in bands]), np.float32([of.weight for of in bands])
    every = np.float32([0, *shares, 1])
    looks, typical, covered, lit, *_ = kernels.edge_evidence(
        *stacked(bands), edges, weight, every, DECIDING
    )
    assert lit == pytest.approx([band.lit() for band in bands])
    for b, side, a in itertools.product(range(4), range(2), range(ANGLES)):
        odds, usual = bands[b].odds(side, a, shares)
        assert looks[b, side, :, a] == pytest.approx(odds, abs=1e-3)
        assert typical[b, side, :, a] == pytest.approx(usual, abs=1e-3)
    for b, band in enumerate(bands):
        expected = band.covered(looks[b, :, -1] - looks[b, :, 0])
        assert covered[b].tolist() == expected.tolist()


def test_edges_are_tried_at_several_places() -> None:
    bands = [Band.random(np.random.default_rng(seed)) for seed in range(3)]
    weight = np.float32([of.weight for of in bands])
    edges = np.stack([[of.edges, np.add(of.edges, [0, 0.1, -0.1])] for of in bands])
    looks, *_ = kernels.shifted_evidence(*stacked(bands), edges, weight, DECIDING)
    for shift in range(2):
        every = np.float32([0, 1])
        alone, *_ = kernels.edge_evidence(
            *stacked(bands), edges[:, shift].copy(), weight, every, DECIDING
        )
        assert np.array_equal(looks[:, shift], alone[:, 0] + alone[:, 1])


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_no_value_leads_beyond_an_array(value: float) -> None:
    gray = np.full((1, 3, 4), value, np.float32)
    radii = np.full((2, 1), value)
    values = kernels.gray_at(gray, np.array([-5, 99]), value, np.full(2, value), radii)
    assert values.shape == (2, 1, 4)
    finite = kernels.gray_at(np.ones_like(gray), np.array([-5, 99]), 0.3, np.full(2, 0.3), radii)
    assert (finite == 1).all()
    band = Band.random(np.random.default_rng(0))
    for name in ('gray', 'reach', 'plate', 'looks', 'edges'):
        setattr(band, name, np.full_like(getattr(band, name), value))
        of = *stacked([band]), band.edges[None], np.float32([1]), np.float32([0, 1]), DECIDING
        looks, *_ = kernels.edge_evidence(*of)
        assert looks.shape == (1, 2, 2, ANGLES)
