"""Coordinates of targets for CAD, inspection and geodesy: PLY, DXF, V-STARS' list, JAG3D's files.

References
----------
.. [1] Autodesk, DXF Reference, groups of the entities POINT and TEXT, release 12.
.. [2] A list that V-STARS wrote: simonsobs/LAT_Alignment, measurements/20240909.
.. [3] Lösler, JAG3D and its bundle adjustment, software.applied-geodesy.org: `.info` has name,
   axis, coordinate and row of each coordinate, `.cxx` the covariance matrix.
"""

from collections.abc import Iterator

import numpy as np

from ahf_ros.files.cloud_files import write_ply
from ahf_ros.files.files import csv_table
from ahf_ros.network.network import FloatArray
from ahf_ros.network.points import MeasuredPoints, blocks, standard_deviations
from ahf_ros.network.solution import Solution
from ahf_ros.network.strength import rays_of
from ahf_ros.network.units import decimals

_LAYER, _LABELS = 'TARGETS', 'TARGET_NAMES'
_TEXT = 0.008  # of the extent of the targets: height of their names
_FEWEST_DECIMALS = 3  # in lists of V-STARS


def ply_files(solution: Solution) -> dict[str, bytes]:
    """Return targets as vertices with their standard deviations and rays.

    `id` is the ID; if one is no number, it is the row of `ply_labels.csv`, from 0 on.
    """
    points = solution.measured_points
    numbered = all(name.isdecimal() and int(name) < 2**31 for name in points.names)
    fields = [(axis, '<f8') for axis in 'xyz']
    fields += [(f'sigma_{axis}', '<f4') for axis in 'xyz']
    cloud = np.zeros((1, len(points.names)), [*fields, ('rays', '<i4'), ('id', '<i4')])
    sigmas = standard_deviations(points.covariance).reshape(-1, 3)
    for axis, name in enumerate('xyz'):
        cloud[name], cloud[f'sigma_{name}'] = points.xyz[:, axis], sigmas[:, axis]
    cloud['rays'] = rays_of(solution)[solution.determined]
    cloud['id'] = [int(it) for it in points.names] if numbered else range(len(points.names))
    files = {'targets.ply': write_ply(cloud)}
    if not numbered:
        files['ply_labels.csv'] = csv_table([('id', 'name'), *enumerate(points.names)])
    return files


def dxf_files(solution: Solution) -> dict[str, bytes]:
    """Return targets as points, and their names as texts on a layer of their own."""
    points = solution.measured_points
    extent = float(np.ptp(points.xyz, axis=0).max(initial=0.0)) or 1.0
    groups: list[tuple[int, object]] = [(0, 'SECTION'), (2, 'HEADER'), (9, '$ACADVER')]
    groups += [(1, 'AC1009'), (0, 'ENDSEC'), (0, 'SECTION'), (2, 'ENTITIES')]
    for name, xyz in zip(points.names, points.xyz.tolist(), strict=True):
        groups += [(0, 'POINT'), (8, _LAYER), *_at(xyz)]
        place = [value + _TEXT * extent * (axis < 2) for axis, value in enumerate(xyz)]
        groups += [(0, 'TEXT'), (8, _LABELS), *_at(place)]
        groups += [(40, f'{_TEXT * extent:.9g}'), (1, _ascii(name))]
    groups += [(0, 'ENDSEC'), (0, 'EOF')]
    return {'targets.dxf': ''.join(f'{code:3d}\r\n{value}\r\n' for code, value in groups).encode()}


def _at(xyz: list[float]) -> Iterator[tuple[int, object]]:
    for code, value in zip((10, 20, 30), xyz, strict=True):
        yield code, f'{value:.12g}'


def _ascii(name: str) -> str:
    r"""Return a name whose other characters are written \U+XXXX, as DXF has them."""
    return ''.join(it if it.isascii() else f'\\U+{ord(it):04X}' for it in name)


def vstars_files(solution: Solution) -> dict[str, bytes]:
    """Return the list: label, x, y, z, their standard deviations, and an offset of zero [2]_.

    The label of a target with a number is CODE and the number.
    """
    points = solution.measured_points
    sigmas = standard_deviations(points.covariance).reshape(-1, 3)
    digits = max(decimals(sigmas.ravel()), _FEWEST_DECIMALS)
    lines = [
        ','.join([_label(name), *(f'{it:.{digits}f}' for it in (*xyz, *sigma, 0.0))])
        for name, xyz, sigma in zip(points.names, points.xyz, sigmas, strict=True)
    ]
    return {'vstars_xyz.csv': ''.join(f'{line}\r\n' for line in lines).encode()}


def _label(name: str) -> str:
    return f'CODE{name}' if name.isdecimal() else name.replace(',', '_')


def jag3d_files(solution: Solution) -> dict[str, bytes]:
    """Return coordinates with the whole covariance as JAG3D writes it, and as JUniForm reads it.

    A ValueError names a target with a blank in its name, at which readers split.
    """
    points = solution.measured_points
    if blank := next((name for name in points.names if len(name.split()) != 1), ''):
        raise ValueError(f'jag3d splits at blanks, accepted is a target without: {blank!r}')
    return {
        'jag3d.info': ''.join(_information(points)).encode(),
        'jag3d.cxx': _matrix(points.covariance),
        'jag3d_points.txt': ''.join(_with_own_covariance(points)).encode(),
    }


def _information(points: MeasuredPoints) -> Iterator[str]:
    for index, (name, xyz) in enumerate(zip(points.names, points.xyz.tolist(), strict=True)):
        for axis, value in enumerate(xyz):
            yield f'{name:>25}\t{"XYZ"[axis]:>5}\t{value:35.15f}\t{3 * index + axis:10d}\n'


def _matrix(values: FloatArray) -> bytes:
    line = '%+35.15e  ' * values.shape[1] + '\n'
    return ''.join(line % tuple(row) for row in values.tolist()).encode()


def _with_own_covariance(points: MeasuredPoints) -> Iterator[str]:
    """Yield name, x, y, z, and the upper triangle of each covariance, row after row."""
    for name, xyz, own in zip(points.names, points.xyz, blocks(points.covariance), strict=True):
        place = [f'{value:.12g}' for value in xyz]
        yield ' '.join([name, *place, *(f'{it:.9g}' for it in own[np.triu_indices(3)])]) + '\n'
