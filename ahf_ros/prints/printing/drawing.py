"""What is on a printed page, whatever the format of the file; lengths are in mm.

(0, 0) is the lower left corner of the page, x to the right and y upwards.
"""

from dataclasses import dataclass

from ahf_ros.prints.designs import Contour

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
    """A target named `name`: what is inside an odd number of contours is black.

    Its centre is at `x`, `y`, and `scale` is the length of a unit of the contours.
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
    """A line of text in letters of which one em is `size`.

    Its baseline begins at `x`, `y`, or has its middle there where it is `centred`. It runs to the
    right, or upwards.
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
    """Return the width of a line of ASCII text in Helvetica, by Adobe's metrics of the font."""
    return round(size * sum(_WIDTHS[letter] for letter in content), 6)
