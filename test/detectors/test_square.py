"""Identification of square markers on rendered scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ahf_ros.detectors import create_detector
from ahf_ros.evaluation import score
from ahf_ros.session import identify
from ahf_ros.synthetic.scene import Rendering, SceneSettings, render
from ahf_ros.target import Target
from support.square_markers import needs_square_markers

pytestmark = needs_square_markers
SCENE = SceneSettings(
    width=1000, height=750, targets=6, family='aruco_4x4_50', dot_radius=16.0, seed=3
)


def scored(rendering: Rendering, targets):
    return score(rendering, targets)


@pytest.mark.parametrize(
    ('detector', 'family'),
    [
        ('aruco', 'aruco_4x4_50'),
        ('aruco', 'aruco_6x6_250'),
        ('apriltag', 'apriltag_36h11'),
        ('apriltag', 'apriltag_25h9'),
    ],
)
@pytest.mark.parametrize('tilt', [0.0, 45.0])
def test_markers_and_their_physical_centres(detector, family, tilt):
    rendering = render(replace(SCENE, family=family, tilt=tilt, targets=4))
    made = create_detector(family=family)
    assert (made.name, made.family) == (detector, family)
    figures = scored(rendering, made(rendering.image))
    assert (figures.right, figures.wrong, figures.false_positives) == (4, 0, 0)
    assert figures.rmse[2] < 0.03


def test_the_ellipse_is_inscribed_in_the_marker():
    rendering = render(SCENE)
    true = {target.id: target for target in rendering.targets}
    for target in create_detector(family=SCENE.family)(rendering.image):
        assert target.semi_major == pytest.approx(true[target.id].semi_major, rel=0.03)
        assert target.semi_minor == pytest.approx(true[target.id].semi_minor, rel=0.03)


@pytest.mark.parametrize(('gamma', 'low', 'high'), [(1.0, -0.03, 0.03), (2.2, -0.42, -0.28)])
def test_the_shift_that_gamma_causes_is_reported_and_does_not_change_the_size(gamma, low, high):
    rendering = render(replace(SCENE, gamma=gamma, dot_radius=30.0, targets=2))
    true = {target.id: target for target in rendering.targets}
    found = create_detector(family=SCENE.family)(rendering.image)
    assert len(found) == 2
    for target in found:
        assert low < target.edge_shift < high
        assert target.semi_major == pytest.approx(true[target.id].semi_major, rel=0.002)


def test_markers_of_another_dictionary_are_not_seen():
    rendering = render(SCENE)
    assert create_detector(family='aruco_7x7_50')(rendering.image) == []


def test_the_filter_finds_markers_that_stripes_hide():
    rendering = render(replace(SCENE, light='stripe', ambient=0.12))
    detector = create_detector(family=SCENE.family)
    without = scored(rendering, detector(rendering.image))
    identification = identify(
        rendering.image, detector=detector, expected_targets=6, max_evaluations=40
    )
    found = scored(rendering, identification.targets)
    assert found.right >= 2 * max(without.right, 1)
    assert (found.wrong, found.false_positives) == (0, 0)


@pytest.mark.parametrize('light', ['stripe', 'lattice', 'fringe'])
def test_places_are_those_of_the_image_as_received(light):
    rendering = render(replace(SCENE, light=light, ambient=0.3))
    detector = create_detector(family=SCENE.family)
    found = identify(rendering.image, detector=detector, expected_targets=6)
    figures = scored(rendering, found.targets)
    assert (figures.right, figures.wrong, figures.false_positives) == (6, 0, 0)
    assert figures.rmse[2] < 0.08
    again = detector.refine(rendering.image, found.targets)
    for one, other in zip(found.targets, again, strict=True):
        assert (other.x, other.y) == pytest.approx((one.x, one.y), abs=0.02)


def test_corners_are_those_of_the_marker():
    rendering = render(SCENE)
    for target in create_detector(family=SCENE.family)(rendering.image):
        corners = np.array(target.corners)
        sides = np.roll(corners, -1, axis=0) - corners
        assert np.hypot(*sides.T) == pytest.approx(np.full(4, 2 * target.semi_major), rel=0.15)
        across, down = sides[:2]
        assert across[0] * down[1] > across[1] * down[0]  # clockwise as seen, y pointing down


def test_what_has_no_corners_or_no_sides_stays_where_it_is():
    rendering = render(SCENE)
    detector = create_detector(family=SCENE.family)
    markers = detector(rendering.image)
    others = [Target(1, 1, 50.0, 60.0, 5.0, 5.0), Target(2, 2, -900.0, 60.0, 5.0, 5.0)]
    assert detector.refine(rendering.image, others) == others
    plain = np.tile(np.arange(1000, dtype=np.uint8), (750, 1))
    assert detector.refine(plain, markers) == markers
    assert detector.refine(rendering.image, []) == []


def test_any_kind_of_image():
    rendering = render(SCENE)
    detector = create_detector(family=SCENE.family)
    same = detector(rendering.image)
    for image in (rendering.image.astype(np.uint16) * 16, rendering.image[:, ::-1][:, ::-1]):
        assert [target.id for target in detector(image)] == [it.id for it in same]
    with pytest.raises(ValueError, match='image has shape'):
        detector(np.zeros((50, 50, 3), np.uint8))
