"""Networks from noise on exact projections, and the panel's photographs, without start values.

A network counts as oriented where all its photographs of four targets or more are, as refused
where `orient` raises or warns, and as silently wrong where it does neither and its points are off
the truth. Random photographs show three targets or fewer now and then, which have several poses.
"""

from __future__ import annotations

import csv
import os
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from ahf_ros import identify, read_image
from ahf_ros.orientation.camera import pinhole, project
from ahf_ros.orientation.network import (
    CameraView,
    FloatArray,
    IntArray,
    Network,
    Observations,
)
from ahf_ros.orientation.orient import orient
from ahf_ros.orientation.resection import FEWEST_POINTS
from ahf_ros.orientation.solution import Solution
from benchmarks.report import number, table

WIDTH, HEIGHT = 3000, 2000
NOISE = 0.05
"""Standard deviation of a coordinate in px."""


@dataclass(frozen=True)
class Rendered:
    """A network with its truth: points (n, 3), and the targets whose IDs are wrong by rows."""

    network: Network
    points: FloatArray
    wrong: FloatArray


def rendered(
    seed: int,
    *,
    flat: bool,
    known: bool,
    wrong: float = 0.0,
    photographs: int = 0,
    distorted: bool = False,
) -> Rendered:
    """Return a random network: 8 to 60 photographs of 20 to 150 targets, tilted and rolled.

    A distorted one has a lens as usual: k1 from -0.3 to 0.1, and a principal point that is off by
    up to 2 % of the image's width.
    """
    random = np.random.default_rng(seed)
    count = photographs or int(random.integers(8, 61))
    number = int(random.integers(20, 151))
    focal = WIDTH * random.uniform(0.7, 2.5)
    points = random.uniform(-1, 1, (number, 3)) * [1, random.uniform(0.5, 1), 0.5]
    if flat:
        points[:, 2] = 0
    rotations, positions = [], []
    tilt = np.radians(random.uniform(15, 50))
    for _ in range(count):
        around = random.uniform(0, 2 * np.pi)
        lean = random.uniform(0.3, 1) * tilt
        away = np.array(
            [np.sin(lean) * np.cos(around), np.sin(lean) * np.sin(around), np.cos(lean)]
        )
        distance = random.uniform(0.7, 1.3) * 2 * focal / WIDTH
        rotations.append(looking(-away, random.uniform(0, 2 * np.pi)))
        positions.append(random.uniform(-0.4, 0.4, 3) * [1, 1, 0] + distance * away)
    view = CameraView('camera', WIDTH, HEIGHT, focal if known else None)
    calibration = pinhole(focal, WIDTH, HEIGHT)
    cameras, of = (view,), np.zeros(count, dtype=int)
    if distorted:
        calibration[1:3] += WIDTH * random.uniform(-0.02, 0.02, 2)
        calibration[3] = random.uniform(-0.3, 0.1)
    return photographed(
        points, rotations, positions, cameras, of, calibration[None], random, wrong
    )


def photographed(
    points: FloatArray,
    rotations: Sequence[FloatArray],
    positions: Sequence[FloatArray],
    cameras: tuple[CameraView, ...],
    camera_of: IntArray,
    calibrations: FloatArray,
    random: np.random.Generator,
    wrong: float = 0.0,
) -> Rendered:
    """Return the network of poses: nine of ten targets in the image, a share with wrong IDs.

    `calibrations` (cameras or photographs, parameters) are the true ones.
    """
    rows = []
    for photograph, (rotation, position) in enumerate(zip(rotations, positions, strict=True)):
        camera = camera_of[photograph]
        own = photograph if len(calibrations) == len(rotations) else camera
        xy = project(calibrations[own], rotation, position, points)
        size = np.array([cameras[camera].width, cameras[camera].height])
        inside = np.all((xy > 10) & (xy < size - 10), axis=1)
        ideal = (points - position) @ rotation.T
        # No lens images twice: beyond this radius Brown's polynomial turns back.
        turning = 1 + 3 * calibrations[own][3] * np.sum((ideal[:, :2] / ideal[:, 2:]) ** 2, axis=1)
        inside &= turning > 0.2
        inside &= random.random(len(points)) < 0.9
        rows += [(photograph, point, *xy[point]) for point in np.flatnonzero(inside)]
    table = np.array(rows)
    xy = table[:, 2:] + random.normal(0, NOISE, (len(table), 2))
    photograph, ids = table[:, 0].astype(int), table[:, 1].astype(int)
    false = random.random(len(table)) < wrong
    for row in np.flatnonzero(false):
        free = np.setdiff1d(np.arange(len(points)), ids[photograph == photograph[row]])
        if len(free):
            ids[row] = random.choice(free)
        else:
            false[row] = False
    network = Network(
        tuple(f'{index}.png' for index in range(len(rotations))),
        np.asarray(camera_of),
        cameras,
        tuple(str(index) for index in range(len(points))),
        Observations(
            photograph, ids, xy, np.broadcast_to(NOISE**2 * np.eye(2), (len(table), 2, 2))
        ),
    )
    return Rendered(network, points, false)


