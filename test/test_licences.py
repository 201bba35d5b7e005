"""docs/licences.md, which scripts/licences.py prints."""

import configparser
import re

from ahf_ros.base.extras import REQUIRED
from support import ROOT


def normalized(requirement: str) -> str:
    name = re.match(r'[\w.-]+', requirement)
    assert name
    return re.sub('[-_.]+', '-', name[0]).lower()


def declared() -> set[str]:
    """Return the names of what the package and its nodes need to run."""
    distributions = configparser.ConfigParser()
    distributions.read(ROOT / 'distributions.ini')
    return {normalized(it) for it in [*REQUIRED, *distributions['jazzy']['run'].split()]}


def test_the_licence_of_every_dependency_is_listed() -> None:
    lines = (ROOT / 'docs' / 'licences.md').read_text().splitlines()
    rows = [line.strip('| ').split(' | ') for line in lines if line.startswith('| ')][1:]
    licences = dict(rows)
    assert len(declared()) > 10
    assert declared() <= set(licences)
    assert all(licences.values()) and 'not stated' not in licences.values()
