"""What `ahf orient` shows of a network on the terminal."""

from __future__ import annotations

import numpy as np
from rich.console import Console
from rich.markup import escape

from ahf_ros.cli.tables import print_table, terminal
from ahf_ros.orientation.solution import Solution
from ahf_ros.orientation.strength import what_to_photograph
from ahf_ros.report import network_summary
from ahf_ros.text import printable


def print_network(solution: Solution, folder: str, console: Console | None = None) -> None:
    """Print a network on standard error."""
    console = console or terminal()
    unit = solution.network.unit
    print_table(folder, ('', ''), network_summary.summary(solution), console)
    for index in np.flatnonzero(solution.calibrated).tolist():
        rows = network_summary.camera_rows(solution, index)
        title = f'Camera {solution.network.cameras[index].name}'
        print_table(title, ('parameter', 'value', 'standard deviation'), rows, console)
    if bars := network_summary.bar_rows(solution):
        head = '', 'role', f'length, {unit}', 'deviation', 'sigma', 'ratio'
        print_table('Scale bars', head, bars, console)
    if control := network_summary.control_rows(solution):
        head = '', 'role', f'dx, {unit}', 'dy', 'dz', 'sigma x, y, z'
        print_table('Control points', head, control, console)
    if rejected := network_summary.rejected_rows(solution):
        head = 'photograph', 'target', 'x, px', 'y, px', 'residual, sigma', 'why'
        print_table(f'{len(rejected)} left out', head, rejected, console)
    for mark, texts in (('yellow]!', solution.warnings), ('cyan]>', what_to_photograph(solution))):
        for text in texts:
            console.print(f'[{mark}[/] {escape(printable(text, len(text)))}', highlight=False)
