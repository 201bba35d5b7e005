"""Pictures of bent sheets: geometry, ink and light agree with what is computed in another way."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from ahf_ros.prints.designs import circle, contours
from ahf_ros.prints.families import FAMILY_NAMES, print_in
from ahf_ros.scenes.bent import exposure
from ahf_ros.scenes.bent.ink import inked
from ahf_ros.scenes.bent.lens import Lens
from ahf_ros.scenes.bent.light import drawn_light, surface_light
from ahf_ros.scenes.bent.picture import BentRendering, render_bent
from ahf_ros.scenes.bent.settings import BentSettings
from ahf_ros.scenes.bent.sheet import Sheet
from ahf_ros.scenes.covers import ink_cover
from support.square_markers import needs_square_markers

SMALL = BentSettings(width=520, height=350, targets=6, sheets=6, dot_radius=8.0)
PLAIN = replace(
    SMALL,
    pinhole=0.0,
    gloss=0.0,
    grain=0.0,
    texture=0.0,
    ragged=0.0,
    motion=0.0,
    full_well=0.0,
    blur=0.4,
    exposure=180.0,
)
LENS = Lens(focal=900.0, principal=(301.5, 198.25), k1=-0.2, p1=0.01, p2=-0.006)


def sheet(curvature: float = 0.005) -> Sheet:
    """Return a sheet that is bent, tilted and turned."""
    tilted, _ = cv2.Rodrigues(np.array([0.3, -0.2, 0.9]))
    return Sheet(np.array([20.0, -30.0, 900.0]), tilted.T, curvature, (80.0, 60.0), 0.6)


def places(count: int = 500) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(1)
    return generator.uniform(-80, 80, count), generator.uniform(-60, 60, count)


def light_of(image: np.ndarray) -> np.ndarray:
    """Return what the curve of sRGB made grey values of."""
    share = image / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def dot_errors(settings: BentSettings) -> np.ndarray:
    """Return by how much the centroids of the ink of dots differ from the truth, shape (n, 2)."""
    printed, plain = render_bent(settings), render_bent(replace(settings, black=1.0))
    ink = 1 - light_of(printed.image) / light_of(plain.image)
    y, x = np.mgrid[: settings.height, : settings.width]
    errors = []
    for target in printed.targets:
        cosine, sine = math.cos(target.angle), math.sin(target.angle)
        along = (x - target.x) * cosine + (y - target.y) * sine
        across = (y - target.y) * cosine - (x - target.x) * sine
        near = np.hypot(along / target.semi_major, across / target.semi_minor) < 1.6
        weight = ink[near] / ink[near].sum()
        errors.append((weight @ x[near] - target.x, weight @ y[near] - target.y))
    return np.array(errors)


@pytest.mark.parametrize(
    'changes',
    [
        {'bend_radius': 1e9},
        {'bend_radius': 40.0, 'bend_ratio': 1.0},
        {'motion': 2.0, 'confusion': 1.0},
        {'lean': 35.0, 'vignetting': 0.7},
        {'distortion': -0.25, 'tangential_1': 0.01, 'tangential_2': -0.02},
    ],
)
def test_small_dots_have_their_centroid_at_the_truth(changes: dict[str, float]) -> None:
    """They are so small that perspective and the bend move them by less than 0.01 px."""
    usual = replace(PLAIN, focal_length=12.0, dot_radius=5.0, printed_radius=1.0)
    settings = replace(usual, **changes)
    errors = np.concatenate([dot_errors(replace(settings, seed=seed)) for seed in (1, 2)])
    assert len(errors) == 12
    assert np.sqrt(np.mean(np.square(errors))) < 0.01
    assert np.abs(errors).max() < 0.02


def test_the_image_of_a_bent_sheet_changes_with_its_radius() -> None:
    flat, bent = (render_bent(replace(PLAIN, bend_radius=of)) for of in (1e9, 60.0))
    assert [it.id for it in flat.targets] == [it.id for it in bent.targets]
    assert (flat.image != bent.image).mean() > 0.02


@pytest.mark.parametrize('curvature', [0.0, 1e-12, 0.005, -0.008])
def test_rays_meet_the_points_of_a_sheet(curvature: float) -> None:
    bent, (width, height) = sheet(curvature), places()
    points = bent.points(width, height)
    seen = bent.places(points[:, 0] / points[:, 2], points[:, 1] / points[:, 2])
    assert np.abs(np.array(seen) - (width, height, points[:, 2])).max() < 1e-6
    assert bent.holds(width, height).all()
    assert not bent.holds(np.array([81.0, 0.0, np.nan]), np.array([0.0, -61.0, 0.0])).any()


def test_a_sheet_that_is_hardly_bent_is_a_plane() -> None:
    x, y = np.meshgrid(np.linspace(-0.08, 0.1, 20), np.linspace(-0.1, 0.04, 20))
    plane, nearly = sheet(0.0).places(x, y), sheet(1e-10).places(x, y)
    assert np.allclose(plane, nearly, atol=1e-5, rtol=0)


def test_paper_keeps_its_lengths() -> None:
    bent = sheet(-0.01)
    width, height = np.linspace(-60, 60, 20001), np.linspace(40, -40, 20001)
    length = np.linalg.norm(np.diff(bent.points(width, height), axis=0), axis=1).sum()
    assert length == pytest.approx(math.hypot(120, 80), abs=1e-4)


def test_normals_are_across_the_surface_and_face_the_camera() -> None:
    bent, (width, height) = sheet(0.01), places()
    normals = np.moveaxis(bent.normals(width, height), 0, -1)
    for step in ((1e-4, 0), (0, 1e-4)):
        there = bent.points(width + step[0], height + step[1])
        along = (there - bent.points(width, height)) / 1e-4
        assert np.abs((along * normals).sum(axis=1)).max() < 1e-4
    assert np.abs(np.linalg.norm(normals, axis=1) - 1).max() < 1e-6
    assert ((bent.points(width, height) * normals).sum(axis=1) < 0).all()


def test_distortion_is_that_of_opencv() -> None:
    points = np.random.default_rng(2).uniform((-200, -150, 800), (200, 150, 900), (300, 3))
    expected, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), LENS.intrinsics, np.array([-0.2, 0, 0.01, -0.006])
    )
    pixels = LENS.project(points)
    assert np.abs(pixels - expected[:, 0]).max() < 1e-9
    x, y = LENS.rays(pixels[:, 0], pixels[:, 1])
    assert np.abs(x - points[:, 0] / points[:, 2]).max() < 1e-10
    assert np.abs(y - points[:, 1] / points[:, 2]).max() < 1e-10


@pytest.mark.parametrize(
    'name',
    [
        pytest.param(it, marks=needs_square_markers)
        if it.startswith(('aruco', 'apriltag'))
        else it
        for it in FAMILY_NAMES
    ],
)
def test_outlines_hold_the_ink_that_the_other_maker_draws(name: str) -> None:
    printed = print_in(name).design
    number = printed.all_ids[2]
    hole = 0.1 if name.startswith(('metashape', 'aicon', 'cct1', 'dots')) else 0.0
    ink = printed.ink(printed.word(number), hole)
    reach = printed.proportions.reach
    x, y = np.random.default_rng(3).uniform(-1, 1, (2, 200, 200)).astype(np.float32) * reach
    here = inked(contours(ink), x.astype(float), y.astype(float))
    there = ink_cover(ink, 0.0)(x, y, np.eye(2, dtype=np.float32) * np.float32(1e-3))
    assert 0.02 < here.mean() < 0.98
    assert (here != (there > 0.5)).mean() < 0.005


def test_a_point_is_inside_of_an_odd_number_of_outlines() -> None:
    square = ((-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0))
    x, y = np.array([0.0, 1.5, 3.0, -1.9]), np.array([0.0, 0.0, 0.0, 1.9])
    assert inked([square, circle(1.0)], x, y).tolist() == [False, True, False, True]


@pytest.mark.parametrize(('motion', 'confusion'), [(0, 0), (3, 0), (0, 1.5), (2, 1)])
def test_points_spread_as_far_as_path_and_disc_reach(motion: float, confusion: float) -> None:
    """The variance of a path is its length^2 / 12, that of a disc radius^2 / 4 on each axis."""
    shape, _ = exposure.spread(0.0, confusion, motion, 0.0, 4)
    reach = len(shape) // 2
    cells = np.arange(-reach, reach + 1) / 4
    x, y = ((shape.sum(axis=axis) * cells**2).sum() for axis in (0, 1))
    assert shape.sum() == pytest.approx(1, abs=1e-5)
    assert x == pytest.approx(motion**2 / 12 + confusion**2 / 4, abs=0.03)
    assert y == pytest.approx(confusion**2 / 4, abs=0.03)
    assert np.allclose(shape, shape[::-1, ::-1], atol=1e-6)


def test_corners_lose_light() -> None:
    share = exposure.vignette(401, 301, np.arange(301), 0.4)
    assert share[150, 200] == 1
    assert share[[0, 0, -1, -1], [0, -1, 0, -1]] == pytest.approx(0.6)


def test_grey_values_are_those_of_srgb() -> None:
    """IEC 61966-2-1: 18 % of light is 118, half of it 188."""
    light = np.array([[0.0, 0.002, 0.18, 0.5, 1.0, 2.0]])
    grey = exposure.exposed(light, 0.0, 0.0, np.random.default_rng(0))
    assert grey.tolist() == [[0, 7, 118, 188, 255, 255]]
    assert exposure.light_of_grey(188) == pytest.approx(0.5, abs=0.005)


def test_noise_has_the_variance_of_electrons() -> None:
    light = np.full((300, 300), 0.2)
    grey = exposure.exposed(light, 1000.0, 5.0, np.random.default_rng(0))
    assert light_of(grey).var() == pytest.approx(0.2 / 1000 + 25 / 1000**2, rel=0.05)
    assert light_of(grey).mean() == pytest.approx(0.2, rel=0.01)


@pytest.mark.parametrize('roughness', [0.2, 0.5])
def test_highlights_are_where_light_is_mirrored(roughness: float) -> None:
    """The smoother the surface, the smaller and the brighter they are."""
    light = drawn_light(replace(PLAIN, ambient=0.0), np.random.default_rng(4))
    middle = np.array([0.0, 0.0, PLAIN.distance])
    halfway = light.position / np.linalg.norm(light.position - middle) - middle * (
        1 / np.linalg.norm(light.position - middle) + 1 / PLAIN.distance
    )
    halfway /= np.linalg.norm(halfway)
    turns = np.radians(np.arange(-60, 61))
    aside = np.cross(halfway, (0.0, 1.0, 0.0))
    aside /= np.linalg.norm(aside)
    normals = np.cos(turns) * halfway[:, None] + np.sin(turns) * aside[:, None]
    points = np.repeat(middle[:, None], len(turns), axis=1)
    scattered, mirrored = surface_light(
        light, points.astype(np.float32), normals.astype(np.float32), 0.04, roughness
    )
    assert abs(int(mirrored.argmax()) - 60) <= 2
    assert mirrored.max() == pytest.approx(0.04 / (4 * roughness**4) * scattered[60], rel=0.2)
    wide = (mirrored > mirrored.max() / 2).sum()
    assert (wide < 12) == (roughness == 0.2)


def equal(first: BentRendering, second: BentRendering) -> bool:
    return np.array_equal(first.image, second.image) and first.targets == second.targets


def test_equal_settings_give_equal_pictures_with_any_number_of_threads() -> None:
    settings = replace(SMALL, light='lattice', distortion=-0.1, seed=3)
    first = render_bent(settings)
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        assert equal(render_bent(settings), first)
    finally:
        cv2.setNumThreads(threads)
    assert not equal(render_bent(replace(settings, seed=4)), first)


@pytest.mark.parametrize('polarity', ['dark', 'bright'])
def test_targets_have_their_polarity(polarity: str) -> None:
    rendering = render_bent(replace(PLAIN, polarity=polarity))
    dots = [rendering.image[round(it.y), round(it.x)] for it in rendering.targets]
    assert (np.array(dots) < 100).all() == (polarity == 'dark')
    assert (np.array(dots) > 130).all() == (polarity == 'bright')


def test_the_ellipse_is_that_of_the_dot() -> None:
    settings = replace(PLAIN, lean=40.0, bend_radius=70.0, bend_ratio=1.0, focal_length=8.0)
    printed, plain = render_bent(settings), render_bent(replace(settings, black=1.0))
    ink = 1 - light_of(printed.image) / light_of(plain.image)
    y, x = np.mgrid[: settings.height, : settings.width]
    for target in printed.targets:
        near = np.hypot(x - target.x, y - target.y) < 1.5 * target.semi_major
        weight = ink[near] / ink[near].sum()
        spread = np.cov(np.stack((x[near], y[near])), aweights=weight, ddof=0)
        blur = settings.blur**2 + settings.confusion**2 / 4 + 1 / 12
        minor, major = np.sqrt(np.linalg.eigvalsh(spread) - blur) * 2
        assert major == pytest.approx(target.semi_major, rel=0.03)
        assert minor == pytest.approx(target.semi_minor, rel=0.03)


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'motion': -1.0}, 'motion is -1.0, accepted is a number from 0 to 20'),
        ({'roughness': 0.0}, 'roughness is 0.0, accepted is a number from 0.05 to 1'),
        ({'light': 'dark'}, "light is 'dark', accepted is one of normal, "),
        ({'targets': 5000}, 'targets is 5000, accepted is an integer from 0 to 6 on 6 sheets'),
        ({'sheets': 100}, 'targets is 6, accepted is an integer from 0 to 0 on 100 sheets'),
        ({'bend_radius': 10.0, 'sheets': 1}, 'bend_radius is 10.0, accepted is a number of at'),
        ({'focal_length': 0.5, 'distortion': -0.3}, 'distortion is -0.3, accepted is a number of'),
    ],
)
def test_bad_settings_are_named(changes: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message.replace('(', r'\(')):
        replace(SMALL, **changes)


def test_a_sheet_without_targets_is_paper() -> None:
    rendering = render_bent(replace(PLAIN, targets=0))
    assert rendering.targets == ()
    assert rendering.image.max() > 150
