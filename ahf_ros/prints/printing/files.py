"""Files of printed sheets: PDF by ReportLab, SVG, and the geometry as JSON."""

import io
import json
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ahf_ros.base.extras import need
from ahf_ros.prints.designs import Arc
from ahf_ros.prints.printing.drawing import Drawing, Ink
from ahf_ros.prints.printing.sheets import Sheets

FORMATS = '.pdf', '.svg'
"""Endings of the files that sheets are written to."""

_POINT = 25.4 / 72  # mm
_PDF_VERSION = 1, 6  # the first one with PrintScaling
_MAXIMUM_CURVE = math.pi / 4  # angle of a Bezier curve: it is within 5e-6 of the radius of its arc
_MAXIMUM_ARC = 2 * math.pi / 3  # of one arc command of SVG, which cannot be a whole circle
_DIGITS = 6  # of lengths in mm


def sheet_files(path: Path, sheets: Sheets) -> Iterator[tuple[Path, bytes]]:
    """Yield the files of sheets, and their content.

    The ending of `path` says the format. An SVG file holds one page: several are numbered,
    `sheet_1.svg` and so on for `sheet.svg`. A ValueError is raised if the format is unknown or the
    page is too small, a `MissingExtra` if its library is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(f'{path} has an unknown format, accepted is one of {", ".join(FORMATS)}')
    if suffix == '.pdf':
        yield path, pdf_bytes(sheets.pages(), sheets.title)
        return
    for number, page in enumerate(sheets.pages(), 1):
        name = path.name if sheets.count == 1 else f'{path.stem}_{number}{path.suffix}'
        yield path.with_name(name), svg_bytes(page, sheets.title)


def geometry_text(sheets: Sheets) -> str:
    """Return the geometry of sheets as JSON: sizes and places of the targets in mm."""
    settings, paper = sheets.settings, sheets.settings.paper
    common = settings.proportions
    radii = {name: settings.radius * length for name, length in common.radii.items()}
    if settings.hole and settings.print.design.has_pinhole:
        radii['pinhole'] = settings.radius * settings.hole
    radii['quiet_zone'] = settings.radius * common.quiet_zone
    geometry = {
        'family': settings.family,
        'family_file': settings.family_file,
        'polarity': settings.colour,
        'unit': 'mm',
        'origin': 'lower left corner of the page, x to the right, y upwards',
        'page': {'name': paper.name, 'width': paper.width, 'height': paper.height},
        'pages': sheets.count,
        'radii': _rounded(radii),
        'targets': [_rounded(asdict(target)) for target in sheets.targets()],
    }
    return json.dumps(geometry, indent=1) + '\n'


def _rounded(values: dict[str, float]) -> dict[str, float]:
    return {name: round(value, _DIGITS) for name, value in values.items()}


def pdf_bytes(pages: Iterable[Drawing], title: str) -> bytes:
    """Return the content of a PDF file whose pages are printed without being scaled.

    Raises a `MissingExtra` without ReportLab.
    """
    need('print')
    from reportlab.pdfgen.canvas import Canvas

    buffer = io.BytesIO()
    canvas = Canvas(buffer, pageCompression=1, invariant=1, pdfVersion=_PDF_VERSION)
    canvas.setTitle(title)
    canvas.setAuthor('ahf_ros')
    canvas.setCreator('ahf targets')
    canvas.setViewerPreference('PrintScaling', 'None')
    for page in pages:
        canvas.setPageSize((page.width / _POINT, page.height / _POINT))
        canvas.scale(1 / _POINT, 1 / _POINT)
        for ink in page.inks:
            canvas.drawPath(_pdf_path(canvas, ink), stroke=0, fill=1, fillMode=0)
        for line in page.lines:
            canvas.setLineWidth(line.width)
            canvas.line(*line.start, *line.end)
        for text in page.texts:
            canvas.saveState()
            canvas.translate(text.x, text.y)
            if text.upwards:
                canvas.rotate(90)
            canvas.setFont('Helvetica', text.size)
            (canvas.drawCentredString if text.centred else canvas.drawString)(0, 0, text.content)
            canvas.restoreState()
        canvas.showPage()
    canvas.save()
    return buffer.getvalue()


def _pdf_path(canvas: Any, ink: Ink) -> Any:
    path = canvas.beginPath()
    for contour in ink.contours:
        go_to = path.moveTo
        for part in contour:
            points = _bezier(part) if isinstance(part, Arc) else [part]
            placed = [(ink.x + ink.scale * x, ink.y + ink.scale * y) for x, y in points]
            go_to(*placed[0])
            go_to = path.lineTo
            for index in range(1, len(placed), 3):
                first, second, end = placed[index : index + 3]
                path.curveTo(*first, *second, *end)
        path.close()
    return path


def _bezier(arc: Arc) -> list[tuple[float, float]]:
    """Return the start of an arc, then two control points and the end of each Bezier curve."""
    count = math.ceil(abs(arc.extent) / _MAXIMUM_CURVE - 1e-9)
    step = arc.extent / count
    handle = 4 / 3 * math.tan(step / 4)
    points = []
    for index in range(count + 1):
        angle = arc.start + index * step
        cosine, sine = math.cos(angle), math.sin(angle)
        if index:
            points.append((cosine + handle * sine, sine - handle * cosine))
        points.append((cosine, sine))
        if index < count:
            points.append((cosine - handle * sine, sine + handle * cosine))
    return [(arc.x + arc.radius * x, arc.y + arc.radius * y) for x, y in points]


def svg_bytes(page: Drawing, title: str) -> bytes:
    """Return the content of an SVG file that has the size of the page."""
    root = ElementTree.Element(
        'svg',
        {
            'xmlns': 'http://www.w3.org/2000/svg',
            'width': f'{_short(page.width)}mm',
            'height': f'{_short(page.height)}mm',
            'viewBox': f'0 0 {_short(page.width)} {_short(page.height)}',
            'style': 'background: white',
        },
    )
    ElementTree.SubElement(root, 'title').text = title
    for ink in page.inks:
        attributes = {'fill-rule': 'evenodd', 'd': _svg_path(ink, page.height)}
        path = ElementTree.SubElement(root, 'path', attributes)
        ElementTree.SubElement(path, 'title').text = ink.name
    for line in page.lines:
        (x1, y1), (x2, y2) = line.start, line.end
        ends = {'x1': x1, 'y1': page.height - y1, 'x2': x2, 'y2': page.height - y2}
        attributes = {name: _short(value) for name, value in ends.items()}
        attributes |= {'stroke': 'black', 'stroke-width': _short(line.width)}
        ElementTree.SubElement(root, 'line', attributes)
    for text in page.texts:
        place = {'x': _short(text.x), 'y': _short(page.height - text.y)}
        font = {'font-family': 'Helvetica, Arial, sans-serif', 'font-size': _short(text.size)}
        element = ElementTree.SubElement(root, 'text', place | font)
        element.text = text.content
        if text.centred:
            element.set('text-anchor', 'middle')
        if text.upwards:
            element.set('transform', f'rotate(-90 {place["x"]} {place["y"]})')
    ElementTree.indent(root, ' ')
    encoded: bytes = ElementTree.tostring(root, encoding='utf-8', xml_declaration=True)
    return encoded + b'\n'


def _short(value: float) -> str:
    """Return a length in mm, to 0.01 micrometres."""
    return f'{value:.5f}'.rstrip('0').rstrip('.')


def _svg_path(ink: Ink, height: float) -> str:
    """Return the outlines of a target as commands of a path."""
    commands = []
    for contour in ink.contours:
        command = 'M'
        for part in contour:
            if isinstance(part, Arc):
                count = math.ceil(abs(part.extent) / _MAXIMUM_ARC)
                angles = [part.start + part.extent * index / count for index in range(count + 1)]
                points = [
                    (part.x + part.radius * math.cos(it), part.y + part.radius * math.sin(it))
                    for it in angles
                ]
                radius = _short(ink.scale * part.radius)
                arc = f'A{radius} {radius} 0 0 {int(part.extent < 0)} '  # y points down
            else:
                points, arc = [part], ''
            first, *others = (
                f'{_short(ink.x + ink.scale * x)} {_short(height - ink.y - ink.scale * y)}'
                for x, y in points
            )
            commands += [command + first, *(arc + place for place in others)]
            command = 'L'
        commands.append('Z')
    return ''.join(commands)
