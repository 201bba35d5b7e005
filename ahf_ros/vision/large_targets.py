"""Targets of any size: identified by octaves of their dots, and measured at full size.

A large dot is read in a half of the image where it has few pixels. Its edges are as sharp in the
image as those of small ones, so that its centre is measured there: from half to half, each of
which doubles the error of a centre to a small part of a pixel.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ahf_ros.base.target import DottedTarget, Target
from ahf_ros.vision.pyramid import ImagePyramid, Octave, octaves

Identify = Callable[[Octave], Sequence[Target]]
"""From an octave to its targets, in px of its half of the image."""

Refine = Callable[[np.ndarray, Sequence[Target]], Sequence[Target]]
"""From an image and targets to the same targets with the centres that the image gives them."""


def targets_of_octaves(
    pyramid: ImagePyramid, radii: tuple[float, float], identify: Identify, refine: Refine
) -> list[Target]:
    """Return the targets of all octaves, in px of the image; where octaves meet, some twice.

    `radii` are the bounds of the radius of a dot, px of the image.
    """
    found: list[Target] = []
    for octave in octaves(pyramid, *radii):
        targets = identify(octave)
        # Halves without targets may have no contrast.
        for half in reversed(pyramid.images[: octave.level if targets else 0]):
            targets = refine(half, [_enlarged(target) for target in targets])
        found += targets
    return found


def _enlarged(target: Target) -> Target:
    """Return a target in px of the image whose half shows it."""
    place: dict[str, Any] = {
        'x': 2 * target.x + 0.5,
        'y': 2 * target.y + 0.5,
        'semi_major': 2 * target.semi_major,
        'semi_minor': 2 * target.semi_minor,
        'covariance': tuple(4 * element for element in target.covariance),
        'edge_shift': None if target.edge_shift is None else 2 * target.edge_shift,
    }
    if not isinstance(target, DottedTarget):
        return replace(target, **place)
    dots = tuple(
        (2 * x + 0.5, 2 * y + 0.5, 2 * major, 2 * minor, angle)
        for x, y, major, minor, angle in target.dots
    )
    return replace(target, dots=dots, **place)
