"""Identified targets as annotations that a viewer draws over the image.

The message for this in ROS 2 is visualization_msgs/ImageMarker. A viewer shows one marker per
topic, and markers have lines but no text. So all outlines and IDs are lines of one marker, with up
to seven lines per digit. foxglove_msgs has text but is not part of ROS 2 nor of its wheels.
"""

from __future__ import annotations

import math

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import ImageMarker

from ahf_ros.drawing.colours import DECODED_COLOUR, DOUBTFUL_COLOUR
from ahf_ros.msg import CodedTarget, CodedTargetArray
from ahf_ros.target import UNDECODED

CORNER = 0.5
"""Offset of coordinates, px: in viewers, (0, 0) is the corner of the first pixel."""

_SIDES = 24  # of the outline of a dot
_MINIMUM_DIGIT = 12.0  # height at a line width of 1, px
_DIGIT = 0.9  # height of a digit, in radii of the dot
_ADVANCE = 0.8  # distance from digit to digit, in heights
_STROKES = {  # x, y of both ends of the seven lines of a digit, in heights
    'a': ((0.0, -1.0), (0.5, -1.0)),
    'b': ((0.5, -1.0), (0.5, -0.5)),
    'c': ((0.5, -0.5), (0.5, 0.0)),
    'd': ((0.5, 0.0), (0.0, 0.0)),
    'e': ((0.0, 0.0), (0.0, -0.5)),
    'f': ((0.0, -0.5), (0.0, -1.0)),
    'g': ((0.0, -0.5), (0.5, -0.5)),
}
_DIGITS = {
    '0': 'abcdef',
    '1': 'bc',
    '2': 'abged',
    '3': 'abgcd',
    '4': 'fgbc',
    '5': 'afgcd',
    '6': 'afgedc',
    '7': 'abc',
    '8': 'abcdefg',
    '9': 'abcdfg',
    '-': 'g',
}


def target_annotations(answer: CodedTargetArray) -> ImageMarker:
    """Return the outlines of dots and the IDs of targets as lines of one marker.

    Parameters
    ----------
    answer : CodedTargetArray
        Targets of an image, whose size sets the width of the lines.
    """
    width = max(1.0, math.hypot(answer.height, answer.width) / 2400)
    marker = ImageMarker(
        header=answer.header,
        ns='targets',
        type=ImageMarker.LINE_LIST,
        action=ImageMarker.ADD,
        scale=width,
        outline_color=ColorRGBA(**_rgba(DECODED_COLOUR)),
    )
    points, colours = [], []
    for target in answer.targets:
        lines = np.concatenate((_outline(target), _letters(target, width))) + CORNER
        points += [Point(x=x, y=y) for x, y in lines.reshape(-1, 2).tolist()]
        colours += [ColorRGBA(**target_colour(target))] * len(lines)
    marker.points = points
    marker.outline_colors = colours
    return marker


def target_colour(target: CodedTarget) -> dict[str, float]:
    """Return the red, green, blue and opacity of a target, 0 to 1."""
    return _rgba(DOUBTFUL_COLOUR if target.id == UNDECODED else DECODED_COLOUR)


def target_name(target: CodedTarget) -> str:
    """Return the label of a target: its ID, or a question mark."""
    return '?' if target.id == UNDECODED else str(target.id)


def _rgba(colour: tuple[int, int, int]) -> dict[str, float]:
    blue, green, red = colour
    return {'r': red / 255, 'g': green / 255, 'b': blue / 255, 'a': 1.0}


def _outline(target: CodedTarget) -> np.ndarray:
    """Return the sides of the ellipse of a dot, shape (n, 2, 2): x, y of both ends."""
    turn = np.linspace(0, 2 * math.pi, _SIDES + 1)
    along = target.semi_major * np.cos(turn)
    across = target.semi_minor * np.sin(turn)
    cosine, sine = math.cos(target.angle), math.sin(target.angle)
    corners = np.stack(
        (
            target.x + along * cosine - across * sine,
            target.y + along * sine + across * cosine,
        ),
        axis=1,
    )
    return np.stack((corners[:-1], corners[1:]), axis=1)


def _letters(target: CodedTarget, width: float) -> np.ndarray:
    """Return the lines of an ID above and to the right of its dot, shape (n, 2, 2)."""
    if target.id == UNDECODED:
        return np.empty((0, 2, 2))
    height = max(_MINIMUM_DIGIT * width, _DIGIT * target.semi_major)
    name = str(target.id)
    lines = np.array([_STROKES[line] for digit in name for line in _DIGITS[digit]])
    counts = [len(_DIGITS[digit]) for digit in name]
    lines[:, :, 0] += _ADVANCE * np.repeat(np.arange(len(name)), counts)[:, None]
    offset = 0.8 * target.semi_major + 2 * width
    return lines * height + (target.x + offset, target.y - offset)
