"""The pixels about one CCTag, as the rings and the light on it form them.

Sharp light times the sharp print is blurred, so that light and ink mix as in a lens. What a camera
does follows: its gamma, and an unsharp mask.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ahf_ros import kernels
from ahf_ros.families.cctag.light import Lights, usual_widths
from ahf_ros.families.cctag.rays import clipped
from ahf_ros.families.cctag.rings import Aligned
from ahf_ros.families.cctag.templates import MASK
from ahf_ros.vision import frame

PRINT, EDGES = slice(7, 10), 12
"""Where parameters are: those of the frame are first, and each edge of light has `OF_EDGE`."""
OF_EDGE = 5
_FRAME = 7
_SHIFT, _BLUR, _CONTRAST, _SLOPES, _OF_LIGHT = 0, 1, 2, slice(3, 5), 5  # in values
_HEIGHT, _WIDTH = 3, 4  # of an edge, after its direction, offset and curvature
OF_LIGHT = [2, _WIDTH]
"""What is alike of all edges of light: curvature and width."""
_REACH = 1.35  # radii, up to which pixels are seen
_SHARP = 1 / math.sqrt(24)  # blur of what is sharp, px: a triangle over two of two samples a px
_MARGIN, _OF_MASK = 4, 4  # px about the pixels, that blur and an unsharp mask mix with them
_LEAST_SHARPENING = 0.15  # amount, below which rays often show some where there is none
_DARK = 1e-4  # light, of that on paper, that is black
OF_INTERPOLATION = 0.17
"""Variance that reading between pixels adds to the blur of rays, px^2."""
_SHARPEST = 0.35  # blur, px
_DARKEST = -0.99  # contrast
_MOST_CURVED, _HIGHEST, _WIDEST = 1.5, 5.0, 0.0  # edges of light: 1 / radii, ln, ln of radii


@dataclass(frozen=True, slots=True)
class Formed:
    """What forms the pixels: a frame, print, lens and light.

    Values are the shift, by which ink has grown, px, ln of the blur, a standard deviation, px, the
    contrast of ink, less than 0 where it is dark, the slopes of ln of the light, and of each of
    its edges the direction, rad, offset, curvature, and ln of the height and of the width.
    """

    frame: np.ndarray  # (3, 3)
    values: np.ndarray  # (5 + 5 e,)

    @property
    def shift(self) -> float:
        """By how much ink has grown, px."""
        return float(self.values[_SHIFT])

    @property
    def blur_of_rays(self) -> float:
        """Blur with that of reading between pixels, px."""
        return math.sqrt(math.exp(2 * self.values[_BLUR]) + OF_INTERPOLATION)

    @property
    def of_print(self) -> tuple[float, float, float]:
        """What is alike of all prints: shift, px, ln of the blur of rays, px, and contrast."""
        return self.shift, math.log(self.blur_of_rays), float(self.values[_CONTRAST])

    @property
    def edges(self) -> np.ndarray:
        """Edges of light, (e, 5)."""
        return self.values[_OF_LIGHT:].reshape(-1, OF_EDGE)

    @property
    def heights(self) -> np.ndarray:
        """By how much light grows at edges, ln, (e,)."""
        return self.edges[:, _HEIGHT]

    def of_light(self, size: float) -> tuple[np.ndarray, np.ndarray]:
        """Return what is alike of all edges of light, and its derivatives by parameters, (e, 2).

        It is the curvature towards where it is brighter, 1 / px, and ln of the width, px, where
        `size` is the radius, px, of the frame that light is told in.
        """
        towards = np.copysign(1 / size, self.heights)
        scales = np.stack([towards, np.ones_like(towards)], axis=1)
        return self.edges[:, OF_LIGHT] * scales + (0.0, math.log(size)), scales


@dataclass(frozen=True, slots=True)
class Patch:
    """The pixels about a target."""

    known: np.ndarray  # bool, whether pixels are of the target and not clipped, (h, w)
    seen: np.ndarray  # gray values of those, float32, (n,)
    corner: np.ndarray  # of the pixels in the image, (2,)
    light: np.ndarray  # frame of the light in these pixels, (3, 3)
    light_size: float  # its radius, px
    circles: np.ndarray  # radii as printed, below 0 if paper fills them
    gamma: float
    sharpening: float
    most_shift: float  # px

    @staticmethod
    def about(
        gray: np.ndarray,
        rings: Aligned,
        circles: np.ndarray,
        light: Lights,
        gamma: float,
        most_shift: float,
    ) -> Patch:
        """Return the pixels about the rings of one target, and in its light.

        Ink has not grown by more than `most_shift`, in radii.
        """
        target, sharpening = rings.frames[0], float(rings.sharpening[0])
        sharpening = sharpening if sharpening > _LEAST_SHARPENING else 0.0
        reach = math.ceil(_REACH * frame.ellipse_axes(target[None])[0][0]) + _MARGIN
        reach += _OF_MASK if sharpening else 0
        corner = np.rint(target[:2, 2]).astype(int) - reach
        x, y = (of + np.arange(2 * reach + 1) for of in corner.tolist())
        rows, columns = (of.clip(0, side - 1) for of, side in zip((y, x), gray.shape, strict=True))
        values = gray[np.ix_(rows, columns)]
        in_plane = frame.project(np.linalg.inv(target)[None], np.stack(np.meshgrid(x, y), axis=-1))
        known = (np.hypot(*in_plane[0].transpose(2, 0, 1)) < _REACH) & ~clipped(values)
        known &= (rows == y)[:, None] & (columns == x)
        return Patch(
            known=known,
            seen=values[known].astype(np.float32),
            corner=corner,
            light=frame.translated(light.frames, *-corner)[0],
            light_size=float(frame.mean_radii(light.frames)[0]),
            circles=circles,
            gamma=gamma,
            sharpening=sharpening,
            most_shift=most_shift * float(frame.mean_radii(rings.frames)[0]),
        )

    def bounds(self, edges: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and the largest values of what forms pixels, (5 + 5 e,) each."""
        of_edge = math.inf, math.inf, _MOST_CURVED, _HIGHEST, _WIDEST
        high = np.array([self.most_shift, *[math.inf] * 4, *of_edge * edges])
        low = -high
        low[_OF_LIGHT + _WIDTH :: OF_EDGE] = -math.inf
        low[[_BLUR, _CONTRAST]] = math.log(_SHARPEST), _DARKEST
        return low, high

    def formed(self, formed: Formed) -> tuple[Any, ...]:
        """Return the pixels and what forms them, as kernels take these."""
        of_light = self.circles, self.light, self.light_size
        place = frame.translated(formed.frame[None], *-self.corner)[0]
        return self.known, *of_light, self.gamma, self.sharpening, MASK, place, formed.values

    def first(self, rings: Aligned, light: Lights, contrast: float = 0.0) -> Formed:
        """Return what forms the pixels as rays tell it; the contrast is 0 if it is not known."""
        blur = math.sqrt(max(float(rings.blur[0]) ** 2 - OF_INTERPOLATION, _SHARPEST**2))
        heights = light.heights[0, 2:]
        edges = light.edges[0, heights != 0]
        edges[:, _HEIGHT] = heights[heights != 0].clip(-_HIGHEST, _HIGHEST)
        size = self.light_size
        wide = usual_widths(np.array(size)) * np.exp(edges[:, _WIDTH]) * size
        edges[:, _WIDTH] = np.log(np.sqrt(np.maximum(wide**2 - blur**2, _SHARP**2)) / size)
        of_print = [float(rings.shift[0]), math.log(blur), contrast]
        values = np.concatenate([of_print, light.heights[0, :2], edges.ravel()])
        formed = Formed(rings.frames[0], values)
        if contrast:
            return formed
        linear = replace(self, gamma=1.0, sharpening=0.0)
        bright, changes = kernels.cctag_pixels(*linear.formed(formed), n=len(self.seen))[:2]
        both = np.stack([bright, changes[:, _FRAME + _CONTRAST]])
        seen = (self.seen / self.seen.max()) ** self.gamma
        paper, step = np.linalg.lstsq(both @ both.T, both @ seen, rcond=None)[0]
        values[_CONTRAST] = max(float(step / max(paper, _DARK)), _DARKEST)
        return formed
