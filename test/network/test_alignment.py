"""Alignment to nominal coordinates, with the covariance of what comes out."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from ahf_ros.network.alignment import Alignment, best_fit, three_two_one, unaligned
from ahf_ros.network.camera import rotation_matrices
from ahf_ros.network.datum import movements, s_transform
from ahf_ros.network.points import MeasuredPoints
from ahf_ros.network.similarity import Similarity, similarity_between

TURN = rotation_matrices(np.array([[0.7, -1.1, 2.0]]))[0]


def points(seed: int = 3, unit: str = 'mm') -> MeasuredPoints:
    """Return eight points with a covariance that is correlated and positive definite."""
    source = np.random.default_rng(seed)
    xyz = source.uniform(-500, 500, (8, 3))
    factor = 0.01 * source.standard_normal((24, 40))
    return MeasuredPoints(tuple('ABCDEFGH'), xyz, factor @ factor.T / 40, 1.1, 90, unit)


def nominal(of: MeasuredPoints, scale: float = 1.0) -> dict[str, np.ndarray]:
    """Return the same points in another frame."""
    moved = scale * of.xyz @ TURN.T + (100.0, -40.0, 900.0)
    return dict(zip(of.names, moved, strict=True))


@pytest.mark.parametrize('scale', [1.0, 1.7])
def test_a_movement_is_found_exactly(scale: float) -> None:
    measured = points()
    aim = nominal(measured, scale)
    found = best_fit(measured, aim, scale=scale != 1.0)
    np.testing.assert_allclose(found.points.xyz, list(aim.values()), atol=1e-9)
    np.testing.assert_allclose(found.similarity.rotation, TURN, atol=1e-12)
    assert found.similarity.scale == pytest.approx(scale)
    assert found.used == measured.names


def test_points_in_a_plane_are_not_mirrored() -> None:
    flat = points().xyz * (1, 1, 0)
    found = similarity_between(flat, flat @ TURN.T, False)
    np.testing.assert_allclose(found.rotation, TURN, atol=1e-12)


@pytest.mark.parametrize('weights', ['covariance', 'equal'])
@pytest.mark.parametrize('scale', [False, True])
def test_the_covariance_is_that_of_numerical_derivatives(
    weights: Literal['covariance', 'equal'], scale: bool
) -> None:
    measured = points()
    aim = nominal(measured)

    def aligned(change: np.ndarray) -> Alignment:
        moved = replace(measured, xyz=measured.xyz + change.reshape(-1, 3))
        return best_fit(moved, aim, on='ABCDE', scale=scale, weights=weights)

    steps = 0.01 * np.eye(24)
    derivatives = [
        (aligned(step).points.xyz - aligned(-step).points.xyz).ravel() / 0.02 for step in steps
    ]
    expected = np.transpose(derivatives) @ measured.covariance @ derivatives
    found = aligned(np.zeros(24)).points.covariance
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


def test_weights_of_the_covariance_give_the_least_variance_of_the_movement() -> None:
    measured = points()
    used = 3 * len(measured.names)
    free = movements(measured.xyz, False)
    best = np.linalg.inv(free.T @ np.linalg.solve(measured.covariance, free))
    equal = np.linalg.pinv(free) @ measured.covariance @ np.linalg.pinv(free).T
    assert np.linalg.eigvalsh(equal - best)[0] > -1e-12 * np.trace(equal)
    aim = dict(zip(measured.names, measured.xyz, strict=True))
    found = best_fit(measured, aim).points.covariance
    normal = np.linalg.solve(measured.covariance, free)
    projection = np.eye(used) - free @ np.linalg.solve(free.T @ normal, normal.T)
    np.testing.assert_allclose(
        found, projection @ measured.covariance @ projection.T, atol=1e-9 * np.abs(found).max()
    )


def test_a_free_network_is_fitted_with_equal_weights() -> None:
    measured = points()
    xyz, covariance = s_transform(measured.xyz, measured.covariance, np.ones(8), scale=False)
    freed = MeasuredPoints(measured.names, xyz, covariance, unit='mm')
    source = np.random.default_rng(1)
    aim = {name: it + source.normal(0, 0.5, 3) for name, it in nominal(measured).items()}
    by_covariance, by_equal = (best_fit(freed, aim), best_fit(freed, aim, weights='equal'))
    np.testing.assert_allclose(by_covariance.points.xyz, by_equal.points.xyz, atol=1e-7)


def test_three_two_one_makes_six_coordinates_nominal() -> None:
    measured = points()
    aim = {name: it + (1.0, -2.0, 0.5) * np.arange(3) for name, it in nominal(measured).items()}
    aim['E'] = aim['E'] + 3.0
    found = three_two_one(measured, aim, plane='ABC', line='DE', point='F')
    off = {
        name: xyz - aim[name] for name, xyz in zip(measured.names, found.points.xyz, strict=True)
    }
    np.testing.assert_allclose([off[it][2] for it in 'ABC'], 0, atol=1e-8)
    np.testing.assert_allclose([off[it][1] for it in 'DE'], 0, atol=1e-8)
    assert off['F'][0] == pytest.approx(0, abs=1e-8)
    assert np.abs(off['H']).max() > 0.1
    variances = np.diag(found.points.covariance).reshape(-1, 3)
    held = [
        variances['ABCDEFGH'.index(name), axis]
        for name, axis in zip('ABCDEF', (2, 2, 2, 1, 1, 0), strict=True)
    ]
    np.testing.assert_allclose(held, 0, atol=1e-12 * variances.max())
    assert variances[6].min() > 0


def test_no_alignment_leaves_points_alone() -> None:
    measured = points()
    assert unaligned(measured).points is measured


def test_a_similarity_turns_a_covariance() -> None:
    measured = points()
    blocks = np.kron(np.eye(8), 2 * TURN)
    np.testing.assert_allclose(
        Similarity(TURN, np.zeros(3), 2.0).turned(measured.covariance),
        blocks @ measured.covariance @ blocks.T,
    )


@pytest.mark.parametrize(
    ('changes', 'text'),
    [
        ({'on': 'AB'}, '2 targets have measured and nominal'),
        ({'on': ('A', 'B', 'Z')}, 'targets Z have no nominal coordinates'),
        ({'names': 'AB'}, '2 targets have measured and nominal'),
        ({'names': ''}, '0 targets have measured and nominal'),
        ({'line': True}, 'on a line'),
        ({'nan': True}, 'nominal coordinates of A'),
        ({'unit': ''}, 'the network has no scale'),
    ],
)
def test_what_cannot_be_aligned_is_named(changes: dict, text: str) -> None:
    measured = points(unit=changes.get('unit', 'mm'))
    aim = nominal(measured)
    if 'names' in changes:
        aim = {name: aim[name] for name in changes['names']}
    if 'line' in changes:
        aim = {name: np.array([1.0, 2.0, 3.0]) * i for i, name in enumerate(aim)}
    if 'nan' in changes:
        aim['A'] = np.array([1.0, np.nan, 2.0])
    with pytest.raises(ValueError, match=text):
        best_fit(measured, aim, on=changes.get('on', ()))


def test_six_coordinates_that_hold_nothing_are_refused() -> None:
    measured = points()
    aim = dict(zip(measured.names, measured.xyz, strict=True))
    with pytest.raises(ValueError, match='plane has 2'):
        three_two_one(measured, aim, plane='AB', line='DE', point='F')
    with pytest.raises(ValueError, match='axes'):
        three_two_one(measured, aim, plane='ABC', line='DE', point='F', axes='zzz')
    aim['B'] = aim['A'] + (50.0, 0.0, 0.0)
    aim['C'] = aim['A'] + (90.0, 0.0, 0.0)
    aim['D'] = aim['A'] + (0.0, 0.0, 70.0)
    same = MeasuredPoints(
        measured.names, np.array(list(aim.values())), measured.covariance, unit='mm'
    )
    with pytest.raises(ValueError, match='do not hold all movements'):
        three_two_one(same, aim, plane='ABC', line='AD', point='A')
