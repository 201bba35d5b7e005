"""What exports of adjusted networks share: lenses as others have them, and who shows what."""

from collections.abc import Iterator
from pathlib import PurePath
from typing import NamedTuple

import numpy as np

from ahf_ros.network.camera import measured_places, parameters_of
from ahf_ros.network.network import FloatArray
from ahf_ros.network.solution import Solution

_GRID = 9  # places in a row of an image, at which lenses are compared


class Lens(NamedTuple):
    """A calibration whose focal lengths may differ, px; the principal point has our origin.

    An equidistant fisheye lens has k4 and no p1 and p2, others have no k4.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    k1: float
    k2: float
    k3: float
    p1: float
    p2: float
    k4: float


class Seen(NamedTuple):
    """A used image point: numbers of its photograph and target, and its place (2,), px."""

    photograph: int
    target: int
    xy: FloatArray


def lens_of(solution: Solution, camera: int, *, square: bool = False) -> Lens:
    """Return the lens of a camera without shear; if `square`, with one focal length."""
    names = parameters_of(solution.network.cameras[camera])
    value = dict(zip(names, solution.state.calibrations[camera].tolist(), strict=True))
    fx, fy = value['f'] * (1 + value['affinity']), value['f']
    if square:
        fx = fy = (fx + fy) / 2
    return Lens(fx, fy, *(value.get(name, 0.0) for name in Lens._fields[2:]))


def lens_loss(solution: Solution, *, square: bool) -> float:
    """Return by how much image points differ where shear is left out, at the most, px.

    If `square`, affinity is left out as well.
    """
    largest = 0.0
    for camera in np.flatnonzero(solution.calibrated).tolist():
        view, calibration = solution.network.cameras[camera], solution.state.calibrations[camera]
        lens = lens_of(solution, camera, square=square)
        columns, rows = (np.linspace(0, it - 1, _GRID) for it in (view.width, view.height))
        xy = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        places = measured_places(calibration, xy)
        other = places * (lens.fx, lens.fy) + (lens.cx, lens.cy)
        largest = max(largest, float(np.linalg.norm(other - xy, axis=1).max()))
    return largest


def file_name(solution: Solution, photograph: int) -> str:
    """Return the name of a photograph without folders."""
    return PurePath(solution.network.photographs[photograph]).name


def oriented(solution: Solution) -> list[int]:
    """Return the numbers of the photographs that have a pose."""
    return np.flatnonzero(solution.oriented).tolist()


def determined(solution: Solution) -> list[int]:
    """Return the numbers of the targets that have coordinates."""
    return np.flatnonzero(solution.determined).tolist()


def used_points(solution: Solution) -> Iterator[Seen]:
    """Yield the used image points, those of a target in the order of the photographs."""
    seen = solution.network.observations
    usable = solution.state.used & solution.determined[seen.point]
    usable &= solution.oriented[seen.photograph]
    order = np.lexsort((seen.photograph, seen.point))
    for row in order[usable[order]].tolist():
        yield Seen(int(seen.photograph[row]), int(seen.point[row]), seen.xy[row])


def by_target(solution: Solution) -> dict[int, list[Seen]]:
    """Return the used image points of each target that has coordinates."""
    found: dict[int, list[Seen]] = {number: [] for number in determined(solution)}
    for it in used_points(solution):
        found[it.target].append(it)
    return found


def numbers(values: FloatArray, blank: str = ' ') -> str:
    """Return numbers with all their digits, row after row."""
    return blank.join(f'{value:.15g}' for value in np.ravel(values))
