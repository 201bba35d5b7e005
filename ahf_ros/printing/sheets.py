"""The pages of a set of targets: ink, captions, cut marks and scale bars."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from ahf_ros.codes.designs import circle, printed_design
from ahf_ros.printing.drawing import Drawing, Ink, Line, Text, text_width
from ahf_ros.printing.layout import MARGIN, Layout, page_layout
from ahf_ros.printing.settings import SheetSettings
from ahf_ros.text import counted

BARS = (100, 50, 20, 10)
"""Lengths of scale bars, mm; the longest one for which there is room is printed."""

_BAR = 6.0  # from the edge of the page to a bar
_TICK, _END = 1.0, 2.0  # ticks of a bar, every 10 mm and at its ends
_BAR_TEXT = 2.0
_THIN, _CUT = 0.15, 0.1  # width of lines of bars and of cut marks
_CUT_LENGTH = 2.0


@dataclass(frozen=True)
class Placed:
    """Where a target is printed.

    Attributes
    ----------
    id, code : int
    page : int
        From 1 on.
    x, y : float
        Its centre from the lower left corner of the page, y upwards, mm.
    """

    id: int
    code: int
    page: int
    x: float
    y: float


@dataclass(frozen=True)
class Sheets:
    """The pages of a set of targets.

    A page or a label that is too small for a target raises a ValueError on the first use.

    Examples
    --------
    >>> sheets = Sheets(SheetSettings(ids='1-54'))
    >>> sheets.count, len(next(sheets.pages()).inks)
    (2, 35)
    """

    settings: SheetSettings

    @cached_property
    def numbers(self) -> list[int]:
        """IDs of the targets."""
        return self.settings.numbers

    @cached_property
    def layout(self) -> Layout:
        """The places for targets on each page."""
        return page_layout(self.settings, max(self.numbers))

    @property
    def count(self) -> int:
        """Number of pages."""
        return -(-len(self.numbers) // len(self.layout.places))

    @property
    def title(self) -> str:
        """The targets in short."""
        targets = counted(len(self.numbers), 'target')
        return f'{self.settings.family}, {targets}, {self.settings.size}'

    def targets(self) -> Iterator[Placed]:
        """Yield where each target is printed."""
        settings = self.settings
        for index, number in enumerate(self.numbers):
            page, place = divmod(index, len(self.layout.places))
            code = printed_design(settings.family, number, 0.0, settings.family_file).code
            yield Placed(number, code, page + 1, *self.layout.places[place])

    def pages(self) -> Iterator[Drawing]:
        """Yield the pages."""
        paper, on_page = self.settings.paper, len(self.layout.places)
        for page in range(self.count):
            numbers = self.numbers[page * on_page : (page + 1) * on_page]
            inks, texts = [], []
            for number, (x, y) in zip(numbers, self.layout.places, strict=False):
                inks.append(self._ink(number, x, y))
                for text in self.layout.caption(number):
                    texts.append(Text(x + text.x, y + text.y, text.size, text.content))
            lines = _cut_marks(self.layout, len(numbers))
            bars, words = self._bars()
            texts += [*words, *self._footer(page + 1)]
            yield Drawing(paper.width, paper.height, tuple(inks), (*lines, *bars), tuple(texts))

    def _ink(self, number: int, x: float, y: float) -> Ink:
        settings = self.settings
        design = printed_design(settings.family, number, settings.pinhole, settings.family_file)
        contours = design.contours
        if settings.polarity == 'bright':
            contours = (circle(settings.proportions.quiet_zone), *contours)
        return Ink(f'{settings.family} {number}', x, y, settings.radius, contours)

    def _bars(self) -> tuple[list[Line], list[Text]]:
        """Return a bar along the lower and one along the left edge, with their lengths."""
        lines, texts = [], []
        paper = self.settings.paper
        for upwards, side in ((False, paper.width), (True, paper.height)):
            length = _bar_length(side)
            if not length:
                continue
            marks = [((MARGIN, _BAR), (MARGIN + length, _BAR))]
            for at in range(0, length + 1, 10):
                tick = _BAR + (_TICK if at % length else _END)
                marks.append(((MARGIN + at, _BAR), (MARGIN + at, tick)))
            turned = [(_along(start, upwards), _along(end, upwards)) for start, end in marks]
            lines += [Line(start, end, _THIN) for start, end in turned]
            place = MARGIN + length + 1, _BAR
            if upwards:
                place = _BAR + _BAR_TEXT * 0.75, MARGIN + length + 1
            texts.append(Text(*place, _BAR_TEXT, f'{length} mm', centred=False, upwards=upwards))
        return lines, texts

    def _footer(self, page: int) -> list[Text]:
        """Return what is said about the page beside the lower bar, as long as there is room."""
        width = self.settings.paper.width
        length = _bar_length(width)
        begin = MARGIN + length + 1 + text_width(f'{length} mm   ', _BAR_TEXT)
        number = f'page {page} of {self.count}'
        for words in (
            f'{self.title}, {number}. Print at 100 %.',
            f'{self.title}, {number}',
            number,
        ):
            if begin + text_width(words, _BAR_TEXT) <= width - MARGIN / 2:
                return [Text(begin, _BAR, _BAR_TEXT, words, centred=False)]
        return []


def _bar_length(side: float) -> int:
    """Return the length of the bar along a side of the page, 0 where there is no room for one."""
    room = side - 2 * MARGIN - text_width('100 mm', _BAR_TEXT)
    return next((length for length in BARS if length <= room), 0)


def _along(point: tuple[float, float], upwards: bool) -> tuple[float, float]:
    return (point[1], point[0]) if upwards else point


def _cut_marks(layout: Layout, count: int) -> list[Line]:
    """Return a cross at each corner of the cells of the first `count` targets."""
    corners = {
        (column + right, row + down)
        for row, column in (divmod(index, max(layout.columns, 1)) for index in range(count))
        for right in (0, 1)
        for down in (0, 1)
        if layout.cuts_x
    }
    lines = []
    for column, row in sorted(corners):
        x, y = layout.cuts_x[column], layout.cuts_y[row]
        lines.append(Line((x - _CUT_LENGTH, y), (x + _CUT_LENGTH, y), _CUT))
        lines.append(Line((x, y - _CUT_LENGTH), (x, y + _CUT_LENGTH), _CUT))
    return lines
