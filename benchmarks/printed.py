"""Prints the targets of every family, renders the PDF, and identifies them.

.venv/bin/python -m benchmarks.printed --output docs/figures/printed.md
.venv/bin/python -m benchmarks.printed --families metashape12 gsi --sample 50
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from ahf_ros import FAMILY_NAMES, create_detector
from ahf_ros.codes.families import KINDS, numbers_of
from ahf_ros.printing.drawing import Drawing
from ahf_ros.printing.pdf import pdf_bytes
from ahf_ros.printing.settings import SheetSettings
from ahf_ros.printing.sheets import Placed, Sheets
from benchmarks.report import number, table
from benchmarks.speed import seconds

SCALE = 8.0
"""Pixels of a rendered page in a millimetre."""

RADII = {'ring': '1mm', 'gsi': '0.5mm', 'dots': '1.25mm', 'aruco': '1.5mm', 'apriltag': '1.5mm'}
"""Radius of the dots of each kind of families."""

LARGER = {('metashape20', 'bright'): '1.5mm'}
"""The radius of other targets: at 8 px, `ring` left 542 of these 26013 undecoded, none wrong."""

HEAD = """# Printed targets

Every ID of every family, printed by `ahf targets` on A5 as PDF, rendered by PDFium at 8 px/mm and
identified. The radius of the dot is 4 to 12 px (`RADII` in `benchmarks/printed.py`). Ink reflects
6 % of the light, the blur of the lens is 0.7 px. The error is the largest distance of a centre
from where it was printed. Bright targets of `metashape20` have dots of 12 px: with dots of 8 px,
542 of them were left undecoded, none was wrong. The machine was busy.
"""
"""What the page begins with."""

_INK, _BLUR = 0.06, 0.7  # reflectance of black, and the blur of the lens, px
_WHITE, _GAMMA = 220, 2.2  # gray value of white, which is light to the power of 1 / gamma
_PAGES = 20  # of a document, to bound the memory
_FAR = 0.5  # mm; what is farther from every printed target is none of them


@dataclass(frozen=True)
class Outcome:
    """What was identified of the targets that were printed.

    Attributes
    ----------
    printed, right, wrong : int
        Targets on the pages, those with the right ID, and reports of anything else.
    error : float
        Largest distance of a right one from where it was printed, mm.
    """

    printed: int = 0
    right: int = 0
    wrong: int = 0
    error: float = 0.0

    def joined(self, other: Outcome) -> Outcome:
        """Return the outcome of both."""
        return Outcome(
            self.printed + other.printed,
            self.right + other.right,
            self.wrong + other.wrong,
            max(self.error, other.error),
        )


def settings_of(name: str, polarity: str, ids: str = '', page: str = 'A5') -> SheetSettings:
    """Return small targets of a family."""
    (kind,) = (kind for kind, names in KINDS.items() if name in names)
    radius = LARGER.get((name, polarity), RADII[kind])
    return SheetSettings(name, ids=ids, polarity=polarity, dot_radius=radius, page=page)


def sample(name: str, count: int) -> str:
    """Return `count` IDs of a family, evenly among all of them, as settings take them."""
    every = np.asarray(numbers_of(name))
    which = np.linspace(0, every.size - 1, min(count, every.size)).round().astype(int)
    return ','.join(map(str, every[which].tolist()))


def images(pages: Iterable[Drawing]) -> Iterator[np.ndarray]:
    """Yield the pages of a PDF as a camera shows them, ndarray of uint8."""
    import pypdfium2

    remaining = iter(pages)
    while some := list(islice(remaining, _PAGES)):
        with pypdfium2.PdfDocument(pdf_bytes(some, 'benchmark')) as document:
            for page in document:
                rendered = page.render(scale=SCALE * 25.4 / 72, grayscale=True).to_numpy()
                light = _INK + (1 - _INK) / 255 * rendered.squeeze().astype(np.float32)
                blurred = cv2.GaussianBlur(light, (0, 0), _BLUR)
                yield np.rint(_WHITE * blurred ** (1 / _GAMMA)).astype(np.uint8)


def identified(settings: SheetSettings) -> Outcome:
    """Print targets, render the pages and identify what they show."""
    sheets = Sheets(settings)
    detect = create_detector(family=settings.family, polarity=settings.polarity)
    outcome = Outcome()
    targets = list(sheets.targets())
    for page, image in enumerate(images(sheets.pages()), 1):
        shown = [target for target in targets if target.page == page]
        outcome = outcome.joined(_compared(shown, detect(image), image.shape, settings))
    return outcome


def _compared(
    printed: list[Placed], found: list, shape: tuple[int, int], settings: SheetSettings
) -> Outcome:
    """Return the outcome of one page."""
    height, width = shape
    paper = settings.paper
    places = {target.id: (target.x, target.y) for target in printed}
    distances: dict[int, float] = {}
    wrong = 0
    for target in found:
        x = (target.x + 0.5) * paper.width / width
        y = paper.height - (target.y + 0.5) * paper.height / height
        distance = float(np.hypot(*np.subtract(places.get(target.id, (np.inf,) * 2), (x, y))))
        if distance < _FAR and target.id not in distances:
            distances[target.id] = distance
        else:
            wrong += 1
    return Outcome(len(printed), len(distances), wrong, max(distances.values(), default=0.0))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line a family and polarity; return 1 unless every target was identified."""
    made = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    made.add_argument('--families', nargs='+', choices=FAMILY_NAMES, default=FAMILY_NAMES)
    made.add_argument('--sample', type=int, default=0, help='IDs of each family; 0: all.')
    made.add_argument('--output', type=Path, help='File for the table, in Markdown.')
    options = made.parse_args(arguments)
    every, rows = Outcome(), []
    for name in options.families:
        ids = sample(name, options.sample) if options.sample else ''
        square = name in (*KINDS['aruco'], *KINDS['apriltag'])
        for polarity in ('dark',) if square else ('dark', 'bright'):
            elapsed, of = seconds(partial(identified, settings_of(name, polarity, ids)))
            ends = number(of.error, 4), number(elapsed, 1)
            rows.append((name, polarity, of.printed, of.right, of.wrong, *ends))
            print(*rows[-1], file=sys.stderr)
            every = every.joined(of)
    head = ('family', 'polarity', 'printed', 'right', 'wrong', 'largest error, mm', 's')
    total = f'{every.printed} printed, {every.right} right, {every.wrong} wrong.'
    page = '\n'.join([HEAD, *table(head, rows), '', total])
    print(page)
    if options.output:
        options.output.write_text(page + '\n', encoding='utf-8')
    return int(every.right < every.printed or every.wrong > 0)


if __name__ == '__main__':
    sys.exit(main())
