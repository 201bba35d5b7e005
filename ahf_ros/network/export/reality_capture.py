"""Adjusted networks for RealityCapture and RealityScan: one XMP file beside each photograph [1]_.

The rotation, row after row, turns vectors of the world into the camera's frame (x right, y down, z
forward), the position is the centre of projection. The focal length counts on film of 36 mm along
the longer side, the principal point from the middle of the image in longer sides. The model
brown3t2 is Brown's with t1 along x: t1 is our p2, and t2 our p1.

References
----------
.. [1] RealityCapture Support, RealityCapture XMP Camera Math, 2020.
"""

from pathlib import PurePath
from xml.etree.ElementTree import Element, SubElement, register_namespace

import numpy as np

from ahf_ros.files.files import csv_table
from ahf_ros.network.export.adjusted import (
    determined,
    file_name,
    lens_of,
    numbers,
    oriented,
    used_points,
)
from ahf_ros.network.export.xml_files import serialised
from ahf_ros.network.network import FloatArray
from ahf_ros.network.solution import Solution

_CORNER = 0.5  # coordinate of the centre of the first pixel
_FILM = 36.0  # mm
_NAMESPACES = {
    'x': 'adobe:ns:meta/',
    'rdf': 'http://www.w3.org/1999/02/22-rdf-syntax-ns#',
    'xcr': 'http://www.capturingreality.com/ns/xcr/1.1#',
}


def reality_capture_files(solution: Solution) -> dict[str, bytes]:
    """Return an XMP file for each photograph, and targets as measured and ground control points.

    XMP files are known by the names of photographs without their endings: a ValueError names two
    that have the same.
    """
    for prefix, uri in _NAMESPACES.items():
        register_namespace(prefix, uri)
    files: dict[str, bytes] = {}
    for number in oriented(solution):
        name = f'{PurePath(file_name(solution, number)).stem}.xmp'
        if name in files:
            raise ValueError(
                f'realitycapture: two photographs have the file {name}, accepted are names that '
                'differ before their endings'
            )
        files[name] = _xmp(solution, number)
    network = solution.network
    rows = [
        (file_name(solution, it.photograph), network.targets[it.target], *_pixels(it.xy))
        for it in used_points(solution)
    ]
    ground = [
        (network.targets[it], *(f'{value:.12g}' for value in solution.state.points[it]))
        for it in determined(solution)
    ]
    files['control_points.csv'] = csv_table([('#image', 'point', 'x', 'y'), *rows])
    files['ground_control.csv'] = csv_table([('#point', 'x', 'y', 'z'), *ground])
    return files


def _pixels(xy: FloatArray) -> list[str]:
    return [f'{value + _CORNER:.5f}' for value in xy]


def _xmp(solution: Solution, number: int) -> bytes:
    camera = int(solution.network.camera_of[number])
    view, lens = solution.network.cameras[camera], lens_of(solution, camera, square=True)
    longer = max(view.width, view.height)
    about = {
        'Version': '3',
        'PosePrior': 'exact',
        'Coordinates': 'absolute',
        'DistortionModel': 'brown3t2',
        'FocalLength35mm': f'{_FILM * lens.fx / longer:.15g}',
        'Skew': '0',
        'AspectRatio': '1',
        'PrincipalPointU': f'{(lens.cx + _CORNER - view.width / 2) / longer:.15g}',
        'PrincipalPointV': f'{(lens.cy + _CORNER - view.height / 2) / longer:.15g}',
        'CalibrationPrior': 'exact',
        'CalibrationGroup': str(camera),
        'DistortionGroup': str(camera),
        'InTexturing': '1',
        'InMeshing': '1',
    }
    root = Element(_tag('x', 'xmpmeta'))
    description = SubElement(
        SubElement(root, _tag('rdf', 'RDF')),
        _tag('rdf', 'Description'),
        {_tag('xcr', name): value for name, value in about.items()},
    )
    start = solution.state
    coefficients = np.array([lens.k1, lens.k2, lens.k3, 0.0, lens.p2, lens.p1])
    for name, values in (
        ('Rotation', start.rotations[number]),
        ('Position', start.positions[number]),
        ('DistortionCoeficients', coefficients),  # as RealityCapture spells it
    ):
        SubElement(description, _tag('xcr', name)).text = numbers(values)
    return serialised(root)


def _tag(prefix: str, name: str) -> str:
    return f'{{{_NAMESPACES[prefix]}}}{name}'
