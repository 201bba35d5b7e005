"""Code words, printed designs and sheets; here the names of families, all that settings need."""

from pathlib import Path
from string import digits

RING_FOLDER = Path(__file__).with_name('ring_families')
"""The data files of the families of ring targets."""

_VENDORS = 'metashape', 'aicon', 'cct'


def _order(name: str) -> tuple[int, str, int, str]:
    vendor = name.rstrip(digits)
    known = _VENDORS.index(vendor) if vendor in _VENDORS else len(_VENDORS)
    return known, vendor, len(name), name


RING_NAMES = tuple(sorted((path.stem for path in RING_FOLDER.glob('*.json')), key=_order))
"""Families of ring targets: vendor or program, and number of sectors."""

VENDOR_NAMES = tuple(name for name in RING_NAMES if not name.startswith('cct'))
"""Those that vendors print. The others have nearly every word."""

ARUCO_NAMES = (
    *(f'aruco_{side}x{side}_{count}' for side in (4, 5, 6, 7) for count in (50, 100, 250, 1000)),
    'aruco_original',
    'aruco_mip_36h12',
)
"""Families of ArUco: cells along a side, and number of markers."""

APRILTAG_NAMES = ('apriltag_16h5', 'apriltag_25h9', 'apriltag_36h10', 'apriltag_36h11')
"""Families of AprilTag."""

CCTAG_NAMES = ('cctag3', 'cctag4')
"""Families of CCTag, by the number of their black rings."""

SQUARE_NAMES = (*ARUCO_NAMES, *APRILTAG_NAMES)
"""All families of square markers."""
