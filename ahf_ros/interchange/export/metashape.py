"""Surveys as markers of Agisoft Metashape."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from ahf_ros.interchange.export import metashape_console
from ahf_ros.interchange.export.mmvii import serialised
from ahf_ros.interchange.export.survey import Survey

MARKERS = 'markers.xml'
SCRIPT = Path(metashape_console.__file__)
"""The script that is handed over beside the markers, which it reads."""


def metashape_files(survey: Survey) -> dict[str, bytes]:
    """Return markers for File > Import > Import Markers, and a script for the console.

    Images of one size get one sensor; Metashape takes the cameras of its project by their labels.
    """
    document = Element('document', version='1.2.0')
    chunk = SubElement(document, 'chunk')
    _add_cameras(chunk, survey)
    numbers = {label: str(number) for number, label in enumerate(survey.labels)}
    _add_markers(chunk, survey, numbers)
    _add_places(chunk, survey, numbers)
    return {MARKERS: serialised(document), SCRIPT.name: SCRIPT.read_bytes()}


def _add_cameras(chunk: Element, survey: Survey) -> None:
    sizes = {(it.width, it.height): None for it in survey.photographs}
    sensors = SubElement(chunk, 'sensors')
    for number, (width, height) in enumerate(sizes):
        label = f'{width} x {height}'
        sensor = SubElement(sensors, 'sensor', id=str(number), label=label, type='frame')
        SubElement(sensor, 'resolution', width=str(width), height=str(height))
    order = list(sizes)
    cameras = SubElement(chunk, 'cameras')
    for number, photograph in enumerate(survey.photographs):
        sensor_id = str(order.index((photograph.width, photograph.height)))
        names = {'id': str(number), 'label': photograph.name, 'sensor_id': sensor_id}
        SubElement(cameras, 'camera', names)


def _add_markers(chunk: Element, survey: Survey, numbers: dict[str, str]) -> None:
    markers = SubElement(chunk, 'markers')
    for label, number in numbers.items():
        marker = SubElement(markers, 'marker', id=number, label=label)
        if label in survey.control:
            x, y, z = (repr(float(value)) for value in survey.control[label])
            SubElement(marker, 'reference', x=x, y=y, z=z, enabled='true')


def _add_places(chunk: Element, survey: Survey, numbers: dict[str, str]) -> None:
    """Add the places of each marker in the cameras."""
    frame = SubElement(SubElement(chunk, 'frames'), 'frame', id='0')
    markers = SubElement(frame, 'markers')
    elements = {
        label: SubElement(markers, 'marker', marker_id=it) for label, it in numbers.items()
    }
    for number, photograph in enumerate(survey.photographs):
        for mark in photograph.marks:
            place = {'x': f'{mark.x:.6f}', 'y': f'{mark.y:.6f}'}
            found = {'camera_id': str(number), 'pinned': 'true', **place}
            SubElement(elements[mark.label], 'location', found)
