"""Triples of dots, against plain loops over all pairs of pairs."""

import numpy as np
import pytest

from ahf_ros import kernels

ARMS = np.array([[-2.0, 9.0], [7.0, 3.0]])  # from the first dot to its partner and to the third
PRINTED = np.array([1.0, 0.8, 1.3])
ERROR, SCALES = (0.3, 0.7), (-0.4, 0.5)


def ln_axes(affine: np.ndarray) -> np.ndarray:
    return np.log(np.maximum(np.linalg.svd(affine)[1], 1e-9**0.5))


@pytest.mark.parametrize('seed', range(12))
def test_triples_are_those_that_their_ellipses_bear_out(seed: int) -> None:
    generator = np.random.default_rng(seed)
    # Three dots as printed, a little off, and others anywhere.
    affine = generator.normal([[3.0, 0.4], [0.2, -2.5]], 0.15)
    places = np.concatenate([np.zeros((1, 2)), ARMS, generator.uniform(-15, 15, (9, 2))])
    centres = places @ affine.T + generator.normal(0, 0.3, places.shape)
    sizes = np.append(PRINTED, generator.uniform(0.5, 1.5, 9)) * np.exp(
        generator.uniform(-0.3, 0.3)
    )
    ellipses = sizes[:, None, None] * affine @ np.diag([1.0, -1.0])
    ellipses += generator.normal(0, 0.1, (12, 2, 2))
    allowed = generator.uniform(0.3, 0.8, 12)
    upwards = ellipses @ np.diag([1.0, -1.0])
    ends = np.array([(i, j) for i in range(12) for j in range(12) if i != j])
    inverses = np.linalg.inv(ellipses)
    offsets = np.array([np.linalg.inv(upwards[i]) @ (centres[j] - centres[i]) for i, j in ends])
    partners = np.flatnonzero(generator.random(len(ends)) < 0.8)
    begin = np.searchsorted(ends[:, 0], ends[partners, 0])
    end = np.searchsorted(ends[:, 0], ends[partners, 0], 'right')
    turn = complex(*ARMS[1]) / complex(*ARMS[0])
    basis = np.linalg.inv(ARMS.T)
    expected, maps = [], []
    for pair, low, high in zip(partners, begin, end, strict=True):
        about = complex(*offsets[pair]) * turn
        for other in range(low, high):
            away = abs(complex(*offsets[other]) - about)
            if away >= ERROR[0] * abs(about) + ERROR[1]:
                continue
            implied = upwards[ends[pair, 0]] @ offsets[[pair, other]].T @ basis
            dots = [*ends[pair], ends[other, 1]]
            axes = np.array(
                [
                    ln_axes(inverses[dot] @ implied * of)
                    for dot, of in zip(dots, PRINTED, strict=True)
                ]
            )
            scale, own = -np.median(axes.mean(axis=1)), allowed[dots]
            good = np.linalg.det(implied) < 0
            good &= SCALES[0] - own[0] < scale < SCALES[1] + own[0]
            if good and (np.abs(axes + scale) < own[:, None]).all():
                expected.append(dots)
                maps.append(implied)
    given = (
        *(ends, offsets, upwards, inverses, allowed, (turn.real, turn.imag), basis, PRINTED),
        *(ERROR, SCALES, partners, begin, end),
    )
    triples, affines, (count,) = kernels.likely_triples(*given, most=2000)
    assert triples[:count].tolist() == expected != []
    assert affines[:count] == pytest.approx(np.reshape(maps, (-1, 2, 2)))
    few, _, (fewer,) = kernels.likely_triples(*given, most=1)
    assert (fewer, few.tolist()) == (1, expected[:1])


def test_the_printed_triple_is_among_them() -> None:
    centres, radius = np.concatenate([np.zeros((1, 2)), ARMS]) * [3.0, -3.0], 3.0
    ends = np.array([(0, 1), (0, 2)])
    offsets = ARMS.copy()
    ellipses = np.tile(np.diag([radius, radius]), (3, 1, 1))
    turn = complex(*ARMS[1]) / complex(*ARMS[0])
    triples, affine, (count,) = kernels.likely_triples(
        *(
            ends,
            offsets,
            ellipses @ np.diag([1.0, -1.0]),
            np.linalg.inv(ellipses),
            np.full(3, 0.5),
        ),
        *((turn.real, turn.imag), np.linalg.inv(ARMS.T), np.ones(3), ERROR, SCALES),
        *(np.array([0]), np.array([-7]), np.array([99])),
        most=9,
    )
    assert triples[:count].tolist() == [[0, 1, 2]]
    shown = ARMS @ affine[0].T
    assert shown == pytest.approx(centres[1:])
