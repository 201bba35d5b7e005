"""`ahf watch`: the coded targets in the images that arrive in a folder."""

import argparse
import sys
from contextlib import closing, redirect_stdout
from functools import partial

from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.batch.engine import EngineLost, available_cores
from ahf_ros.batch.identification import identify_images
from ahf_ros.batch.results import Results, Unwritable
from ahf_ros.batch.task import ImageTask, with_machine
from ahf_ros.batch.watch import Arrivals, watch
from ahf_ros.cli import tell
from ahf_ros.cli.engines import create_engine, shared_settings
from ahf_ros.cli.identify import check_settings, image_paths, image_task, print_outcome
from ahf_ros.cli.options import (
    add_flag,
    add_image_options,
    add_input,
    add_option,
    add_output,
    add_output_options,
    add_search_options,
    add_target_options,
    input_path,
    settings_from,
)
from ahf_ros.files.files import RESULTS_FILE
from ahf_ros.files.image_files import image_suffixes
from ahf_ros.identification.session_settings import IdentificationSettings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    add_input(parser, 'folder', 'FOLDER', 'Where images arrive.', type=input_path)
    text = (
        f'Write results to {RESULTS_FILE} in this folder. What is there already is not '
        'identified again unless settings or the file have changed.'
    )
    add_output(parser, '--output', 'DIR', text, required=True)
    add_flag(parser, '--recursive', 'Look at the folders in the folder, too.')
    text = (
        'Time for which size and time of change of a file have to stay the same before it is '
        'read, s.'
    )
    add_option(parser, Parameter('settling', 1.0, text, minimum=0.0, maximum=3600.0))
    text = 'Time between two looks at the folder, s.'
    add_option(parser, Parameter('interval', 1.0, text, minimum=0.1, maximum=3600.0))
    add_image_options(parser)
    add_target_options(parser)
    add_output_options(parser.add_argument_group('output'))
    add_search_options(parser)


def run(options: argparse.Namespace) -> int:
    """Identify images as they arrive, until a signal ends this process or results are lost."""
    output = sys.stdout if options.json else None
    settings = settings_from(options, IdentificationSettings, [options.folder / 'families'])
    _check_overlay(options)
    image_paths([str(options.folder)])  # which are inputs from now on
    jobs = options.jobs or available_cores()
    shared = shared_settings(settings, jobs, options.scheduler)

    def task_of(path: str) -> ImageTask:
        return image_task(options, [path], shared)

    say = partial(tell, 'watch')
    arrivals = Arrivals(options.folder, image_suffixes(), options.recursive, options.settling)
    with redirect_stdout(sys.stderr):  # what other detectors print is not JSON
        check_settings(settings)
        engine = create_engine(
            'watch', identify_images, jobs, options.scheduler, with_machine, isolated=True
        )
        try:
            with closing(Results(options.output)) as results, closing(engine):
                for outcome in watch(engine, arrivals, results, task_of, options.interval, say):
                    print_outcome('watch', outcome, output, options.quiet)
        except (EngineLost, Unwritable) as error:
            say(error)
    return 1


def _check_overlay(options: argparse.Namespace) -> None:
    """Refuse a folder of overlays that would be watched itself."""
    if not options.overlay:
        return
    watched, drawn = options.folder.resolve(), options.overlay.resolve()
    if drawn == watched or (options.recursive and watched in drawn.parents):
        raise ValueError(
            f'overlay is {str(options.overlay)!r}, accepted is a folder that is not watched'
        )
