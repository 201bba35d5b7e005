"""Scenes of one target each, side by side in one image: targets of very different sizes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Any

import numpy as np

from ahf_ros.base.target import TrueTarget
from ahf_ros.prints.families import print_in
from ahf_ros.scenes.layout import quiet_radius
from ahf_ros.scenes.scene import SceneSettings, render

_FOCAL_LENGTH = 6.0  # of the scenes, in their width


@dataclass(frozen=True)
class Collage:
    """An image of scenes, and the truth of all their targets."""

    image: np.ndarray
    truth: tuple[TrueTarget, ...]


def collage(radii: Sequence[float], family: str = 'metashape12', **settings: Any) -> Collage:
    """Return an image of targets of given radii, px, the largest first, with distinct IDs.

    Each is in a scene of its own, which has the settings.
    """
    sides = [_side(radius, family) for radius in radii]
    height, width = sides[0], sides[0] + max(sides[1:], default=0)
    pieces, seed = [], settings.pop('seed', 0)
    truth: list[TrueTarget] = []
    left, top = 0, 0
    for radius, side in zip(radii, sides, strict=True):
        if top + side > height:  # the next column
            left, top, width = width, 0, width + side
        scene = SceneSettings(
            family=family,
            width=side,
            height=side,
            targets=1,
            dot_radius=radius,
            radius_spread=0.0,
            focal_length=_FOCAL_LENGTH,
            seed=seed,
            **settings,
        )
        shown = render(scene)
        while shown.targets[0].id in {target.id for target in truth}:
            scene = replace(scene, seed=scene.seed + 1)
            shown = render(scene)
        pieces.append((left, top, shown.image))
        (target,) = map(TrueTarget.of, shown.targets)
        truth.append(replace(target, x=target.x + left, y=target.y + top))
        seed = scene.seed + 1
        if not left:
            left = side
        else:
            top += side
    image = np.full((height, width), int(np.median(pieces[0][2])), np.uint8)
    for left, top, piece in pieces:
        image[top : top + len(piece), left : left + piece.shape[1]] = piece
    return Collage(image, tuple(truth))


def _side(radius: float, family: str) -> int:
    """Return the side of a scene that holds one target, px."""
    zone = print_in(family).design.proportions.quiet_zone
    return ceil(2.02 * float(quiet_radius(radius, 2 * _FOCAL_LENGTH * zone * radius, zone)))
