"""What the page of a network and the terminal say of it, as rows of texts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ahf_ros.interchange.network_results import rejections
from ahf_ros.orientation.calibration import usual_deviations
from ahf_ros.orientation.deviations import bar_deviations, control_deviations
from ahf_ros.orientation.points import standard_deviations
from ahf_ros.orientation.solution import Solution
from ahf_ros.orientation.strength import rays_of, semi_axes
from ahf_ros.orientation.views import largest_angles
from ahf_ros.text import decimals

Rows = Sequence[tuple[str, ...]]

_IN_PX = ('f', 'cx', 'cy')


def summary(solution: Solution) -> Rows:
    """Return names and values of what describes a whole network."""
    known, posed, used = solution.determined, solution.oriented, solution.start.used
    unit = f' {solution.network.unit}' if solution.network.unit else ', without scale'
    scaled = ', covariances are scaled by its square' if solution.scaled else ''
    rows = [
        ('photographs', _of(posed)),
        ('targets', _of(known)),
        ('image points used', _of(used)),
        ('image points left out', _left_out(solution)),
        ('sigma0', f'{solution.sigma0:.3f}{scaled}'),
        ('redundancy', str(solution.redundancy)),
    ]
    if used.any():
        rms = np.sqrt((solution.residuals[used] ** 2).mean(axis=0))
        rows.append(('RMS residual x, y', f'{rms[0]:.4f}, {rms[1]:.4f} px'))
    if known.any():
        rays = rays_of(solution)[known]
        angles = np.degrees(largest_angles(solution.network, solution.start)[known])
        middle = np.median(rays)
        rows.append(('rays a target', f'{rays.min()} to {rays.max()}, median {middle:g}'))
        between = f'{np.nanmin(angles):.0f} to {np.nanmax(angles):.0f} degrees'
        rows.append(('angles of rays', between))
        variances = np.diagonal(solution.point_covariances[known], axis1=1, axis2=2)
        mean = ', '.join(f'{value:.3g}' for value in np.sqrt(variances.mean(axis=0)))
        rows.append(('standard deviation x, y, z', f'{mean}{unit}'))
        rows.append(('largest semi-axis', f'{semi_axes(solution)[known].max():.3g}{unit}'))
    return rows


def _of(chosen: np.ndarray) -> str:
    """Return how many there are, and of how many if these are more."""
    number = int(chosen.sum())
    return f'{number}' if number == len(chosen) else f'{number} of {len(chosen)}'


def _left_out(solution: Solution) -> str:
    tested = sum(it.normalised_residual is not None for it in solution.rejected)
    return f'{tested}, expected by chance {solution.expected_rejections:.1f}'


def camera_rows(solution: Solution, camera: int) -> Rows:
    """Return parameters of a calibrated camera, values, standard deviations, and their ratio.

    Instead of the ratio it says where photographs hardly know more than what is usual.
    """
    rows = []
    sigmas = standard_deviations(solution.camera_covariances[camera])
    values = solution.start.calibrations[camera]
    before = usual_deviations(solution.network.cameras[camera], values[0]).items()
    for (name, usual), value, sigma in zip(before, values, sigmas, strict=True):
        called = f'{name}, px' if name in _IN_PX else name
        if name in solution.released[camera]:
            digits = decimals([sigma])
            ratio = '' if name in _IN_PX else f'{abs(value) / sigma:.1f}'
            ratio = 'as usual of lenses' if sigma > usual / 2 else ratio
            rows.append((called, f'{value:.{digits}f}', f'{sigma:.{digits}f}', ratio))
        elif value:
            rows.append((called, f'{value:.7g}', 'kept', ''))
    return rows


def bar_rows(solution: Solution) -> Rows:
    """Return scale bars: ends, role, length, deviation, its standard deviation, their ratio."""
    bars = bar_deviations(solution)
    digits = decimals(it.sigma for it in bars)
    return [
        (
            ' to '.join(it.bar.ends),
            _role(solution, it.bar.check, it.bar.title),
            f'{it.bar.length:.{digits}f}',
            f'{it.deviation:+.{digits}f}',
            f'{it.sigma:.{digits}f}',
            f'{abs(it.deviation) / it.sigma:.1f}' if it.sigma else '',
        )
        for it in bars
    ]


def control_rows(solution: Solution) -> Rows:
    """Return control points: name, role, deviations in x, y, z, their standard deviations."""
    points = control_deviations(solution)
    digits = decimals(value for it in points for value in it.sigma)
    return [
        (
            it.point.name,
            _role(solution, it.point.check, it.point.title),
            *(f'{value:+.{digits}f}' for value in it.deviation),
            ', '.join(f'{value:.{digits}f}' for value in it.sigma),
        )
        for it in points
    ]


def _role(solution: Solution, check: bool, name: str) -> str:
    verdicts = {it.name: it.verdict for it in solution.suspects}
    return verdicts.get(name, 'check' if check else 'control')


def rejected_rows(solution: Solution) -> Rows:
    """Return what was left out: photograph, target, x and y, normalised residual, reason."""
    return [
        (
            it.photograph,
            it.target,
            *(f'{value:.1f}' for value in it.xy),
            '' if it.normalised_residual is None else f'{abs(it.normalised_residual):.1f}',
            it.reason,
        )
        for it in rejections(solution)
    ]
