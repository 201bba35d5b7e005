"""Overlays of what was identified, and pictures side by side."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.imaging.image import stretched_to_8_bit
from ahf_ros.target import UNDECODED, DottedTarget, Identification, Target

Colour = tuple[int, int, int]
"""Blue, green, red."""

Ellipse = tuple[float, float, float, float, float]
"""Centre x and y, semi-major and semi-minor axis, px, and direction of the major one, rad."""

DECODED_COLOUR: Colour = (60, 230, 60)
"""Of a decoded target."""

WRONG_COLOUR: Colour = (60, 60, 255)
"""Of a target that is known to be wrong."""

MISSED_COLOUR: Colour = (0, 130, 255)
"""Of a target that was not identified."""

DECODING_DOT_COLOUR: Colour = (255, 200, 0)
"""Colour of the dots that are the code of a target, where dots are."""

UNDECODED_COLOUR: Colour = (0, 190, 255)
"""Of a target without a code word."""

TEXT_COLOUR: Colour = (255, 255, 255)
"""Of text that is neither good nor bad."""

_OUTLINE_COLOUR = (0, 0, 0)
_GROUND_COLOUR = (45, 40, 35)
_SHIFT = 4  # fractional bits of the coordinates that OpenCV draws
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_FONT_HEIGHT = 22.0  # px of a capital at scale 1


@dataclass(frozen=True, slots=True)
class Tile:
    """One of several pictures side by side.

    Attributes
    ----------
    picture : ndarray of uint8, shape (height, width) or (height, width, 3)
        Gray, or blue, green, red.
    title : str
        Line above it.
    remarks : sequence of (str, tuple of 3 int)
        Words of a second line, each with its colour.
    """

    picture: np.ndarray
    title: str
    remarks: Sequence[tuple[str, Colour]] = ()


def draw(image: np.ndarray, identification: Identification) -> np.ndarray:
    """Return the overlay of an identification, with its summary in a line at the top.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Gray values; more than 8 bits are stretched from their minimum to their maximum.
    identification : Identification
        What to draw.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        Blue, green, red.

    Examples
    --------
    >>> draw(np.full((60, 80), 128, np.uint8), Identification(())).shape
    (60, 80, 3)
    """
    canvas = overlay(image, identification.targets)
    _draw_title(canvas, summary(identification), _pen(image))
    return canvas


def overlay(
    image: np.ndarray,
    targets: Collection[Target],
    wrong: Collection[Target] = (),
    missed: Collection[Target] = (),
    unit: int | None = None,
) -> np.ndarray:
    """Return an image in colour with the dot, the centre and the ID of every target.

    The family is beside the ID if there are targets of several families.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Gray values, as for `draw`.
    targets : collection of Target
        What was identified.
    wrong : collection of Target
        Those of `targets` that are known to be wrong.
    missed : collection of Target
        Targets that were not identified; they are crossed out.
    unit : int, optional
        Width of a line, px. By default it grows with the image, so that lines and letters are
        legible when all of the image is on a screen.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        Blue, green, red.
    """
    canvas = cv2.cvtColor(stretched_to_8_bit(image), cv2.COLOR_GRAY2BGR)
    unit = unit or _pen(image)
    several = len({target.family for target in targets if target.family}) > 1
    for target in missed:
        _cross_out(canvas, target, unit)
    for target in targets:
        colour = DECODED_COLOUR
        if target.id == UNDECODED:
            colour = UNDECODED_COLOUR
        elif target in wrong:
            colour = WRONG_COLOUR
        template, decoding = _ellipses(target)
        for ellipse in template:
            _draw_ellipse(canvas, ellipse, colour, unit)
        for ellipse in decoding:
            _draw_ellipse(canvas, ellipse, DECODING_DOT_COLOUR, unit)
        _draw_cross(canvas, target, colour, unit)
        if target.id != UNDECODED:
            name = f'{target.id} {target.family}' if several else str(target.id)
            _draw_label(canvas, target, name, colour, unit)
    return canvas


def side_by_side(rows: Sequence[Sequence[Tile]], width: int) -> np.ndarray:
    """Return pictures of one size in rows, each with its two lines of text above it.

    Parameters
    ----------
    rows : sequence of sequence of Tile
        As many in each row.
    width : int
        Width of each picture in the result, px.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        Blue, green, red.
    """
    return np.vstack([np.hstack([_framed(tile, width) for tile in row]) for row in rows])


def summary(identification: Identification) -> str:
    """Return n, N, the filter and whether the image is mirrored, in words."""
    words = f'{identification.count} identified'
    if identification.expected or identification.estimated:
        estimated = 'an estimated ' if identification.estimated else ''
        words += f' of {estimated}{identification.expected}'
    if identification.mirrored:
        words += ', mirrored'
    if identification.combination:
        words += f', {identification.combination} of the stack'
    used = identification.filter
    if not used.applied:
        return f'{words}, no filter'
    return f'{words}, gamma_high {used.gamma_high:g}, gamma_low {used.gamma_low:g}'


def _framed(tile: Tile, width: int) -> np.ndarray:
    """Return a picture at a width, with its text above it and a margin all round."""
    height = round(tile.picture.shape[0] * width / tile.picture.shape[1])
    picture = cv2.resize(tile.picture, (width, height), interpolation=cv2.INTER_AREA)
    if picture.ndim == 2:
        picture = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    margin, head = width // 100, width // 9
    framed = cv2.copyMakeBorder(
        picture, head, margin, margin, margin, cv2.BORDER_CONSTANT, value=_GROUND_COLOUR
    )
    _write(framed, [(tile.title, TEXT_COLOUR)], round(0.42 * head), margin)
    _write(framed, tile.remarks, round(0.88 * head), margin)
    return framed


def _write(
    canvas: np.ndarray, words: Sequence[tuple[str, Colour]], bottom: int, margin: int
) -> None:
    """Write a line of words, smaller where it would be too long."""
    scale = canvas.shape[1] / 800
    gap, room = 2 * margin, canvas.shape[1] - 2 * margin
    widths = [cv2.getTextSize(text, _FONT, scale, 2)[0][0] for text, _ in words]
    scale *= min(1.0, room / (sum(widths) + gap * len(words) + 1))
    x = margin
    for text, colour in words:
        cv2.putText(canvas, text, (x, bottom), _FONT, scale, colour, 2, cv2.LINE_AA)
        x += cv2.getTextSize(text, _FONT, scale, 2)[0][0] + gap


def _pen(image: np.ndarray) -> int:
    """Return the width of a line that is visible when all of the image is on a screen, px."""
    return max(1, round(math.hypot(*image.shape) / 2400))


def _cross_out(canvas: np.ndarray, target: Target, unit: int) -> None:
    arm = _fixed(1.8 * target.semi_major)
    x, y = _fixed(target.x), _fixed(target.y)
    for shade, width in ((_OUTLINE_COLOUR, 5 * unit), (MISSED_COLOUR, 3 * unit)):
        for down in (-arm, arm):
            start, end = (x - arm, y - down), (x + arm, y + down)
            cv2.line(canvas, start, end, shade, width, cv2.LINE_AA, _SHIFT)


def _ellipses(target: Target) -> tuple[Sequence[Ellipse], Sequence[Ellipse]]:
    """Return the ellipses that all targets of the family have, and those that are the code."""
    if isinstance(target, DottedTarget):
        return target.dots[: target.template_dots], target.dots[target.template_dots :]
    return ((target.x, target.y, target.semi_major, target.semi_minor, target.angle),), ()


def _draw_ellipse(canvas: np.ndarray, ellipse: Ellipse, colour: Colour, unit: int) -> None:
    x, y, semi_major, semi_minor, direction = ellipse
    centre, axes = (_fixed(x), _fixed(y)), (_fixed(semi_major), _fixed(semi_minor))
    angle = math.degrees(direction)
    for shade, width in ((_OUTLINE_COLOUR, 3 * unit), (colour, unit)):
        cv2.ellipse(canvas, centre, axes, angle, 0, 360, shade, width, cv2.LINE_AA, _SHIFT)


def _draw_cross(canvas: np.ndarray, target: Target, colour: Colour, unit: int) -> None:
    arm = max(3.0 * unit, 0.35 * target.semi_minor)
    x, y, length = _fixed(target.x), _fixed(target.y), _fixed(arm)
    for shade, width in ((_OUTLINE_COLOUR, 3 * unit), (colour, unit)):
        for across, down in ((length, 0), (0, length)):
            start, end = (x - across, y - down), (x + across, y + down)
            cv2.line(canvas, start, end, shade, width, cv2.LINE_AA, _SHIFT)


def _draw_label(canvas: np.ndarray, target: Target, text: str, colour: Colour, unit: int) -> None:
    """Write a text above to the right of the dot, or below to the left where the image ends."""
    scale = max(0.75 * unit, 0.6 * target.semi_major / _FONT_HEIGHT)
    # OpenCV 5 crashes on letters that are much larger than an image can show.
    scale = min(scale, max(canvas.shape[0] / _FONT_HEIGHT, 0.75 * unit))
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
    _draw_text(canvas, text, place, TEXT_COLOUR, scale, unit)


def _draw_text(
    canvas: np.ndarray,
    text: str,
    place: tuple[int, int],
    colour: Colour,
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
