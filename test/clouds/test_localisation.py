import math
from dataclasses import replace

import numpy as np
import numpy.lib.recfunctions as rfn
import pytest

from ahf_ros.base.target import Target
from ahf_ros.clouds.cloud_settings import CloudGrid
from ahf_ros.clouds.localisation import Positions, positions

KIND = np.dtype([('x', '<f4'), ('y', '<f4'), ('z', '<f4')])
EXACT = np.dtype([('x', '<f8'), ('y', '<f8'), ('z', '<f8')])
FOCAL_LENGTH = 1000.0  # px
NOISE = 0.1  # mm, along the ray
CENTRE = (60.3, 50.8)  # px
RADIUS = 8.0  # px


def on_plane(pixels: np.ndarray, tilt: float, distance: float = 1000.0) -> np.ndarray:
    """Return the points of a plane, shape (..., 3), that pixels of a camera at 0 show."""
    rays = np.concatenate((pixels / FOCAL_LENGTH, np.ones((*pixels.shape[:-1], 1))), axis=-1)
    normal = np.array([math.sin(tilt), 0.3 * math.sin(tilt), math.cos(tilt)])
    return rays * (distance * math.cos(tilt) / (rays @ normal))[..., None]


ROWS, COLUMNS = np.mgrid[:100, :120]
PIXELS = np.stack((COLUMNS, ROWS), axis=-1).astype(float)
BESIDE = COLUMNS - CENTRE[0]
AWAY = np.hypot(BESIDE, ROWS - CENTRE[1])


def organised(points: np.ndarray, kind: np.dtype) -> np.ndarray:
    """Return the cloud of points, shape (height, width, 3)."""
    return rfn.unstructured_to_structured(points, kind, casting='same_kind')


def scan(tilt: float = 0.0, noise: float = 0.0, kind: np.dtype = KIND) -> np.ndarray:
    """Return a cloud of 120 x 100 points."""
    random = np.random.default_rng(0).standard_normal((100, 120, 1))
    return organised(on_plane(PIXELS, tilt) * (1 + noise / 1000 * random), kind)


def target(x: float = CENTRE[0], y: float = CENTRE[1], radius: float = RADIUS) -> Target:
    return Target(7, 71, x, y, radius, radius)


def found(cloud: np.ndarray) -> Positions:
    return positions(cloud, [target()])


def error(cloud: np.ndarray, tilt: float) -> float:
    """Return the distance of the position of a target from the truth, mm."""
    return float(np.linalg.norm(found(cloud).points[0] - on_plane(np.array(CENTRE), tilt)))


def blank(cloud: np.ndarray, where: np.ndarray) -> np.ndarray:
    for name in 'xyz':
        cloud[name][where] = np.nan
    return cloud


@pytest.mark.parametrize('degrees', [0, 30, 60])
def test_a_plane_gives_the_point_of_the_centre_exactly(degrees: float) -> None:
    tilt = math.radians(degrees)
    assert error(scan(tilt, kind=EXACT), tilt) < 1e-9
    assert error(scan(tilt), tilt) < 1e-3  # float32 at 1000 mm


def test_the_frame_of_the_cloud_does_not_matter() -> None:
    turn, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    points, true = (
        on_plane(at, 0.7) @ turn + (5, -200, 3000) for at in (PIXELS, np.array(CENTRE))
    )
    assert found(organised(points, EXACT)).points[0] == pytest.approx(true, abs=1e-9)


def test_noise_is_told_and_averaged() -> None:
    cloud = scan(0.5, NOISE)
    assert found(cloud).deviations[0] == pytest.approx(NOISE, rel=0.15)
    assert error(cloud, 0.5) < NOISE / 8


@pytest.mark.parametrize('along_rays', [True, False])
def test_covariances_agree_with_errors(along_rays: bool) -> None:
    """The normalised squared errors of 3 coordinates have the mean 3, here within 4 deviations."""
    random = np.random.default_rng(2)
    covariance = np.array([[9e-4, 3e-4], [3e-4, 16e-4]])  # px^2
    exact, true = on_plane(PIXELS, 0.6), on_plane(np.array(CENTRE), 0.6)
    squares = []
    for _ in range(100):
        noise = random.standard_normal((100, 120, 1 if along_rays else 3))
        cloud = exact * (1 + NOISE / 1000 * noise) if along_rays else exact + NOISE * noise
        x, y = random.multivariate_normal(CENTRE, covariance)
        seen = replace(target(x, y), covariance=tuple(covariance.ravel().tolist()))
        result = positions(organised(cloud, KIND), [seen])
        error = result.points[0] - true
        squares.append(error @ np.linalg.solve(result.covariances[0], error))
    assert np.mean(squares) == pytest.approx(3, abs=4 * math.sqrt(6 / 100))


def test_covariances_are_never_zero() -> None:
    result = positions(organised(np.ones((100, 120, 3)), KIND), [target()])
    assert np.linalg.eigvalsh(result.covariances[0])[0] > 0
    few, many = (
        positions(scan(0.5, noise), [target()]).covariances[0] for noise in (0, 10 * NOISE)
    )
    assert np.linalg.eigvalsh(many - few)[0] > 0  # noise adds in every direction


def test_a_dot_without_points_has_a_position() -> None:
    cloud = blank(scan(0.5, NOISE), AWAY < 1.3 * RADIUS)
    assert error(cloud, 0.5) < NOISE / 8


