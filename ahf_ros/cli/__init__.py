"""The command line `ahf`.

Standard output is for programs: JSON or nothing. Messages for people go to standard error. The
exit status is 0; 1 if a file could not be read or written, while the others are processed; 2 if an
argument is not accepted.
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
        Arguments after the name of the program; those of the process where None.

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
        # Without this, the interpreter reports an error when it flushes the closed pipe.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='ahf', description='Coded photogrammetric targets under difficult light.'
    )
    parser.add_argument('--version', action='version', version=_version())
    commands = parser.add_subparsers(dest='subcommand', metavar='COMMAND', required=True)
    for name, command in COMMANDS.items():
        text = command.DESCRIPTION
        command.add_arguments(commands.add_parser(name, description=text, help=text))
    return parser


def _version() -> str:
    try:
        return version('ahf_ros')
    except PackageNotFoundError:
        return 'not installed'
