"""Lines on images, each with a dark outline so that it is seen on any ground."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from ahf_ros.drawing.colours import OUTLINE_COLOUR, Colour

Ellipse = tuple[float, float, float, float, float]
"""Centre x and y, semi-major and semi-minor axis, px, and direction of the major one, rad."""

FONT = cv2.FONT_HERSHEY_SIMPLEX
FONT_HEIGHT = 22.0
"""Height of a capital of `FONT` at scale 1, px."""

_SHIFT = 4  # fractional bits of the coordinates that OpenCV draws
_DASHES = 10  # of an ellipse


def draw_ellipse(
    canvas: np.ndarray, ellipse: Ellipse, colour: Colour, unit: int, dashed: bool = False
) -> None:
    """Draw an ellipse, `unit` px wide."""
    x, y, semi_major, semi_minor, direction = ellipse
    centre, axes = (_fixed(x), _fixed(y)), (_fixed(semi_major), _fixed(semi_minor))
    angle, period = math.degrees(direction), 360 / _DASHES
    arcs = [(i * period, (i + 0.6) * period) for i in range(_DASHES)] if dashed else [(0, 360)]
    for shade, width in ((OUTLINE_COLOUR, 3 * unit), (colour, unit)):
        for start, end in arcs:
            cv2.ellipse(canvas, centre, axes, angle, start, end, shade, width, cv2.LINE_AA, _SHIFT)


def draw_polygon(
    canvas: np.ndarray, corners: Sequence[tuple[float, float]], colour: Colour, unit: int
) -> None:
    """Draw a closed polygon, `unit` px wide."""
    points = [np.array([(_fixed(x), _fixed(y)) for x, y in corners], np.int32)]
    for shade, width in ((OUTLINE_COLOUR, 3 * unit), (colour, unit)):
        cv2.polylines(canvas, points, True, shade, width, cv2.LINE_AA, _SHIFT)


def draw_plus(
    canvas: np.ndarray, x: float, y: float, arm: float, colour: Colour, unit: int
) -> None:
    """Draw an upright cross, `unit` px wide."""
    _draw_lines(canvas, x, y, ((arm, 0), (0, arm)), colour, unit, 3 * unit)


def cross_out(
    canvas: np.ndarray, x: float, y: float, arm: float, colour: Colour, unit: int
) -> None:
    """Draw a heavy diagonal cross."""
    _draw_lines(canvas, x, y, ((arm, arm), (arm, -arm)), colour, 3 * unit, 5 * unit)


def write(
    canvas: np.ndarray, text: str, place: tuple[int, int], colour: Colour, scale: float, unit: int
) -> None:
    """Write a text with its lower left corner at a place."""
    # The outline is the text, displaced: a wider stroke is not the same in all versions of OpenCV.
    places = [(unit * i, unit * j, OUTLINE_COLOUR) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    for across, down, shade in (*places, (0, 0, colour)):
        corner = (place[0] + across, place[1] + down)
        cv2.putText(canvas, text, corner, FONT, scale, shade, 2 * unit, cv2.LINE_AA)


def text_size(text: str, scale: float, unit: int) -> tuple[int, int]:
    """Return width and height of a text, px."""
    (width, height), _ = cv2.getTextSize(text, FONT, scale, 2 * unit)
    return width, height


def _draw_lines(
    canvas: np.ndarray,
    x: float,
    y: float,
    arms: tuple[tuple[float, float], ...],
    colour: Colour,
    width: int,
    outline: int,
) -> None:
    for shade, thickness in ((OUTLINE_COLOUR, outline), (colour, width)):
        for across, down in arms:
            start = (_fixed(x - across), _fixed(y - down))
            end = (_fixed(x + across), _fixed(y + down))
            cv2.line(canvas, start, end, shade, thickness, cv2.LINE_AA, _SHIFT)


def _fixed(coordinate: float) -> int:
    return round(coordinate * 2**_SHIFT)
