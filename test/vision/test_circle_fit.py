"""Frames fitted to edges: exact where the edges are, robust, and honest about their errors."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from ahf_ros.vision import frame
from ahf_ros.vision.circle_fit import Fit, fit_circles, fit_dots, on_circles

BLUR = 0.7
DARK, BRIGHT = 40.0, 200.0


def drawn(frames: np.ndarray, side: int = 100, radii: Sequence[float] = (1.0,)) -> np.ndarray:
    """Return a target, dark inside, whose edges are blurred steps across circles.

    A blurred step across a circle differs from a blurred disc: its level halfway stays on the
    circle. `fit_circles` expects a disc, whose level halfway moves inwards by blur^2 / 2 radii.
    """
    rows, columns = np.mgrid[:side, :side]
    pixels = np.stack([columns.ravel(), rows.ravel(), np.ones(rows.size)])
    plane = np.linalg.inv(frames[0]) @ pixels
    radius = np.hypot(*(plane[:2] / plane[2])).reshape(side, side)
    scale = 1 / np.maximum(np.hypot(*np.gradient(radius)), 1e-3)  # px a radius across a circle

    def rise(edge: float) -> np.ndarray:
        outwards = (radius - edge) * scale
        outwards = outwards + BLUR**2 / 2 / np.maximum(radius * scale, 1)  # as of a disc
        return 1 / (1 + np.exp(-np.clip(1.702 * outwards / BLUR, -40, 40)))

    light = sum((-1) ** number * rise(edge) for number, edge in enumerate(radii))
    return DARK + (BRIGHT - DARK) * light


def dot_frame(x: float, y: float, radius: float = 12.0) -> np.ndarray:
    return frame.affine_frames([x], [y], [radius], [radius], [0.0])


def fitted(image: np.ndarray, start: np.ndarray) -> Fit:
    dark = np.ones(len(start), int)
    return fit_dots(image.astype(np.float32), start, dark, rays=48, reach=0.45)


def centre(fit: Fit) -> np.ndarray:
    return fit.frames[0, :2, 2]


PLACE, START = (50.2, 49.7), dot_frame(50.0, 50.0)
DISC = drawn(dot_frame(*PLACE))


@pytest.mark.parametrize('place', [(50.0, 50.0), (50.37, 49.81), (49.5, 50.5)])
def test_the_centre_and_the_radius_of_a_disc(place: tuple[float, float]) -> None:
    fit = fitted(drawn(dot_frame(*place)), dot_frame(51.0, 49.5, 12.7))
    assert centre(fit) == pytest.approx(place, abs=0.005)
    assert frame.ellipse_axes(fit.frames)[0] == pytest.approx([12.0], abs=0.03)
    assert fit.share[0] == 1
    assert fit.contrast[0] == pytest.approx(DARK / BRIGHT, abs=0.02)
    assert fit.bright[0] == pytest.approx(BRIGHT, abs=3)
    assert fit.deviation[0] < 0.05


def test_an_ellipse() -> None:
    shape = frame.affine_frames([50.3], [50.2], [15.0], [8.0], [0.6])
    fit = fitted(drawn(shape), frame.affine_frames([50.0], [50.0], [14.5], [8.5], [0.55]))
    major, minor, angle = frame.ellipse_axes(fit.frames)
    assert centre(fit) == pytest.approx((50.3, 50.2), abs=0.01)
    assert (major[0], minor[0], angle[0]) == pytest.approx((15.0, 8.0, 0.6), abs=0.05)


def test_circles_of_several_groups_give_the_image_of_the_centre() -> None:
    """That of the dot's ellipse is 0.1 px beside it; the print is a little off its design."""
    oblique = np.array([[[11.0, 1.5, 60.3], [0.5, 7.0, 59.8], [0.012, -0.01, 1.0]]])
    designed, printed = np.array([1.0, 2.25, 3.5, 4.5]), np.array([1.0, 2.26, 3.49, 4.49])
    image = drawn(oblique, 120, printed).astype(np.float32)
    major, minor, angle = frame.ellipse_axes(oblique)
    start = frame.affine_frames([60.5], [59.5], major, minor, angle)
    by_dot = fitted(image, start)
    rays = 96
    angles = np.tile(2 * np.pi * np.arange(rays) / rays, len(designed))
    polarity = np.repeat([1, -1, 1, -1], rays)[None]
    circles = on_circles(angles, np.repeat(designed, rays), np.repeat(range(4), rays), polarity)
    joint = fit_circles(image, by_dot.frames, circles, reach=0.3, projective=True)
    joint = fit_circles(image, joint.frames, circles, reach=0.3, projective=True)
    errors = [np.hypot(*(centre(fit) - (60.3, 59.8))) for fit in (by_dot, joint)]
    assert errors[0] > 0.08
    assert errors[1] < 0.015
    assert joint.share[0] > 0.9


