"""Deviations from what is known, and what to photograph next."""

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.network.deviations import bar_deviations, control_deviations
from ahf_ros.network.solution import Solution
from ahf_ros.network.strength import rays_of, semi_axes, weaknesses
from ahf_ros.network.views import largest_angles
from support.networks import known, solution


def used_by(number: int, photographs: list[int]) -> Solution:
    """Return the network with one target that only some photographs show."""
    whole = solution()
    seen = whole.network.observations
    used = (seen.point != number) | np.isin(seen.photograph, photographs)
    return replace(whole, state=replace(whole.state, used=used))


def advice(of: Solution, part: str) -> list[str]:
    return [it.remedy for it in weaknesses(of) if part in it.remedy]


def test_rays_and_angles_are_those_of_used_observations() -> None:
    weak = used_by(3, [1, 2])
    assert rays_of(weak).tolist() == [6, 6, 6, 2, *[6] * 8]
    rays = weak.state.positions[[1, 2]] - weak.state.points[3]
    first, second = rays / np.linalg.norm(rays, axis=1)[:, None]
    angles = largest_angles(weak.network, weak.state)
    assert angles[3] == pytest.approx(np.arccos(first @ second))
    alone = used_by(3, [1])
    assert np.isnan(largest_angles(alone.network, alone.state)[3])


def test_semi_axes_are_those_of_the_ellipsoid() -> None:
    whole = solution()
    block = whole.covariance_of_points[9:12, 9:12]
    np.testing.assert_allclose(semi_axes(whole)[3] ** 2, np.linalg.eigvalsh(block)[::-1])


def test_weak_targets_are_named() -> None:
    assert advice(used_by(3, [0, 5]), 'Photograph 4 again') != []
    assert advice(used_by(3, [1, 2, 3]), 'Photograph 4 from further') == []
    assert advice(used_by(3, [1, 2]), 'Photograph 4 from further') != []
    whole = solution()
    assert advice(whole, 'Photograph') == []
    covariance = whole.covariance_of_points.copy()
    covariance[9:12] *= 10
    covariance[:, 9:12] *= 10
    weak = replace(whole, covariance_of_points=covariance)
    assert advice(weak, 'Photograph 4 more often') != []
    points = whole.state.points.copy()
    points[3] = np.nan
    lost = replace(whole, state=replace(whole.state, points=points))
    assert advice(lost, 'Photograph 4 from two sides') != []


def test_weak_photographs_are_named() -> None:
    whole = solution()
    positions = whole.state.positions.copy()
    positions[2] = np.nan
    lost = replace(whole, state=replace(whole.state, positions=positions))
    assert advice(lost, 'view_2.jpg: no pose') != []
    seen = whole.network.observations
    used = (seen.photograph != 1) | (seen.point < 5)
    few = replace(whole, state=replace(whole.state, used=used))
    assert advice(few, 'view_1.jpg: fewer than 6 targets') != []


def test_photographs_that_are_not_rolled_are_named() -> None:
    whole = solution()
    assert advice(whole, 'rolled') == []
    rotations = whole.state.rotations[::2]
    assert len(rotations) == 3
    upright = np.repeat(rotations, 2, axis=0)
    same = replace(whole, state=replace(whole.state, rotations=upright))
    assert advice(same, 'no photograph is rolled') != []
    (view,) = whole.network.cameras
    fixed = replace(same.network, cameras=(replace(view, fixed=True),))
    assert advice(replace(same, network=fixed), 'no photograph is rolled') == []


def test_images_whose_corners_are_empty_are_named() -> None:
    assert advice(solution(), 'targets reach only 31 % of the way to the corners') != []


def test_a_network_without_scale_or_checks_is_told_so() -> None:
    whole = solution(unit='')
    assert advice(whole, 'has no scale') != []
    assert advice(solution(), 'as a check') != []
    checked = replace(solution(), network=known(solution().network))
    assert advice(checked, 'scale') == []


def test_deviations_are_computed_minus_known() -> None:
    whole = replace(solution(), network=known(solution().network))
    used, check = bar_deviations(whole)
    assert (used.deviation, check.deviation) == pytest.approx((-0.02, -0.02))
    assert (used.bar.check, check.bar.check) == (False, True)
    # By sampling from the covariance of the two ends.
    source = np.random.default_rng(5)
    ends = np.concatenate((whole.state.points[2], whole.state.points[3]))
    samples = source.multivariate_normal(ends, whole.covariance_of_points[6:12, 6:12], 100_000)
    lengths = np.linalg.norm(samples[:, :3] - samples[:, 3:], axis=1)
    assert check.sigma == pytest.approx(np.hypot(lengths.std(), 0.05), rel=0.01)
    point, checked = control_deviations(whole)
    np.testing.assert_allclose(point.deviation, [0.01] * 3)
    variances = np.diag(whole.covariance_of_points)
    np.testing.assert_allclose(point.sigma, np.sqrt(variances[12:15]))
    np.testing.assert_allclose(checked.sigma, np.sqrt(variances[15:18] + 0.0004))


def test_there_are_no_deviations_without_scale_or_ends() -> None:
    whole = replace(solution(), network=known(solution().network))
    assert bar_deviations(replace(whole, network=replace(whole.network, unit=''))) == []
    points = whole.state.points.copy()
    points[[0, 4]] = np.nan
    part = replace(whole, state=replace(whole.state, points=points))
    assert [it.bar.ends for it in bar_deviations(part)] == [('3', '4')]
    assert [it.point.name for it in control_deviations(part)] == ['6']


def test_cameras_that_are_weak_alike_are_named_together() -> None:
    whole = solution()
    network, start = whole.network, whole.state
    names = 'EOS R5', 'B', 'C', 'D', 'E', 'F'
    several = replace(
        whole,
        network=replace(
            network,
            cameras=tuple(replace(network.cameras[0], name=name) for name in names),
            camera_of=np.arange(6),
        ),
        state=replace(start, calibrations=np.tile(start.calibrations, (6, 1))),
    )
    (unrolled,) = advice(several, 'rolled by 90 degrees')
    assert unrolled.startswith('Cameras EOS R5, B, C and 3 more: no photograph is rolled')
    (corners,) = advice(several, 'corners')
    assert corners.startswith('Cameras EOS R5, B, C and 3 more: targets reach only')
