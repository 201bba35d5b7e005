"""Write the dependencies in package.xml, the recipes for conda and Debian, and distributions.ini.

pyproject.toml names each of them once; this script needs Python 3.11, which reads it.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import tomllib

ROOT = Path(__file__).resolve().parents[1]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / 'pyproject.toml').read_text(encoding='utf-8'))
OURS: dict[str, Any] = PROJECT['tool']['ahf_ros']
PACKAGING, NAMES, ROS, WHEELS = (OURS[it] for it in ('packaging', 'names', 'ros', 'wheels'))

CONDITION = ' condition="$AHF_ROS_COMMANDS == 1"'
COMMENT = '  <!-- Of commands only: AHF_ROS_COMMANDS=1 rosdep install ... installs them, too. -->'
DISTRIBUTIONS = """\
# Which wheels of ROS 2 the package is built against and runs with where no ROS is installed.
# ros/setup.py reads it; the variable AHF_ROS_DISTRIBUTION chooses, jazzy where it is not set.
# Written by scripts/write_packaging.py from pyproject.toml.
"""


def extras(*names: str) -> dict[str, str]:
    """Return the packages that extras bring, those of extras that they name included.

    The values are the accepted versions.
    """
    found: dict[str, str] = {}
    for requirement in (
        it for name in names for it in PROJECT['project']['optional-dependencies'][name]
    ):
        if brought := re.fullmatch(r'ahf_ros\[(.*)\]', requirement):
            found |= extras(*brought[1].split(','))
        else:
            found |= split(requirement)
    return found


def required() -> dict[str, str]:
    """Return the packages that are installed without any extra, and their accepted versions."""
    return {
        name: bound
        for it in PROJECT['project']['dependencies']
        for name, bound in split(it).items()
    }


def split(requirement: str) -> dict[str, str]:
    """Return the name of a requirement and the versions that it accepts."""
    (parts,) = re.findall(r'^([\w.-]+)(?:\[.*\])?(.*)$', requirement)
    return {parts[0]: parts[1]}


def named(packages: Iterable[str], *kinds: str) -> list[str]:
    """Return what packages are called, by the first of some kinds that has a name of its own."""
    return sorted(
        next((NAMES[it][kind] for kind in kinds if kind in NAMES.get(it, ())), f'python3-{it}')
        for it in packages
    )


def package_xml(text: str) -> str:
    """Return package.xml with the dependencies of today."""
    commands = [*extras(*PACKAGING['commands']), *PACKAGING['commands-only']]
    nodes = [it for it in [*required(), *PACKAGING['nodes']] if it not in commands]
    groups = (
        ('buildtool_depend', '', ROS['build']),
        ('depend', '', ROS['messages']),
        ('exec_depend', '', sorted([*ROS['run'], *named(nodes, 'rosdep', 'debian')])),
        ('exec_depend', CONDITION, named(commands, 'rosdep', 'debian')),
        (
            'test_depend',
            '',
            sorted([*ROS['test'], *named([*commands, *PACKAGING['tests']], 'rosdep', 'debian')]),
        ),
    )
    blocks = []
    for tag, condition, packages in groups:
        lines = [f'  <{tag}{condition}>{it}</{tag}>\n' for it in packages]
        blocks.append((f'{COMMENT}\n' if condition else '') + ''.join(lines))
    new = '\n'.join(blocks)
    return re.sub(r'  <buildtool_depend>.*</test_depend>\n', lambda _: new, text, flags=re.DOTALL)


def conda(text: str) -> str:
    """Return the recipe for conda with the version and the dependencies of today."""
    python = required() | extras(*PACKAGING['commands']) | dict.fromkeys(PACKAGING['nodes'], '')
    foreign = [
        f'{NAMES.get(it, {}).get("conda", it)} {bound}'.strip() for it, bound in python.items()
    ]
    host = [*ROS['build'], *ROS['messages']]
    run = [*ROS['messages'], *ROS['run']]
    for name, others, ours in (('host', ['numpy'], host), ('run', foreign, run)):
        ros = [f'ros-${{{{ distro }}}}-{it.replace("_", "-")}' for it in ours]
        items = [*sorted([*others, 'python']), *sorted(ros)]
        lines = ''.join(f'    - {it}\n' for it in items)
        old = re.search(rf'^  {name}:\n((    - .*\n)+)', text, re.MULTILINE)
        assert old, name
        text = text.replace(old[1], lines)
    version = ElementTree.parse(ROOT / 'package.xml').findtext('version')
    return re.sub(r'(?<=^  version: )\d.*', str(version), text, flags=re.MULTILINE)


def debian(text: str) -> str:
    """Return the file control of Debian with the dependencies of today.

    dh-python reads those that are required from pyproject.toml.
    """
    (oldest,) = re.findall(r'setuptools>=(\d+)', ' '.join(PROJECT['build-system']['requires']))
    text = re.sub(r'(?<=python3-setuptools \(>= )\d+', oldest, text)
    recommended = ',\n            '.join(named(extras(*PACKAGING['commands']), 'debian'))
    suggested = ', '.join(named(extras(*PACKAGING['suggested']), 'debian'))
    return re.sub(
        r'^Recommends: .*?^Suggests: .*?$',
        f'Recommends: {recommended}\nSuggests: {suggested}',
        text,
        flags=re.DOTALL | re.MULTILINE,
    )


def overrides(_: str) -> str:
    """Return which packages dh-python would look for under another name."""
    names = {it: NAMES[it]['debian'] for it in required() if 'debian' in NAMES.get(it, ())}
    return ''.join(f'{it.replace("-", "_")} {name}\n' for it, name in names.items())


def distributions(_: str) -> str:
    """Return the wheels of ROS 2 of each distribution, to build with and to run with."""
    text = DISTRIBUTIONS
    for distribution in dict.fromkeys(name for versions in WHEELS.values() for name in versions):
        build, run = '', ''
        for name, versions in WHEELS.items():
            if distribution in versions:
                line = f'  ros-{name}=={versions[distribution]}\n'
                package = name.split('[')[0].replace('-', '_')
                run += line if package in [*ROS['messages'], *ROS['run']] else ''
                build += line if package not in ROS['run'] else ''
        text += f'\n[{distribution}]\nbuild =\n{build}run =\n{run}'
    return text


FILES: dict[str, Callable[[str], str]] = {
    'package.xml': package_xml,
    'packaging/conda/recipe.yaml': conda,
    'packaging/debian/control': debian,
    'packaging/debian/py3dist-overrides': overrides,
    'distributions.ini': distributions,
}
"""What makes the new text of each file of the old one."""


if __name__ == '__main__':
    for name, renewed in FILES.items():
        path = ROOT / name
        path.write_text(renewed(path.read_text(encoding='utf-8')), encoding='utf-8')
