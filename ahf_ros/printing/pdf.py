"""PDF files of printed pages, by ReportLab."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable
from typing import Any

from ahf_ros.codes.designs import Arc
from ahf_ros.printing.drawing import Drawing, Ink, Text

_POINT = 25.4 / 72  # mm
_VERSION = 1, 6  # the first one with PrintScaling
_MAXIMUM_EXTENT = math.pi / 4  # of a Bezier curve: it is within 5e-6 of the radius of its arc


def pdf_bytes(pages: Iterable[Drawing], title: str) -> bytes:
    """Return the content of a PDF file whose pages are printed without being scaled.

    Parameters
    ----------
    pages : iterable of Drawing
    title : str
        Title of the document.

    Raises
    ------
    ValueError
        If ReportLab is not installed.
    """
    try:
        from reportlab.pdfgen.canvas import Canvas
    except ImportError as error:
        raise ValueError(
            'PDF needs the package reportlab, which is not installed: pip install reportlab, or '
            "install ahf_ros with 'ahf_ros[print]'; accepted without it is SVG"
        ) from error
    buffer = io.BytesIO()
    canvas = Canvas(buffer, pageCompression=1, invariant=1, pdfVersion=_VERSION)
    canvas.setTitle(title)
    canvas.setAuthor('ahf_ros')
    canvas.setCreator('ahf targets')
    canvas.setViewerPreference('PrintScaling', 'None')
    for page in pages:
        canvas.setPageSize((page.width / _POINT, page.height / _POINT))
        canvas.scale(1 / _POINT, 1 / _POINT)
        _draw(canvas, page)
        canvas.showPage()
    canvas.save()
    return buffer.getvalue()


def _draw(canvas: Any, page: Drawing) -> None:
    for ink in page.inks:
        canvas.drawPath(_path(canvas, ink), stroke=0, fill=1, fillMode=0)
    for line in page.lines:
        canvas.setLineWidth(line.width)
        canvas.line(*line.start, *line.end)
    for text in page.texts:
        _write(canvas, text)


def _path(canvas: Any, ink: Ink) -> Any:
    """Return the outlines of a target."""
    path = canvas.beginPath()
    for contour in ink.contours:
        begun = False
        for part in contour:
            points = _bezier(part) if isinstance(part, Arc) else [part]
            placed = [(ink.x + ink.scale * x, ink.y + ink.scale * y) for x, y in points]
            (path.lineTo if begun else path.moveTo)(*placed[0])
            begun = True
            for index in range(1, len(placed), 3):
                first, second, end = placed[index : index + 3]
                path.curveTo(*first, *second, *end)
        path.close()
    return path


def _bezier(arc: Arc) -> list[tuple[float, float]]:
    """Return the start of an arc, then two control points and the end of each Bezier curve."""
    count = math.ceil(abs(arc.extent) / _MAXIMUM_EXTENT - 1e-9)
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


def _write(canvas: Any, text: Text) -> None:
    canvas.saveState()
    canvas.translate(text.x, text.y)
    if text.upwards:
        canvas.rotate(90)
    canvas.setFont('Helvetica', text.size)
    (canvas.drawCentredString if text.centred else canvas.drawString)(0, 0, text.content)
    canvas.restoreState()
