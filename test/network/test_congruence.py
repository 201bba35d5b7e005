"""The congruence test of two epochs, on adjusted bundles and on exact points."""

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.network.camera import rotation_matrices
from ahf_ros.network.congruence import compare
from ahf_ros.network.datum import movements, s_transform
from ahf_ros.network.points import MeasuredPoints
from support.epochs import measured

TURN = rotation_matrices(np.array([[0.7, -1.1, 2.0]]))[0]


def turned(points: MeasuredPoints, scale: float = 1.0) -> MeasuredPoints:
    """Return the same points in another frame, in another order."""
    blocks = np.kron(np.eye(len(points.names)), scale * TURN)
    other = replace(
        points,
        xyz=scale * points.xyz @ TURN.T + (2000.0, 30.0, -500.0),
        covariance=blocks @ points.covariance @ blocks.T,
    )
    return other.chosen(points.names[::-1])


def test_nothing_moves_between_two_adjustments_of_one_object() -> None:
    found = compare(measured(1), measured(2))
    assert found.congruent
    assert (found.moved, found.warnings, found.free_scale) == ((), (), False)
    (test,) = found.tests
    assert (test.targets, test.rank, test.redundancy) == (12, 30, 158)
    assert test.passed and 0.3 < test.statistic < 1.5


def test_targets_that_moved_are_named() -> None:
    second = measured(2, {'5': (0.15, 0.0, 0.1), '11': (0.0, -0.3, 0.0)})
    found = compare(measured(1), second)
    assert not found.congruent
    assert set(found.moved) == {'5', '11'}
    items = {it.name: it for it in found.movements}
    assert not items['5'].in_datum and not items['11'].in_datum
    for name, step in (('5', (0.15, 0.0, 0.1)), ('11', (0.0, -0.3, 0.0))):
        error = items[name].xyz - step
        assert error @ np.linalg.solve(items[name].covariance, error) < 16.3  # 0.1 % of chi2
    assert [it.targets for it in found.tests] == [12, 11, 10]
    assert found.tests[-1].passed


def test_the_shape_is_compared_where_an_epoch_has_no_scale() -> None:
    found = compare(measured(1), measured(2, {'5': (0.2, 0.0, 0.1)}, unit=''))
    assert found.free_scale
    assert found.tests[0].rank == 29
    assert found.moved == ('5',)


def test_a_change_of_scale_is_a_movement_only_with_fixed_scale() -> None:
    first = measured(1)
    larger = replace(first, xyz=first.xyz * 1.0005)
    assert not compare(first, larger).congruent
    assert compare(first, larger, free_scale=True).congruent


@pytest.mark.parametrize('scale', [1.0, 2.5])
def test_the_result_depends_on_no_frame_order_or_datum(scale: float) -> None:
    first, second = measured(1), measured(2, {'5': (0.15, 0.0, 0.1)})
    expected = compare(first, second, free_scale=scale != 1)
    weights = np.zeros(12)
    weights[[1, 6, 9]] = 1
    datum = s_transform(second.xyz, second.covariance, weights, scale=False)[1]
    other = turned(replace(second, covariance=datum), scale)
    found = compare(first, other, free_scale=scale != 1)
    for one, same in zip(found.movements, expected.movements, strict=True):
        assert (one.name, one.moved) == (same.name, same.moved)
        assert one.statistic == pytest.approx(same.statistic, rel=1e-4, abs=1e-6)
        np.testing.assert_allclose(one.xyz, same.xyz, atol=1e-5)  # a thousandth of a sigma
        np.testing.assert_allclose(one.covariance, same.covariance, rtol=1e-3, atol=1e-9)


def test_the_statistics_are_those_of_a_linear_model() -> None:
    """T and the movements from the invariants N'd, N orthogonal to all movements of the frame."""
    first, second = measured(1), measured(2)
    found = compare(first, second)
    free = movements(first.xyz, scale=False)
    invariant = np.linalg.svd(free)[0][:, 6:]
    difference = (second.xyz - first.xyz).ravel()  # the frames are all but the same
    degrees = np.array([first.redundancy, second.redundancy])
    variance = degrees @ (first.sigma0**2, second.sigma0**2) / degrees.sum()
    cofactors = invariant.T @ (first.covariance + second.covariance) @ invariant
    seen = invariant.T @ difference
    weights = np.linalg.inv(cofactors)
    total = seen @ weights @ seen / 30 / variance
    assert found.tests[0].statistic == pytest.approx(total, rel=1e-4)
    moving = invariant.T[:, 15:18]  # target 6 alone
    normal = moving.T @ weights @ moving
    movement = np.linalg.solve(normal, moving.T @ weights @ seen)
    np.testing.assert_allclose(found.movements[5].xyz, movement, atol=1e-6)
    np.testing.assert_allclose(
        found.movements[5].covariance, variance * np.linalg.inv(normal), rtol=1e-4, atol=1e-12
    )
    single = movement @ normal @ movement / 3 / variance
    assert found.movements[5].statistic == pytest.approx(single, rel=1e-3)


