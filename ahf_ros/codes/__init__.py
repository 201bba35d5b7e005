"""Code words and printed designs; here the names of families, which settings need without them."""

from __future__ import annotations

import re
from pathlib import Path

RING_FOLDER = Path(__file__).with_name('ring_families')
"""The data files of the families of ring targets."""


def _vendor_and_bits(name: str) -> tuple[str, int]:
    vendor, bits = re.fullmatch(r'(\D+)(\d+)', name).groups()
    return vendor, int(bits)


RING_NAMES = tuple(
    sorted((path.stem for path in RING_FOLDER.glob('*.json')), key=_vendor_and_bits)
)
"""Families of ring targets: vendor, and number of sectors."""

ARUCO_NAMES = (
    *(f'aruco_{side}x{side}_{count}' for side in (4, 5, 6, 7) for count in (50, 100, 250, 1000)),
    'aruco_original',
)
"""Families of ArUco: cells along a side, and number of markers."""

APRILTAG_NAMES = ('apriltag_16h5', 'apriltag_25h9', 'apriltag_36h10', 'apriltag_36h11')
"""Families of AprilTag."""

SQUARE_NAMES = (*ARUCO_NAMES, *APRILTAG_NAMES)
"""All families of square markers."""
