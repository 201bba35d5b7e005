"""Entry points of the nodes: a signal that comes during the imports ends them in order, too."""

from __future__ import annotations

from importlib import import_module

from ahf_ros.ending import ignore_ending
from ahf_ros.nodes.signals import has_arrived, signalled

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
        Command line arguments; those of the process where None.
    """
    signalled()
    module = import_module(NODES[node])
    if has_arrived():
        ignore_ending()
        return 0
    status: int = module.main(arguments)
    return status


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
