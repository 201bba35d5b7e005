"""The edge pixels of a logarithmic image, and their gradients."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from ahf_ros import kernels

LOG_SCALE = 1000.0
"""Units of a logarithmic image of int16 in one unit of ln."""

_WEAK_EDGE, _STRONG_EDGE = 0.15, 0.22  # steps of ln, of the thresholds with hysteresis
_STRAIGHT = 0.97  # cosine between the directions of an edge and of its continuation
_SCALE = 1 / 32  # of Scharr's operator, for steps of a px
_BAND = 2**23  # pixels whose edges are listed at a time, which bounds the memory
_CONTINUED = 0.5  # of the strength of an edge, that its continuation has at least


@dataclass(frozen=True, slots=True)
class LogEdges:
    """The edge pixels of a logarithmic image, and their gradients."""

    log: np.ndarray  # int16, (height, width)
    contrast: float  # times the steps of the image
    marked: np.ndarray  # uint8, (height, width), not zero on edges
    x: np.ndarray  # int32, (m,), the edge pixels, as the next
    y: np.ndarray
    unit_x: np.ndarray  # float32, (m,), direction of their gradients, as the next
    unit_y: np.ndarray
    strength: np.ndarray  # float32, (m,), size of these gradients

    @staticmethod
    def joined(parts: Sequence[LogEdges]) -> LogEdges:
        """Return the edge pixels of all parts of one image."""
        if len(parts) == 1:
            return parts[0]
        lists: dict[str, Any] = {
            name: np.concatenate([getattr(it, name) for it in parts]) for name in _LISTED
        }
        return replace(parts[0], **lists)

    def select(self, which: np.ndarray | slice) -> LogEdges:
        """Return some of the edge pixels, by an index array, a mask of shape (m,) or a slice."""
        return replace(self, **{name: getattr(self, name)[which] for name in _LISTED})

    def unmasked(self, mask: np.ndarray) -> LogEdges:
        """Return the edges where a mask of the size of the image is 0."""
        return self.select(mask.ravel().take(self.y * np.intp(mask.shape[1]) + self.x) == 0)

    def curved(self, length: float) -> LogEdges:
        """Return the edges that do not run straight on for `length` px, to neither side."""
        bent = kernels.bent_edges(
            *(self.log, self.x, self.y, self.unit_x, self.unit_y, self.strength),
            *(self.contrast * _SCALE, length, _CONTINUED, _STRAIGHT**2),
        )
        return self.select(np.flatnonzero(bent))


_LISTED = 'x', 'y', 'unit_x', 'unit_y', 'strength'


def mask_of(polygons: Iterable[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """Return a mask of shape (height, width) that is not 0 in polygons, each of shape (n, 2)."""
    mask = np.zeros(shape, np.uint8)
    for polygon in polygons:
        cv2.fillPoly(mask, [np.rint(polygon).astype(np.int32)], 1)
    return mask


def find_edges(log: np.ndarray) -> LogEdges:
    """Return the edges of a logarithmic image, ndarray of int16, shape (height, width)."""
    return LogEdges.joined([*edges_in_bands(log)])


def edges_in_bands(log: np.ndarray, contrast: float = 1.0) -> Iterator[LogEdges]:
    """Yield the edges of a logarithmic image with so many times its contrast, row by row.

    Those of large images come in bands of rows: lists of them take more memory than the image.
    """
    height, width = log.shape
    marked, *gradient = find_marked(log, contrast)
    rows = max(_BAND // width, 1)
    for top in range(0, height, rows):
        if rows < height:
            gradient = [*_gradient(log, contrast, top, top + rows)]
        pixels = cv2.findNonZero(marked[top : top + rows])
        pixels = np.zeros((0, 2), np.int32) if pixels is None else pixels.reshape(-1, 2)
        x, y = pixels[:, 0].copy(), pixels[:, 1].copy()
        across, down = (of[y, x].astype(np.float32) for of in gradient)
        strength = np.hypot(across, down)
        y += top
        yield LogEdges(log, contrast, marked, x, y, across / strength, down / strength, strength)


def find_marked(
    log: np.ndarray, contrast: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return where a logarithmic image has edges, uint8, and its gradient, x and y, int16."""
    weak, strong = _WEAK_EDGE * LOG_SCALE, _STRONG_EDGE * LOG_SCALE
    across, down = _gradient(log, contrast, 0, len(log))
    return cv2.Canny(across, down, weak, strong, L2gradient=True), across, down


def _gradient(
    log: np.ndarray, contrast: float, first: int, beyond: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the gradient of some rows of an image, x and y, int16, in its units for a px."""
    above = max(first - 1, 0)
    around = log[above : beyond + 1]
    own = slice(first - above, beyond - above)
    scale = contrast * _SCALE
    dx = cv2.Scharr(around, cv2.CV_16S, 1, 0, scale=scale)[own]
    return dx, cv2.Scharr(around, cv2.CV_16S, 0, 1, scale=scale)[own]
