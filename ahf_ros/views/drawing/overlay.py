"""Overlays: what was found, doubtful and missed, at one look, with labels that have room.

Everything has a dark outline, so that it is seen on any ground. The colours mean the same in
reports and viewers.
"""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from ahf_ros.base.doubt import DOUBTFUL_BELOW
from ahf_ros.base.target import (
    UNDECODED,
    DottedTarget,
    Identification,
    Prints,
    SquareMarker,
    Target,
    UndecodedTarget,
    reach_of,
)
from ahf_ros.vision.image import stretched_to_8_bit

Colour = tuple[int, int, int]
"""Blue, green, red."""

Box = tuple[float, float, float, float]
"""Left, upper, right and lower border, px."""

DECODED_COLOUR: Colour = (60, 230, 60)
DOUBTFUL_COLOUR: Colour = (0, 216, 255)  # confidence below `DOUBTFUL_BELOW`, or not for certain
UNDECODED_COLOUR: Colour = (222, 212, 201)  # a dot without a likely code word
WRONG_COLOUR: Colour = (60, 60, 255)
MISSED_COLOUR: Colour = (0, 130, 255)
DECODING_DOT_COLOUR: Colour = (255, 200, 0)  # the dots that are the code of a target of dots
TEXT_COLOUR: Colour = (255, 255, 255)
OUTLINE_COLOUR: Colour = (0, 0, 0)

FONT = cv2.FONT_HERSHEY_SIMPLEX
_FONT_HEIGHT = 22.0  # px, of a capital at scale 1
_SHIFT = 4  # fractional bits of the coordinates that OpenCV draws
_DASHES = 10  # of an ellipse

_CORNERS = np.array([(1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0)])  # where labels may be
_CIRCLE = math.sqrt(0.5)  # of the radius, what a circle reaches in both directions of a corner
_SIDES = np.array([(1.0, 0.0), (-1.0, 0.0), (0.0, -1.0), (0.0, 1.0)])
_STEPS = 4  # of its height, by which a label moves away from its target
_OUTSIDE = 1e3  # cost of a label that is partly outside, against one that hides a target
_BESIDE = 1.0  # of its height, within which a label needs no line to its target
_OVERLAPPING = 2.0  # the same of one on another label
_AMBIGUOUS, _AWAY = 0.5, 0.2  # of one nearer to another target, and of each step away

_LETTERS = 0.0105  # height, of the diagonal: legible when all of the image is on a screen
_MINIMUM_LETTERS = 15.0  # px
_SMALLEST_LETTERS, _OF_ROOM = 9.0, 0.16  # in crowds: px, and share of distances
_SIDE_POINTS = 9  # at which the outline of a square is sampled
_MAXIMUM_NAMED = 12  # IDs that the summary names at most


