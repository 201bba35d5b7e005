"""The pixels about one CCTag, as the rings and the light on it form them.

Sharp light times the sharp print is blurred, so that light and ink mix as in a lens. What a camera
does follows: its gamma, and an unsharp mask. What is sharp has a small blur, with which a few
samples a pixel are enough.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

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
_SHARP = 0.2  # blur of what is sharp, px
_MARGIN, _OF_MASK = 3, 4  # px about the pixels, that blur and an unsharp mask mix with them
_DARK = 1e-4  # light, of that on paper, that is black
_OF_INTERPOLATION = 0.17  # variance that reading between pixels adds to the blur of rays, px^2
_BLURS = 0.35, 2.0  # px
_DARKEST = -0.99  # contrast
_MOST_CURVED, _HIGHEST, _WIDEST = 1.5, 5.0, 0.0  # edges of light: 1 / radii, ln, ln of radii
_MOST_OF_FRAME, _MOST = 0.08, 0.3  # changes at once
_APART = 1.02  # ratio of the blurs whose difference is taken


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
        wide = (
            usual_widths(np.array(self.light_size)) * np.exp(edges[:, _WIDTH]) * self.light_size
        ) ** 2
        sharp = np.sqrt(np.maximum(wide - blur**2, _SHARP**2))
        edges[:, _WIDTH] = np.log(sharp / self.light_size)
        formed = Formed(
            rings.frames[0], float(rings.shift[0]), blur, 0.0, light.heights[0, :2], edges
        )
        bright = np.exp(self._logarithm(formed))
        ink = self._ink(np.hypot(*self._in_frame(formed)), formed.shift)
        both = self._blurred(np.stack([bright, bright * ink]), blur)[:, self.known].T
        seen = (self.seen / self.seen.max()) ** self.gamma
        paper, step = np.linalg.lstsq(both.T @ both, both.T @ seen, rcond=None)[0]
        return replace(formed, contrast=max(float(step / max(paper, _DARK)), _DARKEST))

    def shown(self, formed: Formed) -> np.ndarray:
        """Return the gray values that are formed where paper in full light is 1, (n,)."""
        x, y = self._in_frame(formed)
        ink = self._ink(np.hypot(x, y), formed.shift)
        sharp = np.exp(self._logarithm(formed)) * (1 + formed.contrast * ink)
        shown: np.ndarray = self._taken(self._blurred(sharp[None], formed.blur))[0]
        return shown

    def changes(self, formed: Formed) -> np.ndarray:
        """Return the derivatives of `shown` by all parameters, (p, n)."""
        x, y = self._in_frame(formed)
        radius = np.maximum(np.hypot(x, y), np.float32(1e-6))
        ink, by_radius, by_shift = self._ink_changes(radius, formed.shift)
        light, by_light = self._light_changes(formed)
        sharp = light * (1 + formed.contrast * ink)
        on_ink = light * formed.contrast
        by_radius *= on_ink
        cosine, sine = x / radius, y / radius
        turned = by_radius * cosine, by_radius * sine
        changes = [
            sharp,
            *turned,
            by_radius * radius,
            turned[0] * x - turned[1] * y,
            2 * turned[0] * y,
            -x * (by_radius * radius),
            -y * (by_radius * radius),
            on_ink * by_shift,
            light * ink,
            *(sharp * of for of in by_light),
        ]
        mixed = self._blurred(np.stack(changes), formed.blur)
        wider, narrower = (
            self._blurred(sharp[None], formed.blur * of) for of in (_APART, 1 / _APART)
        )
        by_blur = (wider - narrower) / (2 * math.log(_APART))
        return self._taken(np.insert(mixed, SHIFT + 2, by_blur, axis=0))[1:]

    def _in_frame(self, formed: Formed) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y of fine points, radii, in the plane of the target."""
        return _in_plane(formed.frame, self.fine_x, self.fine_y)

    def _circles_away(
        self, radius: np.ndarray, shift: float
    ) -> Iterator[tuple[float, np.ndarray]]:
        """Yield the signs of circles, and how far they are outside of fine points, in blurs."""
        scale = self._sharpness(radius)
        for circle in self.circles.tolist():
            sign = math.copysign(1.0, circle)
            yield sign, (abs(circle) - radius) * scale + sign * shift / _SHARP

    def _ink(self, radius: np.ndarray, shift: float) -> np.ndarray:
        """Return the ink at fine points, (m, n)."""
        circles = self._circles_away(radius, shift)
        return np.asarray(sum(sign * normal_integral(away) for sign, away in circles))

    def _ink_changes(self, radius: np.ndarray, shift: float) -> tuple[np.ndarray, ...]:
        """Return the ink at fine points, and its derivatives by the radius and shift."""
        ink, by_radius, by_shift = np.zeros((3, *radius.shape), np.float32)
        for sign, away in self._circles_away(radius, shift):
            density = np.exp(-0.5 * away**2)
            ink += sign * normal_integral(away)
            by_radius += sign * density
            by_shift += density
        by_radius *= self._sharpness(radius) / math.sqrt(2 * math.pi)
        by_shift /= _SHARP * math.sqrt(2 * math.pi)
        return ink, by_radius, by_shift

    def _sharpness(self, radius: np.ndarray) -> np.ndarray:
        """Return how many blurs of what is sharp a radius is at fine points, (m, n)."""
        sharpness: np.ndarray = 1 / np.maximum(
            np.hypot(*np.gradient(radius, 1 / _FINE)) * np.float32(_SHARP), np.float32(1e-6)
        )
        return sharpness

    def _logarithm(self, formed: Formed) -> np.ndarray:
        """Return ln of the light at fine points, (m, n)."""
        logarithm = formed.slopes[0] * self.light_x + formed.slopes[1] * self.light_y
        for edge in formed.edges.tolist():
            away = self._edge_away(edge)[0]
            logarithm = logarithm + np.log1p(math.expm1(edge[_HEIGHT]) * normal_integral(away))
        return logarithm

    def _edge_away(self, edge: list[float]) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """Return how far fine points are from an edge of light, in its widths.

        The next are their distances across and along it, radii, and the width.
        """
        direction, offset, curvature, _, width = edge
        x, y = self.light_x, self.light_y
        cosine, sine = math.cos(direction), math.sin(direction)
        across, along = cosine * x + sine * y - offset, cosine * y - sine * x
        wide = max(math.exp(width), _SHARP / self.light_size)
        return (across - curvature / 2 * (across**2 + along**2)) / wide, across, along, wide

    def _light_changes(self, formed: Formed) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return light at fine points, (m, n), and its derivatives as shares of it, 2 + 5 e."""
        logarithm = formed.slopes[0] * self.light_x + formed.slopes[1] * self.light_y
        changes = [self.light_x, self.light_y]
        for edge in formed.edges.tolist():
            _, offset, curvature, height, _ = edge
            away, across, along, wide = self._edge_away(edge)
            share, more = normal_integral(away), math.expm1(height)
            light = 1 + more * share
            logarithm = logarithm + np.log(light)
            density = np.exp(-0.5 * away**2) / light * (more / (wide * math.sqrt(2 * math.pi)))
            changes += [
                density * along * (1 + curvature * offset),
                density * (curvature * across - 1),
                density * (across**2 + along**2) / -2,
                math.exp(height) * share / light,
                density * away * -wide,
            ]
        return np.exp(logarithm), changes

    def _blurred(self, sharp: np.ndarray, blur: float) -> np.ndarray:
        """Return the light on pixels, (p, h, w), of what is sharp at fine points."""
        rest = math.sqrt(max(blur**2 - _SHARP**2, 0.01))
        return _mixed(sharp, self.rows / rest, self.columns / rest)

    def _taken(self, light: np.ndarray) -> np.ndarray:
        """Return gray values of known pixels, (p, n), of light and of changes of it, (p, h, w)."""
        if self.gamma != 1:
            first = np.maximum(light[0], _DARK)
            gray = first ** (1 / self.gamma)
            light = light * (gray / first / self.gamma)
            light[0] = gray
        if self.sharpening:
            y, x = (np.arange(of, dtype=np.float32) / MASK for of in self.known.shape)
            mask = _mixed(light, y[:, None] - y, x[:, None] - x)
            light = light + self.sharpening * (light - mask)
        return light[:, self.known]


def _mixed(values: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return means of values (p, m, n) by normal weights, of deviations (h, m) and (w, n)."""
    down, across = (np.exp(-0.5 * of**2) for of in (rows, columns))
    down /= down.sum(axis=1, keepdims=True)
    across /= across.sum(axis=1, keepdims=True)
    return down @ values @ across.T


def _in_plane(
    target: np.ndarray, columns: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y, radii, float32, of a grid of pixels in the plane of a frame, (m, n)."""
    inverse = np.linalg.inv(target)
    at_centre = inverse @ (*target[:2, 2], 1.0)  # single precision is enough from there
    along_x = np.outer(inverse[:, 0], columns - target[0, 2]).astype(np.float32)
    along_y = np.outer(inverse[:, 1], rows - target[1, 2]) + at_centre[:, None]
    x, y, scale = along_x[:, None] + along_y.astype(np.float32)[..., None]
    return x / scale, y / scale
