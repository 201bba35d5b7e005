"""Adjusted networks as BlocksExchange XML, which ContextCapture and iTwin Capture read [1]_.

The rotation turns vectors of the world into the camera's frame, whose axes CameraOrientation
names; (0, 0) is the centre of the first pixel. Distortion is Brown's with P1 along x: P1 is our p2
and P2 our p1. AspectRatio is fy over fx.

References
----------
.. [1] Bentley, ContextCapture User Guide, BlocksExchange XML/XMLZ format.
"""

from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ahf_ros.network.export.adjusted import by_target, file_name, lens_of, oriented
from ahf_ros.network.export.xml_files import add_texts, serialised
from ahf_ros.network.solution import Solution

_VERSION = '2.1'


def blocks_exchange_files(solution: Solution) -> dict[str, bytes]:
    """Return one block: cameras and poses, and targets as control points with their precision."""
    root = Element('BlocksExchange', version=_VERSION)
    block = SubElement(root, 'Block')
    add_texts(block, {'Name': 'ahf', 'Description': 'Coded targets, oriented by ahf_ros'})
    groups = SubElement(block, 'Photogroups')
    for camera in np.flatnonzero(solution.calibrated).tolist():
        _photogroup(SubElement(groups, 'Photogroup'), solution, camera)
    points = SubElement(block, 'ControlPoints')
    for target, seen in by_target(solution).items():
        point = SubElement(points, 'ControlPoint')
        add_texts(point, {'Name': solution.network.targets[target], 'Category': 'Full'})
        _place(SubElement(point, 'Position'), solution.state.points[target])
        variances = np.diagonal(solution.point_covariances[target])
        horizontal = float(np.sqrt(variances[:2].mean()))
        add_texts(
            point,
            {
                'HorizontalAccuracy': f'{horizontal:.9g}',
                'VerticalAccuracy': f'{np.sqrt(variances[2]):.9g}',
            },
        )
        for it in seen:
            measurement = SubElement(point, 'Measurement')
            add_texts(measurement, {'PhotoId': str(it.photograph)})
            _place(measurement, it.xy)
    return {'blocks_exchange.xml': serialised(root)}


def _photogroup(group: Element, solution: Solution, camera: int) -> None:
    view, lens = solution.network.cameras[camera], lens_of(solution, camera)
    SubElement(group, 'Name').text = view.name
    size = SubElement(group, 'ImageDimensions')
    add_texts(size, {'Width': str(view.width), 'Height': str(view.height)})
    add_texts(
        group,
        {
            'CameraModelType': 'Perspective',
            'CameraModelBand': 'Visible',
            'FocalLengthPixels': f'{lens.fx:.15g}',
            'AspectRatio': f'{lens.fy / lens.fx:.15g}',
            'Skew': '0',
            'CameraOrientation': 'XRightYDown',
        },
    )
    _place(SubElement(group, 'PrincipalPoint'), np.array([lens.cx, lens.cy]))
    distortion = {'K1': lens.k1, 'K2': lens.k2, 'K3': lens.k3, 'P1': lens.p2, 'P2': lens.p1}
    terms = SubElement(group, 'Distortion')
    add_texts(terms, {name: f'{value:.15g}' for name, value in distortion.items()})
    for number in oriented(solution):
        if solution.network.camera_of[number] == camera:
            _photo(SubElement(group, 'Photo'), solution, number)


def _photo(photo: Element, solution: Solution, number: int) -> None:
    add_texts(
        photo, {'Id': str(number), 'ImagePath': file_name(solution, number), 'Component': '1'}
    )
    pose = SubElement(photo, 'Pose')
    rotation = SubElement(pose, 'Rotation')
    for (row, column), value in np.ndenumerate(solution.state.rotations[number]):
        SubElement(rotation, f'M_{row}{column}').text = f'{value:.15g}'
    _place(SubElement(pose, 'Center'), solution.state.positions[number])


def _place(parent: Element, values: np.ndarray) -> None:
    add_texts(parent, {axis: f'{value:.15g}' for axis, value in zip('xyz', values, strict=False)})
