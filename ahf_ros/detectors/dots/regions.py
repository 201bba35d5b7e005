"""The regions of an image where something may be that is not known yet.

Edges that known targets explain, and straight ones, are no dot's. Where no others are left,
nothing small needs to be looked for.
"""

from __future__ import annotations

import cv2
import numpy as np

from ahf_ros.features.log_edges import LogEdges, mask_of

STRAIGHT = 8.0
"""Length of an edge that is no small dot's, px of the image at half its size."""

_TILE = 64  # side, px of the image at half its size
_MINIMUM_EDGES = 20  # of four tiles, px; disc and border of the smallest target have twice as many
_MAXIMUM_SHARE = 0.7  # share of the image, beyond which all of it is one region


def open_regions(edges: LogEdges, outlines: np.ndarray) -> list[tuple[slice, slice]]:
    """Return the regions that hold edges which nothing explains.

    Parameters
    ----------
    edges : LogEdges
        Of the image at half its size.
    outlines : ndarray of float, shape (k, m, 2)
        Of what is known, px of the image at half its size.

    Returns
    -------
    list of tuple of 2 slice
        Rows and columns of the image at half its size; regions may overlap.
    """
    height, width = edges.marked.shape
    rest = edges.unmasked(mask_of(outlines, edges.marked.shape)).curved(STRAIGHT)
    rows, columns = -(-height // _TILE), -(-width // _TILE)
    of_tiles = np.bincount(
        rest.y // _TILE * columns + rest.x // _TILE, minlength=rows * columns
    ).reshape(rows, columns)
    of_four = 4 * cv2.blur(of_tiles.astype(np.float32), (2, 2), borderType=cv2.BORDER_CONSTANT)
    wide = cv2.dilate((of_four >= _MINIMUM_EDGES).astype(np.uint8), np.ones((3, 3), np.uint8))
    contours, _ = cv2.findContours(wide, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    boxes = [cv2.boundingRect(contour) for contour in contours]
    if sum(across * tall for _, _, across, tall in boxes) > _MAXIMUM_SHARE * rows * columns:
        return [(slice(0, height), slice(0, width))]
    return [
        (
            slice(_TILE * top, min(_TILE * (top + tall), height)),
            slice(_TILE * left, min(_TILE * (left + across), width)),
        )
        for left, top, across, tall in boxes
    ]
