"""Right and wrong IDs of targets that are covered, glossy, faint, cut off or of another family.

    python -m benchmarks.disturbances [--tables disturbances ...] [--families metashape12 ...]

Every row of the first table is a disturbance of sheets of targets; a cell has right and wrong IDs
and false positives. The second table reads the targets of each family as those of the others and
as those of all, and the photographs of the panel as well; the third reads marks that are no
targets. Seeds from 101 on are for tests: nothing in the package was chosen by looking at them.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from ahf_ros.codes.cyclic import smallest_rotation
from ahf_ros.codes.families import AUTO, KINDS
from ahf_ros.codes.ring import FAMILY_NAMES, Family, family
from ahf_ros.detectors import DetectorSettings, create_detector
from ahf_ros.detectors.contract import Detector, Expecting
from ahf_ros.evaluation import FALSE, RIGHT, WRONG, judge
from ahf_ros.interchange.image_files import read_image
from ahf_ros.interchange.truth_files import read_truth
from ahf_ros.target import Target, TrueTarget
from benchmarks import report
from benchmarks.disturbed import Scene, Targets
from benchmarks.exposure import Exposure
from benchmarks.lookalikes import LOOKALIKES
from benchmarks.report import FIRST_TEST_SEED, progress, table
from benchmarks.sheets import COLUMNS, ROWS, mark_sheet
from support import PHOTOS

LOOKALIKE_COUNT = 300
"""Marks of each kind that are no targets."""

TARGETS = (*FAMILY_NAMES, *KINDS['aruco'], *KINDS['apriltag'])
"""Families that can be disturbed; families, look-alikes and expected IDs are of rings."""

COVERED_SECTORS = 3
"""Sectors that may be covered of targets whose IDs are chosen far apart."""

COVERED_ROWS = ('over', 'paper', 'finger', 'spot', 'highlight')
"""Parts of the names of rows whose targets are covered."""

Table = dict[str, dict[str, 'Count']]
"""Reports by row and column."""

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

    def join(self, other: Count) -> None:
        """Add the reports of other images."""
        self.expected += other.expected
        self.right += other.right
        self.wrong += other.wrong
        self.false += other.false
        self.stated += other.stated
        self.seconds += other.seconds

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


def counted(detect: Callable[[np.ndarray], list[Target]], scenes: Iterable[Scene]) -> Count:
    """Return the reports of some scenes."""
    count = Count()
    for image, truth in scenes:
        started = time.process_time()
        targets = detect(image)
        count.seconds += time.process_time() - started
        count.add(truth, targets)
    return count


def disturbance_table(options: argparse.Namespace) -> Table:
    """Return the reports by disturbance and family."""
    made: Table = {}
    for name in options.families:
        detect = detector(options.detector, name)
        targets = Targets(name, options.count, options.seed, options.bright)
        for row, scenes in progress(targets.rows(), name):
            if not options.rows or any(part in row for part in options.rows):
                made.setdefault(row, {})[name] = counted(detect, scenes)
    return made


def far_apart(code: Family, sectors: int, seed: int) -> tuple[int, ...]:
    """Return IDs that cannot look alike, up to a number of sectors of each covered.

    Parameters
    ----------
    code : Family
    sectors : int
        Largest number of neighbouring sectors that are covered.
    seed : int
        Of the order in which IDs are tried.
    """
    windows = [
        sum(1 << (start + step) % code.bits for step in range(count))
        for count in range(sectors + 1)
        for start in range(code.bits)
    ]
    seen: set[int] = set()
    chosen = []
    for index in np.random.default_rng([seed, 8]).permutation(len(code.words)).tolist():
        left = code.words[index] & ~np.array(windows)
        looks = set(smallest_rotation(left, code.bits).tolist())
        if not looks & seen:
            chosen.append(index + 1)
            seen |= looks
    return tuple(sorted(chosen))


def expected_table(options: argparse.Namespace) -> Table:
    """Return the reports of covered targets whose IDs are a known set, chosen far apart."""
    made: Table = {}
    for name in options.families:
        ids = far_apart(family(name), COVERED_SECTORS, options.seed)
        detect = detector(options.detector, name)
        if isinstance(detect, Expecting):
            detect = detect.expecting(frozenset(ids))
        targets = Targets(name, options.count, options.seed, options.bright, ids)
        for row, scenes in progress(targets.rows(), name):
            if any(part in row for part in options.rows or COVERED_ROWS):
                made.setdefault(row, {})[f'{name}, {len(ids)} IDs'] = counted(detect, scenes)
    return made


def family_table(options: argparse.Namespace) -> Table:
    """Return the reports by family of the targets and family, or all, that they are read as."""
    made: Table = {}
    read_as = (*FAMILY_NAMES, *([AUTO] if options.detector == AUTO else []))
    for shown in progress(FAMILY_NAMES, 'families'):
        sheets = Targets(shown, options.count, options.seed, options.bright).sheets()
        scenes = [(sheet.photograph(Exposure()), sheet.truth) for sheet in sheets]
        for name in read_as:
            detect = of_family(detector(options.detector, name), shown if name == AUTO else name)
            seen = ((image, truth if name in (shown, AUTO) else []) for image, truth in scenes)
            made.setdefault(shown, {})[name] = counted(detect, seen)
    folder = Path(os.environ.get('AHF_PHOTOS', PHOTOS)) / 'panel'
    panel = read_truth(folder / 'truth.csv') if folder.exists() else {}
    for photograph, truth in progress(panel.items(), 'photographs'):
        image = read_image(folder / photograph)
        row = made.setdefault('photographs of aicon14', {})
        for name in read_as:
            expected = truth if name in ('aicon14', AUTO) else []
            detect = of_family(
                detector(options.detector, name), 'aicon14' if name == AUTO else name
            )
            row.setdefault(name, Count()).join(counted(detect, [(image, expected)]))
    if AUTO in read_as:
        own = {**{name: name for name in FAMILY_NAMES}, 'photographs of aicon14': 'aicon14'}
        one = sum(made[row][own[row]].seconds for row in made)
        print(
            f'all families take {sum(row[AUTO].seconds for row in table.values()) / one:.2f} '
            'times the time of the right one'
        )
    return made


def of_family(detect: Detector, name: str) -> Callable[[np.ndarray], list[Target]]:
    """Return a detector whose targets of other families than one have an ID that is none."""

    def detected(image: np.ndarray) -> list[Target]:
        return [it if it.family == name else replace(it, id=_NO_ID) for it in detect(image)]

    return detected


def lookalike_table(options: argparse.Namespace) -> Table:
    """Return the reports by kind of mark and family that it is read as."""
    made: Table = {}
    for kind, draw in progress(LOOKALIKES.items(), 'look-alikes'):
        for name in options.families:
            generator = np.random.default_rng([options.seed, 3])
            inks = [draw(family(name), generator) for _ in range(LOOKALIKE_COUNT)]
            size = COLUMNS * ROWS
            sheets = [
                mark_sheet(inks[start : start + size], options.seed + start)
                for start in range(0, LOOKALIKE_COUNT, size)
            ]
            scenes = ((sheet.photograph(Exposure()), ()) for sheet in sheets)
            made.setdefault(kind, {})[name] = counted(detector(options.detector, name), scenes)
    return made


TABLES: dict[str, Callable[[argparse.Namespace], Table]] = {
    'disturbances': disturbance_table,
    'expected': expected_table,
    'families': family_table,
    'look-alikes': lookalike_table,
}


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
        counts = TABLES[name](options)
        print(markdown(name, counts), end='\n\n', flush=True)
        figures[name] = {
            row: {column: asdict(count) for column, count in cells.items()}
            for row, cells in counts.items()
        }
    report.write(figures, options)
    return 0


if __name__ == '__main__':
    sys.exit(main())