def test_a_target_outside_the_datum_is_tested_against_it() -> None:
    first, second = measured(1), measured(2, {'5': (0.15, 0.0, 0.1)})
    found = compare(first, second, stable=[name for name in first.names if name != '5'])
    assert found.moved == ('5',)
    assert len(found.tests) == 1 and found.tests[0].targets == 11
    left = compare(first, second)
    for one, same in zip(found.movements, left.movements, strict=True):
        np.testing.assert_allclose(one.xyz, same.xyz, atol=1e-9)


@pytest.mark.parametrize('size', [0.3, 30.0])
@pytest.mark.parametrize('unit', ['mm', ''])
def test_movements_of_many_targets_do_not_smear(size: float, unit: str) -> None:
    """A third of the targets move together, by up to a tenth of the object."""
    steps = {name: (size, -0.8 * size, 0.3 * size) for name in ('3', '5', '8', '11')}
    found = compare(measured(1, unit=unit), measured(2, steps, unit=unit))
    assert set(found.moved) == set(steps)
    assert found.warnings == ()


def test_variances_that_differ_are_said_and_kept_apart() -> None:
    first, second = measured(1), measured(2)
    worse = replace(second, sigma0=3 * second.sigma0)
    found = compare(first, worse)
    assert not found.variances.equal
    assert found.variances.ratio == pytest.approx((worse.sigma0 / first.sigma0) ** 2)
    assert 'variances of unit weight differ' in found.warnings[0]
    assert found.tests[0].redundancy == 79
    assert found.movements[5].sigma > compare(first, second).movements[5].sigma


def test_covariances_that_are_scaled_already_give_the_same() -> None:
    first, second = measured(1), measured(2)
    scaled = replace(first, covariance=first.covariance * first.sigma0**2, scaled=True)
    expected, found = compare(first, second), compare(scaled, second)
    assert found.tests[0].statistic == pytest.approx(expected.tests[0].statistic)


def test_targets_of_one_epoch_only_are_named() -> None:
    first, second = measured(1), measured(2)
    found = compare(first.chosen(first.names[:10]), second.chosen(second.names[2:]))
    assert [it.name for it in found.movements] == list(first.names[2:10])
    assert (found.only_first, found.only_second) == (('1', '2'), ('11', '12'))


def test_three_targets_tell_that_something_moved_but_not_what() -> None:
    first, second = measured(1), measured(2, {'5': (3.0, -2.0, 1.0)})
    found = compare(first, second, stable=['3', '5', '9'])
    assert (found.congruent, found.moved) == (False, ())
    assert 'No datum is left' in found.warnings[0]


def test_when_most_targets_moved_no_datum_is_left() -> None:
    source = np.random.default_rng(3)
    steps = {str(index): source.normal(0, 2, 3) for index in range(1, 9)}
    found = compare(measured(1), measured(2, steps))
    assert (found.congruent, found.moved) == (False, ())
    assert 'No datum is left' in found.warnings[0]


def exact(names: str = 'ABCDEF', **changes: object) -> MeasuredPoints:
    xyz = np.random.default_rng(1).uniform(0, 1, (len(names), 3))
    points = MeasuredPoints(tuple(names), xyz, 1e-6 * np.eye(3 * len(names)), 1.0, 50, 'm')
    return replace(points, **changes)


@pytest.mark.parametrize(
    ('first', 'second', 'options', 'text'),
    [
        (exact('ABCD'), exact('EFGH'), {}, '0 common targets'),
        (exact('ABCD'), exact('CDEF'), {}, '2 common targets'),
        (exact(), exact(unit='mm'), {}, "unit is 'm' in the first and 'mm' in the second"),
        (exact(), exact(unit=''), {'free_scale': False}, 'free_scale is False'),
        (exact(redundancy=0), exact(), {}, 'redundancy of the first epoch is 0'),
        (
            exact(),
            exact(covariance=np.zeros((18, 18))),
            {},
            'covariance of the second epoch is zero',
        ),
        (exact(), exact(), {'stable': 'AB'}, '2 stable targets'),
        (exact(), exact(), {'stable': 'ABZ'}, 'stable targets Z are not in both epochs'),
        (exact(), exact(), {'level': 0.0}, 'level is 0'),
        (exact(), exact(xyz=np.outer(np.arange(6.0), (1, 2, 3))), {}, 'are on a line'),
    ],
)
def test_what_cannot_be_compared_is_named(
    first: MeasuredPoints, second: MeasuredPoints, options: dict, text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        compare(first, second, **options)


def test_a_covariance_that_is_singular_beyond_its_datum_is_refused() -> None:
    fixed = exact().covariance.copy()
    fixed[:6] = fixed[:, :6] = 0  # two targets without any error
    with pytest.raises(ValueError, match='singular beyond the datum'):
        compare(exact(covariance=fixed), exact(covariance=fixed))
