"""Whether each gate of a detector is worth what it costs: what dies there, and what it saves.

    python -m benchmarks.gates [--detectors ring] [--gates TEXT ...] [--pictures TEXT ...]

A gate is any comparison that drops a candidate, an outline, a dot, a reading or a word;
`gates.yaml` lists them in order. One at a time is opened, and the pictures are
identified again. For each gate: how many targets are read right only when it is open, how many
only when it is closed, how many more reports are wrong or false when it is open, and what it saves
in calls. A gate that loses more than 2 in 1,000 targets is to be loosened or goes, and so does one
that saves nothing. What works on whole arrays saves time rather than calls: the processor time is
shown as well, but depends on the machine.

The pictures are those of a folder with a `truth.csv`, photographs with truth, rendered scenes,
covered targets, and images without any. Each gate has a process of its own, and takes a minute for
twenty pictures.
"""

import argparse
import ast
import csv
import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec
from itertools import product
from pathlib import Path

import cv2
import numpy as np
from ruamel.yaml import YAML

from ahf_ros.base.target import Target, TrueTarget
from ahf_ros.files.truth_files import read_truth
from ahf_ros.prints.families import KINDS
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks import report
from benchmarks.changed import Shown, assigned, definitions
from support import PHOTOS, ROOT, environment
from support.pictures.disturbed import Targets
from support.pictures.textures import lookalikes, text_page, textured_image

YARDSTICK = ROOT.parent / 'shared' / 'yardstick'
"""Pictures that another renderer and cameras made, which are no part of the package."""

PACKAGE = 'ahf_ros.'
MAXIMUM_LOST = 0.002
"""Share of the targets that a gate may lose."""

LEAST_SAVED = 0.005
"""Share of the calls below which a gate saves nothing."""

PATIENCE = 900.0
"""Longest time for the pictures with a gate open, s."""

LIGHTS = ('normal', 'stripe', 'lattice')
SIZE, TARGETS = (1600, 1066), 20  # of a rendered scene: px

RENDERED: dict[str, tuple[tuple[str, ...], tuple[tuple[float, float], ...]]] = {
    'ring': (('metashape12', 'cct12'), ((6.0, 0.12), (10.0, 0.12), (20.0, 0.04))),
    'gsi': (('gsi',), ((3.0, 0.3), (4.0, 0.3), (6.0, 0.12))),
    'dots': (('dots',), ((6.0, 0.3), (10.0, 0.12), (20.0, 0.12))),
    'square': (('aruco_4x4_50', 'apriltag_36h11'), ((5.0, 0.3), (8.0, 0.3), (15.0, 0.3))),
    'cctag': (('cctag3',), ((8.0, 0.3), (12.0, 0.3), (20.0, 0.3))),
}
"""Families of rendered scenes by detector, and radii of dots, px, with the ambient light of each
beside the projected, where readings begin to fail."""

COVERS = 'gray 128 over 2 whole sectors', 'white over 2 sectors', '6 scratches 1 to 3 px wide'
"""What covers targets, of the disturbances of `Targets`, where readings begin to fail."""

COVERED = 72
"""Targets with each cover."""

EMPTY = {textured_image: 7, lookalikes: 7, text_page: 1}
"""What draws images without targets, and how many of them."""

SHOWN_LENGTH = 30
"""Longest value that the table shows, characters."""


@dataclass(frozen=True, slots=True)
class Gate:
    """What a gate drops, where it is in `ahf_ros`, and the expression with which it is open."""

    about: str
    place: str
    opened: str


def _listed() -> dict[str, list[Gate]]:
    """Return the gates by detector; detectors share groups of them."""
    listed = YAML(typ='safe').load(Path(__file__).with_suffix('.yaml'))
    return {
        detector: [
            Gate(*gate)
            for item in listed[detector]
            for gate in (item if isinstance(item[0], list) else [item])
        ]
        for detector in RENDERED
    }


GATES = _listed()
"""The gates by detector."""


@dataclass(frozen=True, slots=True)
class Picture:
    """An image, what it shows, and the family that it is read as."""

    name: str
    image: np.ndarray
    truth: tuple[Shown, ...]
    family: str


@dataclass(frozen=True, slots=True)
class Seen:
    """What was identified in one picture."""

    right: dict[int, float]  # errors of targets, px, by their indices into its truth
    wrong: int
    false: int
    calls: int
    seconds: float


