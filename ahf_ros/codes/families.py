"""All families of coded targets, by the kind of their print."""

from __future__ import annotations

from ahf_ros.codes import ring, square

KINDS: dict[str, tuple[str, ...]] = {
    'ring': ring.FAMILY_NAMES,
    'aruco': square.ARUCO_NAMES,
    'apriltag': square.APRILTAG_NAMES,
    'gsi': ('gsi',),
    'dots': ('dots',),
}
"""The families of each kind."""

FAMILY_NAMES = tuple(name for names in KINDS.values() for name in names)
"""The families that `family` accepts."""
