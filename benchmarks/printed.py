"""Prints the targets of every family, renders the PDF, and identifies them.

.venv/bin/python -m benchmarks.printed --output docs/figures/printed.md
.venv/bin/python -m benchmarks.printed --families metashape12 gsi --sample 50
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from ahf_ros import FAMILY_NAMES, create_detector
from ahf_ros.codes.families import KINDS, print_in
from ahf_ros.evaluation import Score, score, total
from ahf_ros.printing.drawing import Drawing
from ahf_ros.printing.files import pdf_bytes
from ahf_ros.printing.settings import SheetSettings
from ahf_ros.printing.sheets import Sheets
from ahf_ros.target import TrueTarget
from benchmarks.report import number, table
from benchmarks.speed import seconds

SCALE = 8.0
"""Pixels of a rendered page in a millimetre."""

RADII = {
    'ring': '1mm',
    'gsi': '0.5mm',
    'dots': '1.25mm',
    'cctag': '3mm',
    'aruco': '1.5mm',
    'apriltag': '1.5mm',
}
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
_FAR = 4.0  # px; what is farther from every printed target is none of them


def settings_of(name: str, polarity: str, ids: str = '', page: str = 'A5') -> SheetSettings:
    """Return small targets of a family."""
    (kind,) = (kind for kind, names in KINDS.items() if name in names)
    radius = LARGER.get((name, polarity), RADII[kind])
    return SheetSettings(name, ids=ids, polarity=polarity, dot_radius=radius, page=page)


def sample(name: str, count: int) -> str:
    """Return `count` IDs of a family, evenly among all of them, as settings take them."""
    every = np.asarray(print_in(name).design.all_ids)
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


def identified(settings: SheetSettings) -> Score:
    """Print targets, render the pages and identify what they show."""
    sheets, paper = Sheets(settings), settings.paper
    detect = create_detector(family=settings.family, polarity=settings.polarity)
    targets, scores = list(sheets.targets()), []
    for page, image in enumerate(images(sheets.pages()), 1):
        down, across = image.shape[0] / paper.height, image.shape[1] / paper.width
        truth = [
            TrueTarget(it.id, it.x * across - 0.5, (paper.height - it.y) * down - 0.5)
            for it in targets
            if it.page == page
        ]
        scores.append(score(truth, detect(image), tolerance=_FAR))
    return total(scores)


def largest_error(figures: Score) -> float:
    """Return the largest distance of a right target from where it was printed, mm."""
    return max((math.hypot(*error) / SCALE for error in figures.errors), default=0.0)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line a family and polarity; return 1 unless every target was identified."""
    made = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    made.add_argument('--families', nargs='+', choices=FAMILY_NAMES, default=FAMILY_NAMES)
    made.add_argument('--sample', type=int, default=0, help='IDs of each family; 0: all.')
    made.add_argument('--output', type=Path, help='File for the table, in Markdown.')
    options = made.parse_args(arguments)
    scores, rows = [], []
    for name in options.families:
        ids = sample(name, options.sample) if options.sample else ''
        square = name in (*KINDS['aruco'], *KINDS['apriltag'])
        for polarity in ('dark',) if square else ('dark', 'bright'):
            elapsed, of = seconds(partial(identified, settings_of(name, polarity, ids)))
            wrong = of.wrong + of.false_positives
            ends = number(largest_error(of), 4), number(elapsed, 1)
            rows.append((name, polarity, of.expected, of.right, wrong, *ends))
            print(*rows[-1], file=sys.stderr)
            scores.append(of)
    every = total(scores)
    wrong = every.wrong + every.false_positives
    head = ('family', 'polarity', 'printed', 'right', 'wrong', 'largest error, mm', 's')
    summary = f'{every.expected} printed, {every.right} right, {wrong} wrong.'
    page = '\n'.join([HEAD, *table(head, rows), '', summary])
    print(page)
    if options.output:
        options.output.write_text(page + '\n', encoding='utf-8')
    return int(every.right < every.expected or wrong > 0)


if __name__ == '__main__':
    sys.exit(main())
