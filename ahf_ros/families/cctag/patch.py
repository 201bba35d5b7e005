"""The pixels about one CCTag, as the rings and the light on it form them.

Sharp light times the sharp print is blurred, so that light and ink mix as in a lens. What a camera
does follows: its gamma, and an unsharp mask. What is sharp has a small blur, with which a few
samples a pixel are enough.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ahf_ros.families.cctag.alignment import Aligned
from ahf_ros.families.cctag.light import Lights, usual_widths
from ahf_ros.families.cctag.rays import clipped
from ahf_ros.families.cctag.templates import MASK
from ahf_ros.vision import frame
from ahf_ros.vision.normal import normal_integral

PERSPECTIVE, PRINT, SLOPES, EDGES = slice(5, 7), slice(7, 10), slice(10, 12), 12
"""Where parameters are: those of the frame are first, and each edge of light has `OF_EDGE`."""
SHIFT, BLUR, CONTRAST = range(7, 10)
OF_EDGE = 5
_CURVATURE, _HEIGHT, _WIDTH = 2, 3, 4  # of an edge, after its direction and offset
OF_LIGHT = [_CURVATURE, _WIDTH]
"""What is alike of all edges of light."""
_REACH = 1.35  # radii, up to which pixels are seen
_FINE = 2  # samples a px along each axis
_SHARP = 1 / (_FINE * math.sqrt(6))  # blur of what is sharp, px: a triangle over two samples
_MARGIN, _OF_MASK = 3, 4  # px about the pixels, that blur and an unsharp mask mix with them
_DARK = 1e-4  # light, of that on paper, that is black
_OF_INTERPOLATION = 0.17  # variance that reading between pixels adds to the blur of rays, px^2
_BLURS = 0.35, 2.0  # px
_DARKEST = -0.99  # contrast
_MOST_CURVED, _HIGHEST, _WIDEST = 1.5, 5.0, 0.0  # edges of light: 1 / radii, ln, ln of radii
_MOST_OF_FRAME, _MOST = 0.08, 0.3  # changes at once


@dataclass(frozen=True, slots=True)
class Formed:
    """What forms the pixels: a frame, print, lens and light."""

    frame: np.ndarray  # (3, 3)
    shift: float  # by which ink has grown, px
    blur: float  # standard deviation, px
    contrast: float  # of ink, less than 0 where it is dark
    slopes: np.ndarray  # of ln of the light, (2,)
    edges: np.ndarray  # (e, 5): direction, rad, offset, curvature, ln of the height and width

    @property
    def blur_of_rays(self) -> float:
        """Blur with that of reading between pixels, px."""
        return math.sqrt(self.blur**2 + _OF_INTERPOLATION)

    @property
    def of_print(self) -> tuple[float, float, float]:
        """What is alike of all prints: shift, px, ln of the blur of rays, px, and contrast."""
        return self.shift, math.log(self.blur_of_rays), self.contrast

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

    def changed(self, change: np.ndarray, most_shift: float) -> Formed:
        """Return what forms the pixels after a change of parameters, within bounds."""
        of_frame = np.clip(change[:SHIFT], -_MOST_OF_FRAME, _MOST_OF_FRAME)
        change = np.clip(change, -_MOST, _MOST)
        edges = self.edges + change[EDGES:].reshape(-1, OF_EDGE)
        edges[:, _CURVATURE] = edges[:, _CURVATURE].clip(-_MOST_CURVED, _MOST_CURVED)
        edges[:, _HEIGHT] = edges[:, _HEIGHT].clip(-_HIGHEST, _HIGHEST)
        edges[:, _WIDTH] = np.minimum(edges[:, _WIDTH], _WIDEST)
        return Formed(
            frame=frame.moved(self.frame[None], of_frame[None])[0],
            shift=float(np.clip(self.shift + change[SHIFT], -most_shift, most_shift)),
            blur=float(np.clip(self.blur * math.exp(change[BLUR]), *_BLURS)),
            contrast=max(self.contrast + float(change[CONTRAST]), _DARKEST),
            slopes=self.slopes + change[SLOPES],
            edges=edges,
        )


@dataclass(frozen=True, slots=True)
class Patch:
    """The pixels about a target, and finer points about them."""

    known: np.ndarray  # bool, whether pixels are of the target and not clipped, (h, w)
    seen: np.ndarray  # gray values of those, (n,)
    fine_x: np.ndarray  # columns of finer points, px, (n,)
    fine_y: np.ndarray  # their rows, (m,)
    light_x: np.ndarray  # of finer points, in the plane of the frame of the light, (m, n)
    light_y: np.ndarray
    light_size: float  # radius of that frame, px
    columns: np.ndarray  # distances of pixels from fine points, px, (w, n)
    rows: np.ndarray  # (h, m)
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
        target = rings.frames[0]
        sharpening = float(rings.sharpening[0])
        reach = math.ceil(_REACH * frame.ellipse_axes(target[None])[0][0]) + 1
        reach += _OF_MASK if sharpening else 0
        middle = np.rint(target[:2, 2]).astype(int)
        low = np.maximum(middle - reach, 0)
        high = np.minimum(middle + reach + 1, gray.shape[::-1])
        about = slice(low[1], high[1]), slice(low[0], high[0])
        x, y = (np.arange(of, to, dtype=float) for of, to in zip(low, high, strict=True))
        fine_x, fine_y = (
            np.arange(of[0] - _MARGIN, of[-1] + _MARGIN + 1 / _FINE, 1 / _FINE) for of in (x, y)
        )
        known = (np.hypot(*_in_plane(target, x, y)) < _REACH) & ~clipped(gray[about])
        light_x, light_y = _in_plane(light.frames[0], fine_x, fine_y)
        return Patch(
            known=known,
            seen=gray[about][known].astype(np.float64),
            fine_x=fine_x,
            fine_y=fine_y,
            light_x=light_x,
            light_y=light_y,
            light_size=float(frame.mean_radii(light.frames)[0]),
            columns=(x[:, None] - fine_x).astype(np.float32),
            rows=(y[:, None] - fine_y).astype(np.float32),
            circles=circles,
            gamma=gamma,
            sharpening=sharpening,
            most_shift=most_shift * float(frame.mean_radii(rings.frames)[0]),
        )

    def first(self, rings: Aligned, light: Lights) -> Formed:
        """Return what forms the pixels as rays tell it."""
        blur = math.sqrt(max(float(rings.blur[0]) ** 2 - _OF_INTERPOLATION, _BLURS[0] ** 2))
        heights = light.heights[0, 2:]
        edges = light.edges[0, heights != 0]
        edges[:, _HEIGHT] = heights[heights != 0].clip(-_HIGHEST, _HIGHEST)
        size = self.light_size
        wide = usual_widths(np.array(size)) * np.exp(edges[:, _WIDTH]) * size
        edges[:, _WIDTH] = np.log(np.sqrt(np.maximum(wide**2 - blur**2, _SHARP**2)) / size)
        formed = Formed(
            rings.frames[0], float(rings.shift[0]), blur, 0.0, light.heights[0, :2], edges
        )
        bright = self._light(formed)[0]
        inked = bright * self._ink(formed)[0]
        both = self._blurred(np.stack([bright, inked], axis=1), blur).swapaxes(1, 2)[self.known]
        seen = (self.seen / self.seen.max()) ** self.gamma
        paper, step = np.linalg.lstsq(both.T @ both, both.T @ seen, rcond=None)[0]
        return replace(formed, contrast=max(float(step / max(paper, _DARK)), _DARKEST))

    def shown(self, formed: Formed) -> np.ndarray:
        """Return the gray values that are formed where paper in full light is 1, (n,)."""
        light = self._light(formed)[0]
        sharp = light * (1 + formed.contrast * self._ink(formed)[0])
        return self._taken(self._blurred(sharp[:, None], formed.blur))[0]

    def changes(self, formed: Formed) -> np.ndarray:
        """Return the derivatives of `shown` by all parameters, (p, n).

        What edges of light change at places far from them is multiplied after blur, not before.
        """
        light, of_edges = self._light(formed)
        ink, *turned, by_shift = self._ink(formed, changes=True)
        sharp, on_ink = light * (1 + formed.contrast * ink), light * formed.contrast
        (across, down), (x, y) = (on_ink * of for of in turned), self._in_frame(formed)
        outwards = across * x + down * y
        images = [sharp, across, down, outwards, across * x - down * y, 2 * across * y]
        images += [-x * outwards, -y * outwards, on_ink * by_shift, light * ink]
        images += [sharp * of for edge in of_edges for of in edge[:3]]
        mixed = self._blurred(np.stack(images, axis=1), formed.blur, by_blur=True)
        first, *of_print, by_blur = self._taken(mixed)
        of_print, of_light = of_print[:CONTRAST], of_print[CONTRAST:]
        changes = [*of_print[:BLUR], by_blur, *of_print[BLUR:]]
        gray = first / self.gamma
        changes += [gray * self._at_pixels(of) for of in (self.light_x, self.light_y)]
        for number, (edge, of) in enumerate(zip(formed.edges.tolist(), of_edges, strict=True)):
            density, by_height, by_width = of_light[3 * number : 3 * number + 3]
            along_it, across_it = (self._at_pixels(it) for it in of[3:])
            _, offset, curvature, *_ = edge
            changes += [
                density * along_it * (1 + curvature * offset),
                density * (curvature * across_it - 1),
                density * (across_it**2 + along_it**2) / -2,
                by_height,
                by_width,
            ]
        return np.stack(changes)

    def _in_frame(self, formed: Formed) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y of fine points, radii, in the plane of the target."""
        return _in_plane(formed.frame, self.fine_x, self.fine_y)

    def _at_pixels(self, fine: np.ndarray) -> np.ndarray:
        """Return values of fine points (m, n) at known pixels, (n,)."""
        inner = slice(_MARGIN * _FINE, -_MARGIN * _FINE, _FINE)
        return fine[inner, inner][self.known]

    def _ink(self, formed: Formed, changes: bool = False) -> tuple[np.ndarray, ...]:
        """Return the ink at fine points, (m, n), and its derivatives by x, y and the shift.

        Edges are those of a triangular blur as wide as two fine points are apart.
        """
        x, y = self._in_frame(formed)
        radius = np.sqrt(x * x + y * y) + np.float32(1e-6)
        (a, b), (_, c) = _of_gradient(formed.frame)
        scale = np.sqrt((a * x + 2 * b * y) * x + c * y * y + np.float32(1e-12))
        scale = radius / scale * np.float32(_FINE)
        signs = np.sign(self.circles).astype(np.float32)
        grown = (signs * np.float32(formed.shift * _FINE))[:, None, None]
        away = np.abs(self.circles).astype(np.float32)[:, None, None] - radius
        away *= scale
        away += grown
        np.clip(away, -1, 1, out=away)
        density = 1 - np.abs(away)
        away *= 1 + density
        ink = (signs @ away.reshape(len(signs), -1)).reshape(radius.shape) / 2
        if not changes:
            return (ink,)
        by_radius = (signs @ density.reshape(len(signs), -1)).reshape(radius.shape)
        by_radius *= scale / radius
        return ink, by_radius * x, by_radius * y, density.sum(axis=0) * _FINE

    def _light(self, formed: Formed) -> tuple[np.ndarray, list[tuple[Any, ...]]]:
        """Return light at fine points, (m, n), and what it changes by at each of its edges.

        These are shares of it: density, change by the height and by the width. The last two are
        distances along and across an edge, radii.
        """
        x, y = self.light_x, self.light_y
        along_x, along_y = formed.slopes.tolist()
        light, changes = np.exp(along_x * x + along_y * y), []
        for direction, offset, curvature, height, width in formed.edges.tolist():
            cosine, sine = math.cos(direction), math.sin(direction)
            across, along = cosine * x + sine * y - offset, cosine * y - sine * x
            wide = max(math.exp(width), _SHARP / self.light_size)
            away = (across - curvature / 2 * (across**2 + along**2)) / wide
            share, more = normal_integral(away), math.expm1(height)
            own = 1 + more * share
            light = light * own
            density = np.exp(-0.5 * away**2) / own * (more / (wide * math.sqrt(2 * math.pi)))
            by_height = math.exp(height) * share / own
            changes.append((density, by_height, density * away * -wide, along, across))
        return light, changes

    def _blurred(self, sharp: np.ndarray, blur: float, by_blur: bool = False) -> np.ndarray:
        """Return the light on pixels, (h, p, w), of what is sharp at fine points, (m, p, n).

        The change of the first by ln of the blur follows if that is asked for.
        """
        rest = math.sqrt(max(blur**2 - _SHARP**2, 0.01))
        (down, more_down), (across, more_across) = (
            _weights(of / rest) for of in (self.rows, self.columns)
        )
        mixed = _mixed(sharp, down, across)
        if by_blur:
            first = sharp[:, :1]
            change = _mixed(first, more_down, across) + _mixed(first, down, more_across)
            mixed = np.concatenate([mixed, change * np.float32((blur / rest) ** 2)], axis=1)
        return mixed

    def _taken(self, light: np.ndarray) -> np.ndarray:
        """Return gray values of known pixels, (p, n), of light and of changes of it, (h, p, w)."""
        if self.gamma != 1:
            first = np.maximum(light[:, :1], np.float32(_DARK))
            gray = first ** np.float32(1 / self.gamma)
            light = light * (gray / first / np.float32(self.gamma))
            light[:, :1] = gray
        if self.sharpening:
            mask = _mixed(light, *(_mask_weights(size) for size in self.known.shape))
            light = light + np.float32(self.sharpening) * (light - mask)
        return light.transpose(1, 0, 2)[:, self.known]


