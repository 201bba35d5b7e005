"""Surveys as XML: markers of Agisoft Metashape, and measurements of MicMac's MMVII."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from ahf_ros.interchange.export import metashape_console
from ahf_ros.interchange.export.survey import Survey

NAME = 'ahf'
"""Name of the set of measurements, which commands of MMVII are given."""


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
    """Return a document of MMVII with a set of measures."""
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
