"""Print the licence of every package that is installed with ahf_ros, as the packages state it.

.venv/bin/python scripts/licences.py > docs/licences.md
"""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ElementTree
from importlib.metadata import Distribution, distributions
from pathlib import Path

OURS = ('ahf-ros', 'ahf-ros-interfaces', 'pip')
UNKNOWN = 'not stated'
_MAXIMUM_LENGTH = 60  # characters; longer ones are the text of a licence

HEAD = """# Licences

What `pip install '.[test,docs,test-browser]' ./ros` installs beside ahf_ros, with the licences
that the packages state. Printed by `python scripts/licences.py`.

| package | licence |
|---|---|"""


def installed() -> dict[str, Distribution]:
    """Return the installed packages by their names, without this one and its installer."""
    found = {
        re.sub('[-_.]+', '-', item.metadata['Name']).lower(): item
        for item in distributions()
        if item.metadata['Name']
    }
    # The wheels of ROS hold the metadata of their Python packages, too.
    twice = {name.removeprefix('ros-') for name in found if name.startswith('ros-')}
    return {name: item for name, item in found.items() if name not in twice.union(OURS)}


def licence(item: Distribution) -> str:
    """Return the licence that a package states in its metadata, or in package.xml of ROS."""
    about = item.metadata
    stated = (about.get_all('License-Expression') or about.get_all('License') or [''])[0]
    if stated.strip() and len(stated) <= _MAXIMUM_LENGTH and '\n' not in stated:
        return stated.strip()
    classified = [
        line.split(' :: ')[-1]
        for line in about.get_all('Classifier') or ()
        if line.startswith('License :: ')
    ]
    return ', '.join(classified or _ros_licences(item)) or UNKNOWN


def _ros_licences(item: Distribution) -> list[str]:
    files = {file.name: str(file.locate()) for file in item.files or ()}
    if 'package.xml' in files:
        root = ElementTree.parse(files['package.xml']).getroot()
        return [' '.join((it.text or '').split()) for it in root.iter('license')]
    if 'LICENSE' in files:
        words = Path(files['LICENSE']).read_text(encoding='utf-8').split()
        return [' '.join(words[:4]).rstrip(',')]
    return []


def main() -> int:
    """Print a table."""
    print(HEAD)
    for name, item in sorted(installed().items()):
        print(f'| {name} | {licence(item)} |')
    return 0


if __name__ == '__main__':
    sys.exit(main())
