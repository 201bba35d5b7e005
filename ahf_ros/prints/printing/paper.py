"""Lengths with units, sizes of pages, and sheets of labels."""

import re
from dataclasses import dataclass

from ahf_ros.base.text import shown

_UNITS = {'mm': 1.0, 'cm': 10.0, 'm': 1000.0, 'in': 25.4, 'pt': 25.4 / 72}
_NUMBER = r'\s*(\d+\.?\d*|\.\d+)\s*'

MAXIMUM_PAGE = 5000.0
"""Side of a page, mm; a PDF may have 14,400 points, which is 5080 mm."""

PAGES = {
    'A0': (841.0, 1189.0),
    'A1': (594.0, 841.0),
    'A2': (420.0, 594.0),
    'A3': (297.0, 420.0),
    'A4': (210.0, 297.0),
    'A5': (148.0, 210.0),
    'A6': (105.0, 148.0),
    'letter': (215.9, 279.4),
    'legal': (215.9, 355.6),
    'tabloid': (279.4, 431.8),
}
"""Width and height of pages, mm."""


@dataclass(frozen=True, slots=True)
class Page:
    """A page of `width` and `height` mm; `name` is its name, or its size as text."""

    name: str
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class LabelSheet:
    """A sheet of round labels in a grid on a letter page; lengths are in mm.

    `left` and `top` lead from the edges of the page to the first label, `pitch_x` and `pitch_y`
    from the centre of one label to the next one's.
    """

    columns: int
    rows: int
    diameter: float
    left: float
    top: float
    pitch_x: float
    pitch_y: float


def _inches(columns: int, rows: int, *lengths: float) -> LabelSheet:
    return LabelSheet(columns, rows, *(25.4 * length for length in lengths))


LABEL_SHEETS = {
    'avery6450': _inches(7, 9, 1.0, 0.375, 0.5, 1.125, 1.125),
    'avery5293': _inches(4, 6, 1.625, 0.4157, 0.549, 2.0145, 1.6554),
    'avery8293': _inches(4, 5, 1.5, 0.5, 0.75, 2.0, 2.0),
}
"""Sheets of round labels with a diameter of 1, 1 5/8 and 1 1/2 inch."""


def length_in(field: str, text: str) -> float:
    """Return the length, mm, that the text of a field stands for.

    It is a number above 0 with one of the units mm, cm, m, in, pt, or mm where there is none. A
    ValueError is raised if it is not, or longer than any page.
    """
    found = re.fullmatch(f'{_NUMBER}({"|".join(_UNITS)})?\\s*', text)
    length = float(found[1]) * _UNITS[found[2] or 'mm'] if found else 0.0
    if not 0 < length <= MAXIMUM_PAGE:
        raise ValueError(
            f'{field} is {shown(text)}, accepted is a length such as 4mm, 0.4cm or 0.25in, of at '
            f'most {MAXIMUM_PAGE:g} mm'
        )
    return length


def page_in(text: str) -> Page:
    """Return the page that a text names, or raise a ValueError.

    It is one of `PAGES` in upper or lower case, or width x height with a unit, such as 210x297mm.
    """
    for name, size in PAGES.items():
        if text.lower() == name.lower():
            return Page(name, *size)
    found = re.fullmatch(f'{_NUMBER}x{_NUMBER}({"|".join(_UNITS)})?\\s*', text.lower())
    if not found:
        raise ValueError(
            f'page is {shown(text)}, accepted is one of {", ".join(PAGES)}, or a size such as '
            '210x297mm'
        )
    unit = found[3] or 'mm'
    width, height = (length_in('page', f'{side}{unit}') for side in found.group(1, 2))
    return Page(text, width, height)
