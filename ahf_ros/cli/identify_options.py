"""The options of `ahf identify`, without what identifies: `--help` and mistakes come at once."""

from __future__ import annotations

import argparse
from pathlib import Path

from ahf_ros.cli.engine_options import JOBS, add_scheduler_argument
from ahf_ros.cli.export_options import add_export_arguments
from ahf_ros.cli.options import Group, add_option, add_search_options, add_target_options
from ahf_ros.cli.stacks import add_stack_arguments
from ahf_ros.interchange.files import RESULTS_FILE

IMAGES = (
    'Image files; folders, for their images; patterns in quotation marks, such as "day*/*.jpg" or '
    '"**/*.tif"; URLs of storages that fsspec reads, such as s3:// and https://; @FILE for a list '
    'of these, one a line.'
)
"""What an argument may be."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    parser.add_argument('images', nargs='+', metavar='IMAGE', help=IMAGES)
    add_processing_options(parser)
    add_target_options(parser)
    output = parser.add_argument_group('output')
    output.add_argument(
        '--output',
        type=Path,
        metavar='DIR',
        help=f'Write results to {RESULTS_FILE} in this folder as they come. The same command '
        'again goes on where it was interrupted; files that have changed, and all with other '
        'settings, are identified again.',
    )
    add_output_options(output)
    add_export_arguments(parser.add_argument_group('export'))
    add_stack_arguments(parser.add_argument_group('stacks'))
    add_search_options(parser)


def add_processing_options(parser: Group) -> None:
    """Give a parser the options that say how and where images are read."""
    parser.add_argument(
        '--upright',
        action='store_true',
        help='Turn images as their orientation says. Coordinates then count in the upright '
        'image, otherwise in the pixels as they are stored.',
    )
    add_option(parser, JOBS)
    add_scheduler_argument(parser)


def add_output_options(parser: Group) -> None:
    """Give a parser the options that say what is printed and drawn."""
    parser.add_argument(
        '--json', action='store_true', help='Print one JSON object per image on standard output.'
    )
    parser.add_argument(
        '--overlay',
        type=Path,
        metavar='DIR',
        help='Write each image with its targets marked to this folder, as NAME_overlay.png.',
    )
    parser.add_argument(
        '--quiet', action='store_true', help='Print nothing on standard error but problems.'
    )
