"""What tests and benchmarks share: places, real nodes and made-up bags."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
"""The sources."""

PHOTOS = Path(os.environ.get('AHF_PHOTOS') or ROOT.parent / 'shared' / 'photos')
"""Photographs with truth, which are no part of the package."""
