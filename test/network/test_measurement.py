"""Distances, deviations and errors of calibrated lengths."""

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.network.alignment import best_fit
from ahf_ros.network.datum import s_transform
from ahf_ros.network.measurement import (
    CalibratedLength,
    PermissibleError,
    deviations,
    distances,
    length_errors,
)
from ahf_ros.network.points import MeasuredPoints
from support.epochs import measured


def test_a_distance_has_the_standard_deviation_of_samples() -> None:
    points = measured(1)
    (found,) = distances(points, [('3', '7')])
    source = np.random.default_rng(4)
    rows = points.chosen(['3', '7'])
    samples = source.multivariate_normal(rows.xyz.ravel(), rows.covariance, 100_000)
    lengths = np.linalg.norm(samples[:, :3] - samples[:, 3:], axis=1)
    assert found.length == pytest.approx(lengths.mean(), abs=1e-3)
    assert found.sigma == pytest.approx(lengths.std(), rel=0.02)


def test_the_standard_deviation_of_a_distance_depends_on_no_datum() -> None:
    points = measured(1)
    weights = np.zeros(12)
    weights[[2, 5, 8]] = 1
    other = s_transform(points.xyz, points.covariance, weights, scale=False)[1]
    before, after = (distances(it) for it in (points, replace(points, covariance=other)))
    assert len(before) == 66
    np.testing.assert_allclose([it.sigma for it in after], [it.sigma for it in before], rtol=1e-6)
    np.testing.assert_allclose(before[0].sigma, 0.005, rtol=1e-3)  # the scale bar
    diagonal = np.diag(np.diag(points.covariance))
    wrong = distances(replace(points, covariance=diagonal))
    assert max(a.sigma / b.sigma for a, b in zip(wrong, before, strict=True)) > 2


def test_deviations_are_measured_minus_nominal() -> None:
    points = measured(1)
    nominal = dict(zip(points.names, points.xyz, strict=True))
    nominal['4'] = nominal['4'] - (0.0, 0.0, 1.0)
    del nominal['9']
    others = [name for name in nominal if name != '4']
    found = deviations(best_fit(points, nominal, on=others), nominal)
    assert [it.name for it in found] == [name for name in points.names if name != '9']
    moved = next(it for it in found if it.name == '4')
    np.testing.assert_allclose(moved.xyz, (0, 0, 1), atol=1e-9)
    assert (moved.used, moved.distance) == (False, pytest.approx(1))
    np.testing.assert_allclose(moved.sigmas**2, np.diag(moved.covariance))
    assert sum(it.used for it in found) == 10


def standard() -> tuple[MeasuredPoints, list[CalibratedLength]]:
    """Return the ends of seven lines with five lengths each, without errors."""
    places = np.linspace(0, 1, 6)
    corners = [((0, 0, 0), (1, 1, 1)), ((1, 0, 0), (0, 1, 1)), ((0, 1, 0), (1, 0, 1))]
    corners += [((0, 0, 1), (1, 1, 0)), ((0, 0, 0), (1, 0, 0)), ((0, 0, 0), (0, 1, 0))]
    corners += [((0, 0, 0), (0, 0, 1))]
    names, xyz, lengths = [], [], []
    for line, (first, last) in enumerate(np.array(corners, float) * (2000, 2000, 1500)):
        for index, place in enumerate(places):
            names.append(f'{line}{index}')
            xyz.append(first + place * (last - first))
        for index in range(1, 6):
            length = float(np.linalg.norm(last - first) * places[index])
            lengths.append(
                CalibratedLength((f'{line}0', names[-6 + index]), length, 0.0, f'{line}')
            )
    covariance = 1e-4 * np.eye(3 * len(names))
    return MeasuredPoints(tuple(names), np.array(xyz), covariance, 1.0, 100, 'mm'), lengths


