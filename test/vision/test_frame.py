"""Frames: what they map where, how they change, what they say of ellipses."""

import numpy as np
import pytest

from ahf_ros.vision import frame

OBLIQUE = np.array([[[20.0, 3.0, 100.5], [-2.0, 12.0, 80.25], [0.02, -0.01, 1.0]]])
"""A homography whose projected centre is (100.5, 80.25)."""

ANGLES = np.linspace(0, 2 * np.pi, 24, endpoint=False)


def test_an_affine_frame_maps_the_unit_circle_onto_its_ellipse() -> None:
    frames = frame.affine_frames([50], [40], [9], [6], [np.deg2rad(30)])
    ends = np.array([[np.cos(np.pi / 6), np.sin(np.pi / 6)], [-0.5, np.sqrt(0.75)]])
    major_end, minor_end = frame.project(frames, ends)[0]
    assert major_end == pytest.approx((50 + 9 * np.sqrt(0.75), 44.5))
    assert minor_end == pytest.approx((47, 40 + 6 * np.sqrt(0.75)))


@pytest.mark.parametrize('degrees', [-89, -30, 0, 45, 90])
def test_axes_of_an_affine_frame_are_those_it_was_made_of(degrees: int) -> None:
    angle = np.deg2rad(degrees)
    major, minor, direction = frame.ellipse_axes(frame.affine_frames([1], [2], [9], [6], [angle]))
    assert (major[0], minor[0]) == pytest.approx((9, 6))
    assert np.exp(2j * direction[0]) == pytest.approx(np.exp(2j * angle))


def test_the_centre_of_a_homography_is_not_that_of_its_ellipse() -> None:
    angles = np.linspace(0, 2 * np.pi, 3600)
    outline = frame.project(OBLIQUE, frame.circle_points(angles, np.ones(1)))[0, :, 0]
    assert frame.project(OBLIQUE, np.zeros(2))[0] == pytest.approx((100.5, 80.25))
    middle = (outline.min(axis=0) + outline.max(axis=0)) / 2
    assert np.hypot(*(middle - (100.5, 80.25))) > 0.3


def test_each_frame_projects_points_of_its_own() -> None:
    frames = np.concatenate([OBLIQUE, frame.affine_frames([5], [6], [2], [2], [0])])
    points = np.array([[[[0.0, 0.0], [1.0, 0.0]]], [[[0.5, 0.0], [0.0, 1.0]]]])
    for own, of_frame, images in zip(frames, points, frame.project(frames, points), strict=True):
        assert images == pytest.approx(frame.project(own[None], of_frame)[0])


@pytest.mark.parametrize('unknown', range(7))
def test_the_basis_says_how_circles_move(unknown: int) -> None:
    changes = np.zeros((1, 7))
    changes[0, unknown] = 1e-5
    radii = np.array([1.0, 3.0])
    moved = frame.project(
        frame.moved(np.eye(3)[None], changes), frame.circle_points(ANGLES, radii)
    )[0]
    for number, radius in enumerate(radii):
        outwards = np.hypot(*moved[:, number].T) - radius
        basis = frame.displacement_basis(ANGLES, np.full(24, radius))[:, unknown]
        assert outwards == pytest.approx(1e-5 * basis, abs=1e-8)


def test_enlarged_frames_show_the_same_in_pixels_of_the_first_level() -> None:
    small = frame.affine_frames([10.5], [7.0], [4], [3], [0.3])
    large = frame.enlarged(small, 2)
    # The centre of the first pixel of level 2 lies between the four innermost of sixteen.
    assert large[0, :2, 2] == pytest.approx(((10.5 + 0.5) * 4 - 0.5, (7.0 + 0.5) * 4 - 0.5))
    assert frame.ellipse_axes(large)[0] == pytest.approx([16])


def test_the_local_map_is_the_derivative_at_the_centre() -> None:
    step = 1e-6
    ends = frame.project(OBLIQUE, step * np.array([[1.0, 0.0], [0.0, 1.0]]))[0]
    numeric = (ends - OBLIQUE[0, :2, 2]).T / step
    assert frame.local_affine(OBLIQUE)[0] == pytest.approx(numeric, rel=1e-4)


def test_the_axes_of_a_shape_give_it_again() -> None:
    square = frame.shapes(OBLIQUE)
    again = frame.affine_frames(1.0, 2.0, *frame.axes_of(square))
    root = frame.local_affine(again)
    assert root @ root == pytest.approx(square)
    assert root == pytest.approx(root.transpose(0, 2, 1))


def test_inverse_maps_undo_maps() -> None:
    maps = OBLIQUE[:, :2, :2] * np.arange(1.0, 4)[:, None, None]
    assert frame.inverses(maps) @ maps == pytest.approx(np.tile(np.eye(2), (3, 1, 1)))
    assert frame.determinants(maps) == pytest.approx(246 * np.arange(1, 4) ** 2)
