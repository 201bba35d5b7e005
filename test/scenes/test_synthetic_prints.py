"""Prints are put into the image without bias."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from ahf_ros.prints.ring import family
from ahf_ros.scenes import prints
from ahf_ros.scenes.camera import Camera, tilted_camera
from ahf_ros.scenes.covers import Cover, distractor_cover, ink_cover
from ahf_ros.scenes.prints import Mark, print_mark

RING = family('metashape12')


def camera(tilt: float = 0.0) -> Camera:
    return tilted_camera(200, 160, 800.0, math.radians(tilt), 0.0, np.random.default_rng(1))


def printed(mark: Mark, looking: Camera, blur: float = 0.7) -> np.ndarray:
    """Return the ink in each pixel under even light."""
    image = np.zeros((160, 200), np.float32)
    print_mark(image, np.ones_like(image), mark, looking, 1.0, blur)
    return image


def target(centre: tuple[float, float], radius: float, turn: float = 0.3) -> Mark:
    return Mark(np.array(centre), radius, RING.band_outer, ink_cover(RING.ink(71), turn))


def ellipse_mask(mark: Mark, looking: Camera, radius: float) -> np.ndarray:
    y, x = np.mgrid[:160, :200].astype(float)
    wall = looking.wall(np.stack((x.ravel(), y.ravel()), axis=1))
    return (np.hypot(*(wall - mark.centre).T) < radius * mark.radius).reshape(160, 200)


@pytest.mark.parametrize('blur', [0.0, 0.7, 2.0])
@pytest.mark.parametrize('centre', [(0.0, 0.0), (5.37, -11.81), (-20.123, 8.77)])
def test_dots_have_their_centroid_and_area(centre: tuple[float, float], blur: float) -> None:
    looking = camera()
    mark = target(centre, 12.0)
    dot = printed(mark, looking, blur) * ellipse_mask(mark, looking, 1.6)
    y, x = np.mgrid[:160, :200]
    truth = looking.project(mark.centre[None])[0]
    bound = 0.001 if blur >= 0.7 else 0.004
    assert abs((dot * x).sum() / dot.sum() - truth[0]) < bound
    assert abs((dot * y).sum() / dot.sum() - truth[1]) < bound
    assert dot.sum() == pytest.approx(math.pi * 12.0**2, rel=1e-3)


def test_the_band_covers_its_sectors() -> None:
    looking = camera()
    mark = target((1.3, 2.4), 12.0)
    ink = printed(mark, looking).sum()
    band = math.pi * (RING.band_outer**2 - RING.band_inner**2) * 4 / 12
    assert ink == pytest.approx((math.pi + band) * 144, rel=1e-3)


def test_sector_zero_starts_at_the_turn_and_goes_counter_clockwise() -> None:
    looking = camera()
    x, y = looking.project(np.zeros((1, 2)))[0]
    radius = 12.0 * (RING.band_inner + RING.band_outer) / 2
    for turn in (0.0, 1.0, 4.0):
        ink = printed(target((0.0, 0.0), 12.0, turn), looking)
        angles = turn + (np.arange(12) + 0.5) * math.pi / 6
        columns = np.float32(x + radius * np.cos(angles))[None]
        rows = np.float32(y - radius * np.sin(angles))[None]
        read = cv2.remap(ink, columns, rows, cv2.INTER_LINEAR)[0]
        assert np.flatnonzero(read > 0.5).tolist() == [0, 1, 2, 6]
        assert np.abs(read - (read > 0.5)).max() < 0.01


def test_prints_under_tilt_match_brute_force() -> None:
    """Eight times eight hard samples a pixel, the unfiltered definition of the print."""
    looking = camera(tilt=60.0)
    mark = target((3.0, -4.0), 14.0)
    fine = (np.arange(8) + 0.5) / 8 - 0.5
    x = (np.arange(200)[:, None] + fine).ravel()
    y = (np.arange(160)[:, None] + fine).ravel()
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    offset = (looking.wall(grid) - mark.centre) / mark.radius
    distance = np.hypot(*offset.T)
    sector = np.floor((np.arctan2(-offset[:, 1], offset[:, 0]) - 0.3) * 12 / (2 * math.pi)) % 12
    inked = np.isin(sector, (0, 1, 2, 6)) & (distance > RING.band_inner)
    inked = (inked & (distance < RING.band_outer)) | (distance < 1)
    brute = inked.reshape(160, 8, 200, 8).mean(axis=(1, 3)).astype(np.float32)
    error = printed(mark, looking, 0.0) - brute
    assert np.abs(error).max() < 0.15
    assert np.sqrt((error**2).sum() / (brute * (1 - brute) > 0).sum()) < 0.03
    assert error.sum() / brute.sum() == pytest.approx(0, abs=1e-3)


def test_a_pinhole_is_white() -> None:
    looking = camera()
    mark = Mark(np.zeros(2), 12.0, 3.5, ink_cover(RING.ink(71, 0.25), 0.0))
    change = printed(target((0.0, 0.0), 12.0, 0.0), looking) - printed(mark, looking)
    assert change.sum() == pytest.approx(math.pi * 3.0**2, rel=0.01)


def test_circles_are_inked_and_grow() -> None:
    looking, circled = camera(), replace(RING, circles=((4.0, 4.5),))
    marks = [
        Mark(np.zeros(2), 10.0, 4.6, ink_cover(of.ink(71), 0.0, 0.05)) for of in (RING, circled)
    ]
    change = printed(marks[1], looking) - printed(marks[0], looking)
    assert change.sum() == pytest.approx(math.pi * (45.5**2 - 39.5**2), rel=0.01)


def test_blocks_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    looking = camera(tilt=30.0)
    mark = target((2.0, 3.0), 13.0)
    whole = printed(mark, looking)
    monkeypatch.setattr(prints, '_BLOCK_PIXELS', 900)
    assert np.abs(printed(mark, looking) - whole).max() < 1e-5


def test_a_mark_may_be_cut_by_the_frame() -> None:
    looking = camera()
    corner = looking.wall(np.array([[199.0, 0.0]]))[0]
    ink = printed(Mark(corner, 20.0, 3.5, ink_cover(RING.ink(71), 0.0)), looking)
    assert ink[3, 196] == pytest.approx(1, abs=1e-3)


def test_light_falls_on_prints() -> None:
    looking = camera()
    light = np.full((160, 200), 0.25, np.float32)
    image = light.copy()
    print_mark(image, light, target((0.0, 0.0), 12.0), looking, -0.9, 0.7)
    assert image.min() == pytest.approx(0.025, abs=1e-3)
    assert image.max() == pytest.approx(0.25, abs=1e-3)


def test_distractors_stay_in_their_circle() -> None:
    y, x = np.float32(np.mgrid[-1.2:1.2:200j, -1.2:1.2:200j])
    generator = np.random.default_rng(0)
    covers: list[Cover] = [distractor_cover(generator)[0] for _ in range(30)]
    inks = [cover(x, y, np.float32(np.eye(2) * 0.012)) for cover in covers]
    assert all(ink.max() > 0.4 for ink in inks)
    assert all(ink[np.hypot(x, y) > 1.03].max() < 0.02 for ink in inks)
    assert len({round(float(ink.sum())) for ink in inks}) > 20
