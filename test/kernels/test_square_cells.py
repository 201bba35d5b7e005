"""Evidence of the cells of square markers, and of words, against matrices and plain loops."""

import math

import numpy as np
import pytest

from ahf_ros import kernels
from support.plain_values import below, value

SEEDS, SHADED = range(6), range(6, 9)
INSIDE, BORDER = 4, 1
SIDE = INSIDE + 2 * BORDER
PLACES = np.array([[0.0, 0.0], [-0.2, -0.2], [-0.2, 0.2], [0.2, -0.2], [0.2, 0.2]])
OFFSET, MIXED, LEAST, USUAL, SHARE, EVERYWHERE = 4.0, 0.2, 0.35, 0.4, 0.6, 1e-6
SHARPNESS, MOST, UNCLEAR, UNUSUAL = 12.0, 3.0, 1.5, 2.5
WEIGHTS, CORNER = np.array([0.15, 0.3, 0.7]), 0.3
WINDOW = np.exp(-((np.arange(SIDE + 2) / 2.0) ** 2) / 2)


def plainly(
    gray: np.ndarray, frame: np.ndarray, size: np.ndarray, blur: float, spread: bool
) -> tuple[np.ndarray, float, float, float] | None:
    """Return evidence of cells, odds of ink, of square corners, and of the border."""
    grid = SIDE + 2
    parts = np.empty((5, grid, grid))
    for part, row, column in np.ndindex(parts.shape):
        at = (np.array([column, row]) - (grid - 1) / 2 + PLACES[part]) / SIDE
        parts[part, row, column] = value(gray, frame, *at)
    whole = parts.min(axis=0) if spread else parts[1:].mean(axis=0)
    for length in size[::-1]:
        next_to = np.eye(grid, k=1) + np.eye(grid, k=-1)
        next_to[0, 0] = next_to[-1, -1] = 1
        mixed = min(below(-length / blur / 2), MIXED)
        whole = np.linalg.solve(np.eye(grid) + mixed * (next_to - 2 * np.eye(grid)), whole).T
    levels = np.log(np.maximum([whole, *parts[1:]], 0) + OFFSET)
    of_sides = [np.rot90(np.indices((grid, grid)), turn, axes=(1, 2)) for turn in range(4)]
    ink, paper = (np.stack([of[:, row, 1:-1] for of in of_sides]) for row in (1, 0))
    dark, bright = (levels[0][tuple(of.swapaxes(0, 1))] for of in (ink, paper))
    steps = bright - dark
    usual = np.median(steps)
    clear = (steps > USUAL * usual) & (steps > LEAST / 2)
    if not (usual > LEAST and clear.mean(axis=1).min() >= SHARE):
        return None
    lit, shaded, paler = dark[:, 1:-1].max(), dark[:, 1:-1].min(), bright[:, 1:-1].min()
    uneven = bool(lit - shaded > usual / 2 and paler - lit > LEAST / 2)
    odds, square, evidence = np.zeros(2), 0.0, np.zeros((INSIDE, INSIDE))
    for row, column in np.ndindex(SIDE, SIDE):
        rows, columns = np.abs(ink - np.array([row + 1, column + 1])[:, None]).swapaxes(0, 1)
        weights = clear * (WINDOW[rows] * WINDOW[columns] + EVERYWHERE)
        half, step = (np.average(of, weights=weights) for of in ((dark + bright) / 2, steps))
        if uneven:
            half, step = (lit + paler) / 2, paler - lit
        of_parts = np.clip(SHARPNESS * (levels[:, row + 1, column + 1] - half) / step, -MOST, MOST)
        terms = math.log(2) - np.log1p(np.exp(of_parts))
        against = terms[0] + WEIGHTS[0] * terms[1:].sum()
        against -= UNCLEAR * (1 - abs(of_parts[0]) / MOST)
        if {row, column}.isdisjoint((0, SIDE - 1)):
            evidence[row - 1, column - 1] = of_parts[0] + WEIGHTS[0] * of_parts[1:].sum()
            odds += against, 0
            continue
        odds += WEIGHTS[1] * against
        if {row, column} <= {0, SIDE - 1}:
            odds += WEIGHTS[2] * against
            outermost = levels[1 + (row > 0) + 2 * (column > 0), row + 1, column + 1]
            low, high = math.exp(half - step / 2), math.exp(half + step / 2)
            blurred = 1 - below(CORNER * size[0] / blur) * below(CORNER * size[1] / blur)
            level = (math.exp(outermost) - low) / (high - low)
            of = SHARPNESS * (1 - blurred) * ((1 + blurred) / 2 - level)
            square += min(max(of, -MOST), MOST)
    against = UNUSUAL * (int(spread) + uneven)
    return evidence, odds[0] - against, square - against, odds[1]


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return an image of a marker or of noise, and the frames of some quadrilaterals near it.

    A shadow lies on the markers of the seeds that are `SHADED`.
    """
    generator = np.random.default_rng(seed)
    cells = np.pad(generator.random((INSIDE, INSIDE)) < 0.5, BORDER)
    cells = np.pad(cells, 2, constant_values=True)
    gray = np.kron(np.where(cells, 190.0, 30.0), np.ones((9, 9)))
    if seed in SHADED:
        gray[:, 50:] /= 4
    gray += generator.normal(0, 2 if seed in SHADED else 8, (90, 90))
    if not seed:
        gray = generator.uniform(0, 255, (90, 90))
    frames = np.array([[[54.0, 0, 44.5], [0, 54, 44.5], [0, 0, 1]]]).repeat(5, axis=0)
    frames[1:, :2] += generator.normal(0, 1.5, (4, 2, 3))
    frames[4] = np.eye(3)
    return np.clip(gray, 0, 255).astype(np.uint8), frames


def evidence(gray: np.ndarray, frames: np.ndarray, sizes: np.ndarray, blurs: np.ndarray) -> tuple:
    spread = np.arange(len(frames)) < 3
    of_levels = OFFSET, MIXED, LEAST, USUAL, SHARE, EVERYWHERE
    of_cells = SHARPNESS, MOST, UNCLEAR, UNUSUAL, WEIGHTS, CORNER
    seen = gray, frames, sizes, blurs, spread, WINDOW, PLACES
    return kernels.cell_evidence(*seen, *of_levels, *of_cells, n=INSIDE)[:3]


@pytest.mark.parametrize('seed', [*SEEDS, *SHADED])
def test_cells_say_what_plain_loops_find(seed: int) -> None:
    gray, frames = drawn(seed)
    generator = np.random.default_rng(seed)
    sizes, blurs = generator.uniform(0.8, 9, (5, 2)), generator.uniform(0.4, 0.9, 5)
    seen, paper, odds = evidence(gray, frames, sizes, blurs)
    for index, darkest in np.ndindex(5, 2):
        read = darkest, index
        if darkest and index > 2:
            assert not seen[read]
            continue
        expected = plainly(gray, frames[index], sizes[index], blurs[index], bool(darkest))
        assert seen[read] == (expected is not None)
        if expected is not None:
            np.testing.assert_allclose(
                paper[read], expected[0], atol=1e-4 if seed in SHADED else 1e-5
            )
            np.testing.assert_allclose(odds[(slice(None), *read)], expected[1:], atol=1e-4)
    assert seen[0, 0] == (seed > 0)


@pytest.mark.parametrize('seed', SEEDS)
def test_quadrilaterals_are_dark_inside(seed: int) -> None:
    gray, frames = drawn(seed)
    along = np.linspace(-0.45, 0.45, 7)
    dark = kernels.dark_inside(gray, frames, along, 0.56, 0.44, OFFSET, 1.2, 0.6)
    turns = [np.array([[c, -s], [s, c]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
    for frame, found in zip(frames, dark.tolist(), strict=True):
        shares = []
        for turn in turns:
            paper, ink = (
                [value(gray, frame, *(turn @ [at, -depth])) for at in along]
                for depth in (0.56, 0.44)
            )
            shares.append(np.mean(np.add(paper, OFFSET) > 1.2 * np.add(ink, OFFSET)))
        assert found == (min(shares) >= 0.6)


@pytest.mark.parametrize('seed', SEEDS)
def test_the_likeliest_word_and_all_others(seed: int) -> None:
    generator = np.random.default_rng(seed)
    count, cells, words = [1, 5][seed % 2], [9, 16, 17][seed % 3], [1, 30][seed // 3]
    marked = generator.random((words, 4, cells)) < 0.5
    bits = np.moveaxis(np.packbits(marked, axis=2, bitorder='little'), 2, 0)
    paper = generator.normal(0, 3, (count, cells)).astype(np.float32)
    ink, square = generator.normal(0, 9, (2, count))
    prior, few, shapes = generator.uniform(0, 4, (3, words))
    anyway = np.arange(count) % 2 == 1
    numbers = 6.0, 7.0, -12.0
    found = kernels.likeliest_words(
        paper, ink, square, anyway, np.ascontiguousarray(bits), prior, few, shapes, *numbers
    )
    for index, (best, total, others, likely) in enumerate(zip(*found[:4], strict=True)):
        odds = marked @ paper[index].astype(float) - prior[:, None]
        word, turn = np.unravel_index(odds.argmax(), odds.shape)
        assert best.tolist() == [word, turn]
        of_cells = odds.max() + ink[index] - 6 - few[word]
        of_shape = square[index] + shapes[word] - 7
        assert total == pytest.approx(-np.logaddexp(-of_cells, -of_shape), abs=1e-4)
        assert likely == (total > -12 or anyway[index])
        if likely and words > 1:
            rest = np.delete(odds, word, axis=0) - odds.max()
            assert others == pytest.approx(np.logaddexp.reduce(rest.ravel()), abs=1e-4)


def test_no_word_is_likely_where_ink_is_not() -> None:
    paper, bits = np.full((2, 9), 0.5, np.float32), np.full((2, 3, 4), 255, np.uint8)
    anyway = np.array([False, True])
    of_words = bits, *np.ones((3, 3)), 6.0, 7.0, -12.0
    best, total, _, likely, *_ = kernels.likeliest_words(
        paper, np.full(2, -20.0), np.zeros(2), anyway, *of_words
    )
    assert likely.tolist() == [False, True]
    assert best.tolist() == [[0, 0]] * 2
    assert total[1] < total[0] < -12


@pytest.mark.parametrize('bad', [0.0, math.nan, math.inf, -1e30])
def test_bad_values_end(bad: float) -> None:
    gray, frames = np.zeros((1, 1), np.uint8), np.full((3, 3, 3), bad)
    evidence(gray, frames, np.full((3, 2), bad), np.full(3, bad))
    kernels.dark_inside(gray, frames, [bad], bad, bad, 0.0, bad, bad)
    kernels.cell_evidence(
        *(gray, frames[:1], [[1.0, 1.0]], [1.0], [True], [1.0], PLACES),
        *(*[bad] * 10, WEIGHTS, bad),
        n=3,
    )
    of_words = np.full((1, 2, 4), 255, np.uint8), *np.full((3, 2), bad)
    kernels.likeliest_words([[np.float32(1)]], [bad], [bad], [True], *of_words, bad, bad, bad)
