"""Straight edges, and the quadrilaterals that they enclose, against plain loops."""

import math
from collections.abc import Iterator
from itertools import product

import cv2
import numpy as np
import pytest

from ahf_ros import kernels

COSINE, STRICT, LEAST, AWAY = 0.94, 0.985, 4.0, 0.5
REACH, ASIDE = 2, 1.5
SIDE, GAPS, OVERLAP, TURN, APART = 20.0, np.array([9.0, 0.8, 40.0]), 3.0, 0.3, 0.5
RULES = np.array([0.98, 1.5, 0.03, 0.3, 8.0])
MOST = 12


def picture(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where blurred polygons have edges, and the gradient."""
    generator = np.random.default_rng(seed)
    image = np.full((60, 80), 200, np.float32)
    for _ in range(1 + seed):
        corners = generator.uniform(0, 80, (generator.integers(3, 6), 2)).astype(np.int32)
        cv2.fillPoly(image, [corners], float(generator.uniform(20, 250)))
    image = cv2.GaussianBlur(image, (0, 0), 1.0) + generator.normal(0, 1, image.shape)
    gradient = [
        np.rint(8 * cv2.Scharr(image, cv2.CV_64F, *of) / 32).astype(np.int16)
        for of in ((1, 0), (0, 1))
    ]
    return cv2.Canny(*gradient, 60, 90, L2gradient=True), *gradient


def plain_edges(
    marked: np.ndarray, across: np.ndarray, down: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the ends of straight edges."""
    height, width = marked.shape
    left = {(int(y), int(x)) for y, x in np.argwhere(marked)}

    def direction(y: int, x: int) -> np.ndarray:
        size = math.hypot(across[y, x], down[y, x])
        return np.array([across[y, x], down[y, x]]) / size

    def grown(
        first: tuple[int, int], cosine: float
    ) -> tuple[list[tuple[int, int]], np.ndarray, np.ndarray]:
        left.remove(first)
        some, bright, places = [first], np.zeros(2), []
        for y, x in some:
            level = abs(across[y, x]) < abs(down[y, x])
            sizes = np.abs((down if level else across).astype(float))
            step = (1, 0) if level else (0, 1)
            behind = sizes[min(y + step[0], height - 1), min(x + step[1], width - 1)]
            before = sizes[max(y - step[0], 0), max(x - step[1], 0)]
            bent = 2 * sizes[y, x] - before - behind
            away = np.clip((behind - before) / (2 * bent), -0.5, 0.5) if bent > 0 else 0.0
            places.append((x + away * step[1], y + away * step[0]))
            bright = bright + direction(y, x)
            mean = bright / np.linalg.norm(bright)
            beside = range(-REACH, REACH + 1)
            for v, u in product(beside, beside):
                alike = (
                    (y + v, x + u) in left
                    and direction(y + v, x + u) @ mean >= cosine
                    and abs(u * mean[0] + v * mean[1]) <= ASIDE
                )
                if alike:
                    left.remove((y + v, x + u))
                    some.append((y + v, x + u))
        return some, bright, np.array(places)

    for first in sorted(left):
        if first not in left:
            continue
        straight = False
        for cosine in (COSINE, STRICT):
            some, bright, points = grown(first, cosine)
            if len(some) < LEAST:
                break
            values, vectors = np.linalg.eigh(np.cov(points.T, bias=True))
            straight = values[0] < AWAY**2
            if straight:
                break
            if cosine == COSINE:
                left.update(some)
        if not straight:
            continue
        along = vectors[:, 1]
        if along[1] * bright[0] - along[0] * bright[1] < 0:
            along = -along
        middle = points.mean(axis=0)
        pixels = np.array([(x, y) for y, x in some])
        at = (pixels - middle) @ along
        if np.ptp(at) >= LEAST:
            yield middle + at.min() * along, middle + at.max() * along


@pytest.mark.parametrize('seed', range(6))
def test_straight_edges(seed: int) -> None:
    of_picture = picture(seed)
    count = cv2.countNonZero(of_picture[0])
    of_pixels = *of_picture, COSINE, STRICT, LEAST, AWAY
    edges, found, *_ = kernels.straight_edges(*of_pixels, m=count, e=count)
    expected = np.array([*plain_edges(*of_picture)]).reshape(-1, 4)
    assert found == len(expected) > 0
    np.testing.assert_allclose(edges[: found[0]], expected, atol=1e-9)
    some, found, *_ = kernels.straight_edges(*of_pixels, m=2, e=count)
    assert found == min(len(expected), 2)
    np.testing.assert_array_equal(some[: found[0]], edges[: found[0]])


def scattered(seed: int) -> np.ndarray:
    """Return the sides of squares, in pieces, among others."""
    generator = np.random.default_rng(seed)
    edges = []
    for _ in range(3):
        size, turn = generator.uniform(14, 40), generator.uniform(0, 2 * np.pi)
        square = size * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]) / 2
        matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        corners = square @ matrix.T + generator.uniform(20, 100, 2)
        for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            ends = np.array([0.05, 0.95]) if generator.random() < 0.5 else [0.05, 0.4, 0.6, 0.95]
            pieces = np.array(ends).reshape(-1, 2)
            edges += [[*(one + a * (other - one)), *(one + b * (other - one))] for a, b in pieces]
    others = generator.uniform(0, 120, (4 * seed, 2))
    lengths = generator.uniform(3, 20, 4 * seed)
    turns = generator.uniform(0, 2 * np.pi, 4 * seed)
    along = lengths[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    made = np.concatenate([edges, np.concatenate([others, others + along], axis=1)])
    return generator.permutation(made + generator.normal(0, 0.05, made.shape))


def plain_quadrilaterals(edges: np.ndarray) -> list[np.ndarray]:
    """Return all quadrilaterals, before those that are alike are left out."""
    begin, end = edges[:, :2], edges[:, 2:]
    length = np.linalg.norm(end - begin, axis=1)
    along = (end - begin) / length[:, None]
    straight, offset, bent, seen, smallest = RULES
    reach = GAPS[2]

    def crossed(a: np.ndarray, b: np.ndarray) -> float:
        return float(a[0] * b[1] - a[1] * b[0])

    def cell(place: np.ndarray) -> np.ndarray:
        return np.clip(np.floor(place / SIDE), 0, 6)

    def beyond(i: int, first: np.ndarray, last: np.ndarray) -> float:
        far, farther = along[i] @ (first - end[i]), along[i] @ (last - end[i])
        on_it = abs(crossed(along[i], first - end[i])) < offset + bent * far
        on_it &= abs(crossed(along[i], last - end[i])) < offset + bent * farther
        return far if on_it and -offset < far < farther else math.inf

    follows, corners = [], []
    for i in range(len(edges)):
        near = [
            j
            for j in range(len(edges))
            if (cell(end[i] - reach) <= cell(begin[j])).all()
            and (cell(begin[j]) <= cell(end[i] + reach)).all()
        ]
        ahead = [(beyond(i, begin[j], end[j]), j) for j in near if along[i] @ along[j] > straight]
        ahead = [(far, j) for far, j in ahead if far < reach and j != i]
        against = [beyond(i, end[j], begin[j]) for j in near if along[i] @ along[j] < -straight]
        nearest, next_one = min(ahead, default=(reach, None))
        follows.append(None if min(against, default=math.inf) < nearest else next_one)
        for j in near:
            sine = crossed(along[i], along[j])
            if abs(along[i] @ along[j]) > straight or sine <= TURN:
                continue
            past = -crossed(along[j], begin[j] - begin[i]) / sine - length[i]
            before = crossed(along[i], begin[j] - begin[i]) / sine
            far = GAPS[0] + GAPS[1] * length[[i, j]]
            if -OVERLAP < past < far[0] and -OVERLAP < before < far[1]:
                corners.append((i, j, end[i] + past * along[i]))

    def sides(number: int) -> Iterator[int]:
        _, first, place = corners[number]
        shown, j, passed = 0.0, first, 0
        while j is not None and passed < len(edges):
            shown += length[j]
            for other, (last, _, to) in enumerate(corners):
                vector = to - place
                size = math.hypot(*vector)
                most = offset + bent * size
                if (
                    last == j
                    and size >= smallest
                    and shown >= seen * size
                    and min(along[first] @ vector, along[j] @ vector) > 0
                    and abs(crossed(along[first], vector)) < most
                    and abs(crossed(along[j], vector)) < most
                ):
                    yield other
            j, passed = follows[j], passed + 1

    links = [set(list(sides(number))[:MOST]) for number in range(len(corners))]
    return [
        np.array([corners[of][2] for of in (a, b, c, d)])
        for a in range(len(corners))
        for b in links[a]
        for c in links[b]
        for d in links[c]
        if a in links[d] and a < min(b, c, d)
    ]


@pytest.mark.parametrize('seed', range(6))
def test_quadrilaterals(seed: int) -> None:
    edges = scattered(seed)
    count = len(edges)
    corners, found, *_ = kernels.edge_quadrilaterals(
        edges,
        SIDE,
        GAPS,
        OVERLAP,
        TURN,
        RULES,
        APART,
        tall=7,
        wide=7,
        **{of: most * count for of, most in zip('clq', (30, 300, 300), strict=True)},
    )
    corners = corners[: found[0]]
    expected = plain_quadrilaterals(edges)
    assert len(expected) >= len(corners) >= 3
    for of in expected:
        assert min(np.abs(of - corners).max(axis=(1, 2))) < APART
    for index, of in enumerate(corners):
        assert min(np.abs(np.array(expected) - of).max(axis=(1, 2))) < 1e-9
        assert all(np.abs(other - of).max() >= APART for other in corners[:index])


def test_few_quadrilaterals_are_some_of_them() -> None:
    edges = scattered(4)
    numbers = SIDE, GAPS, OVERLAP, TURN, RULES, APART
    every, some = (
        kernels.edge_quadrilaterals(edges, *numbers, tall=7, wide=7, c=900, l=9000, q=most)[:2]
        for most in (900, 2)
    )
    assert every[1] > some[1] == 2
    np.testing.assert_array_equal(every[0][:2], some[0])
