"""Errors of positions from a cloud: four neighbours, a plane without perspective, the homography.

    python -m benchmarks.positions

Flat targets before a pinhole camera at a metre; a structured-light scanner's noise along the ray,
correlated over neighbouring pixels, more of it on ink, where points are also missing, and some
points that are far off. RMS distance from the truth, mm, over the targets that got a position.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

import cv2
import numpy as np

from ahf_ros.interchange.point_clouds import AXES
from ahf_ros.localisation import NEIGHBOURHOOD, positions
from ahf_ros.synthetic.camera import Camera, tilted_camera
from ahf_ros.target import Target

SIDE = 400  # px, of the image
FOCAL_LENGTH = 2000.0  # px
DISTANCE = 1000.0  # mm
NOISE, CORRELATION = 0.1, 0.7  # mm on paper, and px of the blur that correlates it
INK_NOISE, INK_MISSING = 4.0, 0.4  # times as much, share of points
WILD = 0.02  # share of points
DOT, BAND = 1.0, (2.25, 3.5)  # inked, in dot radii; of the band every other of twelve sectors
SCENES = {
    'no noise': (0.0, 0.0, 0.0),
    'noise': (1.0, 1.0, 0.0),
    'noise, ink, wild points': (1.0, INK_NOISE, 0.4),
    'noise, ink, no points in the dot': (1.0, INK_NOISE, 1.0),
}
"""Noise on paper and on ink, as multiples of `NOISE`, and missing points of the dot."""

KIND = np.dtype([(name, 'f4') for name in AXES])


def four_neighbours(cloud: np.ndarray, target: Target) -> np.ndarray:
    """Return the bilinear mean of the points about a centre, of those that there are."""
    column, row = math.floor(target.x), math.floor(target.y)
    across, down = target.x - column, target.y - row
    corners = cloud[row : row + 2, column : column + 2]
    points = np.stack([corners[name] for name in AXES], axis=-1).astype(float)
    weights = np.outer((1 - down, down), (1 - across, across))
    weights[~np.isfinite(points).all(axis=-1)] = 0
    total = weights.sum()
    return (np.nan_to_num(points) * weights[..., None]).sum(axis=(0, 1)) / (total or math.nan)


def plane(cloud: np.ndarray, target: Target) -> np.ndarray:
    """Return what x, y, z, as linear functions of the pixel, are at a centre, without outliers."""
    reach = math.ceil(NEIGHBOURHOOD * target.semi_major)
    rows, columns = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    rows, columns = rows + round(target.y), columns + round(target.x)
    points = np.stack([cloud[name][rows, columns] for name in AXES], axis=-1).astype(float)
    across, down = columns - target.x, rows - target.y
    used = np.isfinite(points).all(axis=-1) & (np.hypot(across, down) <= reach)
    for _ in range(5):
        design = np.stack((np.ones(used.sum()), across[used], down[used]), axis=1)
        fitted = np.linalg.lstsq(design, points[used], rcond=None)[0]
        seen = fitted[0] + across[..., None] * fitted[1] + down[..., None] * fitted[2]
        distances = np.linalg.norm(points - seen, axis=-1)
        used &= distances <= max(1e-3, 3 * 1.4826 * np.median(distances[used]))
    return fitted[0]


def homography(cloud: np.ndarray, target: Target) -> np.ndarray:
    """Return the position of the package."""
    return positions(cloud, [target]).points[0]


METHODS: dict[str, Callable[[np.ndarray, Target], np.ndarray]] = {
    'four neighbours': four_neighbours,
    'plane': plane,
    'homography': homography,
}


def scan(
    camera: Camera, centre: np.ndarray, radius: float, scene: str, generator: np.random.Generator
) -> np.ndarray:
    """Return the cloud of a wall with one target."""
    paper, ink, missing = SCENES[scene]
    rows, columns = np.mgrid[:SIDE, :SIDE]
    wall = camera.wall(np.column_stack((columns.ravel(), rows.ravel())).astype(float))
    points = np.column_stack((wall, np.ones(len(wall)))) @ camera.pose.T * DISTANCE / FOCAL_LENGTH
    across, down = (wall - centre).T / radius
    away, sector = np.hypot(across, down), np.arctan2(down, across) // (math.pi / 6)
    dot = away < DOT
    inked = dot | ((away > BAND[0]) & (away < BAND[1]) & (sector % 2 == 0))
    noise = cv2.GaussianBlur(generator.standard_normal((SIDE, SIDE)), (0, 0), CORRELATION).ravel()
    deviations = NOISE * np.where(inked, ink, paper)
    points *= 1 + (deviations * noise / noise.std() / np.linalg.norm(points, axis=1))[:, None]
    chance = generator.uniform(size=len(points))
    if missing:
        points[chance < WILD] *= 1.03
        points[inked & (chance > 1 - np.where(dot, missing, INK_MISSING))] = np.nan
    cloud = np.empty((SIDE, SIDE), KIND)
    for axis, name in enumerate(AXES):
        cloud[name] = points[:, axis].reshape(SIDE, SIDE)
    return cloud


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--count', type=int, default=30, help='targets a row')
    count = parser.parse_args().count
    print('| scene | tilt | radius px |', ' | '.join(METHODS), '|')
    print('|---' * (3 + len(METHODS)) + '|')
    for scene in SCENES:
        for tilt, radius in ((0, 20.0), (45, 20.0), (45, 8.0), (60, 20.0)):
            errors = np.array([trial(scene, tilt, radius, seed) for seed in range(count)])
            cells = []
            for column in errors.T:
                known = column[np.isfinite(column)]
                rms = math.sqrt(np.mean(known**2)) if len(known) else math.nan
                cells.append(f'{rms:.4f}' + f' ({len(known)})' * (len(known) < count))
            print(f'| {scene} | {tilt} | {radius:g} |', ' | '.join(cells), '|')


def trial(scene: str, tilt: float, radius: float, seed: int) -> list[float]:
    """Return the error of every method, mm, NaN where there is no position."""
    generator = np.random.default_rng(seed)
    camera = tilted_camera(SIDE, SIDE, FOCAL_LENGTH, math.radians(tilt), 0.0, generator)
    centre = generator.uniform(-30, 30, 2)
    cloud = scan(camera, centre, radius, scene, generator)
    x, y = camera.project(centre[None])[0]
    target = Target(1, 71, x, y, *camera.circle(centre, radius))
    true = camera.pose @ (*centre, 1.0) * DISTANCE / FOCAL_LENGTH
    return [float(np.linalg.norm(method(cloud, target) - true)) for method in METHODS.values()]


if __name__ == '__main__':
    main()