@dataclass(slots=True)
class Difference:
    """What an open gate changes in some pictures together."""

    targets: int = 0
    gained: int = 0  # targets that are right only with the gate open
    lost: int = 0  # targets that are right only with it closed
    bad: int = 0  # more reports that are wrong or false
    calls: int = 0  # with the gate closed
    more: int = 0  # calls with the gate open
    seconds: float = 0.0  # of the processor, with the gate closed
    longer: float = 0.0  # the same with the gate open
    pictures: list[str] = field(default_factory=list)  # in which targets are gained

    @property
    def saved(self) -> float:
        """Calls that the gate saves, as a share of those without it."""
        return 1 - self.calls / self.more if self.more else 0.0

    @property
    def saved_time(self) -> float:
        """Processor time that the gate saves, as a share of that without it."""
        return 1 - self.seconds / self.longer if self.longer else 0.0

    @property
    def loses(self) -> bool:
        """Whether more targets die at the gate than may."""
        return self.gained > MAXIMUM_LOST * self.targets

    @property
    def saves_nothing(self) -> bool:
        """Whether neither calls nor reports tell that the gate is there."""
        return self.saved < LEAST_SAVED and self.bad <= 0 and self.lost == 0


def kind_of_detector(family: str) -> str:
    """Return which gates the targets of a family come to."""
    kinds = [kind for kind, names in KINDS.items() if family in names]
    square = {'aruco': 'square', 'apriltag': 'square'}
    return square.get(kinds[0], kinds[0]) if kinds else family


def chosen(name: str, texts: Sequence[str]) -> bool:
    """Return whether a name has one of some texts in it; no texts choose all."""
    return not texts or any(text in name for text in texts)


def pictures_of_folder(folder: Path, detector: str, texts: Sequence[str]) -> Iterator[Picture]:
    """Yield the chosen pictures of a folder with a truth.csv: file, family, id, x, y."""
    file = folder / 'truth.csv'
    shown: dict[tuple[str, str], list[Shown]] = defaultdict(list)
    if file.is_file():
        with file.open(newline='') as rows:
            for row in csv.DictReader(rows):
                x, y = (float(row[of]) if row[of] else None for of in ('x', 'y'))
                targets = shown[row['file'], row['family']]
                targets += [(row['id'], x, y)] if row['id'] else []
    for (file_name, family), truth in shown.items():
        name = f'yardstick {file_name}'
        if kind_of_detector(family) == detector and chosen(name, texts):
            image = cv2.imread(str(folder / 'images' / file_name), cv2.IMREAD_GRAYSCALE)
            assert image is not None, file_name
            yield Picture(name, image, tuple(truth), family)


def _shown(targets: Sequence[Target | TrueTarget]) -> tuple[Shown, ...]:
    """Return targets as pictures have them."""
    return tuple((str(it.id), it.x, it.y) for it in targets)


def photographs(texts: Sequence[str]) -> Iterator[Picture]:
    """Yield the chosen photographs of the panel, if they are there."""
    panel = PHOTOS / 'panel'
    for file_name, targets in read_truth(panel / 'truth.csv').items() if panel.is_dir() else ():
        name = f'photograph {file_name}'
        if chosen(name, texts):
            image = cv2.imread(str(panel / file_name), cv2.IMREAD_GRAYSCALE)
            assert image is not None, file_name
            yield Picture(name, image, _shown(targets), 'aicon14')


def rendered(
    detector: str,
    seeds: Sequence[int],
    texts: Sequence[str],
    *,
    lights: Sequence[str] = LIGHTS,
    size: tuple[int, int] = SIZE,
    targets: int = TARGETS,
) -> Iterator[Picture]:
    """Yield the chosen scenes by family, seed, light, and size with ambient light."""
    for family, seed, light, (radius, ambient) in product(
        RENDERED[detector][0], seeds, lights, RENDERED[detector][1]
    ):
        name = f'rendered {family} {radius:g} {light} {seed}'
        if not chosen(name, texts):
            continue
        settings = SceneSettings(
            width=size[0],
            height=size[1],
            targets=targets,
            distractors=8,
            family=family,
            dot_radius=radius,
            light=light,
            ambient=0.3 if light == 'normal' else ambient,
            seed=seed,
        )
        scene = render(settings)
        yield Picture(name, scene.image, _shown(scene.targets), family)


