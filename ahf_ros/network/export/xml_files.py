"""Surveys and adjusted networks as XML, for Agisoft Metashape and for MicMac's MMVII.

Metashape has (0, 0) at the corner of the first pixel, so that 0.5 is added; MMVII has it at the
centre. Both have our model of the lens with p1 and p2 exchanged; MMVII applies affinity and shear
before the distortion, which makes a difference of their product.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path, PurePath
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ahf_ros.network.camera import PARAMETERS, parameters_of
from ahf_ros.network.export import metashape_console
from ahf_ros.network.export.adjusted import determined, numbers, oriented
from ahf_ros.network.export.survey import Survey
from ahf_ros.network.network import CameraView
from ahf_ros.network.solution import Solution

NAME = 'ahf'
"""Name of the set of measurements, which commands of MMVII are given."""


_SHIFT = 0.5  # of Metashape
_PROJECT = 'MMVII-PhgrProj'


def metashape_files(survey: Survey) -> dict[str, bytes]:
    """Return markers for File > Import > Import Markers, and the script that reads them.

    Images of one size get one sensor; Metashape takes the cameras of its project by their labels.
    """
    document, sensors, cameras, points, measured = _metashape_document()
    elements = {}
    for index, label in enumerate(survey.labels):
        xyz = [repr(float(value)) for value in survey.control.get(label, ())]
        elements[label] = _metashape_marker(points, measured, index, label, xyz)
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
            x, y = f'{mark.x:.6f}', f'{mark.y:.6f}'
            found = {'camera_id': str(index), 'pinned': 'true', 'x': x, 'y': y}
            SubElement(elements[mark.label], 'location', found)
    script = Path(metashape_console.__file__)
    return {'markers.xml': serialised(document), script.name: script.read_bytes()}


def _metashape_document() -> tuple[Element, Element, Element, Element, Element]:
    """Return a document, its sensors, cameras and markers, and the places of these in images."""
    document = Element('document', version='1.2.0')
    chunk = SubElement(document, 'chunk')
    sensors, cameras, markers = (SubElement(chunk, it) for it in ('sensors', 'cameras', 'markers'))
    frame = SubElement(SubElement(chunk, 'frames'), 'frame', id='0')
    return document, sensors, cameras, markers, SubElement(frame, 'markers')


def _metashape_marker(
    markers: Element, measured: Element, index: int, label: str, place: Sequence[str]
) -> Element:
    """Add a marker with its coordinates, if it has some; return what takes its image points."""
    marker = SubElement(markers, 'marker', id=str(index), label=label)
    if place:
        reference = dict(zip('xyz', place, strict=True))
        SubElement(marker, 'reference', {**reference, 'enabled': 'true'})
    return SubElement(measured, 'marker', marker_id=str(index))


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
    add_texts(content, name)
    items = SubElement(content, 'Measures')
    for measure in measures:
        add_texts(SubElement(items, 'el'), measure)
    return mmvii_file(content)


def mmvii_file(content: Element) -> bytes:
    """Return a document of MMVII's serialisation."""
    root = Element('Root')
    add_texts(root, {'Type': '"MMVII_Serialization"', 'Version': '"0.0.0"'})
    SubElement(root, 'Data').append(content)
    return serialised(root)


def add_texts(parent: Element, texts: dict[str, str]) -> None:
    """Give an element an element for each tag, with a text."""
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
    document, sensors, cameras, markers, measured = _metashape_document()
    _metashape_cameras(sensors, cameras, solution)
    _metashape_markers(markers, measured, solution)
    files = {'cameras.xml': serialised(document)}
    network = solution.network
    for index, view in enumerate(network.cameras):
        if solution.calibrated[index]:
            root = Element('calibration')
            size = {'width': str(view.width), 'height': str(view.height)}
            add_texts(root, {'projection': _metashape_type(view), **size})
            add_texts(root, _metashape_lens(solution, index))
            stem = 'camera' if len(network.cameras) == 1 else f'camera_{index + 1}'
            files[f'{stem}.xml'] = serialised(root)
    return files


def _metashape_type(view: CameraView) -> str:
    """Return Metashape's name of a lens; a fisheye one is equidistant, and then distorted."""
    return 'fisheye' if view.equidistant else 'frame'


