"""Search for dots in an image, or in some parts of it only.

What is found in a part is measured and read in the whole image, so that it is what a search of all
would find there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.families.ring.known import Explained
from ahf_ros.vision import frame
from ahf_ros.vision.dots import NO_DOTS, Dots, distinct
from ahf_ros.vision.parts import Part
from ahf_ros.vision.pyramid import ImagePyramid, Octave, image_pyramid

_ALIGNED = 32  # px; halves of parts that begin there are parts of the halves


@dataclass(frozen=True, slots=True)
class ImagePart:
    """A part of an image: its first pixel, and its pyramid."""

    x: int
    y: int
    pyramid: ImagePyramid


def image_parts(image: np.ndarray, parts: Sequence[Part], max_radius: float) -> list[ImagePart]:
    """Return parts of an image, uint8 or float32, a little larger where they would not fit."""
    found = []
    for left, top, right, bottom in parts:
        x, y = (of // _ALIGNED * _ALIGNED for of in (left, top))
        across, down = (-(-of // _ALIGNED) * _ALIGNED for of in (right, bottom))
        shown = np.ascontiguousarray(image[y:down, x:across])
        found.append(ImagePart(x, y, image_pyramid(shown, max_radius)))
    return found


def dots_in(
    parts: Sequence[ImagePart] | None,
    octave: Octave,
    explained: Explained,
    search: Callable[[Octave, Explained], Dots],
) -> Dots:
    """Return the dots that a search finds in an octave, or in parts of it off certain targets."""
    if parts is None:
        return search(octave, explained)
    found, size = [NO_DOTS], 2**octave.level
    for part in parts:
        # With its band, a target is at least twice as wide as its dot.
        if 4 * octave.radii[0] * size <= min(part.pyramid.image.shape) or not octave.level:
            of_part = replace(octave, pyramid=part.pyramid.half(octave.level))
            dots = search(of_part, explained.moved(-part.x, -part.y))
            frames = frame.translated(dots.frames, part.x / size, part.y / size)
            found.append(replace(dots, frames=frames))
    dots = distinct(Dots.joined(found))
    certain = explained.select(explained.certain)
    return dots.select(~certain.on_them(dots.frames, octave.level))
