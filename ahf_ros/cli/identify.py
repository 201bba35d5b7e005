"""`ahf identify`: the coded targets in image files: files, folders, patterns and lists.

What computes is imported where it is used, so that `--help` and mistakes come at once.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, redirect_stdout, suppress
from dataclasses import dataclass, field
from glob import glob, has_magic
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from ahf_ros.base.doubt import doubtful_remark
from ahf_ros.base.extras import missing
from ahf_ros.base.inputs import check_output, register_input
from ahf_ros.base.opening import Most, file_errors, is_url, read_text, urls_named
from ahf_ros.base.settings.parameter import parameters
from ahf_ros.base.target import UNDECODED
from ahf_ros.base.text import listed, shown
from ahf_ros.batch.engine import Engine, EngineLost, available_cores
from ahf_ros.batch.task import ImageOutcome, ImageTask, Level, with_machine
from ahf_ros.cli import say, tell
from ahf_ros.cli.engines import create_engine, shared_settings, tracker
from ahf_ros.cli.export import add_export_arguments, check_control, control_from, write_exports
from ahf_ros.cli.options import (
    add_image_options,
    add_input,
    add_option,
    add_output,
    add_output_options,
    add_search_options,
    add_target_options,
    settings_from,
)
from ahf_ros.files.files import RESULTS_FILE
from ahf_ros.identification.session_settings import IdentificationSettings, StackSettings
from ahf_ros.prints.families import AUTO

if TYPE_CHECKING:
    import numpy as np

    from ahf_ros.network.export.survey import MeasuredImage

_WORTH_PROCESSES = 4  # images; fewer are identified before processes have started


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    text = (
        'Image files; folders, for their images; patterns in quotation marks, such as '
        '"day*/*.jpg" or "**/*.tif"; URLs of storages that fsspec reads, such as s3:// and '
        'https://; @FILE for a list of these, one a line.'
    )
    add_input(parser, 'images', 'IMAGE', text, nargs='+')
    add_image_options(parser)
    add_target_options(parser)
    output = parser.add_argument_group('output')
    text = (
        f'Write results to {RESULTS_FILE} in this folder as they come. The same command '
        'again goes on where it was interrupted; files that have changed, and all with other '
        'settings, are identified again.'
    )
    add_output(output, '--output', 'DIR', text)
    add_output_options(output)
    add_export_arguments(parser.add_argument_group('export'))
    stacks = parser.add_argument_group('stacks')
    for item in parameters(StackSettings):
        if item.name in ('stack', 'stack_movement'):
            add_option(stacks, item)
    stacks.add_argument(
        '--stack-by',
        default='',
        metavar='REGEX',
        help='Identify images together that are in one folder (folder), or in whose names the '
        "groups of a regular expression match the same text, such as '(.*)_\\d+'; with --stack N, "
        'N of them at a time.',
    )
    add_search_options(parser)


def run(options: argparse.Namespace) -> int:
    """Identify, print and draw each image or stack, independently of those before it."""
    output = sys.stdout if options.json else None
    with redirect_stdout(sys.stderr):  # what other detectors print is not JSON
        return _run(options, output)


def _run(options: argparse.Namespace, output: TextIO | None) -> int:
    check_control(options)
    if options.upright and options.export:
        raise ValueError(
            'upright is given with export, accepted is one of them: other software counts pixels '
            'as they are stored'
        )
    paths, problems, left_out = image_paths(options.images)
    beside = dict.fromkeys(Path(path).parent / 'families' for path in paths if not is_url(path))
    settings = settings_from(options, IdentificationSettings, beside)
    for problem in (*problems, *([] if options.quiet else left_out)):
        tell('identify', problem)
    jobs, tasks = _tasks(options, settings, paths)
    for export in options.export:
        export.check_names([task.paths[0] for task in tasks])
    try:
        control = control_from(options)
    except ValueError as error:
        tell('identify', error)
        return 1
    check_settings(settings)

    from ahf_ros.batch.identification import identify_images
    from ahf_ros.batch.results import Unwritable
    from ahf_ros.batch.settling import settled_tasks
    from ahf_ros.families import is_foreign
    from ahf_ros.network.export.survey import measured_image

    failed = bool(problems)
    seen = _Seen()
    measured: list[MeasuredImage] = []
    engine = create_engine(
        'identify',
        identify_images,
        jobs,
        options.scheduler,
        with_machine,
        isolated=is_foreign(settings.detector),
    )
    shown = len(tasks) > 1 and not options.quiet
    with closing(engine), tracker(shown, len(tasks), 'identify') as track:
        try:
            outcomes = _outcomes(engine, settled_tasks(engine, tasks), options)
            for outcome in track(outcomes):
                print_outcome('identify', outcome, output, options.quiet)
                failed |= outcome.failed
                for record in outcome.records:
                    seen.add(record)
                    if options.export:
                        measured.append(measured_image(record, record['image']))
        except (EngineLost, Unwritable) as error:
            tell('identify', error)
            return 1
    if not options.quiet:
        for line in seen.lines(settings, drawn=bool(options.overlay)):
            say(line)
    if not write_exports('identify', options.export, measured, control, options.quiet):
        failed = True
    return int(failed)


@dataclass
class _Seen:
    """What the results of a command have in common, which its last lines say."""

    results: int = 0
    identified: int = 0
    empty: list[str] = field(default_factory=list)
    families: set[str] = field(default_factory=set)
    doubts: Counter[str] = field(default_factory=Counter)

    def add(self, record: dict[str, Any]) -> None:
        """Take note of the result of an image or a stack."""
        found = [it for it in record['targets'] if it['id'] != UNDECODED]
        self.results += 1
        self.identified += len(found)
        self.empty += [record['image']] * (not found and not record.get('repeated'))
        self.families.update(it['family'] for it in found)
        self.doubts.update(it['doubt'] for it in found if 'doubt' in it)

    def lines(self, settings: IdentificationSettings, *, drawn: bool) -> Iterator[str]:
        """Yield what there is, and what may help; `drawn` says that overlays show it."""
        from ahf_ros.identification.settling import families_line

        if not self.results:
            return
        if self.families and settings.settles:
            yield families_line(sorted(self.families))
        if self.doubts and not drawn:
            yield doubtful_remark(self.doubts, self.identified)
        yield from _hint(settings, self.identified)
        if 2 * len(self.empty) >= self.results:
            yield from _advice(self.empty, settings)


def check_settings(settings: IdentificationSettings) -> None:
    """Raise a ValueError if the settings do not fit together, before any image is read.

    A detector of another package is made where it works only, in a process of its own.
    """
    from ahf_ros.batch.identification import detector_of
    from ahf_ros.families import is_foreign
    from ahf_ros.identification.session import create_identifier

    if not is_foreign(settings.detector):
        create_identifier(detector=detector_of(settings), settings=settings)


def print_outcome(command: str, outcome: ImageOutcome, output: TextIO | None, quiet: bool) -> None:
    """Print messages of an outcome on standard error, and JSON where there is an output for it.

    If `quiet`, only warnings and problems are printed on standard error.
    """
    minimum = Level.WARNING if quiet else Level.NOTE if output else Level.DETAIL
    for record in outcome.records if output else ():
        print(json.dumps(record), file=output, flush=True)
    for message in outcome.messages:
        if message.level >= minimum:
            before = f'ahf {command}: ' if message.level == Level.PROBLEM else ''
            say(f'{before}{message.text}')


def _hint(settings: IdentificationSettings, identified: int) -> list[str]:
    """Return a line that says what may help, none if nothing does."""
    from ahf_ros.batch.identification import detector_of

    family = detector_of(settings).family
    if not identified and family == AUTO:
        return ['targets of all families were looked for']
    if not identified:
        return [f'targets of {family} were looked for; --family names others']
    if settings.number or settings.estimate_expected or settings.adaptive.listed:
        return []

    from ahf_ros.families import EarlyStopping

    if isinstance(detector_of(settings), EarlyStopping):  # filters show it hardly more
        return []
    return [
        'N is not given, so that no filter was searched for: with --expected-targets N, AHF '
        'searches for a filter wherever an image shows fewer than N targets'
    ]


def _advice(paths: Sequence[str], settings: IdentificationSettings) -> list[str]:
    """Return lines on the first image in which nothing was identified that says why, or on all."""
    from ahf_ros.files.image_files import read_image
    from ahf_ros.views.advice import advice_on_all
    from ahf_ros.vision.image import check_image

    def images() -> Iterator[tuple[str, np.ndarray]]:
        for path in paths:
            with suppress(ValueError):  # which the identification has said
                image = read_image(path)
                check_image(image)
                yield path, image

    wanted = settings.detection, settings.number or int(settings.estimate_expected)
    return advice_on_all(images(), *wanted)


def _tasks(
    options: argparse.Namespace, settings: IdentificationSettings, paths: Sequence[str]
) -> tuple[int, list[ImageTask]]:
    """Return the number of processes, and a task for each image or stack."""
    groups = stacked(paths, options.stack_by, options.stack)
    jobs = options.jobs or (available_cores() if len(groups) >= _WORTH_PROCESSES else 1)
    jobs = min(jobs, len(groups))
    settings = shared_settings(settings, jobs, options.scheduler)
    stacking = StackSettings(stack=options.stack, stack_movement=options.stack_movement)
    if options.overlay and len(set(_overlay_paths(options, set(paths)))) < len(set(paths)):
        raise ValueError(
            'overlay would hold several images of the same name, accepted are different names'
        )
    return jobs, [
        image_task(
            options,
            group,
            settings,
            stacking=stacking,
            stacked=bool(options.stack_by) or options.stack > 1,
            minimum=0 if options.stack_by else options.stack,
        )
        for group in groups
    ]


def image_task(
    options: argparse.Namespace,
    paths: Iterable[str],
    settings: IdentificationSettings,
    **more: Any,
) -> ImageTask:
    """Return the task of images that are identified together, with more fields of it."""
    paths = tuple(paths)
    for path in paths:
        register_input(path)
    return ImageTask(
        paths=paths,
        settings=settings,
        upright=options.upright,
        overlays=_overlay_paths(options, paths),
        folder=str(Path.cwd()) if options.scheduler else '',
        **more,
    )


def _overlay_paths(options: argparse.Namespace, images: Iterable[str]) -> tuple[str, ...]:
    """Return the files that images are drawn to; none if there is no folder for them."""
    if options.overlay is None:
        return ()
    paths = tuple(str(options.overlay / f'{Path(it).stem}_overlay.png') for it in images)
    for path in paths:  # here, since another process knows its own images only
        check_output(path)
    return paths


def _outcomes(
    engine: Engine, tasks: Sequence[ImageTask], options: argparse.Namespace
) -> Iterator[ImageOutcome]:
    """Yield the outcomes of tasks in their order, and keep the results if that is wanted."""
    from ahf_ros.batch.results import Results, kept_outcomes_in_order, outcomes_in_order

    if not options.output:
        yield from outcomes_in_order(engine, tasks)
        return

    def noted(text: str) -> None:
        if not options.quiet:
            say(text)

    with closing(Results(options.output)) as results:
        yield from kept_outcomes_in_order(engine, tasks, results, noted)


def image_paths(arguments: Sequence[str]) -> tuple[list[str], list[str], list[str]]:
    """Return the image files that arguments name, and what is wrong with other arguments.

    The last are lines on what is left out in folders. A file of the name comes first, whatever
    characters are in it. Files are in the order of the arguments, and sorted by name within a
    folder or a pattern.

    Examples
    --------
    >>> image_paths(['left.png', 'right.png'])
    (['left.png', 'right.png'], [], [])
    """
    paths: list[str] = []
    problems: list[str] = []
    left_out: list[str] = []
    for argument in arguments:
        try:
            with file_errors(argument, 'read'):
                found = list(_named(argument, left_out))
        except ValueError as error:
            problems.append(str(error))
            continue
        if not found:
            problems.append(f'{shown(argument)} names no image, accepted are files and folders')
        paths += found
        for path in found:
            register_input(path)
    return paths, problems, left_out


def _named(argument: str, left_out: list[str]) -> Iterator[str]:
    from ahf_ros.files.image_files import image_suffixes

    path, suffixes = Path(argument), image_suffixes()
    if is_url(argument):
        yield from urls_named(argument, suffixes)
    elif path.is_dir():
        files = sorted(str(it) for it in path.iterdir() if not it.is_dir())
        kinds = Counter(Path(it).suffix.lower() or 'without an ending' for it in files)
        if others := [f'{number} {it}' for it, number in kinds.items() if it not in suffixes]:
            advice = missing('heic') if '.heic' in kinds else ''
            accepted = '; '.join(filter(None, (', '.join(suffixes), advice)))
            left_out.append(f'{path}: left out are {listed(others)}; accepted are {accepted}')
        yield from (it for it in files if it.lower().endswith(suffixes))
    elif path.exists():
        yield argument
    elif argument.startswith('@'):
        for line in read_text(argument[1:], Most.TABLE).splitlines():
            if line.strip():
                yield from _named(line.strip(), left_out)
    elif has_magic(argument):
        yield from sorted(glob(argument, recursive=True))  # noqa: PTH207  no absolute ones in Path
    else:
        yield argument  # whoever reads it says what is wrong


def stacked(images: Sequence[str], by: str, size: int) -> list[list[str]]:
    r"""Return the images of each stack, in the order of their first images.

    `by` is 'folder', or a regular expression with a group, which has to match whole names without
    their endings, or empty. A stack has at most `size` images; 1 is no maximum where `by` groups
    them. A ValueError says what is wrong with `by`.

    Examples
    --------
    >>> stacked(['a_0.png', 'a_1.png', 'b_0.png'], r'(.*)_\d', 1)
    [['a_0.png', 'a_1.png'], ['b_0.png']]
    """
    groups: dict[object, list[str]] = {}
    for path in images:
        groups.setdefault(_key(path, by), []).append(path)
    stacks = []
    for paths in groups.values():
        step = len(paths) if by and size == 1 else size
        stacks += [paths[first : first + step] for first in range(0, len(paths), step)]
    return stacks


def _key(path: str, by: str) -> object:
    """Return what the images of one stack have in common."""
    if not by:
        return None
    if by == 'folder':
        return Path(path).parent
    try:
        pattern = re.compile(by)
    except (re.error, RecursionError) as error:
        raise ValueError(
            f'stack_by is {shown(by)}, accepted is folder or a regular expression: {error}'
        ) from error
    if not pattern.groups:
        raise ValueError(
            f'stack_by is {shown(by)}, accepted is folder or a regular expression with a group'
        )
    match = pattern.fullmatch(Path(path).stem)
    if match is None:
        raise ValueError(
            f'stack_by is {shown(by)}, which does not match {shown(Path(path).stem)}; accepted is '
            'an expression that matches the names of all images, without their endings'
        )
    return (Path(path).parent, *match.groups())
