"""`ahf identify`: the coded targets in image files: files, folders, patterns and lists."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, redirect_stdout
from glob import glob, has_magic
from pathlib import Path
from typing import Any, TextIO

from rich.console import Console
from rich.progress import Progress

from ahf_ros.batch.engine import Engine, EngineLost, available_cores
from ahf_ros.batch.identification import (
    ImageOutcome,
    ImageTask,
    detector_of,
    identify_images,
    with_machine,
)
from ahf_ros.batch.results import (
    Results,
    Unwritable,
    kept_outcomes_in_order,
    outcomes_in_order,
)
from ahf_ros.cli.engines import create_engine, shared_settings
from ahf_ros.cli.export import control_from, write_exports
from ahf_ros.cli.export_options import check_control
from ahf_ros.cli.identify_options import stacked
from ahf_ros.cli.options import settings_from
from ahf_ros.cli.outcomes import overlay_path, print_outcome
from ahf_ros.codes.families import AUTO, LISTED
from ahf_ros.interchange.export.survey import MeasuredImage, measured_image
from ahf_ros.interchange.files import read_text
from ahf_ros.interchange.image_files import SUFFIXES
from ahf_ros.interchange.urls import is_url, urls_named
from ahf_ros.session import create_identifier
from ahf_ros.session_settings import IdentificationSettings, StackSettings
from ahf_ros.target import UNDECODED
from ahf_ros.text import shown


def run(options: argparse.Namespace) -> int:
    """Identify, print and draw each image or stack, independently of those before it.

    Returns
    -------
    int
        0, or 1 if a file could not be read or written.

    Raises
    ------
    ValueError
        If options contradict each other.
    """
    output = sys.stdout
    with redirect_stdout(sys.stderr):  # what other detectors print is not JSON
        return _run(options, output)


def _run(options: argparse.Namespace, output: TextIO) -> int:
    settings = settings_from(options, IdentificationSettings)
    check_control(options)
    if options.upright and options.export:
        raise ValueError(
            'upright is given with export, accepted is one of them: other software counts pixels '
            'as they are stored'
        )
    paths, problems = image_paths(options.images)
    for problem in problems:
        print(f'ahf identify: {problem}', file=sys.stderr)
    jobs, tasks = _tasks(options, settings, paths)
    for export in options.export:
        export.check_names([task.paths[0] for task in tasks])
    try:
        control = control_from(options)
    except ValueError as error:
        print(f'ahf identify: {error}', file=sys.stderr)
        return 1
    # Refuses what does not fit together.
    create_identifier(detector=detector_of(settings), settings=settings)
    quiet = options.quiet
    failed = bool(problems)
    results = identified = 0
    measured: list[MeasuredImage] = []
    engine = create_engine('identify', identify_images, jobs, options.scheduler, with_machine)
    with closing(engine):
        try:
            for outcome in _with_progress(_outcomes(engine, tasks, options), len(tasks), quiet):
                print_outcome('identify', outcome, output if options.json else None, quiet)
                failed |= outcome.failed
                results += len(outcome.records)
                identified += sum(_decoded(record) for record in outcome.records)
                if options.export:
                    measured += [measured_image(it, it['image']) for it in outcome.records]
        except (EngineLost, Unwritable) as error:
            print(f'ahf identify: {error}', file=sys.stderr)
            return 1
    if results and not quiet:
        print(_hint(settings, identified), end='', file=sys.stderr)
    failed |= bool(write_exports('identify', options.export, measured, control, quiet))
    return int(failed)


_WITHOUT_N = (
    'N is not given, so that no filter was searched for: with --expected-targets N, AHF searches '
    'for a filter wherever an image shows fewer than N targets\n'
)


def _decoded(record: Mapping[str, Any]) -> int:
    return sum(target['id'] != UNDECODED for target in record['targets'])


def _hint(settings: IdentificationSettings, identified: int) -> str:
    """Return a line that says what may help, empty if nothing does."""
    family = settings.detection.family
    if not identified and family == AUTO:
        return (
            f'--family {AUTO} looks for rings only, {", ".join(LISTED)}; other families have to '
            'be named\n'
        )
    if not identified:
        return f'targets of {family} were looked for; --family names others\n'
    if settings.expected_targets or settings.adaptive.listed or settings.estimate_expected:
        return ''
    return _WITHOUT_N


_WORTH_PROCESSES = 4  # images; fewer are identified before processes have started


def _tasks(
    options: argparse.Namespace, settings: IdentificationSettings, paths: Sequence[str]
) -> tuple[int, list[ImageTask]]:
    """Return the number of processes, and a task for each image or stack."""
    groups = stacked(paths, options.stack_by, options.stack)
    jobs = options.jobs or (available_cores() if len(groups) >= _WORTH_PROCESSES else 1)
    jobs = min(jobs, len(groups))
    settings = shared_settings(settings, jobs, options.scheduler)
    stacking = StackSettings(stack=options.stack, stack_movement=options.stack_movement)
    overlays = _overlay_paths(paths, options.overlay)
    return jobs, [
        ImageTask(
            tuple(group),
            settings,
            stacking,
            upright=options.upright,
            stacked=bool(options.stack_by) or options.stack > 1,
            minimum=0 if options.stack_by else options.stack,
            overlays=tuple(overlays[path] for path in group) if overlays else (),
            folder=str(Path.cwd()) if options.scheduler else '',
        )
        for group in groups
    ]


def _outcomes(
    engine: Engine, tasks: Sequence[ImageTask], options: argparse.Namespace
) -> Iterator[ImageOutcome]:
    """Yield the outcomes of tasks in their order, and keep the results if that is wanted."""
    if not options.output:
        yield from outcomes_in_order(engine, tasks)
        return

    def say(text: str) -> None:
        if not options.quiet:
            print(text, file=sys.stderr)

    with closing(Results(options.output)) as results:
        yield from kept_outcomes_in_order(engine, tasks, results, say)


def _overlay_paths(images: Sequence[str], folder: Path | None) -> dict[str, str]:
    """Return the path of the overlay of each image; none if there is no folder for them."""
    if folder is None:
        return {}
    paths = {path: overlay_path(folder, path) for path in images}
    if len(set(paths.values())) < len(paths):
        raise ValueError(
            'overlay would hold several images of the same name, accepted are different names'
        )
    return paths


def _with_progress(
    outcomes: Iterator[ImageOutcome], count: int, quiet: bool
) -> Iterator[ImageOutcome]:
    """Yield outcomes, with a progress bar for several tasks on a terminal."""
    shown = count > 1 and sys.stderr.isatty() and not quiet
    # If standard output were redirected, JSON would go to the console of the progress bar.
    with Progress(
        console=Console(stderr=True, quiet=not shown),
        transient=True,
        redirect_stdout=False,
        disable=not shown,
    ) as progress:
        yield from progress.track(outcomes, total=count, description='identify')


def image_paths(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the image files that arguments name, and what is wrong with the others.

    Parameters
    ----------
    arguments : sequence of str
        As `ahf_ros.cli.identify_options.IMAGES` says. A file of the name comes first, whatever
        characters are in it.

    Returns
    -------
    paths : list of str
        In the order of the arguments, and sorted by name within a folder or a pattern.
    problems : list of str
        One for each argument that names no image.

    Examples
    --------
    >>> image_paths(['left.png', 'right.png'])
    (['left.png', 'right.png'], [])
    """
    paths: list[str] = []
    problems: list[str] = []
    for argument in arguments:
        try:
            found = list(_named(argument))
        except ValueError as error:
            problems.append(str(error))
            continue
        if not found:
            problems.append(f'{shown(argument)} names no image, accepted are files and folders')
        paths += found
    return paths, problems


def _named(argument: str) -> Iterator[str]:
    path = Path(argument)
    if is_url(argument):
        yield from urls_named(argument, SUFFIXES)
    elif path.is_dir():
        yield from sorted(str(file) for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
    elif path.exists():
        yield argument
    elif argument.startswith('@'):
        for line in read_text(argument[1:]).splitlines():
            if line.strip():
                yield from _named(line.strip())
    elif has_magic(argument):
        found = glob(argument, recursive=True)  # noqa: PTH207  Path has none for absolute patterns
        yield from sorted(found)
    else:
        yield argument  # whoever reads it says what is wrong
