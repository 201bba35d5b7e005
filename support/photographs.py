"""Photographs with truth: tests of them skip where they are missing, unless they were promised."""

import os

import pytest

from support import PHOTOS, ROOT

PANEL = PHOTOS / 'panel'
WALL = PHOTOS / 'wall' / 'wall_14bit.jpg'

IN_CI = bool(os.environ.get('CI')) and (ROOT.parent / 'shared').is_dir()
"""Whether this is CI, which promises everything in the folder beside the sources."""

PROMISED = IN_CI or bool(os.environ.get('AHF_PHOTOS'))

needs_photographs = pytest.mark.skipif(
    not (PROMISED or PHOTOS.is_dir()),
    reason=f'no photographs in {PHOTOS}; AHF_PHOTOS names their folder',
)
