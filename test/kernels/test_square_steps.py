"""Evidence of the steps between the cells of square markers, against plain loops."""

import math
from itertools import product

import numpy as np
import pytest

from ahf_ros import kernels
from support.plain_values import below, value

INSIDE = 4
PLACES = np.array([-0.3, 0.0, 0.25])
ASIDE, OFFSET, LEAST, STRAY, WEIGHT, OF_BORDER = 0.3, 2.0, 0.35, 0.08, 0.4, 0.3
DEVIATION = np.array([0.25, 0.5])
CORNER = np.array([0.3, 0.7, 12.0, 3.0])
FALLING, SAME, RISING = -1, 0, 1


def shown(seed: int, border: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return a marker under stripes, about where it is, the size of its cells, and the cells."""
    generator = np.random.default_rng(seed)
    side = INSIDE + 2 * border
    ink = np.ones((side, side), bool)
    ink[border:-border, border:-border] = generator.random((INSIDE, INSIDE)) < 0.5
    turn, size = generator.uniform(0, np.pi), generator.uniform(30, 60)
    frame = np.eye(3)
    frame[:2, :2] = (
        size
        * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        @ np.diag([1.0, generator.uniform(0.6, 1)])
    )
    frame[:2, 2] = [50, 46]
    y, x = np.mgrid[:92, :100]
    at = np.linalg.inv(frame) @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    cells = np.floor((at[:2] + 0.5) * side).astype(int)
    on = ((cells >= 0) & (cells < side)).all(axis=0)
    dark = np.zeros(x.size, bool)
    dark[on] = ink[cells[1, on], cells[0, on]]
    gray = np.where(dark, 30.0, 190.0).reshape(x.shape) * (1 - 0.8 * (x // 12 % 2))
    moved = frame.copy()
    moved[:2] += generator.normal(0, 0.3, (2, 3))
    sizes = np.linalg.norm(frame[:2, :2], axis=0) / side
    return np.rint(gray).astype(np.uint8), moved, sizes, ink


def share_below(away: float) -> float:
    """Return the share of a normal distribution below so many deviations, as kernels know it."""
    return float(kernels.normal_shares(np.array([away]))[0])


def unmixed(seen: np.ndarray, place: float, blur: float) -> np.ndarray:
    """Return rows without the shares that blur mixes into them from those beside them."""
    before, behind = (share_below((way * place - 0.5) / blur) for way in (-1, 1))
    if before + behind <= 1e-3:
        return seen
    beside = np.full(len(seen) - 1, before), np.full(len(seen) - 1, behind)
    mixed = np.diag(beside[0], -1) + np.diag(beside[1], 1)
    return np.linalg.solve(mixed + np.diag(1 - mixed.sum(axis=1)), seen)


def plainly(
    gray: np.ndarray, frame: np.ndarray, sizes: np.ndarray, side: int
) -> tuple[float, dict[tuple[int, int, int], dict[int, float]], float]:
    """Return the usual step, the odds of all kinds of all lines, and those of square corners."""

    def log(x: float, y: float) -> float:
        return math.log(value(gray, frame, x, y) + OFFSET)

    blurs, middles = CORNER[1] / sizes, (np.arange(side + 2) - (side + 1) / 2) / side

    def light(axis: int, place: tuple[float, float]) -> np.ndarray:
        """Return logarithms in a place of each cell, by its line and its place along this."""
        across, along = (middles + of / side for of in place)
        at = product(across.tolist(), along.tolist())
        seen = [value(gray, frame, *(of if axis == 0 else of[::-1])) for of in at]
        clean = unmixed(np.reshape(seen, (side + 2, side + 2)), place[0], blurs[axis])
        clean = unmixed(clean.T, place[1], blurs[1 - axis]).T
        return np.log(np.maximum(clean, 0) + OFFSET)

    steps = {key: np.zeros(len(PLACES)) for key in product(range(2), range(side + 1), range(side))}
    for axis, (index, along) in product(range(2), enumerate(PLACES.tolist())):
        before, behind = (light(axis, (way * (0.5 - ASIDE), along)) for way in (1, -1))
        for line, cell in product(range(side + 1), range(side)):
            step = behind[line + 1, cell + 1] - before[line, cell + 1]
            steps[axis, line, cell][index] = step
    sides = [
        sign * steps[axis, line, cell]
        for axis, (line, sign), cell in product(range(2), ((0, -1), (side, 1)), range(side))
    ]
    usual = float(np.median(np.concatenate(sides)))
    odds = {}
    for line, of in steps.items():
        deviation = DEVIATION @ [1, share_below(-ASIDE / blurs[line[0]])]
        each = {
            kind: WEIGHT
            * np.log(np.exp(-(((of / usual - kind) / deviation) ** 2) / 2) + STRAY).sum()
            for kind in (FALLING, SAME, RISING)
        }
        usually = {FALLING: 0.25, SAME: 0.5, RISING: 0.25}
        any_kind = math.log(sum(usually[kind] * math.exp(each[kind]) for kind in each))
        odds[line] = {kind: each[kind] - any_kind for kind in each}
    middle, outside, outermost = 0.5 - 0.5 / side, 0.5 + 0.5 / side, 0.5 - CORNER[0] / side
    seen = [below(CORNER[0] * of / CORNER[1]) for of in sizes]
    blurred, square = 1 - seen[0] * seen[1], 0.0
    for x, y in product((-1, 1), repeat=2):
        ink = log(x * middle, y * middle)
        paper = min(log(x * outside, y * middle), log(x * middle, y * outside))
        if paper > ink:
            dark, bright = math.exp(ink), math.exp(paper)
            level = (math.exp(log(x * outermost, y * outermost)) - dark) / (bright - dark)
            of = CORNER[2] * (1 - blurred) * ((1 + blurred) / 2 - level)
            square += min(max(of, -CORNER[3]), CORNER[3])
    return usual, odds, square


def evidence(
    gray: np.ndarray, frame: np.ndarray, sizes: np.ndarray, side: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what the kernel says of one quadrilateral."""
    seen, features, odds, *_ = kernels.step_evidence(
        gray,
        frame[None],
        sizes[None],
        PLACES,
        ASIDE,
        OFFSET,
        LEAST,
        DEVIATION,
        STRAY,
        WEIGHT,
        OF_BORDER,
        CORNER,
        s=side,
        t=side + 1,
        c=side + 2,
        n=INSIDE,
        f=4 * INSIDE * (INSIDE + 1),
    )
    return seen, features, odds


@pytest.mark.parametrize('border', [1, 2])
@pytest.mark.parametrize('seed', range(4))
def test_evidence_of_steps(seed: int, border: int) -> None:
    gray, frame, sizes, cells = shown(seed, border)
    side = INSIDE + 2 * border
    seen, features, odds = evidence(gray, frame, sizes, side)
    usual, plain, square = plainly(gray, frame, sizes, side)
    assert seen == (usual > LEAST)
    ink, around, expected, shows = 0.0, 0.0, [], 0.0
    padded = np.pad(cells, 1)
    for axis, line, cell in product(range(2), range(side + 1), range(side)):
        of = plain[axis, line, cell]
        if border <= line <= border + INSIDE and border <= cell < border + INSIDE:
            ink += of[SAME]
            expected += [of[FALLING] - of[SAME], of[RISING] - of[SAME]]
            at = (cell + 1, line) if axis == 0 else (line, cell + 1)
            after = (cell + 1, line + 1) if axis == 0 else (line + 1, cell + 1)
            shows += of[int(padded[at]) - int(padded[after])]
            continue
        around += of[{0: FALLING, side: RISING}.get(line, SAME)]
    np.testing.assert_allclose(features[0], expected, atol=1e-4)
    np.testing.assert_allclose(odds[:, 0], [ink + OF_BORDER * around, square, around], atol=1e-9)
    assert shows > 0  # of the cells that it has, under stripes five times as bright as others


@pytest.mark.parametrize(('seed', 'off'), [(0, 0.1), (1, 0.15), (2, 0.12)])
def test_cells_tell_nothing_where_there_is_no_border(seed: int, off: float) -> None:
    gray, frame, sizes, _ = shown(seed, 1)
    beside = frame @ np.array([[1, 0, off], [0, 1, 0], [0, 0, 1]])
    seen, features, (ink, _, around) = evidence(gray, beside, sizes, INSIDE + 2)
    assert seen.all()
    assert around < 0
    assert ink == OF_BORDER * around
    assert not features.any()
