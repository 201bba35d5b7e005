"""The edge pixels of a logarithmic image, and their gradients."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import cv2
import numpy as np

LOG_SCALE = 1000.0
"""Units of a logarithmic image of int16 in one unit of ln."""

_WEAK_EDGE, _STRONG_EDGE = 0.15, 0.22  # steps of ln, of the thresholds with hysteresis
_STRAIGHT = 0.97  # cosine between the directions of an edge and of its continuation
_PART = 32_768  # edges looked at at a time, which stay in the cache
_CONTINUED = 0.5  # of the strength of an edge, that its continuation has at least


@dataclass(frozen=True, slots=True)
class LogEdges:
    """The edge pixels of a logarithmic image, and their gradients."""

    dx: np.ndarray  # int16, (height, width), gradient of the image, as the next
    dy: np.ndarray
    marked: np.ndarray  # uint8, (height, width), not zero on edges
    x: np.ndarray  # int32, (m,), the edge pixels, as the next
    y: np.ndarray
    unit_x: np.ndarray  # float32, (m,), direction of their gradients, as the next
    unit_y: np.ndarray
    strength: np.ndarray  # float32, (m,), size of these gradients

    def select(self, which: np.ndarray | slice) -> LogEdges:
        """Return some of the edge pixels, by an index array, a mask of shape (m,) or a slice."""
        names = ('x', 'y', 'unit_x', 'unit_y', 'strength')
        return replace(self, **{name: getattr(self, name)[which] for name in names})

    def unmasked(self, mask: np.ndarray) -> LogEdges:
        """Return the edges where a mask of the size of the image is 0."""
        return self.select(mask.ravel().take(self.y * np.intp(mask.shape[1]) + self.x) == 0)

    def curved(self, length: float) -> LogEdges:
        """Return the edges that do not run straight on for `length` px, to neither side."""
        straight = [np.zeros(0, bool)]
        for start in range(0, len(self.x), _PART):
            part = slice(start, start + _PART)
            straight.append(self._continues(part, length) & self._continues(part, -length))
        return self.select(np.flatnonzero(~np.concatenate(straight)))

    def _continues(self, part: slice, way: float) -> np.ndarray:
        """Return whether some edges have the same gradient `way` px along themselves."""
        height, width = self.dx.shape
        unit_x, unit_y = self.unit_x[part], self.unit_y[part]
        x = np.rint(self.x[part] - np.float32(way) * unit_y)
        y = np.rint(self.y[part] + np.float32(way) * unit_x)
        at = np.clip(y, 0, height - 1).astype(np.intp) * width
        at += np.clip(x, 0, width - 1).astype(np.intp)
        across, down = (of.ravel().take(at).astype(np.float32) for of in (self.dx, self.dy))
        along = across * unit_x + down * unit_y
        strong = along > np.float32(_CONTINUED) * self.strength[part]
        squares = across * across + down * down
        return strong & (along * along > np.float32(_STRAIGHT**2) * squares)


def mask_of(polygons: Iterable[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """Return a mask of shape (height, width) that is not 0 in polygons, each of shape (n, 2)."""
    mask = np.zeros(shape, np.uint8)
    for polygon in polygons:
        cv2.fillPoly(mask, [np.rint(polygon).astype(np.int32)], 1)
    return mask


def find_edges(log: np.ndarray) -> LogEdges:
    """Return the edges of a logarithmic image, ndarray of int16, shape (height, width)."""
    dx = cv2.Scharr(log, cv2.CV_16S, 1, 0, scale=1 / 32)
    dy = cv2.Scharr(log, cv2.CV_16S, 0, 1, scale=1 / 32)
    weak, strong = _WEAK_EDGE * LOG_SCALE, _STRONG_EDGE * LOG_SCALE
    marked = cv2.Canny(dx, dy, weak, strong, L2gradient=True)
    pixels = cv2.findNonZero(marked)
    pixels = np.zeros((0, 2), np.int32) if pixels is None else pixels.reshape(-1, 2)
    x, y = pixels[:, 0].copy(), pixels[:, 1].copy()
    across, down = dx[y, x].astype(np.float32), dy[y, x].astype(np.float32)
    strength = np.hypot(across, down)
    return LogEdges(dx, dy, marked, x, y, across / strength, down / strength, strength)
