"""Pictures side by side."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.views.drawing.overlay import FONT, TEXT_COLOUR, Colour

_GROUND_COLOUR = (45, 40, 35)


@dataclass(frozen=True, slots=True)
class Tile:
    """One of several pictures side by side: uint8, gray or colour, with two lines above it.

    The first one is the title, the second one has the remarks in their colours.
    """

    picture: np.ndarray
    title: str
    remarks: Sequence[tuple[str, Colour]] = ()


def side_by_side(rows: Sequence[Sequence[Tile]], width: int) -> np.ndarray:
    """Return pictures of one size in rows of as many, each resized to a width in px.

    The result is an ndarray of uint8, shape (height, width, 3): blue, green, red.
    """
    return np.vstack([np.hstack([_framed(tile, width) for tile in row]) for row in rows])


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
    widths = [cv2.getTextSize(text, FONT, scale, 2)[0][0] for text, _ in words]
    scale *= min(1.0, room / (sum(widths) + gap * len(words) + 1))
    x = margin
    for text, colour in words:
        cv2.putText(canvas, text, (x, bottom), FONT, scale, colour, 2, cv2.LINE_AA)
        x += cv2.getTextSize(text, FONT, scale, 2)[0][0] + gap
