"""Photographs with truth: tests of them skip where they are missing, unless they were promised."""

from __future__ import annotations

import os

import pytest

from support import PHOTOS, ROOT

PANEL = PHOTOS / 'panel'
WALL = PHOTOS / 'wall' / 'wall_14bit.jpg'

PROMISED = bool(
    os.environ.get('AHF_PHOTOS') or (os.environ.get('CI') and (ROOT.parent / 'shared').is_dir())
)
"""Whether somebody says that they are there: AHF_PHOTOS does, and the place of CI."""

needs_photographs = pytest.mark.skipif(
    not (PROMISED or PHOTOS.is_dir()),
    reason=f'no photographs in {PHOTOS}; AHF_PHOTOS names their folder',
)