@dataclass(frozen=True, slots=True)
class Label:
    """A text that belongs to a target.

    `x`, `y` is the centre of the target and `radius` that of a circle that holds it, px. `outline`
    has points on its outline, px, shape (k, 2); none where it is round.
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

    A label is beside its target, `gap` px away, or a few times its own height further where
    there is no room: where it is inside the image of `shape` (height, width), hides the fewest
    targets and earlier labels or `taken` boxes, and is nearest to its own target. If several
    places are as good, the first of upper right, lower right, upper left, lower left and the
    sides. `sizes` are width and height of each label, px.

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
        upper, lower = places[:, None, :2], places[:, None, 2:]
        nearest = np.clip(circles[:, :2], upper, lower) - circles[:, :2]
        beyond = np.hypot(nearest[..., 0], nearest[..., 1]) - circles[:, 2]
        own = beyond[:, index - len(taken)].copy()
        beyond[:, index - len(taken)] = np.inf
        apart = (boxes[:index, :2] > lower) | (boxes[:index, 2:] < upper)
        cost = _AWAY * (np.arange(len(places)) // (len(places) // _STEPS))
        cost += _OUTSIDE * (outside > 0) + _OVERLAPPING * (~apart.any(axis=2)).sum(axis=1)
        cost += (beyond < -0.05 * circles[:, 2]).sum(axis=1)
        cost += _AMBIGUOUS * (beyond.min(axis=1) < own)
        left, _, _, bottom = places[np.argmin(cost)]
        left = max(min(left, width - size[0]), 0.0)
        bottom = min(max(bottom, size[1]), float(height))
        boxes[index] = left, bottom - size[1], left + size[0], bottom
    return [(float(left), float(bottom)) for left, _, _, bottom in boxes[len(taken) :]]


def _boxes(label: Label, size: tuple[float, float], gap: float) -> np.ndarray:
    """Return left, top, right and bottom of the places of a label, the nearest first."""
    centre, directions = np.array([label.x, label.y]), np.concatenate([_CORNERS, _SIDES])
    offsets = directions[:, None] * (label.outline - centre)
    corners, sides = offsets[:4].min(axis=2), offsets[4:].sum(axis=2)
    reach = np.concatenate([corners, sides]).max(axis=1, initial=0.0) + gap  # of the line
    if not len(label.outline):
        reach = label.radius * np.repeat([_CIRCLE, 1.0], 4)
    away, half = size[1] * np.arange(_STEPS)[:, None, None], np.divide(size, 2)
    middle = centre + directions * ((reach + gap)[:, None] + away + half)
    return np.concatenate([middle - half, middle + half], axis=2).reshape(-1, 4)


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
    return overlay(
        image, identification.targets, title=summary(identification), prints=identification.prints
    )


def overlay(
    image: np.ndarray,
    targets: Collection[Target],
    wrong: Collection[Target] = (),
    missed: Collection[Target] = (),
    unit: int | None = None,
    title: str = '',
    prints: Prints | None = None,
) -> np.ndarray:
    """Return an image in colour with the dot, the centre and the ID of every target, as `draw`.

    Decoded targets have a solid outline. Doubtful ones have a dashed one, and their ID has a
    question mark. `wrong` are those of `targets` that are known to be wrong; `missed` ones are
    crossed out. The family is beside the ID if there are targets of several families. `prints` are
    families by name, as far as they are known: labels are beside all of a print.

    Lines are `unit` px wide. By default that grows with the image, so that lines and letters are
    legible when all of the image is on a screen.
    """
    unit = unit or max(1, round(math.hypot(*image.shape) / 2400))
    canvas = cv2.cvtColor(stretched_to_8_bit(image), cv2.COLOR_GRAY2BGR)
    several = len({target.family for target in targets if target.family}) > 1
    for target in missed:
        arm = 1.8 * target.semi_major
        _draw_lines(canvas, target, ((arm, arm), (arm, -arm)), MISSED_COLOUR, 3 * unit, unit)
    labels = []
    for target in sorted(targets, key=lambda it: it.id != UNDECODED):
        colour, text = _look(target, target in wrong)
        _draw_outline(canvas, target, colour, unit)
        if text:
            arm = max(3.0 * unit, 0.35 * target.semi_minor)
            _draw_lines(canvas, target, ((arm, 0), (0, arm)), colour, unit, unit)
            labels.append(
                Label(
                    text=f'{text} {target.family}' if several and target.id != UNDECODED else text,
                    x=target.x,
                    y=target.y,
                    radius=_radius(target, prints or {}),
                    colour=colour,
                    outline=_outline(target),
                )
            )
    taken = [_draw_title(canvas, title, unit)] if title else []
    _draw_labels(canvas, labels, unit, taken)
    return canvas


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


def _look(target: Target, wrong: bool) -> tuple[Colour, str]:
    """Return the colour of a target and its ID in words; these are empty if it has none."""
    if isinstance(target, UndecodedTarget) and target.likely_id != UNDECODED:
        return DOUBTFUL_COLOUR, f'{target.likely_id}?'
    if target.id == UNDECODED:
        return UNDECODED_COLOUR, ''
    if wrong:
        return WRONG_COLOUR, str(target.id)
    if target.confidence < DOUBTFUL_BELOW:
        return DOUBTFUL_COLOUR, f'{target.id}?'
    return DECODED_COLOUR, str(target.id)


def _radius(target: Target, prints: Prints) -> float:
    """Return the radius of a circle that holds a target, px."""
    if isinstance(target, DottedTarget) and target.dots:
        return max(math.hypot(x - target.x, y - target.y) + a for x, y, a, _, _ in target.dots)
    return reach_of(target, prints) * target.semi_major


def _outline(target: Target) -> np.ndarray:
    """Return points on the sides of a square, px, shape (k, 2); none for other targets."""
    if isinstance(target, SquareMarker) and target.corners:
        corners = np.array(target.corners)
        along = np.linspace(0, 1, _SIDE_POINTS)[:, None, None]
        return (corners + along * (np.roll(corners, -1, axis=0) - corners)).reshape(-1, 2)
    return np.empty((0, 2))


def _draw_outline(canvas: np.ndarray, target: Target, colour: Colour, unit: int) -> None:
    """Draw the sides of a square, the dots of a target of dots, or else its ellipse."""
    dashed = colour == DOUBTFUL_COLOUR
    if isinstance(target, SquareMarker) and target.corners:
        corners = np.array([_fixed(*corner) for corner in target.corners], np.int32)
        for shade, width in _strokes(colour, unit, unit):
            cv2.polylines(canvas, [corners], True, shade, width, cv2.LINE_AA, _SHIFT)
    elif isinstance(target, DottedTarget):
        for dot in target.dots[: target.template_dots]:
            _draw_ellipse(canvas, dot, colour, unit, dashed)
        for dot in target.dots[target.template_dots :]:
            _draw_ellipse(canvas, dot, DECODING_DOT_COLOUR, unit, False)
    else:
        ellipse = target.x, target.y, target.semi_major, target.semi_minor, target.angle
        _draw_ellipse(canvas, ellipse, colour, unit, dashed)


def _draw_ellipse(
    canvas: np.ndarray,
    ellipse: tuple[float, float, float, float, float],
    colour: Colour,
    unit: int,
    dashed: bool,
) -> None:
    """Draw an ellipse: centre, semi-axes, px, and direction of the major one, rad."""
    x, y, semi_major, semi_minor, direction = ellipse
    centre, axes = _fixed(x, y), _fixed(semi_major, semi_minor)
    angle, period = math.degrees(direction), 360 / _DASHES
    arcs = [(i * period, (i + 0.6) * period) for i in range(_DASHES)] if dashed else [(0, 360)]
    for shade, width in _strokes(colour, unit, unit):
        for start, end in arcs:
            cv2.ellipse(canvas, centre, axes, angle, start, end, shade, width, cv2.LINE_AA, _SHIFT)


def _draw_lines(
    canvas: np.ndarray,
    target: Target,
    arms: Sequence[tuple[float, float]],
    colour: Colour,
    width: int,
    unit: int,
) -> None:
    """Draw lines through the centre of a target; an arm is half a line, px."""
    x, y = target.x, target.y
    for shade, thickness in _strokes(colour, width, unit):
        for across, down in arms:
            start, end = _fixed(x - across, y - down), _fixed(x + across, y + down)
            cv2.line(canvas, start, end, shade, thickness, cv2.LINE_AA, _SHIFT)


def _strokes(colour: Colour, width: int, unit: int) -> tuple[tuple[Colour, int], ...]:
    """Return colours and widths of the two strokes of a line: its outline and itself."""
    return (OUTLINE_COLOUR, width + 2 * unit), (colour, width)


def _fixed(*coordinates: float) -> tuple[int, ...]:
    return tuple(round(coordinate * 2**_SHIFT) for coordinate in coordinates)


def _draw_labels(
    canvas: np.ndarray, labels: Sequence[Label], unit: int, taken: Sequence[Box]
) -> None:
    shape: tuple[int, int] = canvas.shape[:2]
    height = max(_MINIMUM_LETTERS * unit, _LETTERS * math.hypot(*shape))
    if len(labels) > 1:
        places = np.array([(it.x, it.y) for it in labels])
        apart = np.hypot(*(places[:, None] - places).T)
        room = _OF_ROOM * float(np.median(np.sort(apart, axis=1)[:, 1]))
        height = min(height, max(room, _SMALLEST_LETTERS * unit))
    scale = min(height, shape[0]) / _FONT_HEIGHT
    sizes = [_text_size(label.text, scale, unit) for label in labels]
    placed = place_labels(labels, sizes, shape, 3.0 * unit, taken)
    for label, (left, bottom), size in zip(labels, placed, sizes, strict=True):
        _draw_leader(canvas, label, (left, bottom - size[1], left + size[0], bottom), unit)
    for label, (left, bottom) in zip(labels, placed, strict=True):
        _write(canvas, label.text, (round(left), round(bottom)), label.colour, scale, unit)


def _draw_leader(canvas: np.ndarray, label: Label, box: Box, unit: int) -> None:
    """Draw a line from a label that is not beside its target to this."""
    centre = np.array([label.x, label.y])
    end = np.clip(centre, box[:2], box[2:])
    distance = float(np.hypot(*(end - centre)))
    if distance < label.radius + _BESIDE * (box[3] - box[1]):
        return
    start = centre + (end - centre) * (label.radius / distance)
    for shade, width in _strokes(label.colour, unit, unit):
        cv2.line(canvas, _fixed(*start), _fixed(*end), shade, width, cv2.LINE_AA, _SHIFT)


def _draw_title(canvas: np.ndarray, text: str, unit: int) -> Box:
    """Write a line at the top left, smaller where the image is narrow, and return its box."""
    width, _ = _text_size(text, 1.0, unit)
    scale = min(float(unit), 0.95 * canvas.shape[1] / width)
    place = (round(8 * scale), round(30 * scale))
    _write(canvas, text, place, TEXT_COLOUR, scale, unit)
    return 0.0, 0.0, place[0] + scale * width, 1.2 * place[1]


def _text_size(text: str, scale: float, unit: int) -> tuple[int, int]:
    (width, height), _ = cv2.getTextSize(text, FONT, scale, 2 * unit)
    return width, height


def _write(
    canvas: np.ndarray, text: str, place: tuple[int, int], colour: Colour, scale: float, unit: int
) -> None:
    """Write a text with its lower left corner at a place."""
    # The outline is the text, displaced: a wider stroke is not the same in all versions of OpenCV.
    places = [(unit * i, unit * j, OUTLINE_COLOUR) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    for across, down, shade in (*places, (0, 0, colour)):
        corner = (place[0] + across, place[1] + down)
        cv2.putText(canvas, text, corner, FONT, scale, shade, 2 * unit, cv2.LINE_AA)
