"""The commands of `ahf`; the module of each is imported only where it is called."""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

from ahf_ros.base.extras import MissingExtra, missing
from ahf_ros.base.inputs import inputs_kept
from ahf_ros.base.release import release
from ahf_ros.cli import say, tell

COMMANDS = {
    'identify': ('cli.identify', 'Identify the coded targets in images.'),
    'watch': ('cli.watch', 'Identify the coded targets in images as they arrive.'),
    'bag': ('cli.bag', 'Identify the coded targets in the images of ROS 1 and ROS 2 bags.'),
    'render': ('cli.render', 'Render images of targets under projected light, with their truth.'),
    'evaluate': ('cli.evaluate', 'Compare the output of `ahf identify --json` with the truth.'),
    'export': (
        'cli.export',
        'Hand the output of `ahf identify --json` to other photogrammetric software.',
    ),
    'report': ('cli.report', 'Make one page to look at of the output of `ahf identify --json`.'),
    'orient': (
        'cli.orient',
        'Compute coordinates of targets, poses and calibrations from identified targets alone.',
    ),
    'measure': (
        'cli.measure',
        'Measure distances, deviations from nominal coordinates and length errors in a network.',
    ),
    'register': (
        'cli.register',
        'Put scans, clouds with their images, into one frame by their coded targets.',
    ),
    'compare': ('cli.compare', 'Find the targets that moved between two networks.'),
    'learn-family': (
        'cli.learn_family',
        'Learn a family from photographs of its rings, or from a survey of its dots.',
    ),
    'demo': ('cli.demo', 'Identify a rendered image in three ways, which shows the method.'),
    'doctor': ('cli.doctor', 'Say what is installed, and what is missing for what.'),
    'targets': ('cli.targets', 'Print targets, true to scale, with their geometry.'),
}
"""Module below `ahf_ros` and description of each command."""


def run(arguments: Sequence[str] | None) -> int:
    """Run the command that the arguments name, and return the exit status.

    Each module has `add_arguments`, which gives a parser the arguments of its command, and `run`.
    This returns 0, or 1 if a file could not be read or written, and raises a ValueError if options
    are not accepted.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    if 'COMP_LINE' in os.environ:  # a shell wants to know how this line may go on
        return _complete(os.environ['COMP_LINE'])
    with inputs_kept():
        options = _parser(arguments).parse_args(arguments)
        try:
            return _module(options.subcommand).run(options)
        except (ValueError, MissingExtra) as error:
            tell(options.subcommand, f'error: {error}')
            return 2


def _complete(line: str) -> int:
    """Print how a line of a shell may go on."""
    if said := missing('completion'):
        say(said)
        return 1
    from argcomplete import autocomplete

    autocomplete(_parser(line.split()))
    return 0


def _module(command: str) -> ModuleType:
    return import_module(f'ahf_ros.{COMMANDS[command][0]}')


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """Return the parser, with the arguments of the command that is called."""
    called = next((word for word in words if word in COMMANDS), '')
    parser = argparse.ArgumentParser(
        prog='ahf', description='Coded photogrammetric targets under difficult light.'
    )
    parser.add_argument('--version', action='version', version=release())
    commands = parser.add_subparsers(dest='subcommand', metavar='COMMAND', required=True)
    for name, (_, text) in COMMANDS.items():
        command = commands.add_parser(name, description=text, help=text)
        if name == called:
            _module(name).add_arguments(command)
    return parser
