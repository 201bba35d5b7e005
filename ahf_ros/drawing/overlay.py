"""Overlays: what was found, doubtful and missed, at one look, with labels that have room."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from ahf_ros.codes.designs import relative_reach
from ahf_ros.drawing.colours import (
    DECODED_COLOUR,
    DECODING_DOT_COLOUR,
    DOUBTFUL_BELOW,
    DOUBTFUL_COLOUR,
    MISSED_COLOUR,
    TEXT_COLOUR,
    UNDECODED_COLOUR,
    WRONG_COLOUR,
    Colour,
)
from ahf_ros.drawing.strokes import (
    FONT_HEIGHT,
    Ellipse,
    cross_out,
    draw_ellipse,
    draw_plus,
    draw_polygon,
    text_size,
    write,
)
from ahf_ros.imaging.image import stretched_to_8_bit
from ahf_ros.target import (
    UNDECODED,
    DottedTarget,
    Identification,
    SquareMarker,
    Target,
    UndecodedTarget,
)

Box = tuple[float, float, float, float]
"""Left, upper, right and lower border, px."""

_CORNERS = np.array([(1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0)])  # where labels may be
_CIRCLE = math.sqrt(0.5)  # of the radius, what a circle reaches in both directions of a corner
_OUTSIDE = 1e3  # cost of a label that is partly outside, against one that hides a target

_LETTERS = 0.0105  # height, of the diagonal: legible when all of the image is on a screen
_MINIMUM_LETTERS = 15.0  # px
_SIDE_POINTS = 9  # at which the outline of a square is sampled
_MAXIMUM_NAMED = 12  # IDs that the summary names at most


@dataclass(frozen=True, slots=True)
class Label:
    """A text that belongs to a target.

    Attributes
    ----------
    text : str
    x, y : float
        Centre of the target, px.
    radius : float
        Of the circle that holds the target, px.
    colour : tuple of 3 int
    outline : ndarray of float64, shape (k, 2)
        Points on the outline of the target, px; empty where it is round.
    """

    text: str
    x: float
    y: float
    radius: float
    colour: Colour
    outline: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))


def place_labels(
    labels: Sequence[Label],
    sizes: Sequence[tuple[float, float]],
    shape: tuple[int, int],
    gap: float,
    taken: Sequence[Box] = (),
) -> list[tuple[float, float]]:
    """Return the left and the lower border of each label, px.

    A label is beside its target: where it is inside the image and hides the fewest targets and
    earlier labels; if several places are as good, the first of upper right, lower right, upper
    left and lower left.

    Parameters
    ----------
    labels : sequence of Label
    sizes : sequence of (float, float)
        Width and height of each, px.
    shape : tuple of int
        Height and width of the image, px.
    gap : float
        Between a target and its label, px.
    taken : sequence of Box, optional
        What is written already.

    Examples
    --------
    >>> labels = [Label('7', 50.0, 50.0, 10.0, (0, 0, 0)), Label('8', 70.0, 40.0, 9.0, (0, 0, 0))]
    >>> [(round(x), round(y)) for x, y in place_labels(labels, [(20, 10)] * 2, (100, 200), 2.0)]
    [(59, 69), (78, 32)]
    """
    height, width = shape
    circles = np.array([(it.x, it.y, it.radius) for it in labels]).reshape(-1, 3)
    boxes = np.zeros((len(taken) + len(labels), 4))
    boxes[: len(taken)] = np.reshape(taken, (-1, 4))
    for index, (label, size) in enumerate(zip(labels, sizes, strict=True), len(taken)):
        places = _boxes(label, size, gap)
        outside = np.maximum(-places[:, :2], 0).sum(axis=1)
        outside += np.maximum(places[:, 2:] - (width, height), 0).sum(axis=1)
        hidden = [_hidden(box, circles) + _crossed(box, boxes[:index]) for box in places]
        left, _, _, bottom = places[np.argmin(_OUTSIDE * (outside > 0) + hidden)]
        left = max(min(left, width - size[0]), 0.0)
        bottom = min(max(bottom, size[1]), float(height))
        boxes[index] = left, bottom - size[1], left + size[0], bottom
    return [(float(left), float(bottom)) for left, _, _, bottom in boxes[len(taken) :]]


def _boxes(label: Label, size: tuple[float, float], gap: float) -> np.ndarray:
    """Return left, top, right and bottom of the four places of a label."""
    centre = np.array([label.x, label.y])
    offsets = _CORNERS[:, None] * (label.outline - centre)
    reach = offsets.min(axis=2).max(axis=1, initial=0.0) + gap  # of the line
    if not len(label.outline):
        reach = np.full(4, _CIRCLE * label.radius)
    near = centre + _CORNERS * (reach + gap)[:, None]  # the corner of the box beside the target
    far = near + _CORNERS * size
    return np.hstack([np.minimum(near, far), np.maximum(near, far)])


def _hidden(box: np.ndarray, circles: np.ndarray) -> int:
    """Return the number of circles that a box touches."""
    nearest = np.clip(circles[:, :2], box[:2], box[2:])
    return int((np.hypot(*(nearest - circles[:, :2]).T) < 0.95 * circles[:, 2]).sum())


def _crossed(box: np.ndarray, boxes: np.ndarray) -> int:
    """Return the number of boxes that a box overlaps."""
    apart = (boxes[:, :2] > box[2:]) | (boxes[:, 2:] < box[:2])
    return int((~apart.any(axis=1)).sum())


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
    canvas, labels = _marked(image, identification.targets, (), (), _pen(image))
    title = _draw_title(canvas, summary(identification), _pen(image))
    _draw_labels(canvas, labels, _pen(image), [title])
    return canvas


def overlay(
    image: np.ndarray,
    targets: Collection[Target],
    wrong: Collection[Target] = (),
    missed: Collection[Target] = (),
    unit: int | None = None,
) -> np.ndarray:
    """Return an image in colour with the dot, the centre and the ID of every target.

    Decoded targets have a solid outline. Doubtful ones have a dashed one, and their ID has a
    question mark. Missed ones are crossed out. The family is beside the ID if there are targets of
    several families.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Gray values, as for `draw`.
    targets : collection of Target
        What was identified.
    wrong : collection of Target
        Those of `targets` that are known to be wrong.
    missed : collection of Target
        Targets that were not identified.
    unit : int, optional
        Width of a line, px. By default it grows with the image, so that lines and letters are
        legible when all of the image is on a screen.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
        Blue, green, red.
    """
    unit = unit or _pen(image)
    canvas, labels = _marked(image, targets, wrong, missed, unit)
    _draw_labels(canvas, labels, unit)
    return canvas


def _marked(
    image: np.ndarray,
    targets: Collection[Target],
    wrong: Collection[Target],
    missed: Collection[Target],
    unit: int,
) -> tuple[np.ndarray, list[Label]]:
    """Return an image with the outlines of its targets, and the labels that are to be written."""
    canvas = cv2.cvtColor(stretched_to_8_bit(image), cv2.COLOR_GRAY2BGR)
    several = len({target.family for target in targets if target.family}) > 1
    labels = []
    for target in missed:
        cross_out(canvas, target.x, target.y, 1.8 * target.semi_major, MISSED_COLOUR, unit)
    for target in sorted(targets, key=lambda it: it.id != UNDECODED):
        look = _look(target, target in wrong)
        _draw_target(canvas, target, look, unit)
        if look.text:
            named = several and target.id != UNDECODED
            text = f'{look.text} {target.family}' if named else look.text
            labels.append(
                Label(
                    text=text,
                    x=target.x,
                    y=target.y,
                    radius=_radius(target),
                    colour=look.colour,
                    outline=_outline(target),
                )
            )
    return canvas, labels


def summary(identification: Identification) -> str:
    """Return n, N, the missed IDs, the filter and whether the image is mirrored, in words."""
    words = f'{identification.count} identified'
    if identification.expected or identification.estimated:
        estimated = 'an estimated ' if identification.estimated else ''
        words += f' of {estimated}{identification.expected}'
    found = {target.id for target in identification.targets}
    if missed := [str(it) for it in identification.expected_ids if it not in found]:
        more = len(missed) - _MAXIMUM_NAMED
        words += f', missed {" ".join(missed[:_MAXIMUM_NAMED])}'
        words += f' and {more} others' if more > 0 else ''
    if identification.mirrored:
        words += ', mirrored'
    if identification.combination:
        words += f', {identification.combination} of the stack'
    used = identification.filter
    if not used.applied:
        return f'{words}, no filter'
    return f'{words}, gamma_high {used.gamma_high:g}, gamma_low {used.gamma_low:g}'


@dataclass(frozen=True, slots=True)
class _Look:
    """How a target looks."""

    colour: Colour
    text: str
    dashed: bool = False


def _look(target: Target, wrong: bool) -> _Look:
    if isinstance(target, UndecodedTarget) and target.likely_id != UNDECODED:
        return _Look(DOUBTFUL_COLOUR, f'{target.likely_id}?', dashed=True)
    if target.id == UNDECODED:
        return _Look(UNDECODED_COLOUR, '')
    if wrong:
        return _Look(WRONG_COLOUR, str(target.id))
    if target.confidence < DOUBTFUL_BELOW:
        return _Look(DOUBTFUL_COLOUR, f'{target.id}?', dashed=True)
    return _Look(DECODED_COLOUR, str(target.id))


def _pen(image: np.ndarray) -> int:
    """Return the width of a line that is visible when all of the image is on a screen, px."""
    return max(1, round(math.hypot(*image.shape) / 2400))


def _radius(target: Target) -> float:
    """Return the radius of a circle that holds a target, px."""
    if isinstance(target, DottedTarget) and target.dots:
        return max(math.hypot(x - target.x, y - target.y) + a for x, y, a, _, _ in target.dots)
    return relative_reach(target.family) * target.semi_major


def _outline(target: Target) -> np.ndarray:
    """Return points on the sides of a square, px, shape (k, 2); none for other targets."""
    if isinstance(target, SquareMarker) and target.corners:
        corners = np.array(target.corners)
        along = np.linspace(0, 1, _SIDE_POINTS)[:, None, None]
        return (corners + along * (np.roll(corners, -1, axis=0) - corners)).reshape(-1, 2)
    return np.empty((0, 2))


def _ellipses(target: Target) -> tuple[Sequence[Ellipse], Sequence[Ellipse]]:
    """Return the ellipses that all targets of the family have, and those that are the code."""
    if isinstance(target, DottedTarget):
        return target.dots[: target.template_dots], target.dots[target.template_dots :]
    if isinstance(target, SquareMarker) and target.corners:
        return (), ()
    return ((target.x, target.y, target.semi_major, target.semi_minor, target.angle),), ()


def _draw_target(canvas: np.ndarray, target: Target, look: _Look, unit: int) -> None:
    if isinstance(target, SquareMarker) and target.corners:
        draw_polygon(canvas, target.corners, look.colour, unit)
    template, decoding = _ellipses(target)
    for ellipse in template:
        draw_ellipse(canvas, ellipse, look.colour, unit, look.dashed)
    for ellipse in decoding:
        draw_ellipse(canvas, ellipse, DECODING_DOT_COLOUR, unit)
    if look.text:
        arm = max(3.0 * unit, 0.35 * target.semi_minor)
        draw_plus(canvas, target.x, target.y, arm, look.colour, unit)


def _draw_labels(
    canvas: np.ndarray, labels: Sequence[Label], unit: int, taken: Sequence[Box] = ()
) -> None:
    """Write the labels, in letters of one height."""
    shape: tuple[int, int] = canvas.shape[:2]
    height = max(_MINIMUM_LETTERS * unit, _LETTERS * math.hypot(*shape))
    scale = min(height, shape[0]) / FONT_HEIGHT
    sizes = [text_size(label.text, scale, unit) for label in labels]
    places = place_labels(labels, sizes, shape, 3.0 * unit, taken)
    for label, (left, bottom) in zip(labels, places, strict=True):
        write(canvas, label.text, (round(left), round(bottom)), label.colour, scale, unit)


def _draw_title(canvas: np.ndarray, text: str, unit: int) -> Box:
    """Write a line at the top left, smaller where the image is narrow, and return its box."""
    width, _ = text_size(text, 1.0, unit)
    scale = min(float(unit), 0.95 * canvas.shape[1] / width)
    place = (round(8 * scale), round(30 * scale))
    write(canvas, text, place, TEXT_COLOUR, scale, unit)
    return 0.0, 0.0, place[0] + scale * width, 1.2 * place[1]
