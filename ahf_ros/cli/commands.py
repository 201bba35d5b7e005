"""The commands of `ahf` and their arguments."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

from ahf_ros.release import release

COMMANDS = {
    'identify': ('ahf_ros.cli.identify', 'Identify the coded targets in images.'),
    'watch': ('ahf_ros.cli.watch', 'Identify the coded targets in images as they arrive.'),
    'bag': (
        'ahf_ros.cli.bag',
        'Identify the coded targets in the images of ROS 1 and ROS 2 bags.',
    ),
    'render': (
        'ahf_ros.cli.render',
        'Render images of targets under projected light, with their truth.',
    ),
    'evaluate': (
        'ahf_ros.cli.evaluate',
        'Compare the output of `ahf identify --json` with the truth.',
    ),
    'export': (
        'ahf_ros.cli.export',
        'Hand the output of `ahf identify --json` to other photogrammetric software.',
    ),
    'report': (
        'ahf_ros.cli.report',
        'Make one page to look at of the output of `ahf identify --json`.',
    ),
    'learn-family': (
        'ahf_ros.cli.learn_family',
        'Learn template, positions and numbers of point-distributed targets from a survey.',
    ),
    'targets': ('ahf_ros.cli.targets', 'Print targets, true to scale, with their geometry.'),
}
"""The module of each command, which is imported only where it is called, and what it does."""

OPTIONS = {'identify': 'ahf_ros.cli.identify_options'}
"""Where the options of a command are a module of their own."""

_COMPLETED = 'COMP_LINE'  # what is completed, where argcomplete calls


def run(arguments: Sequence[str] | None) -> int:
    """Run the command that the arguments name, and return the exit status."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if _COMPLETED in os.environ:
        _complete(os.environ[_COMPLETED].split())
    options = _parser(arguments).parse_args(arguments)
    try:
        status: int = _module(options.subcommand).run(options)
        return status
    except ValueError as error:
        print(f'ahf {options.subcommand}: error: {error}', file=sys.stderr)
        return 2


def _module(command: str) -> ModuleType:
    return import_module(COMMANDS[command][0])


def _complete(words: Sequence[str]) -> None:
    """Print how a line may go on, for the completion of bash and zsh, and end."""
    from argcomplete import autocomplete

    autocomplete(_parser(words))


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
            options = import_module(OPTIONS[name]) if name in OPTIONS else _module(name)
            options.add_arguments(command)
    return parser
