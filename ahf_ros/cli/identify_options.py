"""The options of `ahf identify`, and which images are a stack, without what identifies.

So `--help` and mistakes come at once.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from pathlib import Path

from ahf_ros.cli.export_options import add_export_arguments
from ahf_ros.cli.options import (
    JOBS,
    Group,
    add_option,
    add_scheduler_argument,
    add_search_options,
    add_target_options,
)
from ahf_ros.interchange.files import RESULTS_FILE
from ahf_ros.session_settings import StackSettings
from ahf_ros.settings.parameter import parameters
from ahf_ros.text import shown

IMAGES = (
    'Image files; folders, for their images; patterns in quotation marks, such as "day*/*.jpg" or '
    '"**/*.tif"; URLs of storages that fsspec reads, such as s3:// and https://; @FILE for a list '
    'of these, one a line.'
)
"""What an argument may be."""

FOLDER = 'folder'
"""Images of one folder are one stack."""


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


def add_stack_arguments(parser: Group) -> None:
    """Give a parser the options that say which images belong together."""
    for item in parameters(StackSettings):
        if item.name in ('stack', 'stack_movement'):
            add_option(parser, item)
    parser.add_argument(
        '--stack-by',
        default='',
        metavar='REGEX',
        help='Identify images together that are in one folder (folder), or in whose names the '
        "groups of a regular expression match the same text, such as '(.*)_\\d+'; with --stack N, "
        'N of them at a time.',
    )


def stacked(images: Sequence[str], by: str, size: int) -> list[list[str]]:
    r"""Return the images of each stack, in the order of their first images.

    Parameters
    ----------
    images : sequence of str
        Paths, as the user gave them.
    by : str
        `FOLDER`, a regular expression with a group, which has to match a whole name without its
        ending, or nothing.
    size : int
        Maximum number of images of a stack; 1 for no maximum where `by` groups them.

    Raises
    ------
    ValueError
        If `by` is no such expression or does not match a name.

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
    if by == FOLDER:
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
