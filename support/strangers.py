"""Photographs by strangers: what they show, and where they are in clones of repositories."""

import json
import subprocess
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.target import TrueTarget
from support import ROOT

TRUTH = ROOT / 'benchmarks' / 'truth'
"""What photographs show, and the families that the package does not have."""

Photograph = dict[str, Any]


def photographs() -> list[Photograph]:
    """Return what all photographs show."""
    return json.loads((TRUTH / 'photographs.json').read_text())


def targets_of(shown: Photograph) -> list[TrueTarget]:
    """Return the targets of a photograph."""
    counted = [TrueTarget(*it) for it in shown['targets']]
    others = [TrueTarget(no, x, y, confirmed=False) for no, x, y in shown.get('uncounted', ())]
    return counted + others


def picture(folder: Path, shown: Photograph) -> np.ndarray:
    """Return a photograph in gray, from the clone of its repository.

    Raises
    ------
    ValueError
        If there is no clone, or if it does not have this picture.
    """
    clone = folder / shown['repository']
    command = ['git', '-C', str(clone), 'cat-file', 'blob', shown['blob']]
    git = subprocess.run(command, capture_output=True, check=False)
    if git.returncode:
        raise ValueError(
            f'{clone} has no {shown["path"]} ({shown["blob"]}), accepted is a clone of '
            f'https://github.com/{shown["repository"]}'
        )
    gray = cv2.imdecode(np.frombuffer(git.stdout, np.uint8), cv2.IMREAD_GRAYSCALE)
    return np.asarray(gray)
