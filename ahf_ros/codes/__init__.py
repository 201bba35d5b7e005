"""Code words and printed designs; here the names of families, which settings need without them."""

RING_NAMES = ('metashape12', 'metashape14', 'metashape16', 'metashape20', 'aicon12', 'aicon14')
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
