"""Printed sheets, rendered as a camera shows them, and what is identified on them."""

import math
from collections.abc import Iterable, Iterator
from itertools import islice

import cv2
import numpy as np

from ahf_ros import DetectorSettings, create_detector
from ahf_ros.base.target import TrueTarget
from ahf_ros.prints.families import KINDS, print_in
from ahf_ros.prints.printing.drawing import Drawing
from ahf_ros.prints.printing.files import pdf_bytes
from ahf_ros.prints.printing.settings import SheetSettings
from ahf_ros.prints.printing.sheets import Sheets
from ahf_ros.scenes.evaluation import Score, score, total

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
    search = DetectorSettings(family=settings.family, polarity=settings.polarity)
    detect = create_detector(settings=search)
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