def looking(along: FloatArray, roll: float) -> FloatArray:
    """Return a rotation from world to camera that looks along a unit vector and is rolled."""
    up = np.array([0, 1, 0]) if abs(along[1]) < 0.9 else np.array([1, 0, 0])
    right = np.cross(along, up)
    right = right / np.linalg.norm(right)
    rotation = np.array([right, np.cross(along, right), along])
    turn = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    return turn @ rotation


def deviations(points: FloatArray, truth: FloatArray) -> FloatArray:
    """Return what is left of points (n, 3) against the truth after a similarity transform."""
    source, target = points - points.mean(axis=0), truth - truth.mean(axis=0)
    left, values, right = np.linalg.svd(target.T @ source)
    sign = np.diag([1, 1, np.linalg.det(left @ right)])
    rotation = left @ sign @ right
    scale = np.sum(values * np.diag(sign)) / np.sum(source**2)
    return scale * source @ rotation.T - target


def starts_table(seeds: Sequence[int], runs: int) -> list[str]:
    """Return how many random networks were oriented, refused, and silently wrong."""
    rows = []
    for flat, known, distorted in product((False, True), (True, False), (False, True)):
        counts: Counter[str] = Counter()
        times = []
        for run in range(runs):
            seen = rendered(1000 * seeds[0] + run, flat=flat, known=known, distorted=distorted)
            started = time.perf_counter()
            counts[outcome(seen)] += 1
            times.append(time.perf_counter() - started)
        kinds = ('oriented', 'in part, said', 'refused', 'wrong')
        shares = (f'{counts[kind]} ({counts[kind] / runs:.1%})' for kind in kinds)
        field = 'plane' if flat else 'space'
        focal = 'known' if known else 'unknown'
        lens = 'usual' if distorted else 'none'
        rows.append((field, focal, lens, *shares, number(float(np.median(times)), 1)))
    head = (
        'field',
        'focal length',
        'distortion',
        'oriented',
        'in part, said',
        'refused',
        'silently wrong',
        's',
    )
    return table(head, rows)


def outcome(seen: Rendered) -> str:
    """Return what became of a network: see the module."""
    try:
        solution = orient(seen.network)[0]
    except ValueError:
        return 'refused'
    start = solution.start
    known = np.flatnonzero(np.isfinite(start.points[:, 0]))
    rows = (3 * known[:, None] + np.arange(3)).ravel()
    variances = np.diag(solution.covariance_of_points)[rows].reshape(-1, 3).sum(axis=1)
    wrong = np.linalg.norm(deviations(start.points[known], seen.points[known]), axis=1)
    scale = np.linalg.norm(seen.points[known].std(axis=0)) / np.linalg.norm(
        start.points[known].std(axis=0)
    )
    if np.median(wrong / (scale * np.sqrt(variances))) > 3 or np.any(wrong > 0.02):
        return 'wrong'
    shown = np.bincount(seen.network.observations.photograph, minlength=len(start.positions))
    if np.isfinite(start.positions[shown >= FEWEST_POINTS]).all():
        return 'oriented'
    return 'in part, said' if solution.warnings else 'wrong'


