"""Networks that nobody gave approximate values for: exact projections with noise, and refusals."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from ahf_ros.network.camera import PARAMETERS, pinhole
from ahf_ros.network.files.network_files import make_network
from ahf_ros.network.files.observation_files import read_observations
from ahf_ros.network.network import CameraView, Network, once_a_photograph
from ahf_ros.network.orient import orient
from ahf_ros.network.progress import Progress
from ahf_ros.network.solution import Solution
from support import ROOT
from support.random_networks import Rendered, deviations, looking, photographed

pytest.importorskip('scipy', reason='the adjustment needs scipy')

FOCAL = 2600.0


def ring(count: int, tilt: float, rolled: bool = True) -> tuple[list, list]:
    """Return poses that look at the origin from a circle of directions, at a distance of 3."""
    rotations, positions = [], []
    for index in range(count):
        around, lean = 2.4 * index, np.radians(tilt)
        away = np.array(
            [np.sin(lean) * np.cos(around), np.sin(lean) * np.sin(around), np.cos(lean)]
        )
        rotations.append(looking(-away, np.pi / 2 * (index % 4) * rolled))
        positions.append((2.5 + 0.3 * (index % 3)) * away)
    return rotations, positions


def field(number: int, depth: float) -> np.ndarray:
    random = np.random.default_rng(5)
    return random.uniform(-1, 1, (number, 3)) * [1, 0.7, depth]


def taken(
    count: int = 6,
    tilt: float = 35,
    focal: float | None = None,
    depth: float = 0.3,
    number: int = 30,
    wrong: float = 0,
    lens: dict[str, float] | None = None,
) -> Rendered:
    rotations, positions = ring(count, tilt)
    camera = CameraView('camera', 3000, 2000, focal)
    calibration = pinhole(FOCAL, 3000, 2000)[None]
    for name, value in (lens or {}).items():
        calibration[0, PARAMETERS.index(name)] += value
    random = np.random.default_rng(7)
    of = np.zeros(count, dtype=int)
    points = field(number, depth)
    return photographed(points, rotations, positions, (camera,), of, calibration, random, wrong)


@cache
def oriented_by_five() -> Solution:
    (solution,) = orient(taken(count=5, focal=FOCAL).network)
    return solution


def error(solution: Any, truth: np.ndarray) -> float:
    known = np.isfinite(solution.state.points[:, 0])
    assert known.mean() > 0.95
    return float(np.abs(deviations(solution.state.points[known], truth[known])).max())


@pytest.mark.parametrize('depth', [0.0, 0.3])
@pytest.mark.parametrize('focal', [pytest.param(None, marks=pytest.mark.lasting), FOCAL])
def test_nothing_but_ids_orients_a_network(depth: float, focal: float | None) -> None:
    seen = taken(depth=depth, focal=focal)
    (solution,) = orient(seen.network)
    assert error(solution, seen.points) < 1e-3
    assert np.isfinite(solution.state.positions).all()
    assert solution.state.calibrations[0, 0] == pytest.approx(FOCAL, rel=5e-3)
    assert 0.8 < solution.sigma0 < 1.2


@pytest.mark.lasting
@pytest.mark.parametrize('k1', [-0.3, 0.1])
def test_a_lens_with_distortion_that_nobody_gave(k1: float) -> None:
    seen = taken(count=5, lens={'k1': k1, 'cx': 50.0, 'cy': -40.0})
    (solution,) = orient(seen.network)
    assert np.isfinite(solution.state.positions).all()
    assert error(solution, seen.points) < 2e-3


@pytest.mark.lasting
def test_half_of_the_photographs_of_the_panel() -> None:
    """Its lens displaces image points by up to 40 px; true lengths are those of a scale bar."""
    every = read_observations(ROOT / 'docs' / 'examples' / 'panel.csv')
    network, _ = make_network(every[::2])
    (solution,) = orient(network)
    assert np.isfinite(solution.state.positions).all()
    places = dict(zip(network.targets, solution.state.points, strict=True))
    first, second = (np.linalg.norm(places[a] - places[b]) for a, b in (('5', '60'), ('22', '70')))
    assert first / second == pytest.approx(608.8297 / 747.6563, rel=2e-4)


def test_the_frame_is_that_of_the_principal_axes() -> None:
    solution = oriented_by_five()
    points = solution.measured_points.xyz
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=1e-3)
    spread = points.T @ points
    np.testing.assert_allclose(spread, np.diag(np.diag(spread)), atol=1e-3 * spread.max())
    assert (np.diff(np.diag(spread)) < 0).all()
    assert (solution.state.positions[:, 2] > 0).all()


@pytest.mark.lasting
def test_a_fisheye_lens_is_fitted() -> None:
    seen = taken(count=8, focal=1000.0, number=60)
    network = seen.network
    source = np.random.default_rng(9)
    rotations, positions = (np.array(it) for it in ring(8, 35))
    positions = 0.45 * positions  # so near that targets are up to 60 degrees off the axis
    photograph, point = (it.ravel() for it in np.indices((8, 60)))
    towards = np.einsum(
        'mij,mj->mi', rotations[photograph], seen.points[point] - positions[photograph]
    )
    flat = np.hypot(*towards.T[:2])
    angle = np.arctan2(flat, towards[:, 2])
    xy = 900 * (angle / flat)[:, None] * towards[:, :2] + [1499.5, 999.5]
    inside = ((xy > 0) & (xy < [3000, 2000])).all(axis=1)
    observations = replace(
        network.observations,
        photograph=photograph[inside],
        point=point[inside],
        xy=xy[inside] + source.normal(0, 0.05, (inside.sum(), 2)),
        covariance=np.tile(0.05**2 * np.eye(2), (inside.sum(), 1, 1)),
    )
    cameras = (CameraView('camera', 3000, 2000, 900.0),)
    (solution,) = orient(replace(network, cameras=cameras, observations=observations))
    assert any('an equidistant fisheye one' in text for text in solution.warnings)
    assert solution.network.cameras[0].equidistant
    assert solution.oriented.all() and solution.state.used.all()
    assert solution.released[0] == ('f', 'cx', 'cy', 'k1', 'k2', 'k3', 'k4', 'affinity', 'shear')
    found = solution.state.calibrations[0, :3] - [900, 1499.5, 999.5]
    assert (np.abs(found) < 4 * np.sqrt(np.diag(solution.camera_covariances[0])[:3])).all()


def test_targets_at_one_place_in_the_image_give_no_pose() -> None:
    seen = taken(focal=FOCAL)
    observed = seen.network.observations
    last, random = observed.photograph == 5, np.random.default_rng(2)
    xy = observed.xy.copy()
    xy[last] = random.normal([2500, 900], 0.05, (last.sum(), 2))
    network = replace(seen.network, observations=replace(observed, xy=xy))
    (solution,) = orient(network)
    assert solution.oriented.tolist() == [True] * 5 + [False]
    assert any('5.png: not oriented, all targets are at one' in it for it in solution.warnings)
    assert error(solution, seen.points) < 1e-3


def test_two_photographs_are_never_a_network() -> None:
    """What is left of three photographs of which one contradicts the others is no network."""
    network = taken(count=3, focal=FOCAL).network
    mixed = network.observations.point.copy()
    of_last = network.observations.photograph == 2
    mixed[of_last] = np.random.default_rng(1).permutation(mixed[of_last])
    with pytest.raises(ValueError, match='photographs'):
        orient(replace(network, observations=replace(network.observations, point=mixed)))


def test_wrong_ids_are_named() -> None:
    seen = taken(focal=FOCAL, wrong=0.05)
    (solution,) = orient(seen.network)
    assert error(solution, seen.points) < 1e-3
    rejected = {(one.photograph, one.target) for one in solution.rejected}
    observed = seen.network.observations
    wrong = {
        (seen.network.photographs[observed.photograph[row]], str(observed.point[row]))
        for row in np.flatnonzero(seen.wrong)
    }
    assert wrong and wrong <= rejected


def test_the_same_network_gives_the_same_bits() -> None:
    first = oriented_by_five()
    (second,) = orient(taken(count=5, focal=FOCAL).network)
    assert np.array_equal(first.state.points, second.state.points, equal_nan=True)


@pytest.mark.lasting
def test_a_target_twice_in_a_photograph_is_set_aside() -> None:
    seen = taken(focal=FOCAL)
    observed = seen.network.observations
    rows = np.append(np.arange(len(observed.xy)), 3)
    double = observed.rows(rows)
    double.xy[-1] += 100
    once = once_a_photograph(replace(seen.network, observations=double))
    assert len(once.observations.xy) == len(observed.xy) - 1
    assert {one.target for one in once.set_aside} == {str(observed.point[3])}
    (solution,) = orient(replace(seen.network, observations=double))
    assert [one.reason for one in solution.rejected].count(
        'its ID is more than once in the photograph'
    ) == 2


def of_few(number: int, changed: int | None = None) -> Network:
    """Return a network whose last photograph shows few targets, one of them perhaps another."""
    network = taken(count=5, focal=FOCAL).network
    observed = network.observations
    last = np.flatnonzero(observed.photograph == 4)
    kept = np.setdiff1d(np.arange(len(observed.xy)), last[number:])
    point = observed.point.copy()
    if changed is not None:
        point[last[changed]] = observed.point[last[-1]]
    return replace(network, observations=replace(observed, point=point).rows(kept))


@pytest.mark.lasting
def test_four_targets_orient_a_photograph_if_they_agree() -> None:
    (solution,) = orient(of_few(4))
    assert solution.oriented.all() and not any('not oriented' in it for it in solution.warnings)
    whole = oriented_by_five().state
    few = solution.state
    turns = [it.rotations[4] @ it.rotations[0].T for it in (whole, few)]
    assert np.abs(turns[0] - turns[1]).max() < 1e-3
    for network, reason in ((of_few(4, 2), 'no pose fits well'), (of_few(3), 'fewer than 4')):
        (solution,) = orient(network)
        assert solution.oriented.tolist() == 4 * [True] + [False]
        assert any('4.png' in it and reason in it for it in solution.warnings)


@pytest.mark.lasting
def test_groups_that_do_not_hang_together_are_oriented_each_by_itself() -> None:
    seen = taken(count=8, focal=FOCAL)
    observed = seen.network.observations
    names = tuple(str(index) for index in range(60))
    point = observed.point + 30 * (observed.photograph % 2)
    network = replace(seen.network, targets=names, observations=replace(observed, point=point))
    solutions = orient(network)
    posed = [np.isfinite(one.state.positions[:, 0]) for one in solutions]
    assert len(solutions) == 2
    assert np.array_equal(posed[0], ~posed[1])


@pytest.mark.lasting
def test_portrait_and_landscape_are_two_cameras() -> None:
    rotations, positions = ring(8, 35)
    cameras = CameraView('landscape', 3000, 2000), CameraView('portrait', 2000, 3000)
    calibrations = np.stack([pinhole(FOCAL, 3000, 2000), pinhole(FOCAL, 2000, 3000)])
    of = np.arange(8) // 4
    points = field(30, 0.3)
    random = np.random.default_rng(1)
    seen = photographed(points, rotations, positions, cameras, of, calibrations, random)
    (solution,) = orient(seen.network)
    assert error(solution, points) < 1e-3
    assert solution.state.calibrations[:, 0] == pytest.approx(FOCAL, rel=5e-3)


def zooming(zooms: Sequence[float]) -> tuple[Rendered, np.ndarray]:
    """Return one photograph of 20 targets a zoom, all of one camera, with its targets."""
    rotations, positions = ring(len(zooms), 35)
    calibrations = np.stack([pinhole(FOCAL * zoom, 3000, 2000) for zoom in zooms])
    camera, of = CameraView('camera', 3000, 2000), np.zeros(len(zooms), dtype=int)
    points, random = field(20, 0.3), np.random.default_rng(1)
    return photographed(points, rotations, positions, (camera,), of, calibrations, random), points


@pytest.mark.lasting
def test_another_zoom_gets_a_camera_of_its_own() -> None:
    seen, points = zooming((1, 1, 1, 1.2, 1.2, 1, 1, 1))
    (solution,) = orient(seen.network)
    assert solution.oriented.all()
    assert any('2 of 8 photographs, such as 3.png' in it for it in solution.warnings)
    assert solution.network.camera_of.tolist() == [0, 0, 0, 1, 1, 0, 0, 0]
    assert solution.state.calibrations[:, 0] == pytest.approx([FOCAL, 1.2 * FOCAL], rel=0.01)
    assert error(solution, points) < 1e-3


@pytest.mark.lasting
def test_each_photograph_may_have_its_own_zoom() -> None:
    zooms = np.random.default_rng(4).uniform(0.9, 1.1, 12)
    seen, points = zooming(zooms)
    (solution,) = orient(seen.network)
    assert solution.oriented.all()
    focal = solution.state.calibrations[solution.network.camera_of, 0]
    assert focal == pytest.approx(FOCAL * zooms, rel=0.01)
    assert error(solution, points) < 1e-3


@pytest.mark.lasting
@pytest.mark.parametrize('depth', [0.0, 0.3])
def test_parallel_photographs_do_not_tell_the_focal_length(depth: float) -> None:
    rotations = [looking(np.array([0, 0, -1.0]), 0)] * 4
    positions = [np.array([x, y, 2.5]) for x in (-0.4, 0.4) for y in (-0.3, 0.3)]
    camera, of = CameraView('camera', 3000, 2000), np.zeros(4, dtype=int)
    calibration = pinhole(FOCAL, 3000, 2000)[None]
    points, random = field(20, depth), np.random.default_rng(1)
    seen = photographed(points, rotations, positions, (camera,), of, calibration, random)
    with pytest.raises(ValueError, match=r'focal length.*tilted'):
        orient(seen.network)


def without(network: Network, keep: np.ndarray) -> Network:
    observed = network.observations
    return replace(network, observations=observed.rows(keep))


def test_too_little_is_refused_in_words() -> None:
    network = taken(focal=FOCAL).network
    observed = network.observations
    with pytest.raises(ValueError, match='photographs: 2 with targets, expected three'):
        orient(without(network, observed.photograph < 2))
    with pytest.raises(ValueError, match='targets: 3 in two or more photographs, expected 6'):
        orient(without(network, observed.point < 3))
    with pytest.raises(ValueError, match='no ID is seen in two photographs'):
        orient(without(network, observed.point // 5 == observed.photograph))
    few = (observed.point - 3 * observed.photograph) % 30 < 6
    with pytest.raises(ValueError, match=r'no two have more than 3 targets in common'):
        orient(without(network, few))


def test_targets_on_a_line_are_refused() -> None:
    rotations, positions = ring(6, 35)
    camera, of = CameraView('camera', 3000, 2000, FOCAL), np.zeros(6, dtype=int)
    calibration = pinhole(FOCAL, 3000, 2000)[None]
    points, random = field(30, 0) * [1, 0, 0], np.random.default_rng(1)
    seen = photographed(points, rotations, positions, (camera,), of, calibration, random)
    with pytest.raises(ValueError, match='lie on a line'):
        orient(seen.network)


@pytest.mark.lasting
def test_who_watches_is_told_stages_photographs_and_iterations() -> None:
    network = taken(focal=FOCAL).network
    seen: list[Progress] = []
    solutions = orient(network, progress=seen.append)
    assert np.array_equal(solutions[0].state.points, orient(network)[0].state.points)
    assert len(seen) > len({str(it) for it in seen}) / 2 > 5
    assert all(a != b for a, b in pairwise(seen))
    posed = [it.done for it in seen if it.stage == 'start values' and not it.iteration]
    assert posed[0].startswith('a beginning') and posed[-1] == '6 of 6 photographs'
    last = [it.iteration for it in seen if it.stage == 'adjustment']
    assert last == list(range(len(last)))
    assert str(seen[-1]).startswith('adjustment, iteration ')
