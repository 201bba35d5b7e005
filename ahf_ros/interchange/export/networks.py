"""Adjusted networks for other software: cameras, poses and targets.

Our pixel (0, 0) is the centre of the first pixel. Where a format has (0, 0) at the corner of that
pixel, 0.5 is added to image points and principal points.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path, PurePath
from pkgutil import resolve_name

from ahf_ros.interchange.files import write_whole
from ahf_ros.orientation.solution import Solution

NETWORK_FORMATS: Mapping[str, str] = {
    'colmap': 'interchange.export.colmap_model:colmap_model_files',
    'metashape': 'interchange.export.network_xml:metashape_network_files',
    'mmvii': 'interchange.export.network_xml:mmvii_network_files',
}
"""Module below `ahf_ros` and name of the function that returns the files of each format."""


def write_network_export(format_name: str, folder: Path, solution: Solution) -> tuple[Path, ...]:
    """Write a network for other software, each file as a whole, and return the paths.

    A ValueError says what the format cannot hold, or which file cannot be written.
    """
    solution.check_forward()
    names = [PurePath(it).name for it in solution.network.photographs]
    if len(set(names)) < len(names) and format_name != 'colmap':
        raise ValueError(
            f'{format_name} knows images by their names, accepted are different names in all '
            'folders'
        )
    write: Callable[[Solution], dict[str, bytes]] = resolve_name(
        f'ahf_ros.{NETWORK_FORMATS[format_name]}'
    )
    files = write(solution)
    for name, content in files.items():
        write_whole(folder / name, content)
    return tuple(folder / name for name in files)
