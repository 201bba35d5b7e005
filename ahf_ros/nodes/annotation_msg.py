"""Outlines of identified targets that a viewer draws over the image.

The message for this in ROS 2 is visualization_msgs/ImageMarker. A viewer shows one marker per
topic, so that all outlines are lines of one marker. Markers have no text: IDs are drawn into the
debug image.
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


def target_annotations(answer: CodedTargetArray) -> ImageMarker:
    """Return the outlines of dots as lines of one marker.

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
        lines = _outline(target) + CORNER
        points += [Point(x=x, y=y) for x, y in lines.reshape(-1, 2).tolist()]
        colours += [ColorRGBA(**target_colour(target))] * len(lines)
    marker.points = points
    marker.outline_colors = colours
    return marker


def target_colour(target: CodedTarget) -> dict[str, float]:
    """Return the red, green, blue and opacity of a target, 0 to 1."""
    return _rgba(DOUBTFUL_COLOUR if target.id == UNDECODED else DECODED_COLOUR)


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
