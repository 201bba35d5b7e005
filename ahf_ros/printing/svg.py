"""SVG files of printed pages."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

from ahf_ros.codes.designs import Arc
from ahf_ros.printing.drawing import Drawing, Ink, Text

_SPACE = 'http://www.w3.org/2000/svg'
_MAXIMUM_EXTENT = 2 * math.pi / 3  # of one arc command, which cannot be a whole circle


def svg_bytes(page: Drawing, title: str) -> bytes:
    """Return the content of an SVG file that has the size of the page.

    Parameters
    ----------
    page : Drawing
    title : str
        Title of the document.
    """
    root = ElementTree.Element(
        'svg',
        {
            'xmlns': _SPACE,
            'width': f'{_short(page.width)}mm',
            'height': f'{_short(page.height)}mm',
            'viewBox': f'0 0 {_short(page.width)} {_short(page.height)}',
            'style': 'background: white',
        },
    )
    ElementTree.SubElement(root, 'title').text = title
    for ink in page.inks:
        attributes = {'fill-rule': 'evenodd', 'd': _path(ink, page.height)}
        path = ElementTree.SubElement(root, 'path', attributes)
        ElementTree.SubElement(path, 'title').text = ink.name
    for line in page.lines:
        (x1, y1), (x2, y2) = line.start, line.end
        ends = {'x1': x1, 'y1': page.height - y1, 'x2': x2, 'y2': page.height - y2}
        attributes = {name: _short(value) for name, value in ends.items()}
        attributes |= {'stroke': 'black', 'stroke-width': _short(line.width)}
        ElementTree.SubElement(root, 'line', attributes)
    for text in page.texts:
        _write(root, text, page.height)
    ElementTree.indent(root, ' ')
    encoded: bytes = ElementTree.tostring(root, encoding='utf-8', xml_declaration=True)
    return encoded + b'\n'


def _short(value: float) -> str:
    """Return a length in mm, to 0.01 micrometres."""
    return f'{value:.5f}'.rstrip('0').rstrip('.')


def _path(ink: Ink, height: float) -> str:
    """Return the outlines of a target as commands of a path."""

    def place(x: float, y: float) -> str:
        return f'{_short(ink.x + ink.scale * x)} {_short(height - ink.y - ink.scale * y)}'

    commands = []
    for contour in ink.contours:
        command = 'M'
        for part in contour:
            if not isinstance(part, Arc):
                commands.append(command + place(*part))
                command = 'L'
                continue
            count = math.ceil(abs(part.extent) / _MAXIMUM_EXTENT)
            angles = [part.start + part.extent * index / count for index in range(count + 1)]
            points = [
                place(
                    part.x + part.radius * math.cos(angle), part.y + part.radius * math.sin(angle)
                )
                for angle in angles
            ]
            radius = _short(ink.scale * part.radius)
            sweep = int(part.extent < 0)  # y points down
            commands.append(command + points[0])
            commands += [f'A{radius} {radius} 0 0 {sweep} {point}' for point in points[1:]]
            command = 'L'
        commands.append('Z')
    return ''.join(commands)


def _write(root: ElementTree.Element, text: Text, height: float) -> None:
    x, y = _short(text.x), _short(height - text.y)
    attributes = {
        'x': x,
        'y': y,
        'font-family': 'Helvetica, Arial, sans-serif',
        'font-size': _short(text.size),
    }
    if text.centred:
        attributes['text-anchor'] = 'middle'
    if text.upwards:
        attributes['transform'] = f'rotate(-90 {x} {y})'
    ElementTree.SubElement(root, 'text', attributes).text = text.content
