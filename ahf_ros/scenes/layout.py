"""Placement of targets and distractors in the image, without overlap."""

import math
from dataclasses import dataclass

import numpy as np

from ahf_ros.scenes.camera import Camera

MAXIMUM_VIEW_ANGLE = 75.0
"""Largest angle between the wall's normal and the ray to a target, degrees, where the wall is not
tilted by more than `TILT_MARGIN` less."""

TILT_MARGIN = 5.0
"""Angle by which targets may be seen more obliquely than the middle of the wall at the steepest
tilts, degrees."""

_TRIES = 1000  # positions per distractor: one in 200 of the image being free is enough in 99 %


@dataclass(frozen=True, slots=True, eq=False)
class Placements:
    """Circles in the image that do not overlap: centres, shape (n, 2), and radii, (n,), px."""

    centres: np.ndarray
    radii: np.ndarray


def quiet_radius(semi_major: np.ndarray | float, focal_length: float, zone: float) -> np.ndarray:
    """Return the radius of the circle in the image that holds a target and its quiet zone, px.

    The semi-major axis of its dot and the focal length are in px, the radius of the quiet zone is
    in radii of the dot. On a tilted wall, the nearer half of a target appears larger; the shorter
    the focal length, the more so.
    """
    reach = zone * np.asarray(semi_major, dtype=float)
    return 1.02 * reach / np.maximum(1 - reach / focal_length, 0.1)


def size_ratios(text: str) -> list[float]:
    """Return the ratios that a text lists, such as '0.5, 1, 2'; from 0.05 to 20, or ValueError."""
    try:
        ratios = [float(part) for part in text.split(',')]
    except ValueError:
        ratios = []
    if not ratios or not all(0.05 <= ratio <= 20 for ratio in ratios):
        raise ValueError(f'sizes is {text!r}, accepted are numbers from 0.05 to 20, with commas')
    return ratios


def finest_grid(width: int, height: int, radius: float) -> tuple[int, int]:
    """Return the columns and rows of the densest grid of circles that fits into an image."""
    return int(width / (2 * radius)), int(height / (2 * radius))


def fitting_grid(width: int, height: int, radius: float, count: int) -> tuple[int, int]:
    """Return the columns and rows of the coarsest grid with a cell for each of so many circles.

    A ValueError says so if no grid has.
    """
    grids = _grids(finest_grid(width, height, radius), width / height, count)
    if not grids:
        raise ValueError(f'{count} circles of {radius:g} px do not fit into {width} x {height} px')
    return grids[0]


def grid_placements(
    camera: Camera, radii: np.ndarray, generator: np.random.Generator
) -> Placements:
    """Place circles at random inside the cells of a grid, one per cell.

    The radii are in px. The grid is as coarse as possible. Cells where the camera sees the wall at
    more than the maximum view angle stay empty; a ValueError is raised if too few are left.
    """
    steepest = max(MAXIMUM_VIEW_ANGLE, camera.tilt + TILT_MARGIN)
    count = len(radii)
    if not count:
        return Placements(np.empty((0, 2)), radii)
    size = np.array([camera.width, camera.height], dtype=float)
    finest = finest_grid(camera.width, camera.height, radii.max())
    capacity = 0
    for grid in _grids(finest, camera.width / camera.height, count):
        cell = size / grid
        x, y = np.meshgrid(*(np.arange(side) for side in grid))
        corners = np.stack((x.ravel(), y.ravel()), axis=1) * cell - 0.5
        angles = np.degrees(camera.view_angle(camera.wall(corners + cell / 2)))
        corners = corners[angles <= steepest]
        if len(corners) >= count:
            selected = corners[generator.permutation(len(corners))[:count]]
            slack = cell - 2 * radii[:, None]
            inside = radii[:, None] + generator.uniform(0, 1, (count, 2)) * slack
            return Placements(selected + inside, radii)
        capacity = len(corners)
    raise ValueError(
        f'targets is {count}, accepted is an integer from 0 to {capacity} where the camera '
        f'sees the wall at less than {steepest:g} degrees'
    )


def scattered_placements(
    camera: Camera, radii: np.ndarray, taken: Placements, generator: np.random.Generator
) -> Placements:
    """Place circles at random where the image is free, the largest circle first.

    The radii are in px; circles in `taken` are not overlapped. A ValueError is raised if no free
    position is found in `_TRIES` attempts.
    """
    size = np.array([camera.width, camera.height])
    centres, occupied = taken.centres, taken.radii
    placed = np.empty((len(radii), 2))
    for count, index in enumerate(np.argsort(-radii, kind='stable')):
        tries = generator.uniform(0, 1, (_TRIES, 1, 2)) * (size - 1)
        gaps = np.linalg.norm(tries - centres, axis=2) - occupied
        free = (gaps > radii[index]).all(axis=1)
        if not free.any():
            raise ValueError(
                f'distractors is {len(radii)}, accepted is an integer from 0 to {count} in this '
                'scene'
            )
        placed[index] = tries[free.argmax(), 0]
        centres = np.concatenate((centres, placed[index][None]))
        occupied = np.append(occupied, radii[index])
    return Placements(placed, radii)


def _grids(finest: tuple[int, int], ratio: float, minimum: int) -> list[tuple[int, int]]:
    """Return grids of nearly square cells, from coarse to fine, with at least `minimum` cells."""
    grids = []
    for columns in range(1, finest[0] + 1):
        rows = min(max(math.floor(columns / ratio), 1), finest[1])
        grids += [(columns, rows), (columns, min(rows + 1, finest[1]))]
    grids.append(finest)
    return [grid for grid in grids if grid[0] * grid[1] >= minimum]
