"""The command line `ahf`.

Standard output is for programs: it gets JSON or nothing. All that is for people goes to standard
error. The exit status is 0; 1 where a file could not be read or written, the others being done; 2
where an argument is not accepted.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version

import ahf_ros.blas  # noqa: F401  before numpy
from ahf_ros.cli import bag, evaluate, identify, learn_family, render

COMMANDS = {
    'identify': identify,
    'bag': bag,
    'render': render,
    'evaluate': evaluate,
    'learn-family': learn_family,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows the name of the program; those of the process where None.

    Returns
    -------
    int
        The exit status.
    """
    options = _parser().parse_args(arguments)
    try:
        return COMMANDS[options.subcommand].run(options)
    except ValueError as error:
        print(f'ahf {options.subcommand}: error: {error}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # Nobody reads any more; without this the interpreter complains while it closes the pipe.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='ahf', description='Coded photogrammetric targets under difficult light.'
    )
    parser.add_argument('--version', action='version', version=_version())
    commands = parser.add_subparsers(dest='subcommand', metavar='COMMAND', required=True)
    for name, command in COMMANDS.items():
        told = command.DESCRIPTION
        command.add_arguments(commands.add_parser(name, description=told, help=told))
    return parser


def _version() -> str:
    try:
        return version('ahf_ros')
    except PackageNotFoundError:
        return 'not installed'
