"""Dynamic programs over words and covers, against plain loops over all that they choose from."""

import itertools
from collections.abc import Callable

import numpy as np
import pytest

from ahf_ros import kernels

SEEDS = range(8)
STATES = 'seen', 'covered', 'paper'


def numbers(seed: int) -> tuple[np.random.Generator, Callable[..., np.ndarray]]:
    """Return a generator, and what draws single-precision numbers of a shape from it."""
    generator = np.random.default_rng(seed)
    return generator, lambda *shape: generator.normal(0, 3, shape).astype(np.float32)


def path_value(
    path: tuple[str, ...],
    look: np.ndarray,
    steps: np.ndarray,
    first: int,
    as_paper: np.ndarray,
    prices: tuple[float, float, float],
    most: np.ndarray,
) -> float:
    """Return the evidence of a path of states from an angle on, -inf if it may not be taken."""
    price, cost, paper_price = prices
    (kinds, count), total, before = look.shape, 0.0, 'seen'
    for i, state in enumerate(path):
        a = (first + i) % count
        if state != 'seen' and (i == 0 or before not in ('seen', state)):
            return -np.inf
        begins = state != 'seen' and before == 'seen'
        if state == 'seen':
            beside = 'covered' in (before, *path[i + 1 : i + 2])
            total += min(look[steps[a], a], most[a] if beside else np.inf)
        elif state == 'covered':
            total -= cost + price * begins
        else:
            marked = 2 * steps[a] > kinds - 1
            total += as_paper[int(marked)][a] - paper_price * begins
        before = state
    return float(total)


@pytest.mark.parametrize('seed', SEEDS)
def test_covers_are_those_of_the_best_of_all_paths(seed: int) -> None:
    generator, drawn = numbers(seed)
    k, w, n, m = 2, 9, 1 + seed % 4, 1 + seed % 6
    looks, as_paper, most = drawn(k, n, m), drawn(2, k, m), drawn(k, m)
    steps = generator.integers(0, n, (k, w, m)).astype(np.uint8)
    first = generator.integers(0, m, k)
    price, cost, paper_price = 1.5, np.abs(drawn(k)), np.abs(drawn(k))
    of_paths = as_paper, price, cost, paper_price
    whole = np.full((k, m), np.inf, np.float32)
    every = [kernels.covered_words(looks, steps, first, *of_paths, of) for of in (most, whole)]
    hidden, _ = kernels.hidden_angles(looks, steps[:, 0], first, *of_paths)
    for b, word, (scores, at_most) in itertools.product(
        range(k), range(w), zip(every, (most, whole), strict=True)
    ):
        of_band = as_paper[:, b], (price, cost[b], paper_price[b]), at_most[b]
        values = {
            path: path_value(path, looks[b], steps[b, word], first[b], *of_band)
            for path in itertools.product(STATES, repeat=m)
        }
        best = max(values, key=lambda path: values[path])
        assert scores[b, word] == pytest.approx(values[best], abs=1e-4)
        if word == 0 and at_most is whole:
            expected = [best[(a - first[b]) % m] != 'seen' for a in range(m)]
            assert hidden[b].tolist() == expected


@pytest.mark.parametrize('seed', SEEDS)
def test_arcs_are_the_best_of_all_of_any_length(seed: int) -> None:
    generator, drawn = numbers(seed)
    k, n, m, price = 2, 2 + seed % 3, 1 + seed % 6, 1.5
    looks, border, cost = drawn(k, n, m), np.abs(drawn(k)), np.abs(drawn(k))
    first = generator.integers(0, m, k)
    scores, borders = kernels.free_arcs(looks, first, border, price, cost)
    for b in range(k):
        best = -np.inf, 0
        for path in itertools.product(('paper', 'ink', 'covered'), repeat=m):
            total, turns, before = 0.0, 0, path[0]
            for i, state in enumerate(path):
                look = looks[b, :, (first[b] + i) % m]
                begins = i > 0 and state == 'covered' and before != 'covered'
                if state == 'covered':
                    total -= np.inf if i == 0 else cost[b] + price * begins
                elif i and before not in (state, 'covered'):
                    total += max(look[0], look[-1], *np.maximum(look[1:-1], 0)) - border[b]
                    turns += 1
                else:
                    total += look[0 if state == 'paper' else -1]
                before = state
            best = max(best, (total, turns))
        assert (scores[b], borders[b]) == (pytest.approx(best[0], abs=1e-4), best[1])


