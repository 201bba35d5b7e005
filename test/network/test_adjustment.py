"""The adjustment of simulated networks: values, covariances, datum, wrong IDs, bad input."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
import pytest

from ahf_ros.network import image_points
from ahf_ros.network.adjustment import adjust
from ahf_ros.network.camera import PARAMETERS, project
from ahf_ros.network.datum import Datum, movements
from ahf_ros.network.network import CameraView, ControlPoint, Network, ScaleBar
from ahf_ros.network.refinement import refine
from ahf_ros.network.similarity import similarity_between
from ahf_ros.network.solution import NetworkState
from benchmarks.network_errors import RELEASED, counted, coverage
from support.camcal import dbat, folder, in_dbat_units, solve
from support.network_scenes import Field, approximate, simulate

pytest.importorskip('scipy')
FIELD = Field(photographs=10, targets=20)

Scene: TypeAlias = tuple[Network, NetworkState, NetworkState]
"""A network, its true values, and others to start from."""


@pytest.fixture
def scene() -> Scene:
    random = np.random.default_rng(3)
    network, truth = simulate(FIELD, random)
    return network, truth, approximate(truth, random)


def named(
    scene: Scene, names: Iterable[str], scale: float = 1.0, offset: float = 0.0
) -> tuple[ControlPoint, ...]:
    """Return control points at true coordinates, in a scale and with an offset."""
    _, truth, _ = scene
    return tuple(
        ControlPoint(name, scale * truth.points[int(name)] + offset, np.zeros((3, 3)))
        for name in names
    )


def distance(points: np.ndarray, first: int, second: int) -> float:
    return float(np.linalg.norm(points[first] - points[second]))


def test_refine_brings_values_near_the_truth(scene: Scene) -> None:
    network, truth, start = scene
    refined = refine(network, start, ('f', 'k1', 'k2', 'cx', 'cy'))
    movement = similarity_between(refined.points, truth.points)
    error = movement.moved(refined.points) - truth.points
    assert np.abs(error).max() < 3e-4
    assert refined.used.mean() > 0.99


def test_stages_release_what_is_significant(scene: Scene) -> None:
    network, truth, start = scene
    solution = adjust(network, start)
    assert {'f', 'k1', 'cx', 'p1'} <= set(solution.released[0])
    free = np.isin(PARAMETERS, solution.released[0])
    sigma = np.sqrt(np.diag(solution.camera_covariances[0]))
    assert (sigma[free] > 0).all()
    assert (sigma[~free] == 0).all()
    error = (solution.state.calibrations[0] - truth.calibrations[0])[:3]
    assert (np.abs(error) < 5 * np.maximum(sigma[:3], 0.5)).all()


def test_covariances_are_those_of_the_whole_inverse(scene: Scene) -> None:
    """Poses eliminated or not, the inverse is the same: here by the dense Jacobian."""
    network, _, start = scene
    solution = adjust(network, start, release=('f',), test=False)
    numbers, poses = 3 * len(network.targets), len(network.photographs)
    free = np.isin(PARAMETERS, ['f'])[None]
    layout = image_points.lay_out(network, solution.state, solution.state.used, free)
    design = image_points.linearise(layout, solution.state)
    whole = np.zeros((len(layout.xy), 2, numbers + 1 + 6 * poses))
    for row in range(len(layout.xy)):
        point, image = 3 * layout.point[row], numbers + 1 + 6 * layout.photograph[row]
        whole[row, :, point : point + 3] = design.by_point[row]
        whole[row, :, numbers] = design.by_calibration[row, :, 0]
        whole[row, :, image : image + 6] = design.by_pose[row]
    whole = whole.reshape(-1, whole.shape[2])
    border = np.zeros((whole.shape[1], 7))
    border[:numbers] = movements(solution.state.points)
    matrix = np.block([[whole.T @ whole, border], [border.T, np.zeros((7, 7))]])
    size = 1 / np.sqrt(np.maximum(np.diag(matrix), 1))
    inverse = size[:, None] * np.linalg.inv(size[:, None] * matrix * size) * size
    factor = solution.sigma0**2 if solution.scaled else 1
    expected = factor * inverse
    close = {'rtol': 1e-5, 'atol': 1e-6 * expected[:numbers, :numbers].max()}
    np.testing.assert_allclose(
        solution.covariance_of_points, expected[:numbers, :numbers], **close
    )
    np.testing.assert_allclose(
        solution.camera_covariances[0][0, 0], expected[numbers, numbers], rtol=1e-5
    )
    first = expected[numbers + 1 : numbers + 7, numbers + 1 : numbers + 7]
    np.testing.assert_allclose(solution.pose_covariances[0], first, rtol=1e-4, atol=1e-13)


@pytest.mark.parametrize('planar', [False, True])
def test_ellipsoids_hold_the_truth(planar: bool) -> None:
    held = []
    for run in range(12):
        random = np.random.default_rng([4, run])
        network, truth = simulate(replace(FIELD, planar=planar), random)
        start = approximate(truth, random)
        held.append(coverage(adjust(network, start, release=RELEASED, test=False), truth))
    assert 0.88 < np.mean(held) <= 0.99


def test_wrong_ids_and_a_moved_target_are_found() -> None:
    wrong, accepted, good, kept, found = counted(Field(16, 40, each=30), np.random.default_rng(5))
    assert wrong > 20
    assert accepted == 0
    assert kept >= 0.99 * good
    assert found


def test_every_rejection_says_what_and_why(scene: Scene) -> None:
    network, _, start = scene
    observations = network.observations
    row = int(np.flatnonzero(observations.point == 7)[0])
    point = observations.point.copy()
    keep = ~((observations.photograph == observations.photograph[row]) & (point == 9))
    point[row] = 9
    wrong = replace(
        observations,
        **{
            name: values[keep]
            for name, values in {
                'photograph': observations.photograph,
                'point': point,
                'xy': observations.xy,
                'covariance': observations.covariance,
            }.items()
        },
    )
    start = replace(start, used=start.used[keep])
    solution = adjust(replace(network, observations=wrong), start)
    (rejection,) = solution.rejected
    assert rejection.photograph == network.photographs[observations.photograph[row]]
    assert rejection.target == '9'
    assert rejection.xy == pytest.approx(observations.xy[row])
    assert rejection.reason == 'wrong ID: the place of target 7'
    assert rejection.normalised_residual > 4.7


def test_bars_give_scale_and_redundancy(scene: Scene) -> None:
    network, truth, start = scene
    bars = tuple(
        ScaleBar((str(a), str(b)), 500 * distance(truth.points, a, b), 0.01)
        for a, b in ((0, 1), (2, 3))
    )
    without = adjust(network, start, release=('f', 'k1', 'k2'), test=False)
    solution = adjust(
        replace(network, bars=bars, unit='mm'), start, release=('f', 'k1', 'k2'), test=False
    )
    assert solution.redundancy == without.redundancy + 1  # two bars, one degree of freedom less
    assert distance(solution.state.points, 0, 1) == pytest.approx(bars[0].length, abs=0.05)
    exact = (replace(bars[0], sigma=0.0),)
    solution = adjust(replace(network, bars=exact), start, release=('f',), test=False)
    assert distance(solution.state.points, 0, 1) == pytest.approx(bars[0].length, abs=1e-8)


@pytest.mark.parametrize('planar', [False, True])
@pytest.mark.parametrize('sigma', [0.0, 1e-4])
def test_a_known_field_calibrates_its_camera(planar: bool, sigma: float) -> None:
    random = np.random.default_rng(12)
    network, truth = simulate(replace(FIELD, planar=planar), random)
    control = tuple(
        ControlPoint(name, place + random.normal(0, sigma, 3), sigma**2 * np.eye(3))
        for name, place in zip(network.targets, truth.points, strict=True)
    )
    network = replace(network, control=control, unit='m')
    solution = adjust(network, approximate(truth, random))
    error = solution.state.calibrations[0] - truth.calibrations[0]
    deviations = np.sqrt(np.diag(solution.camera_covariances[0]))
    assert (np.abs(error) < 3.5 * deviations).all()
    assert deviations[0] < 1
    assert not solution.suspects
    assert np.isfinite(solution.measured_points.covariance).all()


def test_photographs_without_rolls_know_less_of_the_principal_point_and_say_so() -> None:
    errors, deviations = [], []
    for rolled in (True, False):
        random = np.random.default_rng(13)
        network, truth = simulate(replace(FIELD, rolled=rolled), random)
        solution = adjust(network, approximate(truth, random))
        errors.append(solution.state.calibrations[0, 1:3] - truth.calibrations[0, 1:3])
        deviations.append(np.sqrt(np.diag(solution.camera_covariances[0])[1:3]))
    assert (np.abs(errors) < 3.5 * np.array(deviations)).all()
    assert (deviations[1] > 1.3 * deviations[0]).all()


def test_heavy_tails_are_no_reason_to_reject() -> None:
    kept, expected = 0, 0.0
    for run in range(3):
        random = np.random.default_rng([14, run])
        network, truth = simulate(Field(16, 40), random)
        seen = network.observations
        exact = project(
            truth.calibrations[0],
            truth.rotations[seen.photograph],
            truth.positions[seen.photograph],
            truth.points[seen.point],
        )
        heavier = np.sqrt(5 / random.chisquare(5, len(exact)))[:, None]
        xy = exact + heavier * (seen.xy - exact)
        start = approximate(truth, random, 0.005)
        solution = adjust(replace(network, observations=replace(seen, xy=xy)), start)
        kept += solution.state.used.mean() / 3
        expected += solution.expected_rejections
        assert not any('at two places' in text for text in solution.warnings)
    assert kept > 0.99
    assert expected > 1


def test_fixed_control_points_stay(scene: Scene) -> None:
    network, truth, start = scene
    control = named(scene, '0369', scale=1000, offset=5.0)
    solution = adjust(replace(network, control=control), start, release=RELEASED, test=False)
    for point in control:
        place = int(point.name)
        np.testing.assert_allclose(solution.state.points[place], point.xyz, atol=1e-8)
        block = solution.covariance_of_points[3 * place : 3 * place + 3]
        np.testing.assert_allclose(block, 0, atol=1e-12)
    error = solution.state.points - (1000 * truth.points + 5)
    assert np.abs(error).max() < 1


def test_image_points_that_fit_badly_are_a_warning(scene: Scene) -> None:
    network, _, start = scene
    seen = network.observations
    small = replace(network, observations=replace(seen, covariance=seen.covariance / 100))
    (warning,) = adjust(small, start, release=RELEASED, test=False).warnings
    assert re.match('sigma0 is (9|10)[.].*: image points fit so many times worse', warning)
    assert adjust(network, start, release=RELEASED, test=False).warnings == ()
    assert any('sigma0 is' in it for it in adjust(small, start, release=RELEASED).warnings)


def test_three_fixed_targets_are_the_axes(scene: Scene) -> None:
    network, _, start = scene
    solution = adjust(network, start, Datum('fixed', ('0', '1', '2')), ('f',), test=False)
    points = solution.state.points
    np.testing.assert_allclose(points[0], 0, atol=1e-12)
    np.testing.assert_allclose(points[1, 1:], 0, atol=1e-12)
    assert abs(points[2, 2]) < 1e-12
    inner = adjust(network, start, release=('f',), test=False)
    assert solution.redundancy == inner.redundancy
    assert solution.sigma0 == pytest.approx(inner.sigma0, rel=1e-6)


def bars_of(
    truth: NetworkState, factors: Sequence[float], sigma: float = 0.0002
) -> tuple[ScaleBar, ...]:
    """Return bars between targets 0-1, 2-3 and so on, longer than they are by factors."""
    ends = [(2 * place, 2 * place + 1) for place in range(len(factors))]
    return tuple(
        ScaleBar((str(a), str(b)), factor * distance(truth.points, a, b), sigma)
        for (a, b), factor in zip(ends, factors, strict=True)
    )


def test_a_bar_in_another_unit_is_refused(scene: Scene) -> None:
    network, truth, start = scene
    bars = bars_of(truth, (1.0, 1000.0, 1.0))
    with pytest.raises(ValueError, match=r'2-3 is .* times as long as the other.* 1000:'):
        adjust(replace(network, bars=bars), start)


def test_bars_in_other_units_than_control_are_named(scene: Scene) -> None:
    network, truth, start = scene
    bar = ScaleBar(('0', '1'), 1000 * distance(truth.points, 0, 1), 0.1)
    with pytest.raises(ValueError, match=r'0-1 is .* control points say; a factor of 1000'):
        adjust(replace(network, bars=(bar,), control=named(scene, '0369')), start)


@pytest.mark.parametrize('factor', [1.01, 1.5])
def test_a_wrong_bar_is_named_and_no_ray_is_lost(scene: Scene, factor: float) -> None:
    network, truth, start = scene
    network = replace(network, bars=bars_of(truth, (1.0, factor, 1.0, 1.0)), unit='m')
    solution = adjust(network, start)
    (suspect,) = solution.suspects
    assert (suspect.name, suspect.verdict) == ('scale bar 2-3', 'left out')
    assert suspect.gap == pytest.approx((factor - 1) * distance(truth.points, 2, 3), abs=0.002)
    assert suspect.probability < 1e-6
    assert any(text.startswith('scale bar 2-3 contradicts the rest') for text in solution.warnings)
    assert not solution.rejected
    assert distance(solution.state.points, 0, 1) == pytest.approx(
        distance(truth.points, 0, 1), abs=0.002
    )
    kept = adjust(network, start, keep_suspects=True)
    assert [it.verdict for it in kept.suspects] == ['kept']
    assert not kept.rejected


def test_of_two_bars_that_contradict_both_are_named(scene: Scene) -> None:
    network, truth, start = scene
    network = replace(network, bars=bars_of(truth, (1.0, 1.01)), unit='m')
    solution = adjust(network, start)
    (suspect,) = solution.suspects
    assert suspect.verdict == 'unclear'
    assert {suspect.name, *suspect.rivals} == {'scale bar 0-1', 'scale bar 2-3'}
    scale = distance(solution.state.points, 0, 1) / distance(truth.points, 0, 1)
    assert 1 < scale < 1.01
    sigma = solution.network.bars[0].sigma / distance(truth.points, 0, 1)
    assert sigma > 0.002  # what they contradict each other by is in the covariance


def test_bars_that_all_contradict_each_other_are_all_named(scene: Scene) -> None:
    network, truth, start = scene
    bars = bars_of(truth, (1.0, 1.01, 1.02, 0.99, 0.985, 1.015))
    solution = adjust(replace(network, bars=bars, unit='m'), start)
    (suspect,) = solution.suspects
    assert len(suspect.rivals) == 5
    assert 0.003 < solution.network.bars[0].sigma < 0.03
    assert not solution.rejected


def test_one_bar_cannot_be_checked(scene: Scene) -> None:
    network, truth, start = scene
    network = replace(network, bars=bars_of(truth, (1.01,)), unit='m')
    solution = adjust(network, start)
    assert not solution.suspects
    assert any('0-1 is believed: nothing checks it' in text for text in solution.warnings)


@pytest.mark.parametrize(('count', 'said'), [(2, True), (3, False)])
def test_bars_that_cannot_tell_which_is_wrong_are_said(
    scene: Scene, count: int, said: bool
) -> None:
    network, truth, start = scene
    ends = [(0, 1), (2, 3), (4, 5)][:count]
    bars = tuple(ScaleBar((str(a), str(b)), distance(truth.points, a, b), 0.001) for a, b in ends)
    solution = adjust(replace(network, bars=bars, unit='m'), start)
    assert any('too few to tell which one is wrong' in it for it in solution.warnings) == said


def test_a_check_bar_that_fails_is_a_suspect(scene: Scene) -> None:
    network, truth, start = scene
    used, check = bars_of(truth, (1.0, 1.01))
    bars = (used, replace(check, check=True))
    solution = adjust(replace(network, bars=bars, unit='m'), start)
    assert [(it.name, it.verdict) for it in solution.suspects] == [('scale bar 2-3', 'failed')]
    assert any(text.startswith('check failed: scale bar 2-3') for text in solution.warnings)


@pytest.mark.parametrize('sigma', [0.0, 0.001, 0.1])
def test_a_wrong_control_point_is_named(scene: Scene, sigma: float) -> None:
    network, _, start = scene
    control = tuple(
        replace(it, covariance=sigma**2 * np.eye(3))
        for it in named(scene, '01234567', scale=100, offset=5.0)
    )
    wrong = replace(control[3], xyz=control[3].xyz + np.array([0, 2.0, 0]))
    network = replace(network, control=(*control[:3], wrong, *control[4:]), unit='m')
    solution = adjust(network, start)
    assert [(it.name, it.verdict) for it in solution.suspects] == [('control point 3', 'left out')]
    assert solution.suspects[0].gap == pytest.approx(2, abs=0.3)
    assert not solution.rejected


def test_control_points_without_sigma_get_the_one_that_fits(scene: Scene) -> None:
    network, _, start = scene
    random = np.random.default_rng(8)
    control = tuple(
        replace(it, xyz=it.xyz + random.normal(0, 0.02, 3)) for it in named(scene, '01234567')
    )
    solution = adjust(replace(network, control=control, unit='m'), start)
    assert not solution.suspects
    assert not solution.rejected
    (warning,) = [text for text in solution.warnings if 'contradicts the photographs' in text]
    fits = float(re.search(r'one of ([0-9.]+) m is used', warning)[1])
    assert 0.012 < fits < 0.03


def test_a_bar_whose_end_is_not_seen_is_not_used(scene: Scene) -> None:
    network, _, start = scene
    network = replace(network, bars=(ScaleBar(('0', 'nowhere'), 1.0, 0.001),))
    solution = adjust(network, start, release=('f',))
    assert 'scale bar 0-nowhere: nowhere is in no two photographs' in solution.warnings[0]


def test_mirrored_and_exchanged_control_points_are_named(scene: Scene) -> None:
    network, _, start = scene
    control = named(scene, '012345')
    mirrored = tuple(replace(point, xyz=point.xyz * [1, 1, -1]) for point in control)
    with pytest.raises(ValueError, match='control points are mirrored'):
        adjust(replace(network, control=mirrored), start)
    exchanged = (
        replace(control[0], xyz=control[1].xyz),
        replace(control[1], xyz=control[0].xyz),
        *control[2:],
    )
    with pytest.raises(ValueError, match='0 and 1 are exchanged'):
        adjust(replace(network, control=exchanged), start)
    in_millimetres = (replace(control[0], xyz=1000 * control[0].xyz), *control[1:])
    with pytest.raises(ValueError, match=r'0 is in another unit \(factor 1000\)'):
        adjust(replace(network, control=in_millimetres), start)


@pytest.mark.parametrize(
    ('field', 'change', 'message'),
    [
        ('xy', np.nan, 'xy .* of target 0 in 0.jpg: expected finite'),
        ('covariance', np.nan, 'covariance .* of target 0 in 0.jpg: expected finite'),
        ('covariance', 0.0, 'covariance .* of target 0 in 0.jpg: expected symmetric positive'),
        ('covariance', 1.0, 'covariance .* of target 0 in 0.jpg: expected symmetric positive'),
    ],
)
def test_bad_observations_are_named(scene: Scene, field: str, change: float, message: str) -> None:
    network, _, start = scene
    values = getattr(network.observations, field).copy()
    first = np.flatnonzero(network.observations.point == 0)[0]
    values[first] = change
    bad = replace(network, observations=replace(network.observations, **{field: values}))
    with pytest.raises(ValueError, match=message):
        adjust(bad, start)


def test_a_target_twice_in_a_photograph_is_refused(scene: Scene) -> None:
    network, _, start = scene
    point = network.observations.point.copy()
    point[1] = point[0]
    bad = replace(network, observations=replace(network.observations, point=point))
    with pytest.raises(ValueError, match='expected each target once in a photograph'):
        adjust(bad, start)


@pytest.mark.parametrize(
    ('knowledge', 'message'),
    [
        ({'bars': (ScaleBar(('0', '0'), 1.0, 0.1),)}, 'both ends are one target'),
        ({'bars': (ScaleBar(('0', '1'), -1.0, 0.1),)}, 'length -1.0, expected a positive'),
        ({'bars': (ScaleBar(('0', '1'), 1.0, np.nan),)}, 'sigma nan, expected'),
        (
            {'control': (ControlPoint('0', np.zeros(3), -np.eye(3)),)},
            'control point 0: covariance .* without negative variances',
        ),
    ],
)
def test_bad_knowledge_is_named(scene: Scene, knowledge: dict[str, Any], message: str) -> None:
    network, _, start = scene
    with pytest.raises(ValueError, match=message):
        adjust(replace(network, **knowledge), start)


def test_datum_needs_three_seen_targets(scene: Scene) -> None:
    network, _, start = scene
    with pytest.raises(ValueError, match='0, 1 hold no frame'):
        adjust(network, start, Datum('inner', ('0', '1')))
    with pytest.raises(ValueError, match='datum: nowhere is in no two photographs'):
        adjust(network, start, Datum('inner', ('0', '1', 'nowhere')))


def test_knowledge_without_variance_must_not_repeat_itself(scene: Scene) -> None:
    network, truth, start = scene
    bar = ScaleBar(('0', '3'), distance(truth.points, 0, 3), 0.0)
    network = replace(network, bars=(bar,), control=named(scene, '0369'))
    with pytest.raises(ValueError, match='control points without variance repeat each other'):
        adjust(network, start, release=('f',), test=False)


def test_targets_on_a_line_are_refused(scene: Scene) -> None:
    network, truth, _ = scene
    observations = network.observations
    points = np.linspace(-1, 1, 20)[:, None] * [1, 0.5, 0.2]
    xy = project(
        truth.calibrations[0],
        truth.rotations[observations.photograph],
        truth.positions[observations.photograph],
        points[observations.point],
    )
    network = replace(network, observations=replace(observations, xy=xy))
    with pytest.raises(ValueError, match='on a line'):
        adjust(network, replace(truth, points=points))


def test_photographs_of_a_plane_straight_on_do_not_determine_the_focal_length() -> None:
    random = np.random.default_rng(6)
    network, truth = simulate(replace(FIELD, planar=True), random)
    observations = network.observations
    rotations = np.tile(np.diag([1.0, -1.0, -1.0]), (10, 1, 1))
    positions = np.column_stack([random.uniform(-0.3, 0.3, (10, 2)), np.full(10, 4.0)])
    calibration = truth.calibrations[0]
    xy = project(
        calibration,
        rotations[observations.photograph],
        positions[observations.photograph],
        truth.points[observations.point],
    )
    xy += random.normal(0, 0.05, xy.shape)
    network = replace(network, observations=replace(observations, xy=xy))
    start = replace(truth, rotations=rotations, positions=positions)
    solution = adjust(network, start)
    assert solution.camera_covariances[0][0, 0] > (0.03 * solution.state.calibrations[0, 0]) ** 2
    assert any('do not determine the focal length' in text for text in solution.warnings)


def test_a_focal_length_that_was_given_wrongly_is_named(scene: Scene) -> None:
    network, truth, start = scene
    for given, named in ((1280.0, True), (3150.0, False)):
        view = CameraView('camera', 4000, 3000, given)
        solution = adjust(replace(network, cameras=(view,)), start)
        assert solution.state.calibrations[0, 0] == pytest.approx(truth.calibrations[0, 0], abs=1)
        text = 'focal length is 3200 px, and 1280 px was given'
        assert any(text in it for it in solution.warnings) == named


def test_a_fixed_camera_stays(scene: Scene) -> None:
    network, truth, start = scene
    view = CameraView('camera', 4000, 3000, calibration=truth.calibrations[0], fixed=True)
    start = replace(start, calibrations=truth.calibrations.copy())
    solution = adjust(replace(network, cameras=(view,)), start)
    np.testing.assert_array_equal(solution.state.calibrations, truth.calibrations)
    assert not solution.camera_covariances[0].any()


@pytest.mark.skipif(folder() is None, reason='AHF_NETWORKS does not name the networks')
def test_camcal_is_as_dbat_has_it() -> None:
    solution = solve(folder())
    values, deviations = in_dbat_units(solution)
    theirs, their_deviations = dbat(folder())
    assert (np.abs(values - theirs) < 0.2 * their_deviations).all()
    np.testing.assert_allclose(deviations, their_deviations, rtol=0.02)
    assert solution.sigma0 == pytest.approx(1.6148, rel=1e-3)
