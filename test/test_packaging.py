"""Built from the sources: by rosdep and bloom, for Debian, for conda, in a container."""

import os
import re
import runpy
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from support import ROOT

PACKAGE = ElementTree.parse(ROOT / 'package.xml').getroot()
VERSION = PACKAGE.findtext('version') or ''
NAMED = {it.text or '' for it in PACKAGE if it.tag.endswith('depend')}
ON_NOBLE = {it for it in NAMED if it.startswith('python3-')}
"""Keys of rosdep for packages of the same name of Ubuntu 24.04, which Jazzy and Kilted are for."""


@pytest.mark.parametrize(
    'name',
    [
        'package.xml',
        'packaging/conda/recipe.yaml',
        'packaging/debian/control',
        'packaging/debian/py3dist-overrides',
        'distributions.ini',
    ],
)
def test_lists_of_dependencies_are_those_of_pyproject(name: str) -> None:
    pytest.importorskip('tomllib', reason='Python is older than 3.11')
    script = runpy.run_path(str(ROOT / 'scripts' / 'write_packaging.py'))
    written = (ROOT / name).read_text()
    assert written == script['FILES'][name](written), 'run scripts/write_packaging.py'


@pytest.mark.skipif('AHF_ROSDISTRO' not in os.environ, reason='AHF_ROSDISTRO is no rosdistro')
def test_rosdep_resolves_every_dependency_without_pip() -> None:
    """bloom refuses keys that pip resolves, and on Ubuntu 24.04 they cannot be installed.

    With a checkout of ros/rosdistro, as on the day before a release.
    """
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
        assert NAMED - ON_NOBLE - released == set()


def test_the_recipe_for_debian_is_of_this_version() -> None:
    debian = ROOT / 'packaging' / 'debian'
    (version,) = re.findall(r'^ahf-ros \((.*)-\d+\)', (debian / 'changelog').read_text(), re.M)
    assert version == VERSION
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