def _metashape_lens(solution: Solution, index: int) -> dict[str, str]:
    """Return a calibration with the principal point from the middle of the image, px."""
    view = solution.network.cameras[index]
    value = dict(
        zip(parameters_of(view), solution.state.calibrations[index].tolist(), strict=True)
    )
    f = value['f']
    beside = {'k4': value['k4']} if view.equidistant else {'p1': value['p2'], 'p2': value['p1']}
    found = {
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
    return {name: f'{it:.15g}' for name, it in found.items()}


def _metashape_cameras(sensors: Element, cameras: Element, solution: Solution) -> None:
    network, values = solution.network, solution.state
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
        add_texts(lens, _metashape_lens(solution, index))
    for index in oriented(solution):
        about = {
            'id': str(index),
            'label': PurePath(network.photographs[index]).name,
            'sensor_id': str(network.camera_of[index]),
        }
        camera = SubElement(cameras, 'camera', about)
        pose = np.eye(4)  # of the camera in the world
        pose[:3, :3], pose[:3, 3] = values.rotations[index].T, values.positions[index]
        SubElement(camera, 'transform').text = numbers(pose)


def _metashape_markers(markers: Element, measured: Element, solution: Solution) -> None:
    network, values = solution.network, solution.state
    elements = {}
    for index in determined(solution):
        place = [f'{value:.15g}' for value in values.points[index]]
        label = network.targets[index]
        elements[index] = _metashape_marker(markers, measured, index, label, place)
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
    for index in oriented(solution):
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
    degrees = {'Degree': '3 1 1', 'DegreeApproxInv': '3 1 1'}
    auxiliary = SubElement(content, 'Auxiliary')
    add_texts(auxiliary, {'SzBuffer': '-1', **degrees, 'IsFraserMode': '1'})
    middle = f'{value["cx"]:.15g} {value["cy"]:.15g}'
    perfect = SubElement(content, 'PerfectProj')
    add_texts(perfect, {'F': f'{value["f"]:.15g}', 'PP': middle})
    lens = SubElement(content, 'Distorsion')
    for group, names in (
        ('Radial', {'K1': 'k1', 'K2': 'k2', 'K3': 'k3'}),
        ('Decentric', {'p1': 'p2', 'p2': 'p1'}),
        ('Polynomial', {'b1': 'affinity', 'b2': 'shear'}),
    ):
        terms = {theirs: f'{value[ours]:.15g}' for theirs, ours in names.items()}
        add_texts(SubElement(lens, group), terms)
    return mmvii_file(content)


def _mmvii_pose(solution: Solution, index: int, image: str) -> bytes:
    """Return a pose; the axes of the camera in the world are the rows of our rotation."""
    content = Element('CameraPose')
    calibration = _calibration_name(int(solution.network.camera_of[index]))
    names = {'NameImage': f'"{image}"', 'NameInternalCalib': f'"{calibration}"'}
    add_texts(content, {**names, 'Center': numbers(solution.state.positions[index])})
    axes = zip('IJK', solution.state.rotations[index], strict=True)
    turned = {f'Axe{name}': numbers(axis) for name, axis in axes}
    add_texts(SubElement(content, 'RotMatrix'), turned)
    return mmvii_file(content)


def _mmvii_measures(solution: Solution, rows: np.ndarray, image: str) -> bytes:
    seen = solution.network.observations
    measures = [
        {
            'Name': f'"{solution.network.targets[seen.point[row]]}"',
            'Pt': numbers(seen.xy[row]),
            'Sigma2': numbers(seen.covariance[row][np.triu_indices(2)]),
        }
        for row in rows
    ]
    return _measures('SetMesIm', {'NameIm': f'"{image}"'}, measures)


def _mmvii_points(solution: Solution) -> bytes:
    """Return points whose covariances are six numbers: the upper triangle, row after row."""
    covariances = solution.point_covariances
    points = [
        {
            'Name': f'"{solution.network.targets[index]}"',
            'Pt': numbers(solution.state.points[index]),
            'AdditionalInfo': '""',
            '__Opt__Sigma2': numbers(covariances[index][np.triu_indices(3)]),
        }
        for index in determined(solution)
    ]
    return _measures('SetGCP', {'NameSet': f'"{NAME}"'}, points)
