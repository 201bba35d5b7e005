"""Targets that an image shows in faint contrast only, whatever their family is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import hypot

import numpy as np

from ahf_ros.base.target import UNDECODED, DottedTarget, Target
from ahf_ros.vision.faint import faint_parts


def with_faint_targets(
    image: np.ndarray,
    found: Sequence[Target],
    search: Callable[[np.ndarray], Sequence[Target]],
) -> list[Target]:
    """Return the targets of an image, and those that only its parts of faint contrast show.

    The latter are decoded, and in places where the image shows no such target. Where parts
    overlap, some are there twice.

    Parameters
    ----------
    image : ndarray of uint8 or float32, shape (height, width)
        Gray values from 0 to 255.
    found : sequence of Target
        What was found in it.
    search : callable
        From such gray values to the targets that they show.
    """
    every, known = list(found), [it for it in found if it.id != UNDECODED]
    for part in faint_parts(image):
        shown = [displaced(it, part.x, part.y) for it in search(part.gray) if it.id != UNDECODED]
        every += [it for it in shown if not any(_same_place(it, of) for of in known)]
    return every


def _same_place(one: Target, other: Target) -> bool:
    return hypot(one.x - other.x, one.y - other.y) < other.semi_minor


def displaced(target: Target, x: float, y: float) -> Target:
    """Return a target that lies elsewhere in an image, with its dots."""
    if not x and not y:
        return target
    moved = replace(target, x=target.x + x, y=target.y + y)
    if not isinstance(moved, DottedTarget):
        return moved
    dots = tuple(
        (left + x, top + y, major, minor, angle) for left, top, major, minor, angle in moved.dots
    )
    return replace(moved, dots=dots)
