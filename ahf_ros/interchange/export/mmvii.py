"""Surveys as measurements of MicMac's MMVII, in the XML of its serialisation."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from xml.etree.ElementTree import Element, SubElement

from ahf_ros.interchange.export.survey import Photograph, Survey

NAME = 'ahf'
"""Name of the set of measurements, which commands of MMVII are given."""

FOLDER = f'MMVII-PhgrProj/ObjMesInstr/{NAME}'


def mmvii_files(survey: Survey) -> dict[str, bytes]:
    """Return a file of measurements for each image, and one of the control points.

    Raises
    ------
    ValueError
        If the name of an image or a label has a quotation mark, which the format cannot hold.
    """
    files = {}
    for label in survey.labels:
        if '"' in label:
            raise ValueError(f'label is {label!r}, accepted is a label without "')
    for photograph in survey.photographs:
        if '"' in photograph.name:
            raise ValueError(f'image is {photograph.path!r}, accepted is a name without "')
        files[f'{FOLDER}/MesIm-{photograph.name}.xml'] = _measurements(photograph)
    if survey.control:
        files[f'{FOLDER}/MesGCP-{NAME}.xml'] = _control(survey)
    return files


def _measurements(photograph: Photograph) -> bytes:
    root, data = _document('SetMesIm')
    _text(data, 'NameIm', f'"{photograph.name}"')
    measures = SubElement(data, 'Measures')
    for mark in photograph.marks:
        item = SubElement(measures, 'el')
        _text(item, 'Name', f'"{mark.label}"')
        _text(item, 'Pt', f'{mark.x:.6f} {mark.y:.6f}')
        _text(item, 'Sigma2', ' '.join(f'{value:.6g}' for value in mark.covariance))
    return serialised(root)


def _control(survey: Survey) -> bytes:
    root, data = _document('SetGCP')
    _text(data, 'NameSet', f'"{NAME}"')
    measures = SubElement(data, 'Measures')
    for label, point in survey.control.items():
        item = SubElement(measures, 'el')
        _text(item, 'Name', f'"{label}"')
        _text(item, 'Pt', ' '.join(repr(float(value)) for value in point))
        _text(item, 'AdditionalInfo', '""')
    return serialised(root)


def serialised(root: Element) -> bytes:
    """Return an indented XML document."""
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding='UTF-8', xml_declaration=True) + b'\n'


def _document(tag: str) -> tuple[Element, Element]:
    """Return the root of a document and the element that holds its content."""
    root = Element('Root')
    _text(root, 'Type', '"MMVII_Serialization"')
    _text(root, 'Version', '"0.0.0"')
    return root, SubElement(SubElement(root, 'Data'), tag)


def _text(parent: Element, tag: str, text: str) -> None:
    SubElement(parent, tag).text = text
