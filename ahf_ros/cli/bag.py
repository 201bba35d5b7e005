"""`ahf bag`: the coded targets in recorded images."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from contextlib import closing, redirect_stdout
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from ahf_ros.base.extras import need
from ahf_ros.base.inputs import inputs_kept, registered_inputs
from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.batch.engine import EngineLost, TaskFailed, finished_tasks
from ahf_ros.batch.processes import SHUTDOWN_TIMEOUT
from ahf_ros.cli import say, tell
from ahf_ros.cli.engines import create_engine, progress_bar, shared_settings
from ahf_ros.cli.options import (
    add_engine_options,
    add_flag,
    add_input,
    add_option,
    add_options,
    add_output,
    add_registration_options,
    add_search_options,
    add_target_options,
    input_path,
    settings_from,
)
from ahf_ros.clouds.cloud_settings import CloudSettings
from ahf_ros.clouds.registration_settings import RegistrationSettings
from ahf_ros.families import is_foreign
from ahf_ros.identification.session_settings import IdentificationSettings, StackSettings

if TYPE_CHECKING:
    from ahf_ros.bag.output import Outcome
    from ahf_ros.bag.registration import Registered, RegistrationTask
    from ahf_ros.bag.run import BagTask

_Result = list['Outcome | Registered | ValueError']
"""What became of a bag, part by part."""

# A process outlives its killed worker of a cluster by at most `SHUTDOWN_TIMEOUT`.
_LOCK_TIMEOUT = 2 * SHUTDOWN_TIMEOUT  # s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    text = 'Bags: ROS 2 folders, .db3 or .mcap files, or ROS 1 .bag files.'
    add_input(parser, 'bags', 'IN', text, type=input_path, nargs='+')
    text = (
        'Output bag, a folder; for several bags, the folder for their output bags. An '
        'unfinished output bag is continued.'
    )
    add_output(parser, 'output', 'OUT', text)
    parser.add_argument(
        '--topic',
        action='append',
        default=[],
        metavar='TOPIC',
        help='Topic of images; may be repeated. Default: all image topics.',
    )
    text = (
        'Topic of the answers, relative to the topic of the images unless it begins with a slash.'
    )
    add_option(parser, Parameter('output_topic', 'coded_targets', text))
    storages = 'mcap', 'sqlite3'
    text = 'Storage format of the output bag.'
    add_option(parser, Parameter('storage', 'mcap', text, choices=storages))
    add_flag(parser, '--debug-images', 'Also write annotated images, as JPEG.')
    text = 'Number of bags processed at the same time.'
    add_engine_options(parser, Parameter('jobs', 1, text, minimum=1))
    add_target_options(parser)
    add_options(parser.add_argument_group('stacks'), StackSettings)
    add_search_options(parser)
    text = 'Of scans, images with organised clouds, as the node registration does it.'
    group = parser.add_argument_group('registration', text)
    text = (
        'Register all scans, and write clouds, transforms and targets to this folder, as '
        '~/save does; for several bags, the folder for their folders.'
    )
    add_output(group, '--register', 'DIR', text)
    text = 'Topic of the clouds; empty: the only one.'
    add_option(group, Parameter('cloud_topic', '', text))
    add_registration_options(group)


def run(options: argparse.Namespace) -> int:
    """Process all bags; the status is 1 as well if an image or a bag is refused or damaged."""
    tasks = _tasks(options)
    jobs = min(options.jobs, len(tasks))
    columns = TextColumn('{task.description}'), BarColumn(), MofNCompleteColumn()
    failed = False
    with progress_bar(*columns, TimeRemainingColumn()) as progress:
        bars = [progress.add_task(task.source.name, total=None) for task in tasks]

        def report(number: int, done: int, total: int, remark: str) -> None:
            progress.update(bars[number], completed=done, total=max(total, done))
            if remark:
                tell('bag', f'{tasks[number].source}: {remark}')

        engine = create_engine(
            'bag',
            partial(_attempt, registered_inputs()),
            jobs,
            options.scheduler,
            _with_machine,
            report,
            isolated=is_foreign(tasks[0].identification.detector),
        )
        try:
            with closing(engine):
                for item in finished_tasks(engine, tasks):
                    result: _Result = item.result
                    if isinstance(item.result, TaskFailed):
                        result = [ValueError(f'{item.task.source}: {item.result.reason}')]
                    for part in result:
                        failed |= not _report(item.task, part)
        except EngineLost as error:
            tell('bag', error)
            failed = True
    return int(failed)


def _tasks(options: argparse.Namespace) -> list[BagTask]:
    need('bag')
    from ahf_ros.bag.run import BagTask

    jobs = min(options.jobs, len(options.bags))
    settings = settings_from(options, IdentificationSettings)
    settings = shared_settings(settings, jobs, options.scheduler)
    several = len(options.bags) > 1
    outputs = [options.output]
    if several:
        outputs = [options.output / bag.stem for bag in options.bags]
        if len(set(outputs)) < len(outputs):
            raise ValueError(
                'OUT would hold several bags of the same name, accepted are different names'
            )
    return [
        BagTask(
            source=source.absolute() if options.scheduler else source,
            output=output.absolute() if options.scheduler else output,
            topics=tuple(options.topic),
            output_topic=options.output_topic,
            storage=options.storage,
            debug_images=options.debug_images,
            identification=settings,
            stacking=settings_from(options, StackSettings),
            registration=_registration(options, output.name if several else ''),
            lock_timeout=_LOCK_TIMEOUT if options.scheduler else 0.0,
        )
        for source, output in zip(options.bags, outputs, strict=True)
    ]


def _registration(options: argparse.Namespace, name: str) -> RegistrationTask | None:
    """Return the registration of a bag, None if it is not wanted."""
    from ahf_ros.bag.registration import RegistrationTask

    if not options.register:
        if options.adjust or options.coordinates or options.cloud_topic:
            raise ValueError(
                'adjust, coordinates and cloud_topic have no effect; accepted with them is '
                'register'
            )
        return None
    folder, coordinates = options.register / name, options.coordinates
    if options.scheduler:
        folder = folder.absolute()
        coordinates = coordinates and str(Path(coordinates).absolute())
    return RegistrationTask(
        folder=folder,
        cloud_topic=options.cloud_topic,
        adjust=options.adjust,
        settings=replace(settings_from(options, RegistrationSettings), coordinates=coordinates),
        cloud_settings=settings_from(options, CloudSettings),
    )


def _with_machine(result: _Result, machine: str) -> _Result:
    return [
        ValueError(f'{part} (on {machine})') if isinstance(part, ValueError) else part
        for part in result
    ]


def _attempt(inputs: Sequence[str], task: BagTask, report: Any) -> _Result:
    """Return what became of the images of a bag, and of its scans; inputs stay as they are."""
    with inputs_kept(inputs):
        return _attempted(task, report)


def _attempted(task: BagTask, report: Any) -> _Result:
    from ahf_ros.bag.registration import register_bag
    from ahf_ros.bag.run import WRITING_ERRORS, answer_bag

    result: _Result = []
    try:
        with redirect_stdout(sys.stderr):  # what other detectors print
            result.append(outcome := answer_bag(task, report))
    except ValueError as error:
        return [error]
    except WRITING_ERRORS as error:
        return [ValueError(f'{task.output} cannot be written: {error}')]
    if task.registration:
        folder = task.registration.folder
        tell = partial(report, outcome.images, outcome.images)
        try:
            result.append(register_bag(task.registration, task.output, tell))
        except ValueError as error:
            result.append(error)
        except WRITING_ERRORS as error:
            result.append(ValueError(f'{folder} cannot be written: {error}'))
    return result


def _report(task: BagTask, outcome: Outcome | Registered | ValueError) -> bool:
    """Report the outcome of a bag on standard error; return whether all of it was processed."""
    from ahf_ros.bag.registration import Registered

    if isinstance(outcome, ValueError):
        tell('bag', outcome)
        return False
    if isinstance(outcome, Registered):
        for line in outcome.said:
            say(f'{task.source}: {line}')
        return not outcome.refused
    refused = f', {outcome.refused} of them not accepted' if outcome.refused else ''
    damaged = f', {outcome.damaged} of them damaged' if outcome.damaged else ''
    say(f'{task.output}: {outcome.images} images answered{refused}{damaged}')
    for lost in outcome.lost:
        tell('bag', f'{task.source}: missing: {lost}')
    for left_out in outcome.left_out:
        tell('bag', f'{task.source}: left out: {left_out}')
    if not (outcome.refused or outcome.damaged or outcome.lost):
        return True
    tell(
        'bag',
        f'{task.output}: what was not accepted, is damaged or missing is not tried again; to do '
        'so, remove this bag or name another one',
    )
    return False
