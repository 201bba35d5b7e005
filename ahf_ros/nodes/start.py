"""Entry points of the nodes: a signal that comes during the imports ends them in order, too."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module

from ahf_ros.ending import has_arrived, ignore_ending, signalled

NODES = {
    'demo': 'ahf_ros.nodes.demo',
    'detector': 'ahf_ros.nodes.detector',
    'illumination': 'ahf_ros.nodes.illumination',
    'scoreboard': 'ahf_ros.nodes.scoreboard',
}
"""Modules whose `main` runs a node, by the name of the node."""


def start(node: str, arguments: list[str] | None = None) -> int:
    """Run one of `NODES` and return its exit status.

    Parameters
    ----------
    node : str
    arguments : list of str, optional
        Command line arguments; where None, `sys.argv` has them.
    """
    signalled()
    if node != 'demo' and _help_wanted(sys.argv[1:] if arguments is None else arguments):
        from ahf_ros.nodes.interfaces import help_text

        print(help_text(node), end='')
        return 0
    module = import_module(NODES[node])
    if has_arrived():
        ignore_ending()
        return 0
    status: int = module.main(arguments)
    return status


def _help_wanted(arguments: Sequence[str]) -> bool:
    """Return whether `--help` is among the arguments, before those that ROS reads."""
    end = arguments.index('--ros-args') if '--ros-args' in arguments else len(arguments)
    return not {'-h', '--help'}.isdisjoint(arguments[:end])


def demo() -> int:
    """Run the demonstration."""
    return start('demo')


def detector() -> int:
    """Run the node `detector`."""
    return start('detector')


def illumination() -> int:
    """Run the node `illumination`."""
    return start('illumination')


def scoreboard() -> int:
    """Run the node `scoreboard`."""
    return start('scoreboard')