def covered(detector: str, seeds: Sequence[int], texts: Sequence[str]) -> Iterator[Picture]:
    """Yield the chosen sheets of covered rings or squares by family, seed and cover."""
    families = RENDERED[detector][0] if detector in ('ring', 'square') else ()
    for family, seed in product(families, seeds):
        for cover, scenes in Targets(family, COVERED, seed).rows():
            name = f'{cover} {family} {seed}'
            if cover not in COVERS or not chosen(name, texts):
                continue
            for image, targets in scenes:
                yield Picture(name, image, _shown(targets), family)


def empty(detector: str, seeds: Sequence[int], texts: Sequence[str]) -> Iterator[Picture]:
    """Yield the chosen images without targets by what draws them and seed."""
    for (draw, count), seed in product(EMPTY.items(), seeds):
        for number in range(count):
            name = f'{draw.__name__} {seed} {number}'
            if chosen(name, texts):
                yield Picture(name, draw(100 * seed + number), (), RENDERED[detector][0][0])


def pictures(
    detector: str, seeds: Sequence[int], folder: Path, texts: Sequence[str]
) -> Iterator[Picture]:
    """Yield the pictures for a detector whose names have one of some texts in them."""
    yield from pictures_of_folder(folder, detector, texts)
    if detector == 'ring':
        yield from photographs(texts)
    yield from rendered(detector, seeds, texts)
    yield from covered(detector, seeds, texts)
    yield from empty(detector, seeds, texts)


def written(some: Sequence[Picture], folder: Path) -> dict[str, Picture]:
    """Write pictures into a folder, and return them by the names of their files."""
    named = {f'{number:03}': picture for number, picture in enumerate(some)}
    for name, picture in named.items():
        truth = json.dumps(picture.truth)
        np.savez(folder / name, image=picture.image, truth=truth, family=picture.family)
    return named


def seen(folder: Path, gate: Gate | None = None) -> dict[str, Seen]:
    """Return what is identified in the pictures in a folder, perhaps with a gate open.

    Pictures that are not done in time, or whose detector does not work then, are missing.
    """
    changed = ('--', PACKAGE + gate.place, gate.opened) if gate else ()  # which may be negative
    command = [sys.executable, '-m', 'benchmarks.changed', str(folder), *changed]
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        env=environment(OPENBLAS_NUM_THREADS='1'),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        output, errors = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        output, errors = process.communicate()
    if process.returncode > 0:
        print(errors, end='', file=sys.stderr)
    found = {}
    for line in output.splitlines():
        values = json.loads(line)
        name = values.pop('picture')
        values['right'] = {int(index): error for index, error in values['right'].items()}
        found[name] = Seen(**values)
    return found


def difference(
    closed: dict[str, Seen], opened: dict[str, Seen], named: dict[str, Picture]
) -> Difference:
    """Return what an open gate changes in the pictures that were done in time."""
    made = Difference()
    for name in closed.keys() & opened.keys():
        before, after = closed[name], opened[name]
        gained = len(after.right.keys() - before.right.keys())
        made.targets += len(named[name].truth)
        made.gained += gained
        made.lost += len(before.right.keys() - after.right.keys())
        made.bad += after.wrong + after.false - before.wrong - before.false
        made.calls += before.calls
        made.more += after.calls
        made.seconds += before.seconds
        made.longer += after.seconds
        made.pictures += [named[name].name] if gained else []
    return made


def value_of(place: str) -> str:
    """Return the source of the value of a name of the package; KeyError if there is none."""
    module, _, name = place.partition(':')
    spec = find_spec(PACKAGE + module)
    if spec is None or spec.origin is None:
        raise KeyError(place)
    scope: ast.Module | ast.FunctionDef | ast.ClassDef = ast.parse(Path(spec.origin).read_text())
    *scopes, last = name.split('.')
    for outer in scopes:
        scope = definitions(scope)[outer]
    if last in definitions(scope):
        return 'a function'
    values: list[ast.expr] = []
    for node in scope.body:
        before = assigned(ast.Module([node], []))
        if last in before:
            values.append(_value(node, last))
    if not values:
        raise KeyError(place)
    return ast.unparse(values[-1])


def _value(node: ast.stmt, name: str) -> ast.expr:
    """Return what a statement assigns to a name."""
    assert isinstance(node, (ast.Assign, ast.AnnAssign)) and node.value is not None
    target = node.targets[0] if isinstance(node, ast.Assign) else node.target
    if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
        names = [it.id if isinstance(it, ast.Name) else '' for it in target.elts]
        return node.value.elts[names.index(name)]
    return node.value


