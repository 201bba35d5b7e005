"""Write the parameter files in config/ from the declarations in the code."""

from __future__ import annotations

import json
import textwrap
from pathlib import Path

from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.nodes.settings import (
    DetectorNodeSettings,
    IlluminationNodeSettings,
    PoseNodeSettings,
    RegistrationNodeSettings,
)

CONFIG = Path(__file__).resolve().parent.parent / 'config'
NODES = {
    'detector': DetectorNodeSettings,
    'illumination': IlluminationNodeSettings,
    'pose': PoseNodeSettings,
    'registration': RegistrationNodeSettings,
}
WIDTH = 99
HEADER = """\
# Parameters of the node `{node}`: what each one means, what is accepted, and its default.
# Written by scripts/write_config.py; copy this file to change values.
/**:
  ros__parameters:
"""


def entry(item: Parameter) -> str:
    """Return the lines of one parameter."""
    comment = f'{item.description} Accepted is {item.accepted}.'
    lines = textwrap.wrap(comment, WIDTH, initial_indent='    # ', subsequent_indent='    # ')
    return '\n'.join([*lines, f'    {item.name}: {value(item.default)}', ''])


def value(default: object) -> str:
    """Return a value in YAML 1.1, where a number with an exponent needs a decimal point."""
    text = json.dumps(default)
    return text.replace('e-', '.0e-') if isinstance(default, float) and '.' not in text else text


def configuration(node: str) -> str:
    """Return the parameter file of a node."""
    return HEADER.format(node=node) + '\n'.join(map(entry, flat_parameters(NODES[node])))


if __name__ == '__main__':
    for name in NODES:
        (CONFIG / f'{name}.yaml').write_text(configuration(name))
