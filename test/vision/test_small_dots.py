"""Small dots in even light."""

import numpy as np
import pytest

from ahf_ros.vision import small_dots as module
from ahf_ros.vision.frame import ellipse_axes
from ahf_ros.vision.log_edges import LOG_SCALE
from ahf_ros.vision.pyramid import log_image
from ahf_ros.vision.small_dots import small_dots
from support.drawn_dots import drawn


@pytest.mark.parametrize('polarity', [1, -1])
def test_round_and_flat_dots_are_found_with_their_ellipses(polarity: int) -> None:
    dots = [(30, 30, 2.5, 2.5, 0.0), (80.3, 40.6, 5.0, 1.2, 0.5), (120, 90, 6.0, 3.0, 1.6)]
    colours = (200, 50) if polarity == 1 else (40, 200)
    log = log_image(drawn(dots, *colours, shape=(120, 160)))
    found = small_dots(log, 1.5, 8.0, (polarity,), LOG_SCALE)
    assert found.polarity.tolist() == [polarity] * 3
    order = np.argsort(found.frames[:, 0, 2])
    for (x, y, major, minor, _), frame in zip(dots, found.frames[order], strict=True):
        assert frame[:2, 2] == pytest.approx((x, y), abs=0.3)
        axes = [float(values[0]) for values in ellipse_axes(frame[None])]
        assert axes[0] == pytest.approx(major, abs=0.7)
        assert axes[1] == pytest.approx(minor, abs=0.7)


def test_lines_corners_and_flat_ground_are_no_dots() -> None:
    image = np.full((120, 160), 180, np.uint8)
    image[40:43] = 40
    image[80:, 100:] = 60
    assert not len(small_dots(log_image(image), 1.5, 8.0, (1, -1), LOG_SCALE).frames)
    assert not len(small_dots(log_image(image[:30]), 1.5, 8.0, (1, -1), LOG_SCALE).frames)


def test_a_blob_beside_a_long_column_is_part_of_it_and_one_at_the_border_is_a_dot() -> None:
    image = np.full((120, 160), 180, np.uint8)
    image[20:100, 60:62] = 40
    image[50:54, 62:65] = 40
    image[:5, 20:25] = image[-5:, 100:105] = 40
    found = small_dots(log_image(image), 1.5, 8.0, (1,), LOG_SCALE).frames[:, :2, 2]
    assert sorted(found.round().tolist()) == [[22, 2], [102, 117]]


def test_strips_of_large_images_show_the_same_dots(monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(3)
    places = [(x, y) for x in range(20, 300, 24) for y in range(20, 600, 24)]
    dots = [(*(place + generator.uniform(-6, 6, 2)), 3.0, 2.0, 0.3) for place in places]
    log = log_image(drawn(dots, 200, 50, shape=(600, 300)))
    whole = small_dots(log, 1.5, 8.0, (1, -1), LOG_SCALE)
    monkeypatch.setattr(module, '_STRIP', 300 * 40)
    parts = small_dots(log, 1.5, 8.0, (1, -1), LOG_SCALE)
    assert len(whole.frames) >= len(dots)
    assert np.allclose(*(np.sort(of.frames[:, :2, 2], axis=0) for of in (whole, parts)))