@pytest.mark.parametrize('seed', SEEDS)
def test_bits_are_the_best_of_all(seed: int) -> None:
    generator = np.random.default_rng(seed)
    n = 2 + seed
    ones, pairs = generator.normal(0, 2, (2, 3, n))
    bits, highest, _ = kernels.likeliest_bits(ones, pairs)
    for b in range(3):
        every = np.array(list(itertools.product((0, 1), repeat=n)))
        scores = every @ ones[b] + (every & np.roll(every, 1, axis=1)) @ pairs[b]
        assert highest[b] == pytest.approx(scores.max())
        assert bits[b].tolist() == every[scores.argmax()].tolist()


@pytest.mark.parametrize('seed', SEEDS)
def test_words_show_their_sectors_and_what_spreads_beyond_them(seed: int) -> None:
    generator = np.random.default_rng(seed)
    k, w, n, p, last = 2, 3, 2 + seed, 4, 5
    words = generator.integers(0, 1 << n, (k, w))
    phases = generator.integers(-3 * n * p, 3 * n * p, (k, w))
    rising, falling = generator.uniform(-1, 1, (2, k, 2, p)).astype(np.float32)
    steps = kernels.word_steps(words, phases, rising, falling, last, n=n, m=n * p)
    ranked = generator.normal(0, 3, (k, n * p)).astype(np.float32)
    ones, pairs = kernels.sector_evidence(ranked, rising, falling, n=n)
    for b, word, a in itertools.product(range(k), range(w), range(n * p)):
        sector, i = divmod((a - phases[b, word]) % (n * p), p)
        before, here, after = (bool(words[b, word] >> (sector + d) % n & 1) for d in (-1, 0, 1))
        share = here
        share += (here - before) * (rising if here else -falling)[b, 1, i]
        share += (after - here) * (rising if after else -falling)[b, 0, i]
        assert steps[b, word, a] == int(min(max(share, 0), 1) * last + 0.5)
    for b, sector in itertools.product(range(k), range(n)):
        for phase in range(p):
            about = [ranked[b, (phase + sector * p + i) % (n * p)] for i in range(-p, 2 * p)]
            begins, falls = (np.dot(about[: 2 * p], of[b].ravel()) for of in (rising, falling))
            ends = np.dot(about[p:], falling[b].ravel())
            one = sum(about[p : 2 * p]) + begins + ends
            assert ones[b, phase, sector] == pytest.approx(one, abs=1e-4)
            assert pairs[b, phase, sector] == pytest.approx(-(begins + falls), abs=1e-4)


@pytest.mark.parametrize('seed', SEEDS)
def test_readings_are_bounded_and_shares_take_the_best_near_them(seed: int) -> None:
    generator, drawn = numbers(seed)
    k, n, m = 3, 2 + seed % 4, 5
    values, most = drawn(k, 2, n, m), np.abs(drawn(k)) + 1
    bounded, _ = kernels.bounded_readings(values, most, np.zeros(k, int))
    wanted = most[:, None, None] * np.tanh(values.sum(axis=1) / most[:, None, None])
    assert bounded == pytest.approx(wanted, abs=1e-5)
    reach = generator.integers(-1, 5, k)
    best, _ = kernels.bounded_readings(values, most, reach)
    for b, s, a in itertools.product(range(k), range(n), range(m)):
        away = max(0, min(reach[b], n - 2)) if 0 < s < n - 1 else 0
        near = bounded[b, max(s - away, 0) : s + away + 1, a]
        assert best[b, s, a] == near.max()