def _weights(away: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return normal weights of a sum of 1 for deviations (h, m), changes by ln of width."""
    square = away * away
    weights = np.exp(-0.5 * square)
    weights /= weights.sum(axis=1, keepdims=True)
    return weights, weights * (square - (weights * square).sum(axis=1, keepdims=True))


@lru_cache
def _mask_weights(size: int) -> np.ndarray:
    """Return the weights by which an unsharp mask mixes so many pixels in a row."""
    places = np.arange(size, dtype=np.float32) / MASK
    return _weights(places[:, None] - places)[0]


def _mixed(values: np.ndarray, down: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Return means (h, p, w) of values (m, p, n) by weights (h, m) and (w, n)."""
    rows, images, columns = values.shape
    mixed = (down @ values.reshape(rows, -1)).reshape(-1, columns) @ across.T
    return mixed.reshape(len(down), images, len(across))


def _of_gradient(target: np.ndarray) -> np.ndarray:
    """Return the matrix whose form is the square of how the radius grows by pixels, times itself.

    The perspective hardly changes it within a target.
    """
    inverse = np.linalg.inv(frame.local_affine(target[None])[0])
    return (inverse @ inverse.T).astype(np.float32)


def _in_plane(
    target: np.ndarray, columns: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y, radii, float32, of a grid of pixels in the plane of a frame, (m, n)."""
    inverse = np.linalg.inv(target)
    scale = inverse[2] @ (*target[:2, 2], 1.0)  # single precision is enough from there
    by_x, by_y, _ = (inverse / scale).astype(np.float32).T[..., None, None]
    across = (columns - target[0, 2]).astype(np.float32)
    down = (rows - target[1, 2]).astype(np.float32)
    x, y, scale = by_x * across + by_y * down[:, None]
    scale += 1
    return x / scale, y / scale
