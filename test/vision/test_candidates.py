"""Candidates: votes for the centres of dots, counted in cells, and their peaks between them."""

from collections.abc import Sequence

import numpy as np
import pytest

from ahf_ros.vision import candidates
from ahf_ros.vision.candidates import find_candidates, find_peaks
from ahf_ros.vision.pyramid import image_pyramid
from support.drawn_dots import drawn, in_stripes

SHAPE = (2, 40, 60)
"""Planes, rows and columns of cells."""


def voted(gray: np.ndarray, polarities: Sequence[int] = (1,)) -> tuple[np.ndarray, np.ndarray]:
    """Return points in the pixels of the image, and their polarity."""
    groups = find_candidates(image_pyramid(gray, 60.0).edges, 4, 60, polarities)
    points = [(group.points + 0.5) * 2.0**group.level - 0.5 for group in groups]
    return np.concatenate(points), np.concatenate([group.polarity for group in groups])


def test_an_image_without_edges_has_no_candidates() -> None:
    points, _ = voted(np.full((60, 80), 40, np.uint8), (1, -1))
    assert points.shape == (0, 2)


@pytest.mark.parametrize('radius', [5.0, 9.0, 18.0, 40.0])
@pytest.mark.parametrize('polarity', [1, -1])
def test_votes_find_dots_of_all_sizes_under_stripes(radius: float, polarity: int) -> None:
    colours = (220, 40) if polarity == 1 else (40, 220)
    gray = in_stripes(drawn([(150.0, 120.0, radius)], *colours), round(2.2 * radius), 0.4)
    points, polarities = voted(gray, (polarity,))
    assert set(polarities) == {polarity}
    assert np.linalg.norm(points - (150, 120), axis=1).min() < 0.3 * radius


@pytest.mark.parametrize('radius', [4.6, 5.6, 6.6])
@pytest.mark.parametrize('shift', [0.0, 2.3, 4.6, 6.9])
def test_small_dots_are_placed_between_pixels_under_fine_stripes(
    radius: float, shift: float
) -> None:
    points, _ = voted(in_stripes(drawn([(150.3 + shift, 120.4, radius)]), 19, 0.4))
    assert np.linalg.norm(points - (150.3 + shift, 120.4), axis=1).min() < 0.25 * radius


@pytest.mark.parametrize('angle', [0.0, 0.4, 1.1, 2.0])
@pytest.mark.parametrize('aspect', [0.65, 0.5, 0.42])
def test_votes_find_the_middles_of_oblique_dots_under_stripes(angle: float, aspect: float) -> None:
    points, _ = voted(in_stripes(drawn([(150, 120, 20, 20 * aspect, angle)]), 50, 0.4))
    assert np.linalg.norm(points - (150, 120), axis=1).min() < 0.25 * 20 * aspect**0.5


@pytest.mark.parametrize('polarity', [1, -1])
def test_only_the_polarity_that_is_asked_for_votes(polarity: int) -> None:
    points, _ = voted(drawn([(150.0, 120.0, 12.0)]), (polarity,))
    near = np.linalg.norm(points - (150, 120), axis=1) < 3
    assert near.any() == (polarity == 1)


def test_stripes_alone_get_no_votes() -> None:
    points, _ = voted(in_stripes(drawn([]), 26, 0.2), (1, -1))
    assert len(points) == 0


def test_many_bright_spots_do_not_crowd_out_dark_dots(monkeypatch: pytest.MonkeyPatch) -> None:
    gray = drawn([(x, y, 8.0) for x in range(20, 200, 30) for y in range(20, 230, 30)], 30, 220)
    gray[:, 200:] = in_stripes(drawn([(230.0, 60.0, 8.0), (280.0, 150.0, 8.0)]), 18, 0.4)[:, 200:]
    edges = image_pyramid(gray, 60.0).edges
    every = find_candidates(edges, 4, 60, (1, -1))
    monkeypatch.setattr(candidates, 'MAXIMUM_CANDIDATES', 2)
    few = find_candidates(edges, 4, 60, (1, -1))
    for polarity in (1, -1):
        counts = [np.count_nonzero(group.polarity == polarity) for group in every]
        assert max(counts) > 0
        kept = [np.count_nonzero(group.polarity == polarity) for group in few]
        assert kept == [min(count, 2) for count in counts]


def votes_about(x: float, y: float, plane: int, count: int) -> np.ndarray:
    """Return votes scattered about a point."""
    scatter = np.random.default_rng(3).normal(0, 0.7, (2, count))
    columns, rows = np.rint(np.array([[x], [y]]) + scatter).astype(int)
    votes = np.zeros(SHAPE, np.uint16)
    np.add.at(votes[plane], (rows, columns), 1)
    return votes


@pytest.mark.parametrize('plane', [0, 1])
@pytest.mark.parametrize('x', [20.0, 20.3, 20.5, 20.8])
def test_a_peak_lies_between_cells(plane: int, x: float) -> None:
    peaks = find_peaks(votes_about(x, 15.4, plane, 400), 100, 2)
    assert peaks.plane.tolist() == [plane]
    assert (peaks.x[0], peaks.y[0]) == pytest.approx((x, 15.4), abs=0.15)
    assert peaks.votes[0] > 1


def test_too_few_votes_make_no_peak() -> None:
    assert len(find_peaks(votes_about(20, 15, 0, 60), 100, 2).x) == 0
    assert len(find_peaks(np.zeros(SHAPE, np.uint16), 100, 2).x) == 0


def test_peaks_of_two_planes_do_not_touch() -> None:
    votes = votes_about(20, 36, 0, 300) + votes_about(20, 3, 1, 400)
    peaks = find_peaks(votes, 100, 2)
    assert sorted(peaks.plane.tolist()) == [0, 1]


def test_votes_of_large_images_are_counted_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    dots = [(80.0, 80.0, 12.0), (200.0, 90.0, 20.0, 9.0, 0.5), (120.0, 180.0, 5.0)]
    gray = in_stripes(drawn(dots), 31, 0.4)
    whole = voted(gray, (1, -1))
    monkeypatch.setattr(candidates, '_MOST_CELLS', 1)
    parts = voted(gray, (1, -1))
    for one, other in zip(whole, parts, strict=True):
        assert np.array_equal(np.sort(one, axis=0), np.sort(other, axis=0))
