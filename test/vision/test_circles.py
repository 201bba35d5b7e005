"""Where edges of circles are expected."""

import numpy as np
import pytest

from ahf_ros.vision import frame
from ahf_ros.vision.circle_fit import dot_circles, on_circles
from ahf_ros.vision.edge_fit import edge_points

OBLIQUE = np.array([[[20.0, 3.0, 100.5], [-2.0, 12.0, 80.25], [0.02, -0.01, 1.0]]])
ANGLES = np.linspace(0, 2 * np.pi, 24, endpoint=False)


def test_a_dark_dot_is_brighter_outside() -> None:
    circles = dot_circles(np.array([1, -1]), 8)
    assert circles.polarity.tolist() == [[1] * 8, [-1] * 8]
    assert circles.line.tolist() == [1.0] * 8
    assert circles.group.tolist() == [0] * 8
    assert circles.spacing == pytest.approx(np.full(8, np.pi / 4))


def test_spacing_is_the_distance_to_the_next_point_of_a_circle() -> None:
    radii = np.repeat([1.0, 3.0], [16, 120])
    circles = on_circles(np.zeros(136), radii, (radii > 1).astype(int), np.ones((1, 136), int))
    assert circles.spacing[0] == pytest.approx(2 * np.pi / 16)
    assert circles.spacing[-1] == pytest.approx(2 * np.pi * 3 / 120)


def test_geometry_of_a_circle() -> None:
    frames = frame.affine_frames([50], [40], [8], [8], [0])
    circles = on_circles(ANGLES, np.full(24, 2.5), np.zeros(24, int), np.ones((1, 24), int))
    geometry = edge_points(frames, circles)
    normals = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
    assert geometry.normals[0] == pytest.approx(normals)
    assert geometry.points[0] == pytest.approx(np.array([50, 40]) + 20 * normals)
    assert geometry.scale[0] == pytest.approx(np.full(24, 8.0))
    assert geometry.spacing[0] == pytest.approx(np.full(24, 2 * np.pi / 24 * 20))
    assert geometry.curvature[0] == pytest.approx(np.full(24, 1 / 20))


def test_geometry_of_an_oblique_circle_is_that_of_its_points() -> None:
    step = 1e-4
    before, at, after = (
        frame.project(OBLIQUE, frame.circle_points(ANGLES + shift, np.ones(1)))[0, :, 0]
        for shift in (-step, 0, step)
    )
    along, bend = (after - before) / (2 * step), (after - 2 * at + before) / step**2
    speed = np.hypot(*along.T)
    geometry = edge_points(OBLIQUE, dot_circles([1], 24))
    assert geometry.points[0] == pytest.approx(at)
    assert geometry.spacing[0] == pytest.approx(2 * np.pi / 24 * speed, rel=1e-5)
    curvature = (along[:, 0] * bend[:, 1] - along[:, 1] * bend[:, 0]) / speed**3
    assert geometry.curvature[0] == pytest.approx(curvature, rel=1e-3)
    wider = frame.project(OBLIQUE, frame.circle_points(ANGLES, np.array([1 + step])))[0, :, 0]
    outwards = ((wider - at) * geometry.normals[0]).sum(axis=1) / step
    assert geometry.scale[0] == pytest.approx(outwards, rel=1e-2)