def panel_network(folder: Path) -> Network:
    """Return what the package identifies in the photographs of the panel."""
    rows, covariances, ids = [], [], []
    paths = sorted(folder.glob('*.png'))
    for photograph, path in enumerate(paths):
        found = identify(read_image(path), detector='ring', family='aicon14')
        rows += [(photograph, *centre) for centre in found.centres]
        covariances += list(found.covariances)
        ids += [str(one) for one in found.ids]
    height, width = read_image(paths[0]).shape
    targets = tuple(sorted(set(ids), key=int))
    places = np.array(rows)
    return Network(
        tuple(path.name for path in paths),
        np.zeros(len(paths), dtype=int),
        (CameraView('camera', width, height),),
        targets,
        Observations(
            places[:, 0].astype(int),
            np.array([targets.index(one) for one in ids]),
            places[:, 1:],
            np.array(covariances),
        ),
    )


def panel_table(network: Network, folder: Path) -> list[str]:
    """Return figures of the panel: as identified, with wrong IDs, and with a target renamed.

    Coordinates are compared with those without the observations whose IDs were changed.
    """
    with (folder / 'points.csv').open() as file:
        truth = {row['id']: [float(row[axis]) for axis in 'xyz'] for row in csv.DictReader(file)}
    observed = network.observations
    plain = orient(network)[0]
    rows = [(*_against(plain, truth), '-', '-')]
    mixed = observed.point.copy()
    wrong = [40, 250, 500]
    for row in wrong:
        own = observed.point[observed.photograph == observed.photograph[row]]
        mixed[row] = np.setdiff1d(np.arange(len(network.targets)), own)[0]
    of_target = observed.point == observed.point[0]
    renamed = np.where(of_target, observed.point[10], observed.point)
    cases: tuple[tuple[IntArray, IntArray], ...] = (
        (mixed, np.array(wrong)),
        (renamed, np.flatnonzero(of_target)),
    )
    for points, changed in cases:
        solution = orient(replace(network, observations=replace(observed, point=points)))[0]
        named = {(one.photograph, one.target) for one in solution.rejected}
        asked = {
            (network.photographs[observed.photograph[row]], network.targets[points[row]])
            for row in changed
        }
        clean = orient(_without(network, changed))[0]
        both = np.isfinite(solution.start.points[:, 0]) & np.isfinite(clean.start.points[:, 0])
        reference = np.array([truth[name] for name in np.array(network.targets)[both]])
        first, second = (
            deviations(one.start.points[both], reference) for one in (clean, solution)
        )
        moved = float(np.linalg.norm(first - second, axis=1).max())
        rows.append((*_against(solution, truth), f'{len(asked & named)} of {len(asked)}', moved))
    names = ('as identified', 'three wrong IDs', "a target with another's ID")
    lines = [
        (
            name,
            number(rms, 4),
            number(residual, 4),
            number(sigma0, 2),
            rejected,
            named,
            moved if moved == '-' else number(moved, 5),
        )
        for name, (rms, residual, sigma0, rejected, named, moved) in zip(names, rows, strict=True)
    ]
    head = (
        'panel',
        '3-D RMS, mm',
        'residual, px',
        'sigma0',
        'rejected',
        'changed IDs named',
        'moved by these at most, mm',
    )
    return table(head, lines)


def _without(network: Network, rows: IntArray) -> Network:
    """Return the network without some observations."""
    observed = network.observations
    keep = np.setdiff1d(np.arange(len(observed.xy)), rows)
    return replace(network, observations=observed.rows(keep))


def _against(solution: Solution, truth: dict[str, list[float]]) -> tuple[float, float, float, int]:
    """Return the RMS distance from measured points in mm, and residuals."""
    start, names = solution.start, solution.network.targets
    known = [index for index in np.flatnonzero(np.isfinite(start.points[:, 0]))]
    known = [index for index in known if names[index] in truth]
    apart = deviations(start.points[known], np.array([truth[names[index]] for index in known]))
    residuals = solution.residuals[start.used]
    return (
        float(np.sqrt(np.mean(np.sum(apart**2, axis=1)))),
        float(np.sqrt(np.mean(residuals**2))),
        solution.sigma0,
        len(solution.rejected),
    )


def panel() -> list[str]:
    """Return the table of the panel; `AHF_PHOTOS` is the folder of photographs."""
    if 'AHF_PHOTOS' not in os.environ:
        raise SystemExit('AHF_PHOTOS is not set, expected the folder of photographs')
    folder = Path(os.environ['AHF_PHOTOS']) / 'panel'
    return panel_table(panel_network(folder), folder)
