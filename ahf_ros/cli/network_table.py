"""What `ahf orient` shows of a network on the terminal."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ahf_ros.interchange.network_results import rejections
from ahf_ros.orientation.camera import PARAMETERS
from ahf_ros.orientation.deviations import bar_deviations, control_deviations
from ahf_ros.orientation.solution import Solution
from ahf_ros.orientation.strength import (
    largest_angles,
    rays_of,
    semi_axes,
    what_to_photograph,
)

_ROWS = 20  # of rejected observations


def print_network(solution: Solution, folder: str, console: Console | None = None) -> None:
    """Print a network on standard error."""
    console = console or Console(stderr=True)
    # A pipe has no width; texts are not broken there.
    width = None if console.is_terminal else 120
    tables = [_summary(solution, folder), *_cameras(solution), *_known(solution)]
    for table in (*tables, *_rejected(solution)):
        console.print(table, width=width)
    for warning in solution.warnings:
        console.print(f'[yellow]![/] {escape(warning)}', width=width, highlight=False)
    for advice in what_to_photograph(solution):
        console.print(f'[cyan]>[/] {escape(advice)}', width=width, highlight=False)


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify='left', title_style='bold')
    for number, name in enumerate(columns):
        table.add_column(name, justify='right' if number else 'left')
    return table


def _summary(solution: Solution, folder: str) -> Table:
    known, rays = solution.determined, rays_of(solution)
    angles = np.degrees(largest_angles(solution)[known])
    deviations = np.sqrt(np.diag(solution.covariance_of_points)).reshape(-1, 3)[known]
    unit = f' {solution.network.unit}' if solution.network.unit else ', without scale'
    table = _table(folder, '', '')
    table.show_header = False
    posed = solution.oriented
    table.add_row('photographs', _of(int(posed.sum()), len(posed)))
    table.add_row('targets', _of(int(known.sum()), len(known)))
    if known.any():
        middle = np.median(rays[known])
        table.add_row('rays a target', f'{rays[known].min()} to {rays.max()}, median {middle:g}')
        table.add_row(
            'angles of rays', f'{np.nanmin(angles):.0f} to {np.nanmax(angles):.0f} degrees'
        )
    used = solution.start.used
    table.add_row('image points used', _of(int(used.sum()), len(used)))
    if used.any():
        rms = np.sqrt((solution.residuals[used] ** 2).mean(axis=0))
        table.add_row('RMS residual x, y', f'{rms[0]:.4f}, {rms[1]:.4f} px')
    scaled = ', covariances are scaled by it' if solution.scaled else ''
    table.add_row('sigma0', f'{solution.sigma0:.3f}{scaled}')
    table.add_row('redundancy', str(solution.redundancy))
    if known.any():
        mean = np.sqrt((deviations**2).mean(axis=0))
        text = ', '.join(f'{value:.3g}' for value in mean)
        table.add_row('standard deviation x, y, z', f'{text}{unit}')
        table.add_row('largest semi-axis', f'{np.nanmax(semi_axes(solution)):.3g}{unit}')
    return table


def _of(number: int, every: int) -> str:
    return f'{number}' if number == every else f'{number} of {every}'


def _cameras(solution: Solution) -> Iterator[Table]:
    for index, view in enumerate(solution.network.cameras):
        sigma = np.sqrt(np.diag(solution.camera_covariances[index]))
        values = solution.start.calibrations[index]
        if not np.isfinite(values).all():
            continue
        table = _table(f'camera {escape(view.name)}', 'parameter', 'value', 'standard deviation')
        for name, value, deviation in zip(PARAMETERS, values, sigma, strict=True):
            if name in solution.released[index]:
                table.add_row(name, f'{value:.6g}', f'{deviation:.2g}')
            elif value:
                table.add_row(name, f'{value:.6g}', 'kept')
        yield table


def _known(solution: Solution) -> Iterator[Table]:
    unit = solution.network.unit
    if bars := bar_deviations(solution):
        table = _table('scale bars', '', 'role', f'length, {unit}', 'deviation', 'sigma')
        for it in bars:
            role = 'check' if it.bar.check else 'control'
            numbers = f'{it.bar.length:.10g}', f'{it.deviation:+.4f}', f'{it.sigma:.4f}'
            table.add_row(escape(' to '.join(it.bar.ends)), role, *numbers)
        yield table
    if points := control_deviations(solution):
        table = _table('control points', '', 'role', f'dx, {unit}', 'dy', 'dz', 'sigma')
        for point in points:
            role = 'check' if point.point.check else 'control'
            text = ', '.join(f'{value:.4f}' for value in point.sigma)
            moved = (f'{value:+.4f}' for value in point.deviation)
            table.add_row(escape(point.point.name), role, *moved, text)
        yield table


def _rejected(solution: Solution) -> Iterator[Table]:
    found = rejections(solution)
    if not found:
        return
    table = _table(f'{len(found)} left out', 'photograph', 'target', 'residual, sigma', 'why')
    table.columns[3].justify = 'left'
    for it in found[:_ROWS]:
        size = '' if it.normalised_residual is None else f'{abs(it.normalised_residual):.1f}'
        table.add_row(escape(it.photograph), escape(it.target), size, escape(it.reason))
    if len(found) > _ROWS:
        table.add_row(f'and {len(found) - _ROWS} more', '', '', 'see network.json')
    yield table
