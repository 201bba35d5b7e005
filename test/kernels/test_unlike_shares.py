"""Whether targets look like their words, against loops over every reading."""

import numpy as np
import pytest

from ahf_ros import kernels

OFFSET, EVEN, UNEVEN, INMOST, DEEPER, UNLIKE, READINGS, OF_MARKS = (
    8.0,
    0.3,
    0.5,
    0.5,
    2,
    0.5,
    2,
    0.3,
)
CIRCLES, BITS, PER_SECTOR = 20, 5, 4
ANGLES = BITS * PER_SECTOR
RADII = np.linspace(0.3, 4.0, CIRCLES)
KINDS = np.array([[3.2, 3.8], [1.2, 1.9], [2.1, 2.9], [1.9, 3.1]])  # beyond, gap, deep, near
DIRECTIONS = np.array([np.cos(np.arange(ANGLES)), np.sin(np.arange(ANGLES))])


def lengthened(bits: np.ndarray, longer: int) -> np.ndarray:
    """Return a circle of bits whose ones are longer by some places at either end."""
    turned = [np.roll(bits, step) for step in range(-abs(longer), abs(longer) + 1)]
    return (np.any if longer > 0 else np.all)(turned, axis=0)


@pytest.mark.parametrize('noise', [5.0, 60.0])
@pytest.mark.parametrize('seed', range(10))
def test_what_differs_from_print_is_counted(seed: int, noise: float) -> None:
    generator = np.random.default_rng(seed)
    word, phase = int(generator.integers(0, 1 << BITS)), int(generator.integers(-9, 30))
    sectors = (np.arange(ANGLES) - phase) % ANGLES // PER_SECTOR
    marked = (word >> sectors & 1).astype(bool)
    inside = (RADII > 2) & (RADII < 3)
    inked = (inside[:, None] & marked) | (RADII < 1)[:, None]
    light, step = np.array([5.0, 0.02, -0.03]), -1.2
    gray = np.where(inked, 48.0, 180.0) + generator.normal(0, noise, inked.shape)
    gray = np.maximum(gray, 0).astype(np.float32)
    reach = np.where(generator.random(ANGLES) < 0.8, np.inf, 2.5)
    clear, longer = generator.random(CIRCLES) < 0.9, generator.integers(-2, 3, 2)
    limits = OFFSET, EVEN, UNEVEN, INMOST, DEEPER, UNLIKE, READINGS, OF_MARKS
    shares, *_ = kernels.unlike_shares(
        *(gray[None], [0], light[None], [step], RADII, clear, reach[None], DIRECTIONS),
        *([word], [phase], longer[:, None], KINDS[None], *limits),
        n=BITS,
    )
    shorter, unmarked = lengthened(marked, longer[0]), ~lengthened(marked, longer[1])
    told = shorter | unmarked
    steps = np.log(gray.astype(float) + OFFSET) - light[0]
    steps = (steps - RADII[:, None] * (light[1:] @ DIRECTIONS)) / step
    beyond, gap, deep, near = (clear & (low < RADII) & (high > RADII) for low, high in KINDS)
    ground = lost = marks = uneven = 0
    odd = np.zeros((CIRCLES, ANGLES), bool)
    for a in range(ANGLES):
        ink = faded = 0
        for j in range(CIRCLES):
            seen = RADII[j] <= reach[a]
            ground += seen and beyond[j]
            uneven += seen and beyond[j] and abs(steps[j, a]) > EVEN
            ink += is_ink if (is_ink := bool(seen and deep[j] and shorter[a])) else 0
            of_ink = is_ink and steps[j, a] < UNLIKE
            faded += of_ink
            is_paper = seen and (gap[j] or beyond[j] or (near[j] and unmarked[a]))
            odd[j, a] = of_ink or (is_paper and steps[j, a] > EVEN)
        marks += ink > 0
        lost += faded >= READINGS
    dot = steps[RADII < INMOST].mean()
    if uneven >= UNEVEN * ground or not 1 - EVEN < dot < DEEPER:
        assert np.isnan(shares[0])
        return
    total = 0.0
    for sector in range(BITS):
        most = 0.0
        angles = [(phase + sector * PER_SECTOR + q) % ANGLES for q in range(PER_SECTOR)]
        for j in range(CIRCLES):
            if not (beyond[j] or gap[j] or near[j]):
                continue
            differ = sum(told[a] and odd[j, a] and (j == 0 or odd[j - 1, a]) for a in angles)
            most = max(most, differ / max(sum(told[a] for a in angles), 1))
        total += most / BITS
    assert shares[0] == pytest.approx(max(total, OF_MARKS * lost / max(marks, 1)))


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf, 1.0])
def test_no_value_leads_beyond_an_array(value: float) -> None:
    limits = value, value, value, value, value, value, -1, value
    shares, *_ = kernels.unlike_shares(
        *(np.full((1, 3, 4), value), [99], np.full((1, 3), value), [value], np.full(3, value)),
        *(np.ones(3, bool), np.full((1, 4), value), np.ones((2, 4)), [-1], [-(1 << 62)]),
        *(np.full((2, 1), 1 << 62), np.full((1, 4, 2), value), *limits),
        n=9,
    )
    assert shares.shape == (1,)
