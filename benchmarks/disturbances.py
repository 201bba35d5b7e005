"""Right and wrong IDs of targets that are covered, glossy, faint, cut off or of another family.

    python -m benchmarks.disturbances [--tables disturbances ...] [--families metashape12 ...]

Every row of the first table is a disturbance of sheets of targets; a cell has right and wrong IDs
and false positives. The second table reads the targets of each family as those of the others and
as those of all, and the photographs of the panel as well; the third reads marks that are no
targets. Seeds from 101 on are for tests: nothing in the package was chosen by looking at them.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from ahf_ros.base.target import Target, TrueTarget
from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.families.contract import Detector, Expecting
from ahf_ros.files.image_files import read_image
from ahf_ros.files.truth_files import read_truth
from ahf_ros.prints import RING_NAMES
from ahf_ros.prints.families import AUTO, KINDS
from ahf_ros.prints.ring import FAMILY_NAMES, family
from ahf_ros.scenes.evaluation import FALSE, RIGHT, WRONG, judge
from benchmarks import report
from benchmarks.report import FIRST_TEST_SEED, progress, table
from support import PHOTOS
from support.pictures.disturbed import Scene, Targets, far_apart
from support.pictures.exposure import Exposure
from support.pictures.lookalikes import LOOKALIKES, other_words
from support.pictures.sheets import COLUMNS, ROWS, mark_sheet

LOOKALIKE_COUNT = 180
"""Marks of each kind that are no targets; 6,480 of all but clutter in the usual families."""

TARGETS = (*RING_NAMES, *KINDS['aruco'], *KINDS['apriltag'])
"""Families that can be disturbed; families, look-alikes and expected IDs are of rings."""

COVERED_SECTORS = 3
"""Sectors that may be covered of targets whose IDs are chosen far apart."""

COVERED_ROWS = ('over', 'paper', 'finger', 'spot', 'highlight')
"""Parts of the names of rows whose targets are covered."""

Table = dict[str, dict[str, 'Count']]
"""Reports by row and column."""

Detect = Callable[[np.ndarray], list[Target]]
Job = tuple[str, str, Detect, Iterable[Scene]]
"""Row and column of a table, and what is identified in which scenes."""

_NO_ID = 2**31 - 1  # of any family


@dataclass(slots=True)
class Count:
    """Reports of a kind of image.

    Attributes
    ----------
    expected : int
        Targets that the images show.
    right, wrong, false : int
        IDs at the place of their target, at that of another one, and anywhere else.
    stated : list of float
        Confidences of the reports that are not right.
    seconds : float
        Time of the processor for these images.
    """

    expected: int = 0
    right: int = 0
    wrong: int = 0
    false: int = 0
    stated: list[float] = field(default_factory=list)
    seconds: float = 0.0

    def add(self, truth: Sequence[TrueTarget], targets: Sequence[Target]) -> None:
        """Add the reports of one image."""
        kinds = [verdict.kind for verdict in judge(truth, targets)]
        self.expected += len(truth)
        self.right += kinds.count(RIGHT)
        self.wrong += kinds.count(WRONG)
        self.false += kinds.count(FALSE)
        self.stated += [
            target.confidence for target, kind in zip(targets, kinds, strict=True) if kind != RIGHT
        ]

    def above(self, confidence: float) -> int:
        """Return how many reports with more than a confidence are not right."""
        return sum(stated > confidence for stated in self.stated)

    def __str__(self) -> str:
        """Return right and wrong, false positives where there are any, and the certain errors."""
        text = f'{self.right} / {self.wrong}' + (f' + {self.false}' if self.false else '')
        return text + (f' ({self.above(0.99)})' if self.above(0.99) else '')


def detector(name: str, target_family: str) -> Detector:
    """Return a detector of targets of a family."""
    return create_detector(name, settings=DetectorSettings(family=target_family))


def counted(detect: Detect, scenes: Iterable[Scene]) -> Count:
    """Return the reports of some scenes."""
    count = Count()
    for image, truth in scenes:
        started = time.process_time()
        targets = detect(image)
        count.seconds += time.process_time() - started
        count.add(truth, targets)
    return count


def disturbed(options: argparse.Namespace) -> Iterator[Job]:
    """Yield disturbances by family."""
    for name in options.families:
        detect = detector(options.detector, name)
        targets = Targets(name, options.count, options.seed, options.bright)
        for row, scenes in targets.rows():
            if not options.rows or any(part in row for part in options.rows):
                yield row, name, detect, scenes


def expected(options: argparse.Namespace) -> Iterator[Job]:
    """Yield covered targets whose IDs are a known set, chosen far apart."""
    for name in options.families:
        ids = far_apart(family(name), COVERED_SECTORS, options.seed)
        detect = detector(options.detector, name)
        if isinstance(detect, Expecting):
            detect = detect.expecting(frozenset(ids))
        targets = Targets(name, options.count, options.seed, options.bright, ids)
        for row, scenes in targets.rows():
            if any(part in row for part in options.rows or COVERED_ROWS):
                yield row, f'{name}, {len(ids)} IDs', detect, scenes


def families(options: argparse.Namespace) -> Iterator[Job]:
    """Yield targets by their family and by the family, or all, that they are read as."""
    for shown in FAMILY_NAMES:
        sheets = Targets(shown, options.count, options.seed, options.bright).sheets()
        scenes = [(sheet.photograph(Exposure()), sheet.truth) for sheet in sheets]
        yield from _read(options, shown, shown, scenes)
    folder = Path(os.environ.get('AHF_PHOTOS', PHOTOS)) / 'panel'
    if folder.exists():
        panel = read_truth(folder / 'truth.csv')
        images = [(read_image(folder / name), truth) for name, truth in panel.items()]
        yield from _read(options, 'photographs of aicon14', 'aicon14', images)


def _read(
    options: argparse.Namespace, row: str, shown: str, scenes: Sequence[Scene]
) -> Iterator[Job]:
    """Yield scenes of a family as those of every family; of another one they show no target."""
    for name in (*FAMILY_NAMES, *([AUTO] if options.detector == AUTO else [])):
        own = name in (shown, AUTO)
        detect = of_family(detector(options.detector, name), shown if own else name)
        yield row, name, detect, [(image, truth if own else []) for image, truth in scenes]


def of_family(detect: Detector, name: str) -> Detect:
    """Return a detector whose targets of other families than one have an ID that is none."""

    def detected(image: np.ndarray) -> list[Target]:
        return [it if it.family == name else replace(it, id=_NO_ID) for it in detect(image)]

    return detected


def lookalikes(options: argparse.Namespace) -> Iterator[Job]:
    """Yield marks that are no targets by their kind and the family that they are read as."""
    for kind, draw in LOOKALIKES.items():
        for name in options.families:
            if draw is other_words and name not in FAMILY_NAMES:
                continue  # these have all words
            generator = np.random.default_rng([options.seed, 3])
            inks = [draw(family(name), generator) for _ in range(LOOKALIKE_COUNT)]
            size = COLUMNS * ROWS
            sheets = [
                mark_sheet(inks[start : start + size], options.seed + start)
                for start in range(0, LOOKALIKE_COUNT, size)
            ]
            scenes = ((sheet.photograph(Exposure()), ()) for sheet in sheets)
            yield kind, name, detector(options.detector, name), scenes


TABLES: dict[str, Callable[[argparse.Namespace], Iterator[Job]]] = {
    'disturbances': disturbed,
    'expected': expected,
    'families': families,
    'look-alikes': lookalikes,
}


def time_of_all(counts: Table) -> str:
    """Return how long reading targets as those of all families takes, beside the right one."""
    right = sum(row[name.split()[-1]].seconds for name, row in counts.items())
    ratio = sum(row[AUTO].seconds for row in counts.values()) / right
    return f'all families take {ratio:.2f} times the time of the right one'


def reports(counts: Table) -> str:
    """Return how many marks that are no targets are reported, but for clutter."""
    cells = [cell for kind, row in counts.items() if kind != 'clutter' for cell in row.values()]
    return f'{sum(cell.false for cell in cells)} of {LOOKALIKE_COUNT * len(cells)} are reported'


def markdown(title: str, counts: Table) -> str:
    """Return a table as Markdown."""
    columns = list(dict.fromkeys(name for row in counts.values() for name in row))
    rows = [(name, *(row.get(column, '-') for column in columns)) for name, row in counts.items()]
    return '\n'.join(table((title, *columns), rows))


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    made = report.parser(__doc__, seeds=False)
    made.add_argument('--detector', choices=('auto', 'traditional'), default='auto')
    made.add_argument('--tables', nargs='+', choices=TABLES, default=list(TABLES))
    made.add_argument('--families', nargs='+', choices=TARGETS, default=FAMILY_NAMES)
    made.add_argument('--rows', nargs='+', default=[], help='rows with one of these in their name')
    made.add_argument('--count', type=int, default=216, help='targets of a row')
    made.add_argument('--seed', type=int, default=FIRST_TEST_SEED, help='of the first sheet')
    made.add_argument('--bright', action='store_true', help='bright targets on dark paper')
    options = made.parse_args(arguments)
    figures: report.Report = {'detector': options.detector, 'seed': options.seed}
    for name in options.tables:
        counts: Table = {}
        for row, column, detect, scenes in progress(TABLES[name](options), name):
            counts.setdefault(row, {})[column] = counted(detect, scenes)
        if name == 'families' and options.detector == AUTO:
            print(time_of_all(counts))
        if name == 'look-alikes':
            print(reports(counts))
        print(markdown(name, counts), end='\n\n', flush=True)
        figures[name] = {
            row: {column: asdict(count) for column, count in cells.items()}
            for row, cells in counts.items()
        }
    report.write(figures, options)
    return 0


if __name__ == '__main__':
    sys.exit(main())
