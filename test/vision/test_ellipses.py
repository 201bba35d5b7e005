"""Ellipses of dots: fitted about candidates, refined, and lost where there is no edge."""

from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.vision import frame
from ahf_ros.vision.candidates import Candidates
from ahf_ros.vision.dots import Dots
from ahf_ros.vision.ellipses import fit_ellipses, refine_ellipses
from ahf_ros.vision.pyramid import image_pyramid, log_image
from support.drawn_dots import drawn


def half_in_shadow(gray: np.ndarray, x: float, y: float, angle: float) -> np.ndarray:
    """Return an image in shadow on one side of a line."""
    rows, columns = np.mgrid[: gray.shape[0], : gray.shape[1]]
    side = (columns - x) * np.cos(angle) + (rows - y) * np.sin(angle)
    return np.rint(gray * np.clip(0.65 + side / 2, 0.3, 1)).astype(np.uint8)


def refined(log: np.ndarray, ellipses: list[tuple[float, ...]], polarity: list[int]) -> Dots:
    starts = frame.affine_frames(*np.array(ellipses).reshape(-1, 5).T)
    return refine_ellipses(log, Dots(starts, np.array(polarity, int), np.zeros(len(polarity))))


ELLIPSES = [
    (100.3, 90.6, 9.0, 9.0, 0.0),
    (100.3, 90.6, 18.0, 12.0, 0.7),
    (110.0, 95.5, 30.0, 12.0, -1.2),
]


@pytest.mark.parametrize('ellipse', ELLIPSES, ids=['round', 'tilted', 'oblique'])
@pytest.mark.parametrize('polarity', [1, -1])
def test_a_start_that_is_near_comes_onto_the_edge(
    ellipse: tuple[float, float, float, float, float], polarity: int
) -> None:
    colours = (210, 30) if polarity == 1 else (30, 210)
    log = log_image(drawn([ellipse], *colours))
    x, y, major, minor, angle = ellipse
    start = (x + 0.1 * minor, y - 0.1 * minor, 1.1 * major, 1.08 * minor, angle)
    dots = refined(log, [start], [polarity])
    assert dots.polarity.tolist() == [polarity]
    assert dots.share[0] > 0.9
    assert dots.frames[0, :2, 2] == pytest.approx((x, y), abs=0.2)
    axes = [axis[0] for axis in frame.ellipse_axes(dots.frames)]
    # In the logarithm a blurred edge lies some way towards its dark side.
    assert axes[:2] == pytest.approx((major, minor), abs=0.8)
    if major > minor:
        assert axes[2] == pytest.approx(angle, abs=0.05)


@pytest.mark.parametrize('blur', [0.5, 2.0])
@pytest.mark.parametrize('polarity', [1, -1])
def test_the_size_of_a_dot_does_not_depend_on_its_blur(blur: float, polarity: int) -> None:
    ellipse = (100.3, 90.6, 18.0, 15.0, 0.7)
    gray = drawn([ellipse], *((210, 30) if polarity == 1 else (30, 210)))
    log = log_image(cv2.GaussianBlur(gray, (0, 0), blur))
    dots = refined(log, [ellipse], [polarity])
    assert frame.mean_radii(dots.frames)[0] == pytest.approx((18 * 15) ** 0.5, abs=0.25)


@pytest.mark.parametrize('angle', [0.0, 0.8, 2.0])
def test_an_edge_of_light_across_the_dot_moves_it_little(angle: float) -> None:
    gray = half_in_shadow(drawn([(100.3, 90.6, 16.0, 14.0, 0.3)]), 104, 92, angle)
    dots = refined(log_image(gray), [(101.0, 90.0, 15.0, 15.0, 0.0)], [1])
    assert dots.share[0] > 0.7
    assert dots.frames[0, :2, 2] == pytest.approx((100.3, 90.6), abs=0.4)


def test_what_the_edges_do_not_bear_out_is_left_out() -> None:
    log = log_image(drawn([(60, 60, 12, 12, 0)]))
    start = [(60, 60, 12, 12, 0), (160, 120, 12, 12, 0), (60, 60, 12, 12, 0)]
    dots = refined(log, start, [1, 1, -1])
    assert len(dots.frames) == len(dots.polarity) == len(dots.share) == 1
    assert dots.frames[0, :2, 2] == pytest.approx((60, 60), abs=0.1)


def test_nothing_in_nothing_out() -> None:
    log = log_image(drawn([(60, 60, 12, 12, 0)]))
    dots = refined(log, [], [])
    assert (dots.frames.shape, dots.polarity.shape, dots.share.shape) == ((0, 3, 3), (0,), (0,))


@pytest.mark.parametrize('level', [1, 2])
@pytest.mark.parametrize('ellipse', ELLIPSES, ids=['round', 'tilted', 'oblique'])
def test_an_ellipse_is_found_about_a_candidate(
    ellipse: tuple[float, float, float, float, float], level: int
) -> None:
    x, y, major, minor, _ = ellipse
    scale = 2.0**level
    size = np.sqrt(major * minor) / scale
    points = (np.array([[x + 1.5, y - 1.5]]) + 0.5) / scale - 0.5
    candidate = Candidates(level, points, (0.7 * size, 1.4 * size), np.array([1]))
    dots = fit_ellipses(image_pyramid(drawn([ellipse]), 60.0).logs, [candidate])
    assert dots.polarity.tolist() == [1]
    assert dots.frames[0, :2, 2] == pytest.approx((x, y), abs=0.3 * scale)
    fitted = [axis[0] for axis in frame.ellipse_axes(dots.frames)]
    assert fitted[:2] == pytest.approx((major, minor), abs=scale)


@pytest.mark.parametrize('direction', np.arange(0, 6, 0.7))
def test_a_circle_is_found_beside_a_candidate(direction: Any) -> None:
    x, y = 100.3 + 6 * np.cos(direction), 90.6 + 6 * np.sin(direction)
    candidate = Candidates(1, (np.array([[x, y]]) + 0.5) / 2 - 0.5, (5.8, 11.2), np.array([1]))
    gray = half_in_shadow(drawn([(100.3, 90.6, 13, 13, 0)]), 104, 92, 0.8)
    dots = fit_ellipses(image_pyramid(gray, 60.0).logs, [candidate])
    assert dots.frames[0, :2, 2] == pytest.approx((100.3, 90.6), abs=0.6)


def test_a_candidate_on_even_ground_has_no_ellipse() -> None:
    candidate = Candidates(1, np.array([[80.0, 20.0]]), (5.8, 11.2), np.array([1]))
    dots = fit_ellipses(image_pyramid(drawn([(60, 60, 12, 12, 0)]), 60.0).logs, [candidate])
    assert len(dots.frames) == len(dots.polarity) == len(dots.share) == 0
