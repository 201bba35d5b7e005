"""What is on a printed page, whatever the format of the file; lengths are in mm.

(0, 0) is the lower left corner of the page, x to the right and y upwards.
"""

from __future__ import annotations

from dataclasses import dataclass

from ahf_ros.codes.designs import Contour

_LETTERS = {
    191: "'",
    222: 'ijl',
    260: '|',
    278: ' !,./:;I[\\]ft',
    333: '()-`r',
    334: '{}',
    355: '"',
    389: '*',
    469: '^',
    500: 'Jcksvxyz',
    556: '#$0123456789?L_abdeghnopqu',
    584: '+<=>~',
    611: 'FTZ',
    667: '&ABEKPSVXY',
    722: 'CDHNRUw',
    778: 'GOQ',
    833: 'Mm',
    889: '%',
    944: 'W',
    1015: '@',
}
_WIDTHS = {letter: width / 1000 for width, letters in _LETTERS.items() for letter in letters}


@dataclass(frozen=True, slots=True)
class Ink:
    """A target: what is inside an odd number of contours is black.

    Attributes
    ----------
    name : str
        Of the target, unique on the page.
    x, y, scale : float
        Centre, and length of a unit of the contours.
    contours : tuple of Contour
    """

    name: str
    x: float
    y: float
    scale: float
    contours: tuple[Contour, ...]


@dataclass(frozen=True, slots=True)
class Line:
    """A straight line of some width."""

    start: tuple[float, float]
    end: tuple[float, float]
    width: float


@dataclass(frozen=True, slots=True)
class Text:
    """A line of text.

    Attributes
    ----------
    x, y : float
        Where its baseline begins, or its middle where it is `centred`.
    size : float
        One em.
    content : str
    centred, upwards : bool
        Whether it is centred at `x`, and whether it runs upwards, not to the right.
    """

    x: float
    y: float
    size: float
    content: str
    centred: bool = True
    upwards: bool = False


@dataclass(frozen=True, slots=True)
class Drawing:
    """What is on one page."""

    width: float
    height: float
    inks: tuple[Ink, ...]
    lines: tuple[Line, ...]
    texts: tuple[Text, ...]


def text_width(content: str, size: float) -> float:
    """Return the width of a line of ASCII text in Helvetica, by Adobe's metrics of the font.

    Examples
    --------
    >>> text_width('100 mm', 10.0)
    36.12
    """
    return round(size * sum(_WIDTHS[letter] for letter in content), 6)