def row(gate: Gate, of: Difference, done: int, every: int) -> tuple[str, ...]:
    """Return the cells of a gate, whose pictures were not all done in time perhaps."""
    value = value_of(gate.place)
    said = [
        text for text, holds in (('loses', of.loses), ('saves nothing', of.saves_nothing)) if holds
    ]
    if done < every:
        said.append(f'{done} of {every} pictures' if done else 'does not work open')
    return (
        gate.about,
        f'`{gate.place}`',
        _short(value),
        'none' if value == 'a function' else _short(gate.opened),
        f'{of.gained}',
        f'{of.lost}',
        f'{of.bad:+d}',
        f'{100 * of.saved:.1f} %',
        f'{100 * of.saved_time:.0f} %',
        ', '.join(said),
    )


def _short(text: str) -> str:
    """Return a text that is not too long for a table, as code."""
    return f'`{text}`' if len(text) <= SHOWN_LENGTH else f'`{text[:SHOWN_LENGTH]}`...'


HEAD = (
    'gate',
    'place',
    'value',
    'open',
    'right only open',
    'right only closed',
    'wrong or false, open',
    'calls saved',
    'time',
    '',
)


def measured(
    detector: str, named: dict[str, Picture], gates: Sequence[Gate], folder: Path
) -> report.Report:
    """Return the figures of some gates of a detector as JSON has them."""
    closed = seen(folder)
    rows = []
    for gate in report.progress(gates, detector):
        opened = seen(folder, gate)
        made = difference(closed, opened, named)
        rows.append(row(gate, made, len(closed.keys() & opened.keys()), len(named)))
        print(' | '.join(rows[-1]), *made.pictures, sep='\n    ', file=sys.stderr, flush=True)
    return {
        'detector': detector,
        'pictures': [picture.name for picture in named.values()],
        'targets': sum(len(picture.truth) for picture in named.values()),
        'right': sum(len(of.right) for of in closed.values()),
        'wrong or false': sum(of.wrong + of.false for of in closed.values()),
        'calls': sum(of.calls for of in closed.values()),
        'rows': rows,
    }


def markdown(figures: report.Report) -> str:
    """Return the page of a report."""
    lines = [f'Commit {figures["commit"]}. {report.about_text(figures)}']
    for of in figures['detectors']:
        about = (
            f'`{of["detector"]}`: {len(of["pictures"])} pictures. As it is, {of["right"]} of '
            f'{of["targets"]} targets are right and {of["wrong or false"]} reports wrong or '
            f'false, with {of["calls"]:,} calls.'
        )
        shown = f'Pictures: {", ".join(of["pictures"])}.'
        lines += ['', about, '', *report.table(HEAD, of['rows']), '', shown]
    return '\n'.join(lines)


def commit() -> str:
    """Return what the sources are, as git names it; 'unknown' where there is no git."""
    command = ['git', 'describe', '--always', '--dirty']
    done = subprocess.run(command, cwd=ROOT, check=False, capture_output=True, text=True)
    return done.stdout.strip() or 'unknown'


def measure(options: argparse.Namespace) -> report.Report:
    """Return the figures of the detectors, gates and pictures that are asked for."""
    found = []
    for detector in options.detectors:
        some = list(pictures(detector, options.seeds, options.yardstick, options.pictures))
        gates = [it for it in GATES[detector] if chosen(f'{it.about} {it.place}', options.gates)]
        if some and gates:
            with tempfile.TemporaryDirectory() as folder:
                named = written(some, Path(folder))
                found.append(measured(detector, named, gates, Path(folder)))
    return {'commit': commit(), 'detectors': found}


def main() -> int:
    """Print a table for each detector."""
    parser = report.parser(__doc__)
    parser.add_argument('--detectors', nargs='+', choices=sorted(GATES), default=list(GATES))
    parser.add_argument('--gates', nargs='+', default=[], metavar='TEXT', help='default: all')
    parser.add_argument('--pictures', nargs='+', default=[], metavar='TEXT', help='default: all')
    parser.add_argument('--yardstick', type=Path, default=YARDSTICK, metavar='FOLDER')
    return report.run(parser, measure, markdown)


if __name__ == '__main__':
    sys.exit(main())
