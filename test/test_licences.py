"""docs/licences.md, which scripts/licences.py prints."""

from __future__ import annotations

import ast
import configparser
import re

from support import ROOT


def normalized(requirement: str) -> str:
    name = re.match(r'[\w.-]+', requirement)
    assert name
    return re.sub('[-_.]+', '-', name[0]).lower()


def declared() -> set[str]:
    """Return the names of what setup.py and distributions.ini need to run."""
    parsed = ast.parse((ROOT / 'setup.py').read_text()).body
    (own,) = (
        ast.literal_eval(node.value)
        for node in parsed
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == 'REQUIREMENTS'
    )
    distributions = configparser.ConfigParser()
    distributions.read(ROOT / 'distributions.ini')
    return {normalized(it) for it in [*own, *distributions['jazzy']['run'].split()]}


def test_the_licence_of_every_dependency_is_listed() -> None:
    lines = (ROOT / 'docs' / 'licences.md').read_text().splitlines()
    rows = [line.strip('| ').split(' | ') for line in lines if line.startswith('| ')][1:]
    licences = dict(rows)
    assert len(declared()) > 10
    assert declared() <= set(licences)
    assert all(licences.values()) and 'not stated' not in licences.values()
