"""The commands of `ahf` and their arguments."""

from __future__ import annotations

import argparse
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


def run(arguments: Sequence[str] | None) -> int:
    """Run the command that the arguments name, and return the exit status."""
    options = _parser().parse_args(arguments)
    try:
        return COMMANDS[options.subcommand].run(options)
    except ValueError as error:
        print(f'ahf {options.subcommand}: error: {error}', file=sys.stderr)
        return 2


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
