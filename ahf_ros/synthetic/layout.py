"""Where targets are in the image, each with its quiet zone in the frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ahf_ros.synthetic.camera import Camera

QUIET_ZONE = 4.2
"""Radius round a target that is left free, in radii of the dot."""
STEEPEST_VIEW = 75.0
"""Largest angle between the wall's normal and the ray to a target, degrees."""


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Circles in the image that do not overlap.

    Attributes
    ----------
    centres : ndarray of float64, shape (n, 2)
        Pixels.
    radii : ndarray of float64, shape (n,)
        px.
    """

    centres: np.ndarray
    radii: np.ndarray


def quiet_radius(semi_major: np.ndarray | float, focal_length: float) -> np.ndarray:
    """Return the radius of the circle in the image that holds a target and its quiet zone.

    Parameters
    ----------
    semi_major : float or ndarray
        Of the dot, px.
    focal_length : float
        In px: half a target may come that much nearer to the camera that it is seen larger.
    """
    reach = QUIET_ZONE * np.asarray(semi_major, dtype=float)
    return 1.02 * reach / np.maximum(1 - reach / focal_length, 0.1)


def finest_grid(width: int, height: int, radius: float) -> tuple[int, int]:
    """Return how many columns and rows of circles of a radius an image holds."""
    return int(width / (2 * radius)), int(height / (2 * radius))


def grid_places(camera: Camera, radii: np.ndarray, generator: np.random.Generator) -> Places:
    """Return places for circles, one a cell of a grid and anywhere inside it.

    Cells that show the wall at more than `STEEPEST_VIEW` stay empty, and the grid is only as
    fine as need be.

    Parameters
    ----------
    camera : Camera
        Sees the wall.
    radii : ndarray of float64, shape (n,)
        Of the circles, px.
    generator : numpy.random.Generator
        Draws cells and places.

    Raises
    ------
    ValueError
        If the part of the wall that is seen well enough has too few cells.
    """
    wanted = len(radii)
    if not wanted:
        return Places(np.empty((0, 2)), radii)
    size = np.array([camera.width, camera.height], dtype=float)
    finest = finest_grid(camera.width, camera.height, radii.max())
    held = 0
    for grid in _grids(finest, camera.width / camera.height, wanted):
        cell = size / grid
        x, y = np.meshgrid(*(np.arange(count) for count in grid))
        corners = np.stack((x.ravel(), y.ravel()), axis=1) * cell - 0.5
        steepness = np.degrees(camera.view_angle(camera.wall(corners + cell / 2)))
        corners = corners[steepness <= STEEPEST_VIEW]
        if len(corners) >= wanted:
            chosen = corners[generator.permutation(len(corners))[:wanted]]
            slack = cell - 2 * radii[:, None]
            inside = radii[:, None] + generator.uniform(0, 1, (wanted, 2)) * slack
            return Places(chosen + inside, radii)
        held = len(corners)
    raise ValueError(
        f'targets is {wanted}, accepted is an integer from 0 to {held} where the wall is seen at '
        f'less than {STEEPEST_VIEW:g} degrees'
    )


def scattered_places(
    camera: Camera, radii: np.ndarray, taken: Places, generator: np.random.Generator
) -> Places:
    """Return places for circles, the largest first, anywhere in the image where it is free.

    Parameters
    ----------
    camera : Camera
        Gives the size of the image.
    radii : ndarray of float64, shape (n,)
        Of the circles, px.
    taken : Places
        To keep clear of.
    generator : numpy.random.Generator
        Draws the places.

    Raises
    ------
    ValueError
        If no room is found.
    """
    size = np.array([camera.width, camera.height])
    centres, occupied = taken.centres, taken.radii
    found = np.empty((len(radii), 2))
    for placed, index in enumerate(np.argsort(-radii, kind='stable')):
        tries = generator.uniform(0, 1, (1000, 1, 2)) * (size - 1)
        gaps = np.linalg.norm(tries - centres, axis=2) - occupied
        free = (gaps > radii[index]).all(axis=1)
        if not free.any():
            raise ValueError(
                f'distractors is {len(radii)}, accepted is an integer from 0 to {placed} for '
                'this scene'
            )
        found[index] = tries[free.argmax(), 0]
        centres = np.concatenate((centres, found[index][None]))
        occupied = np.append(occupied, radii[index])
    return Places(found, radii)


def _grids(finest: tuple[int, int], ratio: float, wanted: int) -> list[tuple[int, int]]:
    """Return grids from coarse to fine, nearly square cells, that have enough of them."""
    grids = []
    for columns in range(1, finest[0] + 1):
        rows = min(max(math.floor(columns / ratio), 1), finest[1])
        grids += [(columns, rows), (columns, min(rows + 1, finest[1]))]
    grids.append(finest)
    return [grid for grid in grids if grid[0] * grid[1] >= wanted]
