"""Which dot is nearest, at any place in an image."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

_CELL = 2.0  # smallest one of the map, px


@dataclass(frozen=True, slots=True)
class NearestDots:
    """A map that says for every place in the image which dot is nearest.

    Attributes
    ----------
    centres : ndarray of float64, shape (k, 2)
        px.
    corner : ndarray of float64, shape (2,)
        Place of the first cell, px.
    cell : float
        Its side, px.
    index : ndarray of int32, shape (rows, columns)
    """

    centres: np.ndarray
    corner: np.ndarray
    cell: float
    index: np.ndarray

    @classmethod
    def of(cls, centres: np.ndarray, error: float = 0.0) -> NearestDots:
        """Return the map of at least one dot.

        Parameters
        ----------
        centres : ndarray of float64, shape (k, 2)
            px.
        error : float
            By how much a dot may be farther away than the nearest one, px.
        """
        cell = max(error, _CELL)
        corner = centres.min(axis=0)
        cells = np.rint((centres - corner) / cell).astype(int)
        empty = np.full(cells.max(axis=0)[::-1] + 1, 255, np.uint8)
        empty[cells[:, 1], cells[:, 0]] = 0
        _, labels = cv2.distanceTransformWithLabels(
            empty, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
        )
        dot = np.zeros(labels.max() + 1, np.int32)
        dot[labels[cells[:, 1], cells[:, 0]]] = np.arange(len(cells))
        return cls(centres, corner, cell, dot[labels])

    def within(
        self, places: np.ndarray, units: np.ndarray, reach: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the dots nearest to places, -1 where none is near, and their distances.

        Parameters
        ----------
        places : ndarray of float64, shape (n, 2)
            px.
        units : ndarray of float64, shape (n, 2, 2)
            The map from the unit of `reach` to px at each place.
        reach : float
        """
        last = np.array(self.index.shape[::-1]) - 1
        column, row = np.clip(np.rint((places - self.corner) / self.cell), 0, last).astype(int).T
        found = self.index[row, column]
        gap = np.linalg.inv(units) @ (self.centres[found] - places)[..., None]
        distance = np.hypot(gap[:, 0, 0], gap[:, 1, 0])
        return np.where(distance < reach, found, -1), distance
