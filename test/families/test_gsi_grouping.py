"""Templates among dots, and which dot is nearest."""

import numpy as np

from ahf_ros.families.gsi.grouping import find_templates, nearest_dots
from ahf_ros.prints.gsi import point_family
from ahf_ros.vision.dots import Dots
from ahf_ros.vision.frame import affine_frames
from ahf_ros.vision.homography import local_frames


def test_the_map_knows_the_nearest_of_dots_that_are_apart() -> None:
    generator = np.random.default_rng(2)
    x, y = np.meshgrid(30.0 * np.arange(9), 30.0 * np.arange(7))
    centres = np.stack([x.ravel(), y.ravel()], axis=1) + generator.uniform(-9, 9, (63, 2)) + 500
    nearest = nearest_dots(centres, 0.0)
    places = centres + generator.uniform(-5, 5, centres.shape)
    found, distance = nearest(places, np.tile(np.eye(2) / 2, (63, 1, 1)), 4.0)
    assert found.tolist() == list(range(63))
    assert np.allclose(distance, np.hypot(*(places - centres).T) / 2)


def test_nothing_is_found_beyond_the_reach_or_outside() -> None:
    nearest = nearest_dots(np.array([[100.0, 100.0], [140.0, 100.0]]), 0.0)
    places = np.array([[112.0, 100.0], [-500.0, 9000.0], [133.0, 100.0]])
    found, _ = nearest(places, np.tile(np.eye(2), (3, 1, 1)), 10.0)
    assert found.tolist() == [-1, -1, 1]


def grid(spacing: float, count: tuple[int, int], radius: float) -> Dots:
    x, y = np.meshgrid(*(spacing * (1 + np.arange(side)) for side in count))
    size = np.full(x.size, radius)
    frames = affine_frames(x.ravel(), y.ravel(), size, size, 0 * size)
    return Dots(frames, np.ones(x.size, int), np.ones(x.size))


def test_a_grid_of_dots_has_a_bounded_number_of_templates() -> None:
    templates = find_templates(grid(24.0, (50, 40), 5.0), point_family())
    assert len(templates.misfit) <= 4000
    assert not len(find_templates(grid(24.0, (2, 1), 5.0), point_family()).misfit)


def test_templates_are_not_mirrored_wherever_they_are() -> None:
    # Far from the origin of the image, perspective dominates the upper left of a homography.
    family = point_family()
    slopes, centre, depth = [[0.86, -1.29], [-0.97, -3.30]], [3287.0, 1778.0], [-4.5e-4, 4.8e-4]
    homography = np.vstack(
        [np.column_stack([slopes + np.outer(centre, depth), centre]), [*depth, 1]]
    )
    assert np.linalg.det(homography[:2, :2]) > 0 > np.linalg.det(homography)
    which = [0, 1, 2, 3, 4, 5, 9, 30]
    frames = local_frames(homography[None], family.places[which], family.radii[which])[0]
    dots = Dots(frames, np.ones(len(which), int), np.ones(len(which)))
    templates = find_templates(dots, family)
    found = templates.homographies[:, :2, 2] / templates.homographies[:, 2:, 2]
    assert np.hypot(*(found - centre).T).min() < 0.1
    assert (np.linalg.det(templates.homographies) < 0).all()


def test_small_dots_that_look_a_pixel_wider_still_make_a_template() -> None:
    # Blobs of few pixels have axes of whole pixels: 3 px where the dot has 1.7 px.
    family = point_family()
    minor = np.cos(np.deg2rad(70.0))
    pixels = 5.1 / family.dot_radius
    homography = np.diag([pixels, -pixels * minor, 1.0])
    homography[:2, 2] = 400.0, 300.0
    which = np.arange(len(family.template))
    frames = local_frames(homography[None], family.places[which], family.radii[which])[0]
    wide = frames.copy()
    wide[:, :2, :2] = np.diag([5.1, 3.0])
    dots = Dots(wide, np.ones(len(which), int), np.ones(len(which)))
    templates = find_templates(dots, family)
    assert templates.members.tolist() == [which.tolist()]
    assert templates.misfit[0] < 0.1