def test_a_length_standard_fulfils_the_guideline() -> None:
    points, lengths = standard()
    found = length_errors(points, lengths, PermissibleError(0.05, 100_000))
    assert (found.remarks, found.passed, len(found.errors)) == ((), True, 35)
    assert abs(found.largest.error) < 1e-9
    assert found.errors[0].sigma == pytest.approx(0.01 * np.sqrt(2))
    longest = max(found.errors, key=lambda it: it.calibrated)
    assert longest.permissible == pytest.approx(0.05 + longest.calibrated / 100_000)


def test_a_length_error_is_measured_minus_calibrated() -> None:
    points, lengths = standard()
    lengths[3] = replace(lengths[3], length=lengths[3].length - 0.1, sigma=0.03)
    found = length_errors(points, lengths, PermissibleError(0.05))
    assert found.largest.error == pytest.approx(0.1)
    assert (found.largest.within, found.passed) == (False, False)
    assert found.largest.sigma == pytest.approx(np.hypot(0.03, 0.01 * np.sqrt(2)))
    assert length_errors(points, lengths).passed is None


def test_lengths_that_do_not_fulfil_the_guideline_are_named() -> None:
    points, lengths = standard()
    few = length_errors(points, lengths[1:30])
    assert few.remarks == (
        'Lengths are in 6 named lines, VDI/VDE 2634-1 wants 7.',
        'Line 0 has 4 lengths, VDI/VDE 2634-1 wants 5.',
    )
    short = length_errors(points, [it for it in lengths if it.length < 2000])
    assert 'of the space diagonal of the targets' in short.remarks[-1]


def test_a_permissible_error_has_a_limit() -> None:
    permissible = PermissibleError(0.02, 50_000, 0.05)
    assert [permissible.of(it) for it in (0, 1000, 5000)] == pytest.approx([0.02, 0.04, 0.05])
    for wrong in ((-1.0,), (np.nan,), (np.inf,), (0.1, 0.0), (0.1, 10.0, -1.0)):
        with pytest.raises(ValueError, match='permissible error'):
            PermissibleError(*wrong)


def test_what_cannot_be_measured_is_named() -> None:
    points, lengths = standard()
    with pytest.raises(ValueError, match='targets Z are not among the measured'):
        distances(points, [('00', 'Z')])
    with pytest.raises(ValueError, match='in one place'):
        distances(points, [('00', '40')])
    with pytest.raises(ValueError, match='no calibrated lengths'):
        length_errors(points, [])
    with pytest.raises(ValueError, match='no scale'):
        length_errors(replace(points, unit=''), lengths)
    with pytest.raises(ValueError, match='length of 00 and 01 is -1'):
        length_errors(points, [replace(lengths[0], length=-1.0)])


@pytest.mark.parametrize(
    ('changes', 'text'),
    [
        ({'names': ('A', 'A')}, "names have 'A' twice"),
        ({'xyz': np.zeros((2, 2))}, r'xyz has the shape \(2, 2\)'),
        (
            {'xyz': np.array([[0.0, np.nan, 0], [1, 1, 1]])},
            'xyz has 1 entries that are no numbers',
        ),
        ({'covariance': np.zeros((0, 0))}, r'covariance has the shape \(0, 0\)'),
        ({'covariance': np.full((6, 6), np.nan)}, 'covariance has 36 entries'),
        ({'covariance': np.triu(np.ones((6, 6)))}, 'covariance is not symmetric'),
        ({'covariance': -np.eye(6)}, 'covariance has the eigenvalue -1'),
        ({'sigma0': 0.0}, 'sigma0 is 0'),
        ({'redundancy': -1}, 'redundancy is -1'),
    ],
)
def test_points_that_are_none_are_named(changes: dict, text: str) -> None:
    sound = {'names': ('A', 'B'), 'xyz': np.eye(3)[:2], 'covariance': np.eye(6)}
    with pytest.raises(ValueError, match=text):
        MeasuredPoints(**(sound | changes))
