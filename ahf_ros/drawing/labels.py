"""Where the IDs of targets are written, so that they hide no target and can be read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ahf_ros.drawing.colours import Colour

Box = tuple[float, float, float, float]
"""Left, upper, right and lower border, px."""

_CORNERS = np.array([(1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0)])  # where labels may be
_CIRCLE = math.sqrt(0.5)  # of the radius, what a circle reaches in both directions of a corner
_OUTSIDE = 1e3  # cost of a label that is partly outside, against one that hides a target


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