def test_points_of_another_surface_do_not_count() -> None:
    cloud = scan(0.5, NOISE)
    cloud['z'][BESIDE > 5] += 30  # behind an edge beside the dot
    cloud['z'][(ROWS + COLUMNS) % 9 == 0] -= 500
    assert error(cloud, 0.5) < NOISE / 4


def test_zeros_are_no_points() -> None:
    cloud = scan(0.5)
    cloud[AWAY < 2.2 * RADIUS] = (0, 0, 0)
    assert error(cloud, 0.5) < 1e-3


def test_nothing_is_extrapolated() -> None:
    assert found(blank(scan(), BESIDE < 0)).known[0]
    assert not found(blank(scan(), BESIDE < 10)).known[0]


def test_few_points_or_none_give_no_position() -> None:
    sparse = blank(scan(), (ROWS % 3 > 0) | (COLUMNS % 3 > 0))
    assert not found(sparse).known[0]
    assert not found(blank(scan(), ROWS >= 0)).known[0]
    line = blank(scan(), np.abs(ROWS - COLUMNS + 10) > 0)
    assert not positions(line, [target(radius=1.0)]).known[0]


@pytest.mark.parametrize(
    ('x', 'y', 'radius'),
    [(-500, 50, 8), (60, 1e300, 8), (math.nan, 50, 8), (60, 50, math.inf), (60, 50, math.nan)],
)
def test_a_target_out_of_the_cloud_has_no_position(x: float, y: float, radius: float) -> None:
    assert not positions(scan(), [target(x, y, radius)]).known[0]


@pytest.mark.parametrize('radius', [0.0, 1e308])
def test_a_target_of_no_known_size_has_a_neighbourhood(radius: float) -> None:
    result = positions(scan(), [target(radius=radius)])
    assert result.points[0] == pytest.approx(on_plane(np.array(CENTRE), 0), abs=1e-3)


def test_targets_keep_their_order_and_large_ones_are_thinned_out() -> None:
    places = [(20.0, 30.0), (-100.0, 30.0), (60.5, 50.25)]
    targets = [target(x, y, radius=15.0) for x, y in places]
    result = positions(scan(0.4), targets)
    assert result.known.tolist() == [True, False, True]
    expected = on_plane(np.array(places)[[0, 2]], 0.4)
    assert result.points[[0, 2]] == pytest.approx(expected, abs=1e-3)
    assert result.points.shape == (3, 3)
    assert positions(scan(), []).points.shape == (0, 3)


def test_the_spacing_is_that_of_pixels_on_the_target() -> None:
    assert found(scan()).spacings[0] == pytest.approx(1.0, rel=1e-3)
    half = np.array([0.5, 0.0])
    step = on_plane(CENTRE + half, 1.0) - on_plane(CENTRE - half, 1.0)
    assert found(scan(1.0)).spacings[0] == pytest.approx(np.linalg.norm(step), rel=1e-3)


@pytest.mark.parametrize(
    ('grid', 'part'),
    [
        (CloudGrid(offset_x=32), np.s_[:, 32:]),  # Ensenso with a disparity offset
        (CloudGrid(offset_x=21, offset_y=11), np.s_[11:80, 21:100]),
        (CloudGrid(offset_x=1, step=2), np.s_[::2, 1::2]),
    ],
)
def test_a_cloud_may_be_a_part_of_the_image(grid: CloudGrid, part: tuple) -> None:
    cloud = scan(0.4)
    assert grid.fits(cloud[part].shape, cloud.shape)
    found = positions(cloud[part], [target()], grid=grid)
    assert found.points[0] == pytest.approx(on_plane(np.array(CENTRE), 0.4), abs=1e-3)
    assert found.spacings == pytest.approx(positions(cloud, [target()]).spacings, rel=1e-3)


@pytest.mark.parametrize(
    ('grid', 'shape'),
    [
        (CloudGrid(), (100, 119)),
        (CloudGrid(), (101, 120)),
        (CloudGrid(offset_x=32), (100, 89)),
        (CloudGrid(offset_y=0.6), (100, 120)),
        (CloudGrid(step=2), (51, 60)),
    ],
)
def test_a_cloud_beyond_the_image_does_not_fit(grid: CloudGrid, shape: tuple[int, int]) -> None:
    assert not grid.fits(shape, (100, 120))


def test_a_cloud_that_is_the_same_everywhere_does_no_harm() -> None:
    result = found(np.ones((100, 120), KIND))
    assert result.points[0].tolist() == [1, 1, 1]
    assert (result.deviations[0], result.spacings[0]) == (0, 0)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('kind', ['<f4', '>f4', '<f8'])
def test_garbage_does_no_harm(kind: str) -> None:
    random = np.random.default_rng(0)
    point = np.dtype([(name, kind) for name in 'xyz'])
    for _ in range(100):
        cloud = np.frombuffer(random.bytes(30 * 30 * point.itemsize), point).reshape(30, 30)
        if random.random() < 0.5:  # a real surface with garbage in it
            cloud = np.where(
                random.random((30, 30)) < 0.3, cloud, scan(0.3)[:30, :30].astype(point)
            )
        x, y, major, minor = random.uniform(-5, 35, 4)
        found = positions(cloud, [Target(1, 1, x, y, abs(major), abs(minor), random.normal())])
        assert found.points.shape == (1, 3)
