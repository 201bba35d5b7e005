"""Files of printed sheets: PDF, SVG, and the geometry as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from ahf_ros.printing.pdf import pdf_bytes
from ahf_ros.printing.sheets import Sheets
from ahf_ros.printing.svg import svg_bytes

FORMATS = '.pdf', '.svg'
"""Endings of the files that sheets are written to."""

_DIGITS = 6  # of lengths in mm


def sheet_files(path: Path, sheets: Sheets) -> Iterator[tuple[Path, bytes]]:
    """Yield the files of sheets, and their content.

    Parameters
    ----------
    path : Path
        The file, whose ending says the format. An SVG file holds one page: several are numbered,
        `sheet_1.svg` and so on for `sheet.svg`.
    sheets : Sheets

    Raises
    ------
    ValueError
        If the format is unknown, its library is not installed, or the page is too small.
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
    """Return the geometry of sheets as JSON: sizes and places of the targets in mm.

    Examples
    --------
    >>> from ahf_ros.printing.settings import SheetSettings
    >>> geometry = json.loads(geometry_text(Sheets(SheetSettings(ids='7', pinhole=0.1))))
    >>> geometry['radii']['dot'], geometry['radii']['pinhole'], geometry['targets'][0]['id']
    (4.0, 0.4, 7)
    """
    settings, paper = sheets.settings, sheets.settings.paper
    common = settings.proportions
    radii = {name: settings.radius * length for name, length in common.radii.items()}
    if settings.has_pinhole:
        radii['pinhole'] = settings.radius * settings.pinhole
    radii['quiet_zone'] = settings.radius * common.quiet_zone
    geometry = {
        'family': settings.family,
        'family_file': settings.family_file,
        'polarity': settings.polarity,
        'unit': 'mm',
        'origin': 'lower left corner of the page, x to the right, y upwards',
        'page': {'name': paper.name, 'width': paper.width, 'height': paper.height},
        'pages': sheets.count,
        'radii': _rounded(radii),
        'targets': [_rounded(asdict(target)) for target in sheets.targets()],
    }
    return json.dumps(geometry, indent=1) + '\n'


def _rounded(values: dict) -> dict:
    return {name: round(value, _DIGITS) for name, value in values.items()}
