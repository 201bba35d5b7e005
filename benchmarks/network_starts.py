"""Networks from noise on exact projections, and the panel's photographs, without start values.

A network counts as oriented where all its photographs of four targets or more are, as refused
where `orient` raises or warns, and as silently wrong where it does neither and its points are off
the truth. Random photographs show three targets or fewer now and then, which have several poses.
"""

import csv
import os
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros import identify, read_image
from ahf_ros.network.network import CameraView, IntArray, Network, Observations
from ahf_ros.network.orient import orient
from ahf_ros.network.resection import FEWEST_POINTS
from ahf_ros.network.solution import Solution
from benchmarks.report import number, table
from support.random_networks import Rendered, deviations, rendered


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
    start = solution.state
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
    rows: list[tuple[Any, ...]] = [(*_against(plain, truth), '-', '-')]
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
        both = np.isfinite(solution.state.points[:, 0]) & np.isfinite(clean.state.points[:, 0])
        reference = np.array([truth[name] for name in np.array(network.targets)[both]])
        first, second = (
            deviations(one.state.points[both], reference) for one in (clean, solution)
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
    start, names = solution.state, solution.network.targets
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
