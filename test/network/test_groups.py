"""Groups of photographs that do not hang together."""

from dataclasses import replace

import numpy as np

from ahf_ros.network.network import Rejection
from ahf_ros.network.solution import Solution, separated
from support.networks import known, solution


def group(photographs: list[int], targets: list[int]) -> Solution:
    """Return a solution of a part of the network: values of everything else are NaN."""
    whole = replace(solution(), network=known(solution().network))
    start = whole.state
    positions, points = np.full_like(start.positions, np.nan), np.full_like(start.points, np.nan)
    positions[photographs], points[targets] = start.positions[photographs], start.points[targets]
    return replace(
        whole,
        state=replace(start, positions=positions, points=points),
        rejected=(Rejection('view_0.jpg', '1', (1.0, 2.0), 'why', 5.0),),
    )


def test_groups_are_networks_of_their_own() -> None:
    first, second = separated([group([0, 1, 2], [0, 1, 2, 3, 4]), group([4, 5], [4, 5, 6, 7, 8])])
    assert first.network.photographs == ('view_0.jpg', 'view_1.jpg', 'view_2.jpg', 'view_3.jpg')
    assert first.network.targets == ('1', '2', '3', '4', '5', '10', '11', '12')
    assert second.network.photographs == ('view_4.jpg', 'view_5.jpg')
    assert second.network.targets == ('5', '6', '7', '8', '9')
    assert [len(it.rejected) for it in (first, second)] == [1, 0]
    assert [len(it.network.bars) for it in (first, second)] == [2, 0]
    assert [len(it.network.control) for it in (first, second)] == [1, 2]
    whole = solution()
    seen = second.network.observations
    assert seen.photograph.tolist() == [0] * 5 + [1] * 5
    assert seen.point.tolist() == [0, 1, 2, 3, 4] * 2
    rows = [12 * photograph + target for photograph in (4, 5) for target in range(4, 9)]
    np.testing.assert_array_equal(seen.xy, whole.network.observations.xy[rows])
    np.testing.assert_array_equal(second.residuals, whole.residuals[rows])
    np.testing.assert_array_equal(second.state.points, whole.state.points[4:9])
    np.testing.assert_array_equal(
        second.covariance_of_points, whole.covariance_of_points[12:27, 12:27]
    )


def test_one_group_is_the_whole_network() -> None:
    whole = solution()
    (only,) = separated([whole])
    assert only.network.photographs == whole.network.photographs
    np.testing.assert_array_equal(only.residuals, whole.residuals)
