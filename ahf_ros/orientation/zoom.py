"""Photographs of a camera that were taken with another zoom or focus than the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ahf_ros.orientation import normals
from ahf_ros.orientation.network import Network
from ahf_ros.orientation.normals import Layout
from ahf_ros.orientation.refinement import refine
from ahf_ros.orientation.resection import FEWEST_POINTS, Resection, resections
from ahf_ros.orientation.solution import Solution, Start
from ahf_ros.orientation.triples import STEPS
from ahf_ros.orientation.views import View, lengths_of, spread_of

OWN_CAMERA = 'Photographs of another zoom need a camera of their own'

_ZOOMED = 0.01  # change of a photograph's focal length that is another zoom
_SUSPECT = 0.8  # share of a photograph's observations that agree, below which its zoom is tested
_LARGE_SPREAD = 3.0  # of residuals, in standard deviations, from which on all zooms are tested
_GROUPS = 0.03  # the same between groups of photographs, each with a lens of its own
_FITS = 6.0  # robust spread of a photograph, in those of the network, that its own zoom reaches


def zoomed(network: Network, layout: Layout, state: Start) -> tuple[str, ...]:
    """Return warnings of photographs whose focal length is not that of their camera.

    Photographs of which a fifth disagrees, or all where residuals are large throughout, get a
    focal length of their own each.
    """
    observations = network.observations
    everything = np.bincount(observations.photograph, minlength=len(network.photographs))
    agrees = np.bincount(observations.photograph[state.used], minlength=len(everything))
    suspect = agrees < _SUSPECT * everything
    if normals.robust_spread(normals.whitened_lengths(layout, state)) > _LARGE_SPREAD:
        suspect[:] = True
    own = np.intersect1d(np.flatnonzero(suspect), layout.photographs)
    if not len(own):
        return ()
    camera_of, usual = network.camera_of.copy(), network.camera_of[own]
    camera_of[own] = len(network.cameras) + np.arange(len(own))
    views = network.cameras + tuple(
        replace(network.cameras[place], fixed=False) for place in usual
    )
    freed = refine(
        replace(network, cameras=views, camera_of=camera_of),
        replace(
            state,
            calibrations=np.concatenate([state.calibrations, state.calibrations[usual]]),
            used=state.used | np.isin(observations.photograph, own),
        ),
        ('f',),
    )
    better = np.bincount(observations.photograph[freed.used], minlength=len(everything))[own]
    focal = freed.calibrations[camera_of[layout.photographs], 0]
    warnings = []
    for camera in np.unique(usual):
        middle = np.median(focal[network.camera_of[layout.photographs] == camera])
        relative = freed.calibrations[len(network.cameras) :, 0] / middle - 1
        other = (usual == camera) & (np.abs(relative) > _ZOOMED)
        other &= better >= _SUSPECT * everything[own]
        if other.any():
            warnings.append(
                f'camera {network.cameras[camera].name}: {other.sum()} photographs, such as '
                f'{network.photographs[own[other][0]]}, have another focal length than the rest. '
                + OWN_CAMERA
            )
    return tuple(warnings)


def zoom_of(network: Network, view: View, start: Start) -> float | None:
    """Return a photograph's focal length over its camera's where it alone fits, or None."""
    calibration = start.calibrations[view.camera]
    seen = np.isfinite(start.points[view.points, 0])
    if not np.isfinite(calibration[0]) or seen.sum() <= FEWEST_POINTS:
        return None
    spread = spread_of(lengths_of(network, start))

    def fit(factor: float) -> tuple[float, Resection | None]:
        changed = start.calibrations.copy()
        changed[view.camera, 0] *= factor
        xy, sigma = view.normalised(changed)
        poses = resections(start.points[view.points[seen]], xy[seen], sigma[seen] * spread)
        return (poses[0].scale, poses[0]) if poses else (np.inf, None)

    camera = network.cameras[view.camera]
    width = max(camera.width, camera.height)
    factors = list(STEPS * width / calibration[0])
    best = min(factors, key=lambda factor: fit(factor)[0])
    step = STEPS[1] / STEPS[0]
    for _ in range(6):
        step = np.sqrt(step)
        best = min((best / step, best, best * step), key=lambda factor: fit(factor)[0])
    alone, own = fit(best)[0], fit(1.0)[0]
    return best if abs(best - 1) > _ZOOMED and alone < _FITS and alone < own / 3 else None


def zooms_of_groups(solutions: Sequence[Solution]) -> tuple[str, ...]:
    """Return warnings of cameras whose focal length differs between groups of photographs."""
    network = solutions[0].network
    warnings = []
    for camera, view in enumerate(network.cameras):
        lengths = [
            float(solution.start.calibrations[camera, 0])
            for solution in solutions
            if np.any(network.camera_of[solution.oriented] == camera)
        ]
        if lengths and max(lengths) > (1 + _GROUPS) * min(lengths):
            text = ', '.join(f'{length:.0f}' for length in lengths)
            warnings.append(
                f'camera {view.name}: its focal length is {text} px in groups of photographs. '
                + OWN_CAMERA
            )
    return tuple(warnings)
