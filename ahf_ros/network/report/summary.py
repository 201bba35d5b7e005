"""What the page of a network and the terminal say of it, as rows of texts."""

from collections.abc import Sequence

import numpy as np

from ahf_ros.base.text import counted
from ahf_ros.network.camera import parameters_of
from ahf_ros.network.deviations import bar_deviations, control_deviations
from ahf_ros.network.files.network_results import rejections
from ahf_ros.network.points import standard_deviations
from ahf_ros.network.solution import Solution
from ahf_ros.network.strength import rays_of, semi_axes
from ahf_ros.network.units import decimals
from ahf_ros.network.verdict import undetermined_parameters
from ahf_ros.network.views import largest_angles

Rows = Sequence[tuple[str, ...]]

_IN_PX = ('f', 'cx', 'cy')


def tables(solution: Solution, title: str) -> list[tuple[str, tuple[str, ...], Rows]]:
    """Return the title, the head and the rows of each table that describes a network.

    The first one, of the whole network, has the title that is given; tables without rows are left
    out.
    """
    unit = solution.network.unit
    found: list[tuple[str, tuple[str, ...], Rows]] = [(title, ('', ''), summary(solution))]
    camera_head = 'parameter', 'value', 'standard deviation', 'ratio'
    for index in solution.calibrated.nonzero()[0].tolist():
        name = solution.network.cameras[index].name
        found.append((f'Camera {name}', camera_head, camera_rows(solution, index)))
    if bars := bar_rows(solution):
        bar_head = '', 'role', f'length, {unit}', 'deviation', 'sigma', 'ratio'
        found.append(('Scale bars', bar_head, bars))
    if control := control_rows(solution):
        control_head = '', 'role', f'dx, {unit}', 'dy', 'dz', 'sigma x, y, z'
        found.append(('Control points', control_head, control))
    if rejected := rejected_rows(solution):
        rejected_head = 'photograph', 'target', 'x, px', 'y, px', 'residual, sigma', 'why'
        found.append((f'{len(rejected)} left out', rejected_head, rejected))
    return found


def summary(solution: Solution) -> Rows:
    """Return names and values of what describes a whole network."""
    known, posed, used = solution.determined, solution.oriented, solution.state.used
    unit = f' {solution.network.unit}' if solution.network.unit else ', without scale'
    scaled = ', covariances are scaled by its square' if solution.scaled else ''
    rows = [
        ('photographs', _of(posed)),
        ('targets', _of(known)),
        ('image points used', _of(used)),
        ('image points left out', _rejected(solution)),
        ('sigma0', f'{solution.sigma0:.3f}{scaled}'),
        ('redundancy', str(solution.redundancy)),
    ]
    if used.any():
        rms = np.sqrt((solution.residuals[used] ** 2).mean(axis=0))
        rows.append(('RMS residual x, y', f'{rms[0]:.4f}, {rms[1]:.4f} px'))
    if known.any():
        rays = rays_of(solution)[known]
        angles = np.degrees(largest_angles(solution.network, solution.state)[known])
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


def _tested(solution: Solution) -> int:
    return sum(it.normalised_residual is not None for it in solution.rejected)


def _rejected(solution: Solution) -> str:
    return f'{_tested(solution)}, expected by chance {solution.expected_rejections:.1f}'


def left_out(solution: Solution) -> str:
    """Return how many image points a test rejected, and how many chance alone rejects."""
    number, seen = _tested(solution), len(solution.residuals)
    return (
        f'{number} of {counted(seen, "image point")} failed the test; chance alone rejects about '
        f'{solution.expected_rejections:.1f} good ones of so many.'
    )


def unknown_rows(solution: Solution) -> list[str]:
    """Return for each camera which parameters the photographs do not determine."""
    rows = []
    for camera in np.flatnonzero(solution.calibrated).tolist():
        name = f'Camera {solution.network.cameras[camera].name}'
        released = solution.released[camera]
        names = parameters_of(solution.network.cameras[camera])
        if kept := [it for it in names if it and it not in released]:
            rows.append(f'{name}: {", ".join(kept)} kept as given, or left out where they are 0.')
        if unknown := undetermined_parameters(solution, camera):
            rows.append(
                f'{name}: the photographs hardly determine {", ".join(unknown)}. They are as '
                'usual of lenses, with a standard deviation that is part of all others.'
            )
        elif released:
            rows.append(f'{name}: the photographs determine all of {", ".join(released)}.')
    return rows


def camera_rows(solution: Solution, camera: int) -> Rows:
    """Return parameters of a calibrated camera, values, standard deviations, and their ratio.

    Instead of the ratio it says where photographs hardly know more than what is usual.
    """
    rows = []
    sigmas = standard_deviations(solution.camera_covariances[camera])
    values = solution.state.calibrations[camera]
    unknown = undetermined_parameters(solution, camera)
    names = parameters_of(solution.network.cameras[camera])
    for name, value, sigma in zip(names, values, sigmas, strict=True):
        if not name:
            continue
        called = f'{name}, px' if name in _IN_PX else name
        if name in solution.released[camera]:
            digits = decimals([sigma])
            ratio = '' if name in _IN_PX else f'{abs(value) / sigma:.1f}'
            ratio = 'as usual of lenses' if name in unknown else ratio
            rows.append((called, f'{value:.{digits}f}', f'{sigma:.{digits}f}', ratio))
        else:
            rows.append((called, f'{value:.7g}', 'kept' if value else 'left out', ''))
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
