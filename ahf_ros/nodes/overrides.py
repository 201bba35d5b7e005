"""Arguments and parameter files that have no effect on a node, each with what may be meant."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml

from ahf_ros.text import printable, shown

MAXIMUM_LENGTH = 2000
"""Maximum length of a list of unknown parameters."""

_PARAMETERS = 'ros__parameters'
_NAMESPACE = re.compile(r'/|(/[A-Za-z_][A-Za-z_0-9]*)+')
_RULE = re.compile(r'(?P<node>[^:=]+):(?P<name>[^:=]+):=')


def unknown_parameters(given: Iterable[str], known: Collection[str]) -> Iterator[str]:
    """Yield a message for each given parameter that the node does not have.

    Parameters
    ----------
    given : iterable of str
        Names from the command line and from parameter files.
    known : collection of str
        Parameters of the node.

    Examples
    --------
    >>> list(unknown_parameters(['expected_target', 'queue'], ['expected_targets', 'queue']))
    ['no parameter is named expected_target; the nearest is expected_targets']
    """
    unlike = []
    for name in sorted(set(given) - set(known)):
        if nearest := _nearest(name, known):
            yield f'no parameter is named {printable(name)}; the nearest is {nearest[0]}'
        else:
            unlike.append(name)
    if unlike:
        names = printable(', '.join(unlike), MAXIMUM_LENGTH)
        yield f'no parameter is named {names}; is that a parameter of another node?'


def unknown_arguments(arguments: Iterable[str], known: Collection[str]) -> Iterator[str]:
    """Yield a message for each argument that is not meant for ROS.

    Parameters
    ----------
    arguments : iterable of str
        Arguments without those that ROS reads.
    known : collection of str
        Parameters of the node.

    Examples
    --------
    >>> print(*unknown_arguments(['--seeds', '7'], ['seed', 'queue']))
    argument '--seeds 7' has no effect; meant may be --ros-args -p seed:=7
    """
    for option, *values in _groups(arguments):
        name, assigned, value = option.lstrip('-').replace(':=', '=').partition('=')
        if option == '-p' and values:
            name, assigned, value = values[0].replace(':=', '=').partition('=')
        nearest = _nearest(name.replace('-', '_'), known)
        value = value if assigned else ' '.join(values)
        meant = [f'-p {it}:={value or "..."}' for it in nearest]
        text = printable(' or '.join(meant or ['-p NAME:=VALUE']))
        given = shown(' '.join((option, *values)))
        yield f'argument {given} has no effect; meant may be --ros-args {text}'


def foreign_parameters(arguments: Sequence[str], node: str) -> Iterator[str]:
    """Yield a message for each parameter file or argument that is for other nodes only.

    Parameters
    ----------
    arguments : sequence of str
        All arguments of the process.
    node : str
        Fully qualified name of the node.
    """
    for option, value in pairwise(arguments):
        if option == '--params-file':
            names = _nodes(Path(value))
            if not any(_matches(name, node) for name in names):
                listed = f', only for {printable(", ".join(names))}' if names else ''
                yield f'{printable(value)} has no parameters for {node}{listed}'
        elif option in ('-p', '--param'):
            rule = _RULE.match(value)
            if rule and rule['node'] != node.rpartition('/')[2]:
                yield f'{printable(value)} is not for {node}, but for {printable(rule["node"])}'


def check_arguments(arguments: Sequence[str]) -> None:
    """Refuse what ROS refuses with a report of several lines.

    Parameters
    ----------
    arguments : sequence of str
        All arguments of the process.

    Raises
    ------
    ValueError
        If a parameter file is missing or a namespace is not one.
    """
    for option, value in pairwise(arguments):
        if option == '--params-file' and not Path(value).is_file():
            raise ValueError(f'params-file is {shown(value)}, accepted is the name of a file')
        name, assigned, namespace = value.partition(':=')
        renames = option in ('-r', '--remap') and assigned and name.endswith('__ns')
        if renames and not _NAMESPACE.fullmatch(namespace):
            raise ValueError(
                f'namespace is {shown(namespace)}, accepted are names of letters, digits and '
                'underscores, each after a slash'
            )


def _nearest(name: str, known: Collection[str]) -> list[str]:
    return [name] if name in known else get_close_matches(name, known, n=2)


def _groups(arguments: Iterable[str]) -> Iterator[list[str]]:
    """Yield each option with its value, and each other argument on its own."""
    group: list[str] = []
    for item in arguments:
        if group and (item.startswith('-') or len(group) == 2 or not group[0].startswith('-')):
            yield group
            group = []
        group.append(item)
    if group:
        yield group


def _nodes(file: Path) -> list[str]:
    """Return the names of the nodes that a parameter file is for."""
    try:
        content = yaml.safe_load(file.read_bytes())
    except (OSError, yaml.YAMLError):  # gone meanwhile, or YAML that only ROS reads
        return ['/**']
    return list(_sections(content)) if isinstance(content, Mapping) else []


def _sections(content: Mapping[str, Any], prefix: str = '') -> Iterator[str]:
    """Yield the names of the nodes that have parameters in a mapping."""
    for key, value in content.items():
        if key == _PARAMETERS:
            yield prefix
        elif isinstance(value, Mapping):
            yield from _sections(value, f'{prefix}/{str(key).strip("/")}')


def _matches(name: str, node: str) -> bool:
    """Return whether the name of a section stands for a node; ** is any number of parts."""
    parts = [
        '(/[^/]+)*' if it == '**' else '/' + re.escape(it).replace(r'\*', '[^/]*')
        for it in name.split('/')[1:]
    ]
    return re.fullmatch(''.join(parts), node) is not None
