"""Surveys and adjusted networks as XML, for Agisoft Metashape and for MicMac's MMVII.

Metashape has (0, 0) at the corner of the first pixel, so that 0.5 is added; MMVII has it at the
centre. Both have our model of the lens with p1 and p2 exchanged; MMVII applies affinity and shear
before the distortion, which makes a difference of their product.
"""

import xml.etree.ElementTree as ElementTree
from pathlib import Path, PurePath
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ahf_ros.network.camera import PARAMETERS, parameters_of
from ahf_ros.network.export import metashape_console
from ahf_ros.network.export.survey import Survey
from ahf_ros.network.network import CameraView, FloatArray
from ahf_ros.network.solution import Solution

NAME = 'ahf'
"""Name of the set of measurements, which commands of MMVII are given."""


_SHIFT = 0.5  # of Metashape
_PROJECT = 'MMVII-PhgrProj'


def metashape_files(survey: Survey) -> dict[str, bytes]:
    """Return markers for File > Import > Import Markers, and the script that reads them.

    Images of one size get one sensor; Metashape takes the cameras of its project by their labels.
    """
    document = Element('document', version='1.2.0')
    chunk = SubElement(document, 'chunk')
    sensors, cameras = SubElement(chunk, 'sensors'), SubElement(chunk, 'cameras')
    points = SubElement(chunk, 'markers')
    frame = SubElement(SubElement(chunk, 'frames'), 'frame', id='0')
    measured = SubElement(frame, 'markers')
    elements = {}
    for index, label in enumerate(survey.labels):
        marker = SubElement(points, 'marker', id=str(index), label=label)
        elements[label] = SubElement(measured, 'marker', marker_id=str(index))
        if label in survey.control:
            x, y, z = (repr(float(value)) for value in survey.control[label])
            SubElement(marker, 'reference', x=x, y=y, z=z, enabled='true')
    sizes: dict[tuple[int, int], str] = {}
    for index, photograph in enumerate(survey.photographs):
        size = width, height = photograph.width, photograph.height
        if size not in sizes:
            sizes[size] = str(len(sizes))
            about = {'id': sizes[size], 'label': f'{width} x {height}', 'type': 'frame'}
            sensor = SubElement(sensors, 'sensor', about)
            SubElement(sensor, 'resolution', width=str(width), height=str(height))
        camera = {'id': str(index), 'label': photograph.name, 'sensor_id': sizes[size]}
        SubElement(cameras, 'camera', camera)
        for mark in photograph.marks:
            place = {'x': f'{mark.x:.6f}', 'y': f'{mark.y:.6f}'}
            found = {'camera_id': str(index), 'pinned': 'true', **place}
            SubElement(elements[mark.label], 'location', found)
    script = Path(metashape_console.__file__)
    return {'markers.xml': serialised(document), script.name: script.read_bytes()}


def mmvii_files(survey: Survey) -> dict[str, bytes]:
    """Return a file of measurements for each image, and one of the control points.

    The format cannot hold a quotation mark: a ValueError names the image or label that has one.
    """
    folder = f'MMVII-PhgrProj/ObjMesInstr/{NAME}'
    files = {}
    for label in survey.labels:
        if '"' in label:
            raise ValueError(f'label is {label!r}, accepted is a label without "')
    for photograph in survey.photographs:
        if '"' in photograph.name:
            raise ValueError(f'image is {photograph.path!r}, accepted is a name without "')
        marks = [
            {
                'Name': f'"{mark.label}"',
                'Pt': f'{mark.x:.6f} {mark.y:.6f}',
                'Sigma2': ' '.join(f'{value:.6g}' for value in mark.covariance),
            }
            for mark in photograph.marks
        ]
        name = {'NameIm': f'"{photograph.name}"'}
        files[f'{folder}/MesIm-{photograph.name}.xml'] = _measures('SetMesIm', name, marks)
    if survey.control:
        points = [
            {
                'Name': f'"{label}"',
                'Pt': ' '.join(repr(float(value)) for value in point),
                'AdditionalInfo': '""',
            }
            for label, point in survey.control.items()
        ]
        name = {'NameSet': f'"{NAME}"'}
        files[f'{folder}/MesGCP-{NAME}.xml'] = _measures('SetGCP', name, points)
    return files


def _measures(tag: str, name: dict[str, str], measures: list[dict[str, str]]) -> bytes:
    content = Element(tag)
    _add_texts(content, name)
    items = SubElement(content, 'Measures')
    for measure in measures:
        _add_texts(SubElement(items, 'el'), measure)
    return mmvii_file(content)


def mmvii_file(content: Element) -> bytes:
    """Return a document of MMVII's serialisation."""
    root = Element('Root')
    _add_texts(root, {'Type': '"MMVII_Serialization"', 'Version': '"0.0.0"'})
    SubElement(root, 'Data').append(content)
    return serialised(root)


def _add_texts(parent: Element, texts: dict[str, str]) -> None:
    for tag, text in texts.items():
        SubElement(parent, tag).text = text


