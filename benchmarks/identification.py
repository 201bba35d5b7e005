"""How many targets are identified, how exactly and how fast: lights, families, views and sizes.

Every row is a kind of scene, rendered with the given seeds. The seeds from 101 on are for tests:
nothing in the package was chosen by looking at them. Those below are for development, and a table
is of one kind or the other. The panel is a set of photographs and is shown where it is there.

    python -m benchmarks.identification [--detector ring] [--ahf] [--quick] [--lights stripe ...]
    python -m benchmarks.identification --compare docs/figures/ring.json
    python -m benchmarks.identification --command 'my_detector --family {family} {image}'

A command is used as the detector `command` does; its time includes its start.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from statistics import mean, median
from typing import Any

import cv2
import numpy as np
from rich.console import Console
from rich.progress import track

from ahf_ros.codes.ring import FAMILY_NAMES
from ahf_ros.detectors import DETECTOR_NAMES, DetectorSettings, create_detector
from ahf_ros.evaluation import RIGHT, Score, judge, score, total
from ahf_ros.interchange.image_files import read_image
from ahf_ros.interchange.truth_files import read_truth
from ahf_ros.session import identify
from ahf_ros.synthetic.patterns import LIGHT_NAMES, benchmark_lights
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import Target, TrueTarget
from benchmarks import comparison
from benchmarks.filter import machine
from support import PHOTOS

FIRST_TEST_SEED = 101
"""Seeds below this one are for development."""

PATIENCE = 600.0
"""Longest time for one image, s, of a command."""

QUICK = {'width': 1200, 'height': 900, 'targets': 6}

Seen = tuple[Sequence[Target], float]
"""What was identified in an image, and the time that it took, s."""

Identify = Callable[[np.ndarray, str, int], Seen]
"""From an image, the family of its targets and their number."""


@dataclass(slots=True)
class Row:
    """What one kind of scene gave.

    Attributes
    ----------
    group, name : str
        What is varied, and its value.
    scores : list of Score
        One an image.
    squares : list of float
        Squared errors of the centres, each in units of its own covariance; 2 on average where
        covariances are right.
    seconds, contours : list of float
        Times of identification, and of the plain search for contours and ellipses, one an image.
    """

    group: str
    name: str
    scores: list[Score] = field(default_factory=list)
    squares: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    contours: list[float] = field(default_factory=list)

    def add(self, image: np.ndarray, truth: Sequence[TrueTarget | Target], seen: Seen) -> None:
        """Add what was identified in one image."""
        targets, seconds = seen
        self.scores.append(score(truth, targets))
        self.squares += normalised_squares(truth, targets)
        self.seconds.append(seconds)
        self.contours.append(contour_seconds(image))

    def record(self) -> dict[str, Any]:
        """Return the figures as JSON has them."""
        figures = total(self.scores)
        x, y, both = figures.rmse or (None, None, None)
        return {
            'group': self.group,
            'name': self.name,
            'images': len(self.scores),
            'expected': figures.expected,
            'right': figures.right,
            'wrong': figures.wrong,
            'false_positives': figures.false_positives,
            'rmse_x': x,
            'rmse_y': y,
            'rmse_xy': both,
            'nees': mean(self.squares) if self.squares else None,
            'seconds': median(self.seconds),
            'times_contours': median(
                own / plain for own, plain in zip(self.seconds, self.contours, strict=True)
            ),
        }


def scenes(options: argparse.Namespace) -> Iterator[tuple[str, str, SceneSettings]]:
    """Yield group, name and scene of every row that is asked for."""
    base = SceneSettings(**QUICK) if options.quick else SceneSettings()
    for light, ambient in benchmark_lights():
        yield 'light', f'{light} {ambient:g}', replace(base, light=light, ambient=ambient)
    for family in FAMILY_NAMES[1:]:
        yield 'family', f'{family} normal', replace(base, family=family)
        for light in ('stripe', 'lattice'):
            scene = replace(base, family=family, light=light, ambient=0.12)
            yield 'family', f'{family} {light} 0.12', scene
    for light in ('normal', 'stripe', 'lattice'):
        yield 'polarity', f'bright {light} 0.3', replace(base, polarity='bright', light=light)
    for tilt in (30, 45, 62, 70):
        yield 'tilt', f'{tilt} deg', replace(base, tilt=float(tilt), focal_length=3.0)
    for radius in (5, 7, 10, 30):
        yield 'radius', f'{radius} px', replace(base, dot_radius=float(radius))
    marks = 20 if options.quick else 100
    for light in ('normal', 'stripe', 'lattice'):
        scene = replace(base, targets=0, distractors=marks, light=light)
        yield 'no targets', f'{light} 0.3', scene


def chosen_scenes(options: argparse.Namespace) -> list[tuple[str, str, SceneSettings]]:
    """Return the rows of the groups and lights that are asked for."""
    return [
        (group, name, scene)
        for group, name, scene in scenes(options)
        if group in options.groups and scene.light in options.lights
    ]


def with_detector(options: argparse.Namespace) -> Identify:
    """Return identification by a detector of the package, driven by AHF or not."""

    def run(image: np.ndarray, family: str, expected: int) -> Seen:
        detector = create_detector(options.detector, settings=DetectorSettings(family=family))
        detector(image[:400, :400])  # tables that are made once are not timed
        found = identify(image, detector=detector, expected_targets=expected if options.ahf else 0)
        return found.targets, found.filter.duration

    return run


def with_command(options: argparse.Namespace) -> Identify:
    """Return identification by another program."""

    def run(image: np.ndarray, family: str, expected: int) -> Seen:
        command = options.command.replace('{family}', family).replace('{expected}', str(expected))
        settings = DetectorSettings(command=command, detector_timeout=PATIENCE)
        detector = create_detector('command', settings=settings)
        started = time.perf_counter()
        return detector(image), time.perf_counter() - started

    return run


def normalised_squares(
    truth: Sequence[TrueTarget | Target], targets: Sequence[Target]
) -> list[float]:
    """Return e C^-1 e of the errors e of the right targets that have a covariance C."""
    squares = []
    for verdict, target in zip(judge(truth, targets), targets, strict=True):
        covariance = np.reshape(target.covariance, (2, 2))
        if verdict.kind == RIGHT and verdict.target and np.linalg.det(covariance) > 0:
            error = np.array((target.x - verdict.target.x, target.y - verdict.target.y))
            squares.append(float(error @ np.linalg.solve(covariance, error)))
    return squares


def contour_seconds(image: np.ndarray) -> float:
    """Return the time of the plain search for ellipses: edges, contours, a fit to each."""
    started = time.perf_counter()
    edges = cv2.Canny(image, 50, 150)
    contours, _ = cv2.findContours(edges, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    for contour in contours:
        if len(contour) >= 20:
            cv2.fitEllipse(contour)
    return time.perf_counter() - started


def synthetic_rows(options: argparse.Namespace, run: Identify) -> list[Row]:
    """Render and identify every scene with every seed."""
    rows = [(Row(group, name), scene) for group, name, scene in chosen_scenes(options)]
    jobs = [(row, replace(scene, seed=seed)) for row, scene in rows for seed in options.seeds]
    for row, scene in track(jobs, 'scenes', console=Console(stderr=True)):
        rendering = render(scene)
        truth = rendering.targets
        row.add(rendering.image, truth, run(rendering.image, scene.family, len(truth)))
    return [row for row, _ in rows]


def panel_rows(folder: Path, run: Identify) -> list[Row]:
    """Identify the photographs of the panel, if they are there."""
    truth_path = folder / 'panel' / 'truth.csv'
    if not truth_path.exists():
        return []
    row = Row('photographs', 'panel aicon14')
    truth = read_truth(truth_path)
    for name, targets in track(truth.items(), 'panel', console=Console(stderr=True)):
        image = read_image(truth_path.parent / name)
        shown = sum(target.confirmed for target in targets)
        row.add(image, targets, run(image, 'aicon14', shown))
    return [row]


def markdown(report: dict[str, Any]) -> str:
    """Return the report as a table."""
    facts = report['machine']
    kind = 'Test' if report['test'] else 'Development'
    seeds = ', '.join(map(str, report['seeds']))
    head = ('', '', 'd of N', 'wrong', 'false', 'RMSE X', 'Y', 'XY', 'NEES', 's', '/ contours')
    lines = [
        f'{report["method"]}, {report["width"]} x {report["height"]} px. {kind} seeds: {seeds}. '
        f'{facts["processor"]}, {facts["cores"]} cores, Python {facts["python"]}, numpy '
        f'{facts["numpy"]}, OpenCV {facts["opencv"]}.',
        '',
        f'| {" | ".join(head)} |',
        '|---' * len(head) + '|',
    ]
    for row in report['rows']:
        numbers = [
            '-' if row[name] is None else f'{row[name]:.{digits}f}'
            for name, digits in (
                ('rmse_x', 3),
                ('rmse_y', 3),
                ('rmse_xy', 3),
                ('nees', 1),
                ('seconds', 2),
                ('times_contours', 1),
            )
        ]
        counts = f'{row["right"]} of {row["expected"]}'
        cells = [row['group'], row['name'], counts, row['wrong'], row['false_positives'], *numbers]
        lines.append(f'| {" | ".join(map(str, cells))} |')
    return '\n'.join(lines)


def are_tests(seeds: Sequence[int]) -> bool:
    """Return whether seeds are for tests, not for development; ValueError where they mix."""
    tests = {seed >= FIRST_TEST_SEED for seed in seeds}
    if len(tests) > 1:
        raise ValueError(f'seeds are {seeds}, accepted are all below {FIRST_TEST_SEED} or none')
    return tests == {True}


def parser() -> argparse.ArgumentParser:
    """Return what can be chosen."""
    made = argparse.ArgumentParser(
        description=__doc__.split('\n\n')[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    groups = ('light', 'family', 'polarity', 'tilt', 'radius', 'no targets', 'photographs')
    method = made.add_mutually_exclusive_group()
    method.add_argument('--detector', choices=DETECTOR_NAMES, default='ring')
    method.add_argument('--command', help='another program; {image}, {family}, {expected}')
    made.add_argument('--ahf', action='store_true', help='search for filters, N being given')
    made.add_argument('--quick', action='store_true', help='small images with nine targets')
    made.add_argument('--lights', nargs='+', choices=LIGHT_NAMES, default=LIGHT_NAMES)
    made.add_argument('--groups', nargs='+', choices=groups, default=groups)
    made.add_argument('--seeds', nargs='+', type=int, default=[FIRST_TEST_SEED])
    made.add_argument('--json', type=Path, metavar='FILE', help='also write a JSON object')
    made.add_argument(
        '--compare', type=Path, metavar='FILE', help='an earlier JSON object to show beside'
    )
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    options = parser().parse_args(arguments)
    try:
        test = are_tests(options.seeds)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    size = asdict(SceneSettings(**QUICK) if options.quick else SceneSettings())
    report: dict[str, Any] = {
        'method': options.command or options.detector + (' with AHF' if options.ahf else ''),
        'width': size['width'],
        'height': size['height'],
        'seeds': options.seeds,
        'test': test,
        'machine': machine(),
    }
    before = json.loads(options.compare.read_text()) if options.compare else None
    if before:
        try:
            comparison.check_comparable(before, report)
        except ValueError as error:
            print(error, file=sys.stderr)
            return 2
    run = with_command(options) if options.command else with_detector(options)
    rows = synthetic_rows(options, run)
    if 'photographs' in options.groups:
        rows += panel_rows(PHOTOS, run)
    report['rows'] = [row.record() for row in rows]
    if options.json:
        options.json.write_text(json.dumps(report, indent=1))
    if before:
        print(comparison.markdown(before, report))
        return int(bool(comparison.worse(before, report)))
    print(markdown(report))
    return 0


if __name__ == '__main__':
    sys.exit(main())
