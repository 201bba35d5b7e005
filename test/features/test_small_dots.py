"""Small dots in even light."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from ahf_ros.features.frame import ellipse_axes
from ahf_ros.features.log_edges import LOG_SCALE
from ahf_ros.features.pyramid import log_image
from ahf_ros.features.small_dots import small_dots


def drawn(dots: list[tuple[float, float, float, float, float]], polarity: int) -> np.ndarray:
    """Return an image of ellipses, drawn eight times as large."""
    ink = np.zeros((960, 1280), np.float32)
    for x, y, major, minor, angle in dots:
        centre = (round((x + 0.5) * 8 - 0.5), round((y + 0.5) * 8 - 0.5))
        axes = (round(8 * major), round(8 * minor))
        cv2.ellipse(ink, centre, axes, angle, 0, 360, 1.0, -1)
    ink = cv2.resize(ink, (160, 120), interpolation=cv2.INTER_AREA)
    ink = cv2.GaussianBlur(ink, (0, 0), 0.7)
    ground, dot = (200.0, 50.0) if polarity > 0 else (40.0, 200.0)
    return (ground + (dot - ground) * ink).astype(np.uint8)


@pytest.mark.parametrize('polarity', [1, -1])
def test_round_and_flat_dots_are_found_with_their_ellipses(polarity: int) -> None:
    dots = [
        (30.0, 30.0, 2.5, 2.5, 0.0),
        (80.3, 40.6, 5.0, 1.2, 30.0),
        (120.0, 90.0, 6.0, 3.0, 90.0),
    ]
    log = log_image(drawn(dots, polarity))
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
