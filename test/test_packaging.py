"""Built from the sources: by rosdep and bloom, for Debian, for conda, in a container."""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from support import ROOT

PACKAGE = ElementTree.parse(ROOT / 'package.xml').getroot()
VERSION = PACKAGE.findtext('version') or ''
NAMED = {it.text or '' for it in PACKAGE if it.tag.endswith('depend')}

ON_NOBLE = {
    'python3-argcomplete',
    'python3-hypothesis',
    'python3-jinja2',
    'python3-matplotlib',
    'python3-numpy',
    'python3-opencv',
    'python3-pil',
    'python3-pytest',
    'python3-reportlab',
    'python3-rich',
    'python3-ruamel.yaml',
    'python3-scipy',
    'python3-sklearn',
    'python3-yaml',
}
"""Keys of rosdep that stand for packages of the same name of Ubuntu 24.04, noble, which Jazzy and
Kilted are for. Looked up in the rules of ros/rosdistro of 2026-08-22, commit 8468e88c."""

RELEASED = {
    'ament_cmake',
    'ament_cmake_lint_cmake',
    'ament_cmake_pytest',
    'ament_cmake_python',
    'ament_cmake_xmllint',
    'ament_index_python',
    'ament_lint_auto',
    'builtin_interfaces',
    'diagnostic_msgs',
    'geometry_msgs',
    'launch',
    'launch_ros',
    'lifecycle_msgs',
    'rcl_interfaces',
    'rclpy',
    'rosgraph_msgs',
    'rosidl_default_generators',
    'rosidl_default_runtime',
    'sensor_msgs',
    'sensor_msgs_py',
    'std_msgs',
    'std_srvs',
    'tf2_msgs',
    'vision_msgs',
    'visualization_msgs',
}
"""ROS packages that both distributions have, looked up in the same."""

CONDA = {
    'python3-opencv': 'py-opencv',
    'python3-pil': 'pillow',
    'python3-sklearn': 'threadpoolctl',
    'python3-yaml': 'pyyaml',
}
"""Names in conda-forge that differ from those of rosdep."""


def test_rosdep_resolves_every_dependency_without_pip() -> None:
    """bloom refuses keys that pip resolves, and on Ubuntu 24.04 they cannot be installed."""
    assert set() == NAMED - RELEASED - ON_NOBLE
    assert set() == (RELEASED | ON_NOBLE) - NAMED, 'nobody needs these any more'


@pytest.mark.skipif('AHF_ROSDISTRO' not in os.environ, reason='AHF_ROSDISTRO is no rosdistro')
def test_that_is_what_the_rules_of_rosdep_say() -> None:
    """With a checkout of ros/rosdistro, as on the day before a release."""
    rosdistro = Path(os.environ['AHF_ROSDISTRO'])
    read = YAML(typ='safe').load
    rules = read(rosdistro / 'rosdep' / 'base.yaml') | read(rosdistro / 'rosdep' / 'python.yaml')
    for key in ON_NOBLE:
        rule = rules[key]['ubuntu']
        if isinstance(rule, dict):
            rule = rule.get('noble', rule.get('*'))
        assert rule == [key]
    for name in ('jazzy', 'kilted'):
        file = read(rosdistro / name / 'distribution.yaml')
        assert 'noble' in file['release_platforms']['ubuntu']
        released = set()
        for repository, entry in file['repositories'].items():
            if release := entry.get('release'):
                released |= set(release.get('packages', [repository]))
        assert RELEASED - released == set()


def test_who_uses_the_messages_need_not_install_what_commands_need() -> None:
    conditions = {it.text: it.get('condition') for it in PACKAGE.iter('exec_depend')}
    of_commands = {key for key, condition in conditions.items() if condition}
    assert of_commands == {
        *('python3-argcomplete', 'python3-jinja2', 'python3-pil', 'python3-reportlab'),
        *('python3-scipy', 'python3-sklearn'),
    }
    assert {conditions[key] for key in of_commands} == {'$AHF_ROS_COMMANDS == 1'}


def test_the_recipe_for_conda_has_the_dependencies_of_the_package() -> None:
    recipe = YAML(typ='safe').load(ROOT / 'packaging' / 'conda' / 'recipe.yaml')
    assert recipe['context']['version'] == VERSION
    run = {it.split(' >')[0] for it in recipe['requirements']['run']} - {'python'}
    needed = {it.text or '' for kind in ('depend', 'exec_depend') for it in PACKAGE.iter(kind)}
    ros = {f'ros-${{{{ distro }}}}-{it.replace("_", "-")}' for it in needed & RELEASED}
    foreign = {CONDA.get(it, it.removeprefix('python3-')) for it in needed - RELEASED}
    assert run == ros | foreign
    build = {it.text or '' for kind in ('depend', 'buildtool_depend') for it in PACKAGE.iter(kind)}
    host = {it.removeprefix('ros-${{ distro }}-') for it in recipe['requirements']['host']}
    assert host - {'numpy', 'python'} == {it.replace('_', '-') for it in build}


def test_the_recipe_for_debian_is_of_this_version() -> None:
    debian = ROOT / 'packaging' / 'debian'
    (version,) = re.findall(r'^ahf-ros \((.*)-\d+\)', (debian / 'changelog').read_text(), re.M)
    assert version == VERSION
    control = (debian / 'control').read_text()
    project = (ROOT / 'pyproject.toml').read_text()
    (oldest,) = re.findall(r'python3-setuptools \(>= (\d+)\)', control)
    assert f'requires = ["setuptools>={oldest}"]' in project
    overrides = (debian / 'py3dist-overrides').read_text()
    assert 'opencv_python_headless python3-opencv' in overrides
    (email,) = {it.get('email') for it in PACKAGE.iter('maintainer')}
    assert all(f'<{email}>' in (debian / it).read_text() for it in ('changelog', 'control'))


def test_the_changelog_is_what_bloom_reads() -> None:
    """REP 132: a title, then headings of versions or Forthcoming, newest first, with bullets."""
    text = (ROOT / 'CHANGELOG.rst').read_text()
    assert 'Changelog for package ahf_ros\n' in text
    headings = re.findall(r'^(Forthcoming|\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\))\n(-+)$', text, re.M)
    assert all(len(line) == len(title) for title, line in headings)
    versions = [title.split(' ')[0] for title, _ in headings]
    assert versions[versions[0] == 'Forthcoming'] == VERSION


def test_the_container_copies_what_is_there() -> None:
    text = (ROOT / 'packaging' / 'Containerfile').read_text()
    assert "'/src[all]' /src/ros" in text
    name = re.search(r'^name = "(.*)"', (ROOT / 'ros' / 'pyproject.toml').read_text(), re.M)
    assert name
    assert f"'ahf_ros[all]' {name[1]}" in text
