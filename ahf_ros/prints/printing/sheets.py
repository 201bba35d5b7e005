"""The pages of a set of targets: places, ink, captions, cut marks and scale bars.

Lengths are in mm.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

from ahf_ros.base.text import counted
from ahf_ros.prints.designs import circle, contours
from ahf_ros.prints.printing.drawing import Drawing, Ink, Line, Text, text_width
from ahf_ros.prints.printing.paper import LABEL_SHEETS
from ahf_ros.prints.printing.settings import SheetSettings

MARGIN = 12.0
"""Along each edge of a page without labels; scale bars and page numbers are in it."""

_PAD = 1.0  # between a quiet zone and the line along which the target is cut out
_LABEL_PAD = 0.8  # along the edge of a label, as sheets are not fed to the tenth of a millimetre
_TEXT = 1.6, 3.0  # smallest and largest size of captions
_TEXT_SHARE = 0.6  # size of captions in dot radii
_LEADING = 1.25  # from one baseline to the next, in em
_ABOVE, _BELOW = 0.75, 0.25  # what letters reach above and below the baseline, in em
_HALVINGS = 40  # in the search for the largest radius

BARS = (100, 50, 20, 10)
"""Lengths of scale bars, mm; the longest one for which there is room is printed."""

_BAR = 6.0  # from the edge of the page to a bar
_TICK, _END = 1.0, 2.0  # ticks of a bar, every 10 mm and at its ends
_BAR_TEXT = 2.0
_THIN, _CUT = 0.15, 0.1  # width of lines of bars and of cut marks
_CUT_LENGTH = 2.0


@dataclass(frozen=True, slots=True)
class Layout:
    """The centres of the targets on each page, in the order in which they are filled.

    Targets are cut out at `cuts_x` and `cuts_y`, the borders of columns, ascending, and of rows,
    descending; they are empty where targets are on labels. `caption` leads from an ID to its
    caption about a centre at (0, 0).
    """

    places: tuple[tuple[float, float], ...]
    cuts_x: tuple[float, ...]
    cuts_y: tuple[float, ...]
    caption: Callable[[int], tuple[Text, ...]]


def page_layout(settings: SheetSettings, longest: int) -> Layout:
    """Return the places for targets on each page, with room for the ID `longest`.

    A ValueError with the largest accepted size is raised if the page or the label is too small for
    a single target.
    """
    layout_of = _on_labels if settings.on_labels else _in_cells
    layout = layout_of(settings, settings.radius, longest)
    if layout:
        return layout
    fits, too_large = 0.0, settings.radius
    for _ in range(_HALVINGS):
        middle = (fits + too_large) / 2
        fitting = layout_of(settings, middle, longest)
        fits, too_large = (middle, too_large) if fitting else (fits, middle)
    where = (
        f'labels of {settings.labels}' if settings.on_labels else f'a page {settings.paper.name}'
    )
    name, factor = ('side', settings.size_factor) if settings.side else ('dot_radius', 1.0)
    most = math.floor(100 * factor * fits) / 100
    raise ValueError(
        f'{name} is {factor * settings.radius:g} mm, accepted is '
        f'{f"at most {most:g} mm" if most else "no length"} for {settings.family} on {where}'
    )


def _in_cells(settings: SheetSettings, radius: float, longest: int) -> Layout | None:
    """Return a grid of cells side by side, None where there is not room for one."""
    page = settings.paper
    zone = settings.proportions.quiet_zone * radius
    size = min(max(_TEXT_SHARE * radius, _TEXT[0]), _TEXT[1])
    words = str(longest), settings.family, _any_size(settings)
    inner = max(2 * zone, *(text_width(word, size) for word in words))
    width = inner + 2 * _PAD
    height = 2 * zone + 2 * _PAD + _LEADING * size * len(_wrapped(words, size, inner))
    columns, rows = (
        int((side - 2 * MARGIN) / of_cell + 1e-9)
        for side, of_cell in ((page.width, width), (page.height, height))
    )
    if not columns or not rows:
        return None
    if settings.per_page:
        columns = min(columns, settings.per_page)
        rows = min(rows, math.ceil(settings.per_page / columns))
    left, top = (page.width - columns * width) / 2, (page.height + rows * height) / 2
    cuts_x = tuple(left + column * width for column in range(columns + 1))
    cuts_y = tuple(top - row * height for row in range(rows + 1))
    places = tuple((x + width / 2, y - _PAD - zone) for y in cuts_y[:-1] for x in cuts_x[:-1])

    def caption(number: int) -> tuple[Text, ...]:
        first = -zone - (_LEADING - _BELOW) * size
        lines = _wrapped((str(number), settings.family, settings.size), size, inner)
        return tuple(
            Text(0.0, first - index * _LEADING * size, size, line)
            for index, line in enumerate(lines)
        )

    return Layout(places[: settings.per_page or None], cuts_x, cuts_y, caption)


def _on_labels(settings: SheetSettings, radius: float, longest: int) -> Layout | None:
    """Return the middles of labels, None where a target and its caption do not fit on one."""
    sheet = LABEL_SHEETS[settings.labels]
    zone, size = settings.proportions.quiet_zone * radius, _TEXT[0]
    reach = sheet.diameter / 2 - _LABEL_PAD
    height = zone + (_ABOVE + _BELOW) * size
    for words in (f'{longest}  {_any_size(settings)}', settings.family):
        if math.hypot(text_width(words, size) / 2, height) > reach:
            return None
    first = sheet.left + sheet.diameter / 2, sheet.top + sheet.diameter / 2
    places = tuple(
        (first[0] + column * sheet.pitch_x, settings.paper.height - first[1] - row * sheet.pitch_y)
        for row in range(sheet.rows)
        for column in range(sheet.columns)
    )

    def caption(number: int) -> tuple[Text, ...]:
        above = Text(0.0, zone + _BELOW * size, size, f'{number}  {settings.size}')
        return above, Text(0.0, -zone - _ABOVE * size, size, settings.family)

    return Layout(places[: settings.per_page or None], (), (), caption)


def _any_size(settings: SheetSettings) -> str:
    """Return a text at least as wide as the size of targets, whatever it is."""
    return f'{settings.size_name} 00.00 mm'


def _wrapped(words: tuple[str, ...], size: float, width: float) -> list[str]:
    """Return words in as few lines as there is room for."""
    lines: list[str] = []
    for word in words:
        longer = f'{lines[-1]}  {word}' if lines else word
        if lines and text_width(longer, size) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


@dataclass(frozen=True)
class Placed:
    """Where a target is printed: on which page, from 1 on, and where on it its centre is, mm."""

    id: int
    code: int
    page: int
    x: float
    y: float


@dataclass(frozen=True)
class Sheets:
    """The pages of a set of targets.

    A page or a label that is too small for a target raises a ValueError on the first use.
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
            code = settings.print.design.word(number)
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
            yield Drawing(
                width=paper.width,
                height=paper.height,
                inks=tuple(inks),
                lines=(*lines, *bars),
                texts=tuple(texts),
            )

    def _ink(self, number: int, x: float, y: float) -> Ink:
        settings = self.settings
        design = settings.print.design
        outlines = contours(design.ink(design.word(number), settings.hole))
        if settings.colour == 'bright':
            outlines = (circle(settings.proportions.quiet_zone), *outlines)
        return Ink(
            name=f'{settings.family} {number}', x=x, y=y, scale=settings.radius, contours=outlines
        )

    def _bars(self) -> tuple[list[Line], list[Text]]:
        """Return a bar along the lower and one along the left edge, with their lengths."""
        lines, texts = [], []
        paper = self.settings.paper
        for upwards, side in ((False, paper.width), (True, paper.height)):
            length = _bar_length(side)
            if not length:
                continue
            ends = [(MARGIN, _BAR, MARGIN + length, _BAR)]
            for at in range(0, length + 1, 10):
                tick = _BAR + (_TICK if at % length else _END)
                ends.append((MARGIN + at, _BAR, MARGIN + at, tick))
            for x1, y1, x2, y2 in ends:
                start, end = ((y1, x1), (y2, x2)) if upwards else ((x1, y1), (x2, y2))
                lines.append(Line(start, end, _THIN))
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
        long = f'{self.title}, {number}'
        for words in (f'{long}. Print at 100 %.', long, number):
            if begin + text_width(words, _BAR_TEXT) <= width - MARGIN / 2:
                return [Text(begin, _BAR, _BAR_TEXT, words, centred=False)]
        return []


def _bar_length(side: float) -> int:
    """Return the length of the bar along a side of the page, 0 where there is no room for one."""
    room = side - 2 * MARGIN - text_width('100 mm', _BAR_TEXT)
    return next((length for length in BARS if length <= room), 0)


def _cut_marks(layout: Layout, count: int) -> list[Line]:
    """Return a cross at each corner of the cells of the first `count` targets."""
    columns = len(layout.cuts_x) - 1
    if columns < 1:
        return []
    corners = {
        (index % columns + right, index // columns + down)
        for index in range(count)
        for right in (0, 1)
        for down in (0, 1)
    }
    lines = []
    for column, row in sorted(corners):
        x, y = layout.cuts_x[column], layout.cuts_y[row]
        lines.append(Line((x - _CUT_LENGTH, y), (x + _CUT_LENGTH, y), _CUT))
        lines.append(Line((x, y - _CUT_LENGTH), (x, y + _CUT_LENGTH), _CUT))
    return lines