@pytest.mark.parametrize(
    ('light', 'error'),
    [
        (np.ones(100), 0.005),
        (np.exp(0.015 * (np.arange(100.0) - 50)), 0.025),  # a fifth brighter from side to side
        (0.3 + 0.7 / (1 + np.exp(-(np.arange(100.0) - 53.3) / 0.6)), 0.05),
    ],
    ids=['even', 'slope', 'edge'],
)
def test_light_hardly_moves_the_centre(light: str, error: float) -> None:
    assert centre(fitted(DISC * light, START)) == pytest.approx(PLACE, abs=error)


@pytest.mark.parametrize('colour', [DARK, 110.0, 255.0])
def test_an_edge_that_is_hidden_is_left_out(colour: Any) -> None:
    """A bar over a quarter of the dot, whatever its colour, has edges that are not the dot's."""
    image = DISC.copy()
    image[:, 57:] = colour
    fit = fitted(image, START)
    assert centre(fit) == pytest.approx(PLACE, abs=0.06)
    assert 0.5 < fit.share[0] < 0.85
    assert fit.covariance[0, 0, 0] > 1.5 * fitted(DISC, START).covariance[0, 0, 0]


def test_where_there_is_no_edge_nothing_is_in_place() -> None:
    fit = fitted(np.full((100, 100), 90.0), START)
    assert fit.share[0] == 0
    assert np.isfinite(fit.frames).all()


def test_dots_do_not_depend_on_each_other() -> None:
    image = drawn(dot_frame(30.2, 40.1)) + drawn(dot_frame(70.4, 60.3)) - BRIGHT
    starts = [dot_frame(30.0, 40.0), dot_frame(70.0, 60.0)]
    together = fitted(image, np.concatenate(starts))
    for index, start in enumerate(starts):
        alone = fitted(image, start)
        # BLAS may round batches of another size otherwise.
        assert together.select(np.array([index])).frames == pytest.approx(alone.frames, abs=1e-6)
    halves = [together.select(np.array([index])) for index in (0, 1)]
    assert (Fit.joined(halves).frames == together.frames).all()


@pytest.mark.parametrize('deviation, least', [(1.0, 1.5), (2.0, 1.4), (6.0, 0.7)])
def test_the_covariance_is_that_of_the_errors(deviation: float, least: float) -> None:
    """A hundred discs under noise: e' C^-1 e is 2 on average, with a standard error of 0.2.

    Strong noise is taken for light that is uneven, which makes the covariance too large.
    """
    generator = np.random.default_rng(7)
    corners = 40 * np.stack(np.divmod(np.arange(100), 10), axis=1)
    places = 20 + generator.uniform(-0.5, 0.5, (100, 2))
    image = generator.normal(0, deviation, (400, 400))
    for (x, y), place in zip(corners, places, strict=True):
        image[y : y + 40, x : x + 40] += drawn(dot_frame(*place), side=40)
    fit = fitted(image, frame.affine_frames(*(corners.T + 20), 12.0, 12.0, 0.0))
    errors = fit.frames[:, :2, 2] - corners - places
    squares = np.einsum('ki,kij,kj->k', errors, np.linalg.inv(fit.covariance), errors)
    assert least < np.mean(squares) < 2.6


def test_edges_of_the_band_alone_do_not_make_a_share() -> None:
    """A band is where it should be, and the dot in its middle is smaller than its print."""
    radii = (0.8, 2.0, 3.0)
    count = 48
    angles = 2 * np.pi * np.arange(count) / count
    circles = on_circles(
        angles=np.tile(angles, 3),
        radii=np.repeat([1.0, 2.0, 3.0], count),
        polarity=np.repeat([[1, -1, 1]], count, axis=1),
        group=np.repeat([0, 1, 1], count),
    )
    place = dot_frame(50.0, 50.0, 14.0)
    image = drawn(place, radii=radii).astype(np.float32)
    fit = fit_circles(image, place, circles, reach=0.15, projective=True, uneven=True)
    assert fit.share[0] < 0.1
