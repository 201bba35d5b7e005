"""What tests and benchmarks share: places, real nodes and made-up bags."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
"""The sources."""


def environment(*folders: object, **changes: str) -> dict[str, str]:
    """Return the variables of a process that imports from the sources, and then from folders.

    Where this process imports from comes last: of colcon's build, it has the compiled messages.
    """
    path = [str(ROOT), *map(str, folders), os.environ.get('PYTHONPATH', '')]
    return {**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, path)), **changes}


PHOTOS = Path(os.environ.get('AHF_PHOTOS') or ROOT.parent / 'shared' / 'photos')
"""Photographs with truth, which are no part of the package."""