@pytest.mark.parametrize('bits', [1, 2, 7, 8, 14, 21])
def test_the_likeliest_words_are_those_with_most_evidence_at_any_phase(bits: int) -> None:
    generator, c = np.random.default_rng(bits), 6
    ones, pairs = generator.normal(size=(2, 3, 4, bits))
    words = np.unique(generator.integers(0, 1 << bits, 40))
    before = generator.normal(size=len(words)).astype(np.float32)
    best, phases, _ = kernels.competing_words(ones, pairs, words, before, c=c)
    shown = words[:, None] >> np.arange(bits) & 1
    joined = shown & np.roll(shown, 1, axis=1)
    for b in range(3):
        scores = shown @ ones[b].T + joined @ pairs[b].T
        ranked = np.argsort(-(scores.max(axis=1) + before), kind='stable')[:c]
        wanted = np.resize(ranked, c)
        assert best[b].tolist() == words[wanted].tolist()
        assert phases[b].tolist() == scores[wanted].argmax(axis=1).tolist()
    wild = np.full((1, 4, bits), np.nan)
    best, *_ = kernels.competing_words(wild, wild, [-1, 1 << 62], [np.inf, np.nan], c=c)
    assert set(best[0].tolist()) <= {-1, 1 << 62}


@pytest.mark.parametrize('seed', SEEDS)
def test_light_is_as_predicted_where_the_best_path_says_so(seed: int) -> None:
    _, drawn = numbers(seed)
    k, m, price = 3, 1 + seed, 2.0
    best, further = drawn(k, m), np.abs(drawn(k))
    predicted, _ = kernels.predicted_angles(best, further, price)
    for b in range(k):
        gain = -best[b].astype(float) - further[b]
        ahead, behind, path = np.zeros(m), np.zeros(m), 0.0
        for a in [*range(1, m), *range(m)]:
            ahead[a] = min(max(path, -price), 0)
            path = ahead[a] + gain[a]
        path = gain[-1]
        for a in [*range(m - 2, -1, -1), *range(m - 1, -1, -1)]:
            behind[a] = min(max(path, 0), price)
            path = behind[a] + gain[a]
        assert predicted[b].tolist() == (ahead + gain + behind <= 0).tolist()


def test_a_band_is_moved_to_where_it_fits_best() -> None:
    generator, drawn = numbers(5)
    k, n, m, v = 3, 4, 7, 5
    looks, steps = drawn(k, n, m), generator.integers(0, n, (k, m)).astype(np.uint8)
    here, before = generator.integers(0, m, (2, v, m))
    best = kernels.best_moves(looks, steps, here, before)
    for b in range(k):
        moved = (steps[b, here] + steps[b, before]) // 2
        sums = [looks[b, moved[i], np.arange(m)].sum() for i in range(v)]
        assert best[b] == np.argmax(sums)


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf, 1e38])
def test_no_value_leads_beyond_an_array(value: float) -> None:
    looks = np.full((2, 3, 6), value, np.float32)
    steps = np.full((2, 4, 6), 255, np.uint8)
    first, row = np.array([-9, 99]), np.full((2, 6), value, np.float32)
    of_paths = np.stack([row, row]), value, row[:, 0], row[:, 0]
    kernels.covered_words(looks, steps, first, *of_paths, row)
    kernels.hidden_angles(looks, steps[:, 0], first, *of_paths)
    kernels.free_arcs(looks, first, row[:, 0], value, row[:, 0])
    kernels.best_moves(looks, steps[:, 0], np.full((2, 6), -9), np.full((2, 6), 99))
    kernels.bounded_readings(looks[:, None], [1.0, 1.0], np.array([-(1 << 62), 1 << 62]))
    kernels.word_steps([[5]], [[-(1 << 62)]], [[[value]] * 2], [[[value]] * 2], 1 << 40, n=6, m=6)
