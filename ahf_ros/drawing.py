"""Overlays: what was identified, drawn on the image."""

from __future__ import annotations

import math
from collections.abc import Collection

import cv2
import numpy as np

from ahf_ros.imaging.image import stretched_to_8_bit
from ahf_ros.target import UNDECODED, Identification, Target

DECODED_COLOUR = (60, 230, 60)
"""Blue, green, red of a decoded target."""

WRONG_COLOUR = (60, 60, 255)
"""Blue, green, red of a target that is known to be wrong."""

UNDECODED_COLOUR = (0, 190, 255)
"""Blue, green, red of a target without a code word."""

_OUTLINE_COLOUR = (0, 0, 0)
_TEXT_COLOUR = (255, 255, 255)
_SHIFT = 4  # fractional bits of the coordinates that OpenCV draws
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_FONT_HEIGHT = 22.0  # px of a capital at scale 1


def draw(
    image: np.ndarray, identification: Identification, wrong: Collection[Target] = ()
) -> np.ndarray:
    """Return the image in colour with the dot, the centre and the ID of every target.

    A line at the top says how many were identified, and through which filter. Lines and letters
    grow with the image, so that they can be read where it is shown as a whole.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Gray values; those of more than 8 bit are scaled, extremes to 0 and 255.
    identification : Identification
        What to draw.
    wrong : collection of Target
        Those of its targets that are known to be wrong.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        Blue, green, red.
    """
    canvas = cv2.cvtColor(stretched_to_8_bit(image), cv2.COLOR_GRAY2BGR)
    unit = max(1, round(math.hypot(*image.shape) / 2400))
    for target in identification.targets:
        colour = DECODED_COLOUR
        if target.id == UNDECODED:
            colour = UNDECODED_COLOUR
        elif target in wrong:
            colour = WRONG_COLOUR
        _draw_ellipse(canvas, target, colour, unit)
        _draw_cross(canvas, target, colour, unit)
        if target.id != UNDECODED:
            _draw_label(canvas, target, colour, unit)
    _draw_title(canvas, summary(identification), unit)
    return canvas


def summary(identification: Identification) -> str:
    """Return n, N and the filter of an identification in words."""
    words = f'{identification.count} identified'
    if identification.expected or identification.estimated:
        estimated = 'an estimated ' if identification.estimated else ''
        words += f' of {estimated}{identification.expected}'
    used = identification.filter
    if not used.applied:
        return f'{words}, no filter'
    return f'{words}, gamma_high {used.gamma_high:g}, gamma_low {used.gamma_low:g}'


def _draw_ellipse(
    canvas: np.ndarray, target: Target, colour: tuple[int, int, int], unit: int
) -> None:
    centre = (_fixed(target.x), _fixed(target.y))
    axes = (_fixed(target.semi_major), _fixed(target.semi_minor))
    angle = math.degrees(target.angle)
    for shade, width in ((_OUTLINE_COLOUR, 3 * unit), (colour, unit)):
        cv2.ellipse(canvas, centre, axes, angle, 0, 360, shade, width, cv2.LINE_AA, _SHIFT)


def _draw_cross(
    canvas: np.ndarray, target: Target, colour: tuple[int, int, int], unit: int
) -> None:
    arm = max(3.0 * unit, 0.35 * target.semi_minor)
    x, y, length = _fixed(target.x), _fixed(target.y), _fixed(arm)
    for shade, width in ((_OUTLINE_COLOUR, 3 * unit), (colour, unit)):
        for across, down in ((length, 0), (0, length)):
            start, end = (x - across, y - down), (x + across, y + down)
            cv2.line(canvas, start, end, shade, width, cv2.LINE_AA, _SHIFT)


def _draw_label(
    canvas: np.ndarray, target: Target, colour: tuple[int, int, int], unit: int
) -> None:
    """Write the ID above to the right of the dot, or below to the left where the image ends."""
    scale = max(0.75 * unit, 0.6 * target.semi_major / _FONT_HEIGHT)
    text = str(target.id)
    (width, height), _ = cv2.getTextSize(text, _FONT, scale, 2 * unit)
    offset = 0.8 * target.semi_major + 2 * unit
    left, bottom = target.x + offset, target.y - offset
    if left + width > canvas.shape[1]:
        left = target.x - offset - width
    if bottom - height < 0:
        bottom = target.y + offset + height
    _draw_text(canvas, text, (round(left), round(bottom)), colour, scale, unit)


def _draw_title(canvas: np.ndarray, text: str, unit: int) -> None:
    """Write a line at the top left, smaller where the image is narrow."""
    (width, _), _ = cv2.getTextSize(text, _FONT, 1.0, 2 * unit)
    scale = min(float(unit), 0.95 * canvas.shape[1] / width)
    place = (round(8 * scale), round(30 * scale))
    _draw_text(canvas, text, place, _TEXT_COLOUR, scale, unit)


def _draw_text(
    canvas: np.ndarray,
    text: str,
    place: tuple[int, int],
    colour: tuple[int, int, int],
    scale: float,
    unit: int,
) -> None:
    # The outline is the text, displaced: a wider stroke is not the same in all versions of OpenCV.
    places = [(unit * i, unit * j, _OUTLINE_COLOUR) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    for across, down, shade in (*places, (0, 0, colour)):
        corner = (place[0] + across, place[1] + down)
        cv2.putText(canvas, text, corner, _FONT, scale, shade, 2 * unit, cv2.LINE_AA)


def _fixed(coordinate: float) -> int:
    return round(coordinate * 2**_SHIFT)