def serialised(root: Element) -> bytes:
    """Return an indented XML document."""
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding='UTF-8', xml_declaration=True) + b'\n'


def metashape_network_files(solution: Solution) -> dict[str, bytes]:
    """Return cameras and markers for File > Import > Import Cameras, and each calibration.

    The reference of markers are the adjusted coordinates; axes of cameras are ours.
    """
    document = Element('document', version='1.2.0')
    chunk = SubElement(document, 'chunk')
    _metashape_cameras(chunk, solution)
    _metashape_markers(chunk, solution)
    files = {'cameras.xml': serialised(document)}
    network = solution.network
    for index, view in enumerate(network.cameras):
        if solution.calibrated[index]:
            root = Element('calibration')
            SubElement(root, 'projection').text = _metashape_type(view)
            SubElement(root, 'width').text = str(view.width)
            SubElement(root, 'height').text = str(view.height)
            for name, value in _metashape_lens(solution, index).items():
                SubElement(root, name).text = f'{value:.15g}'
            stem = 'camera' if len(network.cameras) == 1 else f'camera_{index + 1}'
            files[f'{stem}.xml'] = serialised(root)
    return files


def _metashape_type(view: CameraView) -> str:
    """Return Metashape's name of a lens; a fisheye one is equidistant, and then distorted."""
    return 'fisheye' if view.equidistant else 'frame'


def _metashape_lens(solution: Solution, index: int) -> dict[str, float]:
    """Return a calibration with the principal point from the middle of the image, px."""
    view = solution.network.cameras[index]
    value = dict(
        zip(parameters_of(view), solution.state.calibrations[index].tolist(), strict=True)
    )
    f = value['f']
    beside = {'k4': value['k4']} if view.equidistant else {'p1': value['p2'], 'p2': value['p1']}
    return {
        'f': f,
        'cx': value['cx'] + _SHIFT - view.width / 2,
        'cy': value['cy'] + _SHIFT - view.height / 2,
        'b1': f * value['affinity'],
        'b2': f * value['shear'],
        'k1': value['k1'],
        'k2': value['k2'],
        'k3': value['k3'],
        **beside,
    }


def _metashape_cameras(chunk: Element, solution: Solution) -> None:
    network, values = solution.network, solution.state
    sensors, cameras = SubElement(chunk, 'sensors'), SubElement(chunk, 'cameras')
    for index, view in enumerate(network.cameras):
        if not solution.calibrated[index]:
            continue
        kind = _metashape_type(view)
        about = {'id': str(index), 'label': view.name, 'type': kind}
        sensor = SubElement(sensors, 'sensor', about)
        size = {'width': str(view.width), 'height': str(view.height)}
        SubElement(sensor, 'resolution', size)
        lens = SubElement(sensor, 'calibration', {'type': kind, 'class': 'adjusted'})
        SubElement(lens, 'resolution', size)
        for name, value in _metashape_lens(solution, index).items():
            SubElement(lens, name).text = f'{value:.15g}'
    for index in np.flatnonzero(solution.oriented).tolist():
        about = {
            'id': str(index),
            'label': PurePath(network.photographs[index]).name,
            'sensor_id': str(network.camera_of[index]),
        }
        camera = SubElement(cameras, 'camera', about)
        pose = np.eye(4)  # of the camera in the world
        pose[:3, :3], pose[:3, 3] = values.rotations[index].T, values.positions[index]
        SubElement(camera, 'transform').text = _numbers(pose)


def _metashape_markers(chunk: Element, solution: Solution) -> None:
    network, values = solution.network, solution.state
    points = SubElement(chunk, 'markers')
    frame = SubElement(SubElement(chunk, 'frames'), 'frame', id='0')
    measured = SubElement(frame, 'markers')
    elements = {}
    for index in np.flatnonzero(solution.determined).tolist():
        marker = SubElement(points, 'marker', id=str(index), label=network.targets[index])
        x, y, z = (f'{value:.15g}' for value in values.points[index])
        SubElement(marker, 'reference', x=x, y=y, z=z, enabled='true')
        elements[index] = SubElement(measured, 'marker', marker_id=str(index))
    seen = network.observations
    for row in np.flatnonzero(values.used):
        if int(seen.point[row]) in elements:
            x, y = (f'{value + _SHIFT:.6f}' for value in seen.xy[row])
            about = {'camera_id': str(seen.photograph[row]), 'pinned': 'true', 'x': x, 'y': y}
            SubElement(elements[int(seen.point[row])], 'location', about)


