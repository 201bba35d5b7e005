"""What `--help` prints for a node; importable without ROS."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable

from ahf_ros.nodes.interfaces import NODES
from ahf_ros.settings.nested import flat_parameters

_WIDTH = 99
_REST = """\
all parameters, while the node runs:
  ros2 param list /{node}
  ros2 param describe /{node} NAME
or docs/parameters.md, and the files in config/.
"""


def help_text(node: str) -> str:
    """Return what a node does, its topics, services and most used parameters.

    Parameters
    ----------
    node : str
        One of `ahf_ros.nodes.interfaces.NODES`.
    """
    about = NODES[node]
    rows = [
        (f'{it.use:7} {it.name}', f'{it.kind}, {it.text.replace("`", "")}')
        for it in about.interfaces
    ]
    parameters = {item.name: item for item in flat_parameters(about.settings)}
    settings = [
        (item.name, f'{item.description} Default: {json.dumps(item.default)}.')
        for item in map(parameters.__getitem__, about.usual)
    ]
    return '\n'.join(
        [
            f'usage: ros2 run ahf_ros {node} --ros-args -p PARAMETER:=VALUE -r TOPIC:=OTHER ...',
            '',
            about.purpose,
            '',
            'topics and services:',
            *_columns(rows),
            '',
            'parameters that are changed most:',
            *_columns(settings),
            '',
            _REST.format(node=node),
        ]
    )


def _columns(rows: Iterable[tuple[str, str]]) -> list[str]:
    """Return the lines of a table of two columns; the second one is wrapped."""
    rows = list(rows)
    width = max(len(first) for first, _ in rows) + 4
    lines = []
    for first, second in rows:
        indent = ' ' * width
        wrapped = textwrap.wrap(
            second, _WIDTH, initial_indent=f'  {first}'.ljust(width), subsequent_indent=indent
        )
        lines.extend(wrapped)
    return lines
