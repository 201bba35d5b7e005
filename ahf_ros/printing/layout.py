"""Where targets and their captions are on a page; lengths are in mm."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ahf_ros.printing.drawing import Text, text_width
from ahf_ros.printing.paper import LabelSheet, Page
from ahf_ros.printing.settings import SheetSettings

MARGIN = 12.0
"""Along each edge of a page without labels; scale bars and page numbers are in it."""

_PAD = 1.0  # between a quiet zone and the line along which the target is cut out
_LABEL_PAD = 0.8  # along the edge of a label, as sheets are not fed to the tenth of a millimetre
_TEXT = 1.6, 3.0  # smallest and largest size of captions
_TEXT_SHARE = 0.6  # size of captions in dot radii
_LEADING = 1.25  # from one baseline to the next, in em
_ABOVE, _BELOW = 0.75, 0.25  # what letters reach above and below the baseline, in em
_HALVINGS = 40  # in the search for the largest radius


@dataclass(frozen=True, slots=True)
class Layout:
    """The places for targets on each page.

    Attributes
    ----------
    places : tuple of tuple of 2 float
        Centres of the targets, in the order in which they are filled.
    cuts_x, cuts_y : tuple of float
        Where targets are cut out: the borders of columns, ascending, and of rows, descending;
        empty where they are on labels.
    caption : callable
        From an ID to its caption about a centre at (0, 0).
    """

    places: tuple[tuple[float, float], ...]
    cuts_x: tuple[float, ...]
    cuts_y: tuple[float, ...]
    caption: Callable[[int], tuple[Text, ...]]

    @property
    def columns(self) -> int:
        """Number of columns between cuts."""
        return len(self.cuts_x) - 1


def page_layout(settings: SheetSettings, longest: int) -> Layout:
    """Return the places for targets on each page.

    Parameters
    ----------
    settings : SheetSettings
    longest : int
        The ID that takes the most room.

    Raises
    ------
    ValueError
        If the page or the label is too small for a single target.
    """

    def layout_of(radius: float) -> Layout | None:
        if settings.sheet:
            return _on_labels(settings, settings.sheet, radius, longest)
        return _in_cells(settings, settings.paper, radius, longest)

    layout = layout_of(settings.radius)
    if layout:
        return layout
    fits, too_large = 0.0, settings.radius
    for _ in range(_HALVINGS):
        middle = (fits + too_large) / 2
        fits, too_large = (middle, too_large) if layout_of(middle) else (fits, middle)
    where = f'labels of {settings.labels}' if settings.sheet else f'a page {settings.paper.name}'
    name, factor = ('side', settings.size_factor) if settings.side else ('dot_radius', 1.0)
    most = math.floor(100 * factor * fits) / 100
    raise ValueError(
        f'{name} is {factor * settings.radius:g} mm, accepted is '
        f'{f"at most {most:g} mm" if most else "no length"} for {settings.family} on {where}'
    )


def _in_cells(settings: SheetSettings, page: Page, radius: float, longest: int) -> Layout | None:
    """Return a grid of cells side by side, None where there is not room for one."""
    zone, size = settings.proportions.quiet_zone * radius, _text_size(radius)
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


def _on_labels(
    settings: SheetSettings, sheet: LabelSheet, radius: float, longest: int
) -> Layout | None:
    """Return the middles of labels, None where a target and its caption do not fit on one."""
    zone, size = settings.proportions.quiet_zone * radius, _TEXT[0]
    reach = sheet.diameter / 2 - _LABEL_PAD

    height = zone + (_ABOVE + _BELOW) * size
    for words in (f'{longest}  {_any_size(settings)}', settings.family):
        if math.hypot(text_width(words, size) / 2, height) > reach:
            return None
    first = sheet.left + sheet.diameter / 2, sheet.top + sheet.diameter / 2
    places = tuple(
        (first[0] + column * sheet.pitch_x, sheet.page.height - first[1] - row * sheet.pitch_y)
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


def _text_size(radius: float) -> float:
    smallest, largest = _TEXT
    return min(max(_TEXT_SHARE * radius, smallest), largest)


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