def mmvii_network_files(solution: Solution) -> dict[str, bytes]:
    """Return calibrations, orientations, measurements and points of an MMVII project.

    Points are ground control with the covariance of each; the correlations between points are
    lost. The format cannot hold a quotation mark: a ValueError names what has one.
    """
    network, values = solution.network, solution.state
    for text in (*network.photographs, *network.targets, *(it.name for it in network.cameras)):
        if '"' in text or not text.isprintable():
            raise ValueError(f'{text!r} has a quotation mark, accepted is a name without')
    files = {}
    for index in range(len(network.cameras)):
        if solution.calibrated[index]:
            name = _calibration_name(index)
            files[f'{_PROJECT}/Ori/{NAME}/{name}.xml'] = _mmvii_lens(solution, index)
    for index in np.flatnonzero(solution.oriented).tolist():
        image = PurePath(network.photographs[index]).name
        rows = np.flatnonzero(values.used & (network.observations.photograph == index))
        path = f'{_PROJECT}/Ori/{NAME}/Ori-PerspCentral-{image}.xml'
        files[path] = _mmvii_pose(solution, index, image)
        path = f'{_PROJECT}/ObjMesInstr/{NAME}/MesIm-{image}.xml'
        files[path] = _mmvii_measures(solution, rows, image)
    files[f'{_PROJECT}/ObjMesInstr/{NAME}/MesGCP-{NAME}.xml'] = _mmvii_points(solution)
    return files


def _calibration_name(index: int) -> str:
    return f'Calib-PerspCentral-{NAME}_{index + 1}'


def _mmvii_lens(solution: Solution, index: int) -> bytes:
    view = solution.network.cameras[index]
    value = dict(zip(PARAMETERS, solution.state.calibrations[index].tolist(), strict=True))
    content = Element('InternalCalibration')
    SubElement(content, 'Name').text = f'"{_calibration_name(index)}"'
    SubElement(SubElement(content, 'PixelFrame'), 'NbPix').text = f'{view.width} {view.height}'
    SubElement(content, 'Projection').text = '"Stenope"'
    auxiliary = SubElement(content, 'Auxiliary')
    for tag, text in (
        ('SzBuffer', '-1'),
        ('Degree', '3 1 1'),
        ('DegreeApproxInv', '3 1 1'),
        ('IsFraserMode', '1'),
    ):
        SubElement(auxiliary, tag).text = text
    perfect = SubElement(content, 'PerfectProj')
    SubElement(perfect, 'F').text = f'{value["f"]:.15g}'
    SubElement(perfect, 'PP').text = f'{value["cx"]:.15g} {value["cy"]:.15g}'
    lens = SubElement(content, 'Distorsion')
    for group, names in (
        ('Radial', {'K1': 'k1', 'K2': 'k2', 'K3': 'k3'}),
        ('Decentric', {'p1': 'p2', 'p2': 'p1'}),
        ('Polynomial', {'b1': 'affinity', 'b2': 'shear'}),
    ):
        terms = SubElement(lens, group)
        for theirs, ours in names.items():
            SubElement(terms, theirs).text = f'{value[ours]:.15g}'
    return mmvii_file(content)


def _mmvii_pose(solution: Solution, index: int, image: str) -> bytes:
    """Return a pose; the axes of the camera in the world are the rows of our rotation."""
    content = Element('CameraPose')
    SubElement(content, 'NameImage').text = f'"{image}"'
    camera = int(solution.network.camera_of[index])
    SubElement(content, 'NameInternalCalib').text = f'"{_calibration_name(camera)}"'
    SubElement(content, 'Center').text = _numbers(solution.state.positions[index])
    axes = SubElement(content, 'RotMatrix')
    for name, axis in zip('IJK', solution.state.rotations[index], strict=True):
        SubElement(axes, f'Axe{name}').text = _numbers(axis)
    return mmvii_file(content)


def _mmvii_measures(solution: Solution, rows: np.ndarray, image: str) -> bytes:
    seen = solution.network.observations
    content = Element('SetMesIm')
    SubElement(content, 'NameIm').text = f'"{image}"'
    measures = SubElement(content, 'Measures')
    for row in rows:
        item = SubElement(measures, 'el')
        SubElement(item, 'Name').text = f'"{solution.network.targets[seen.point[row]]}"'
        SubElement(item, 'Pt').text = _numbers(seen.xy[row])
        SubElement(item, 'Sigma2').text = _numbers(seen.covariance[row][np.triu_indices(2)])
    return mmvii_file(content)


def _mmvii_points(solution: Solution) -> bytes:
    content = Element('SetGCP')
    SubElement(content, 'NameSet').text = f'"{NAME}"'
    measures = SubElement(content, 'Measures')
    for index in np.flatnonzero(solution.determined).tolist():
        covariance = solution.point_covariances[index]
        item = SubElement(measures, 'el')
        SubElement(item, 'Name').text = f'"{solution.network.targets[index]}"'
        SubElement(item, 'Pt').text = _numbers(solution.state.points[index])
        SubElement(item, 'AdditionalInfo').text = '""'
        # Six numbers: the upper triangle, row after row.
        SubElement(item, '__Opt__Sigma2').text = _numbers(covariance[np.triu_indices(3)])
    return mmvii_file(content)


def _numbers(values: FloatArray) -> str:
    return ' '.join(f'{value:.15g}' for value in np.ravel(values))
