"""Candidates: votes for the centres of dots."""

from __future__ import annotations

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from ahf_ros.features import candidates, frame
from ahf_ros.features.candidates import MAXIMUM_CANDIDATES
from ahf_ros.features.dot_search import whole_outlines
from ahf_ros.features.log_edges import LOG_SCALE, LogEdges, find_edges, mask_of
from ahf_ros.features.pyramid import halved, image_pyramid, log_image
from ahf_ros.imaging.logarithm import LOG_OFFSET
from ahf_ros.synthetic.scene import SceneSettings, render


def drawn(dots: list[tuple[float, float, float]], paper: int = 200, ink: int = 30) -> np.ndarray:
    """Return dots (x, y, radius) on paper, blurred as by a lens, in an image of 320 x 240 px."""
    image = np.full((4 * 240, 4 * 320), paper, np.uint8)
    for x, y, radius in dots:
        centre = (round((4 * x + 1.5) * 16), round((4 * y + 1.5) * 16))
        cv2.circle(image, centre, round(4 * radius * 16), ink, -1, cv2.LINE_AA, 4)
    small = cv2.resize(image, (320, 240), interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(small, (0, 0), 0.7)


def stripes(image: np.ndarray, period: int, shadow: float) -> np.ndarray:
    """Return an image; every other half period lies in the shadow."""
    lit = np.arange(image.shape[1]) % period < period / 2
    return np.rint(image * np.where(lit, 1, shadow)).astype(np.uint8)


def edges_of(gray: np.ndarray) -> tuple[LogEdges, ...]:
    return image_pyramid(gray, 60.0).edges


def places(groups: list[candidates.Candidates]) -> tuple[np.ndarray, np.ndarray]:
    """Return points in the pixels of the image, and their polarity."""
    points = [(group.points + 0.5) * 2.0**group.level - 0.5 for group in groups]
    return np.concatenate(points), np.concatenate([group.polarity for group in groups])


def test_the_logarithm_of_bytes_and_of_numbers_is_the_same():
    gray = np.arange(256, dtype=np.uint8).reshape(16, 16)
    log = log_image(gray)
    assert log.dtype == np.int16
    assert log[0, 0] == int(LOG_SCALE * np.log(LOG_OFFSET))
    assert np.abs(log_image(gray.astype(np.float32)) - log).max() <= 1


def test_a_step_is_as_high_in_the_shadow_as_in_the_light():
    dark, bright = np.float32([[20, 60]]), np.float32([[100, 220]])
    offset = np.float32(LOG_OFFSET)
    shadow = (np.concatenate([dark, bright]) + offset) * np.float32(0.4) - offset
    light = log_image(np.concatenate([dark, bright]))
    assert np.abs(np.diff(light, axis=0) - np.diff(log_image(shadow), axis=0)).max() < 3


@pytest.mark.parametrize('shape', [(64, 48), (65, 49), (16, 17)])
def test_a_pixel_of_the_pyramid_is_the_mean_of_four(shape):
    image = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    first, second, third, _ = halved(image, 3)
    height, width = shape[0] // 2, shape[1] // 2
    assert first is image
    assert second.shape == (height, width)
    assert third.shape == (height // 2, width // 2)
    even = image[: 2 * height, : 2 * width].astype(float)
    means = even.reshape(height, 2, width, 2).mean(axis=(1, 3))
    assert np.abs(second - means).max() <= 0.5


def test_edges_lie_on_steps_and_point_to_the_bright_side():
    gray = np.full((60, 80), 40, np.uint8)
    gray[:, 41:] = 160
    edges = find_edges(log_image(gray))
    assert len(edges.x) >= 50
    assert set(edges.x) <= {40, 41}
    assert edges.unit_x == pytest.approx(1, abs=1e-6)
    assert edges.unit_y == pytest.approx(0, abs=1e-6)


def test_an_image_without_edges_has_no_candidates():
    gray = np.full((60, 80), 40, np.uint8)
    edges = edges_of(gray)
    assert all(len(level.x) == 0 for level in edges)
    assert whole_outlines(edges[0], 2, 30).frames.shape == (0, 3, 3)
    points, _ = places(candidates.find_candidates(edges, 4, 60, (1, -1)))
    assert points.shape == (0, 2)


@pytest.mark.parametrize('polarity', [1, -1])
@pytest.mark.parametrize(('paper', 'ink'), [(200, 30), (70, 20)], ids=['lit', 'shadow'])
def test_a_whole_outline_is_an_ellipse(polarity, paper, ink):
    colours = (paper, ink) if polarity == 1 else (ink, paper)
    gray = drawn([(100.3, 80.6, 14.0)], *colours)
    dots = whole_outlines(edges_of(gray)[0], 2, 30)
    assert dots.polarity.tolist() == [polarity]
    whole = frame.enlarged(dots.frames, 1)
    assert whole[0, :2, 2] == pytest.approx((100.3, 80.6), abs=0.3)
    major, minor, _ = frame.ellipse_axes(whole)
    assert (major[0], minor[0]) == pytest.approx((14, 14), abs=1)


def test_outlines_of_another_size_are_left_out():
    edges = edges_of(drawn([(80, 80, 8.0), (200, 120, 24.0)]))[0]
    small = whole_outlines(edges, 2, 7).frames
    large = whole_outlines(edges, 7, 30).frames
    assert frame.enlarged(small, 1)[:, :2, 2] == pytest.approx(np.array([[80, 80]]), abs=0.5)
    assert frame.enlarged(large, 1)[:, :2, 2] == pytest.approx(np.array([[200, 120]]), abs=0.5)


def test_edges_within_polygons_are_left_out():
    edges = edges_of(drawn([(80, 80, 10.0), (200, 120, 10.0)]))[0]
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * 12.0
    rest = edges.unmasked(mask_of([square + 39.75], edges.marked.shape))
    assert 0 < len(rest.x) < len(edges.x)
    assert rest.x.min() > 80


@pytest.mark.parametrize('radius', [5.0, 9.0, 18.0, 40.0])
@pytest.mark.parametrize('polarity', [1, -1])
def test_votes_find_dots_of_all_sizes_under_stripes(radius, polarity):
    colours = (220, 40) if polarity == 1 else (40, 220)
    gray = stripes(drawn([(150.0, 120.0, radius)], *colours), round(2.2 * radius), 0.4)
    points, polarities = places(candidates.find_candidates(edges_of(gray), 4, 60, (polarity,)))
    assert set(polarities) == {polarity}
    assert np.linalg.norm(points - (150, 120), axis=1).min() < 0.3 * radius


@pytest.mark.parametrize('radius', [4.6, 5.6, 6.6])
@pytest.mark.parametrize('shift', [0.0, 2.3, 4.6, 6.9])
def test_small_dots_are_placed_between_pixels_under_fine_stripes(radius, shift):
    gray = stripes(drawn([(150.3 + shift, 120.4, radius)]), 19, 0.4)
    points, _ = places(candidates.find_candidates(edges_of(gray), 4, 60, (1,)))
    assert np.linalg.norm(points - (150.3 + shift, 120.4), axis=1).min() < 0.25 * radius


@pytest.mark.parametrize('angle', [0.0, 0.4, 1.1, 2.0])
@pytest.mark.parametrize('aspect', [0.65, 0.5, 0.42])
def test_votes_find_the_middles_of_oblique_dots_under_stripes(angle, aspect):
    image = np.full((4 * 240, 4 * 320), 200, np.uint8)
    axes = (80 * 16, round(80 * aspect * 16))
    middle = (round((4 * 150 + 1.5) * 16), round((4 * 120 + 1.5) * 16))
    cv2.ellipse(image, middle, axes, np.degrees(angle), 0, 360, 30, -1, cv2.LINE_AA, 4)
    small = cv2.resize(image, (320, 240), interpolation=cv2.INTER_AREA)
    gray = stripes(cv2.GaussianBlur(small, (0, 0), 0.7), 50, 0.4)
    points, _ = places(candidates.find_candidates(edges_of(gray), 4, 60, (1,)))
    assert np.linalg.norm(points - (150, 120), axis=1).min() < 0.25 * 20 * aspect**0.5


def test_only_the_polarity_that_is_asked_for_votes():
    edges = edges_of(drawn([(150.0, 120.0, 12.0)]))
    points, polarity = places(candidates.find_candidates(edges, 4, 60, (1,)))
    near = np.linalg.norm(points - (150, 120), axis=1) < 3
    assert near.any()
    assert (polarity == 1).all()
    points, _ = places(candidates.find_candidates(edges, 4, 60, (-1,)))
    assert not (np.linalg.norm(points - (150, 120), axis=1) < 3).any()


def test_stripes_alone_get_no_votes():
    gray = stripes(np.full((240, 320), 200, np.uint8), 26, 0.2)
    points, _ = places(candidates.find_candidates(edges_of(gray), 4, 60, (1, -1)))
    assert len(points) == 0


@pytest.mark.parametrize('light', ['stripe', 'lattice', 'shadow'])
def test_every_target_of_a_scene_is_a_candidate(light):
    scene = SceneSettings(
        width=1000, height=700, targets=9, dot_radius=18.0, light=light, ambient=0.12, seed=2
    )
    rendering = render(scene)
    edges = edges_of(rendering.image)
    points, _ = places(candidates.find_candidates(edges, 4, 60, (1,)))
    whole = frame.enlarged(whole_outlines(edges[0], 2, 30).frames, 1)[:, :2, 2]
    points = np.concatenate([points, whole])
    for target in rendering.targets:
        assert np.linalg.norm(points - (target.x, target.y), axis=1).min() < 0.35 * 18


def test_candidates_are_bounded_where_dots_are_everywhere():
    row, column = np.mgrid[:1200, :1600]
    gray = np.where(np.hypot(row % 12 - 6, column % 12 - 6) < 4.4, 30, 200).astype(np.uint8)
    groups = candidates.find_candidates(edges_of(gray), 4, 60, (1, -1))
    assert all(len(group.points) <= 2 * MAXIMUM_CANDIDATES for group in groups)


def test_many_bright_spots_do_not_crowd_out_dark_dots(monkeypatch):
    gray = drawn([(x, y, 8.0) for x in range(20, 200, 30) for y in range(20, 230, 30)], 30, 220)
    gray[:, 200:] = stripes(drawn([(230.0, 60.0, 8.0), (280.0, 150.0, 8.0)]), 18, 0.4)[:, 200:]
    edges = edges_of(gray)
    every = candidates.find_candidates(edges, 4, 60, (1, -1))
    monkeypatch.setattr(candidates, 'MAXIMUM_CANDIDATES', 2)
    few = candidates.find_candidates(edges, 4, 60, (1, -1))
    for polarity in (1, -1):
        counts = [np.count_nonzero(group.polarity == polarity) for group in every]
        assert max(counts) > 0
        kept = [np.count_nonzero(group.polarity == polarity) for group in few]
        assert kept == [min(count, 2) for count in counts]


def test_more_dots_than_are_looked_at_are_said_and_the_roundest_stay(monkeypatch):
    image = np.full((400, 400), 200, np.uint8)
    for row in range(20, 400, 40):
        for column in range(20, 400, 40):
            cv2.ellipse(image, (column, row), (9, 9 if row < 200 else 6), 30, 0, 360, 40, -1)
    edges = find_edges(log_image(image))
    messages: list[str] = []
    log = SimpleNamespace(warning=lambda text, *values: messages.append(text % values))
    monkeypatch.setattr('ahf_ros.features.dots._LOG', log)
    assert len(whole_outlines(edges, 4.0, 20.0).frames) == 100
    assert messages == []
    monkeypatch.setattr('ahf_ros.features.dot_search.MAXIMUM_OUTLINES', 30)
    assert len(whole_outlines(edges, 4.0, 20.0).frames) == 30
    assert messages == ['100 whole ellipses; the 30 best are looked at']
