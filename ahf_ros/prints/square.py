"""Square markers: the ArUco and AprilTag dictionaries that OpenCV holds."""

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import cv2
import numpy as np

from ahf_ros.prints import APRILTAG_NAMES, SQUARE_NAMES
from ahf_ros.prints.prints import Cells, Print, Proportions, Shape

HALF_SIDE = 2.4
"""Half the side of a square marker, in radii of the dot of a ring target of the same size."""

_QUIET_ZONE = 4.2  # as of ring targets, in these radii
_PLAIN = 0.3  # share of the corners of cells; it is 0.5 of random cells


@dataclass(frozen=True, slots=True)
class CellPrint(Print):
    """The print of the markers of a dictionary, one of `SQUARE_NAMES`.

    What its words are read from raises a ValueError if this OpenCV does not have the dictionary.
    """

    name: str

    @property
    def numbers(self) -> np.ndarray:
        """All IDs, ndarray of int64, ascending."""
        return np.arange(len(dictionary(self.name).bytesList))

    def word(self, number: int) -> int:
        """Return the code word of an ID, which is the same."""
        return number

    @property
    def proportions(self) -> Proportions:
        """What all markers have in common."""
        return Proportions(
            reach=HALF_SIDE * 2**0.5,
            radius=HALF_SIDE,
            quiet_zone=_QUIET_ZONE,
            radii={'half_side': HALF_SIDE},
        )

    def ink(self, word: int, pinhole: float = 0.0) -> tuple[Shape, ...]:
        """Return the cells of a marker with its border."""
        rows = (marker(self.name, word, 1) == 0).tolist()
        return (Cells(HALF_SIDE, tuple(map(tuple, rows))),)

    def orbits(self, numbers: np.ndarray) -> np.ndarray:
        """Return the words of the markers in all four rotations, shape (n, 4)."""
        rotations = dictionary(self.name).bytesList[numbers].transpose(0, 2, 1).astype(np.uint64)
        places = np.uint64(8) * np.arange(rotations.shape[2], dtype=np.uint64)
        return (rotations << places).sum(axis=2, dtype=np.uint64)


def dictionary(name: str) -> Any:
    """Return a cv2.aruco.Dictionary by its name, one of `SQUARE_NAMES`.

    Raise a ValueError if there is no such dictionary, or this OpenCV has none at all.
    """
    if name not in SQUARE_NAMES:
        raise ValueError(f'family is {name!r}, accepted is one of {", ".join(SQUARE_NAMES)}')
    if not hasattr(cv2, 'aruco') or not hasattr(cv2.aruco, 'ArucoDetector'):
        raise ValueError(
            f'family is {name!r}, accepted with opencv-python-headless of at least 4.7, which has '
            f'square markers; this is OpenCV {cv2.__version__}'
        )
    if not has_dictionary(name):
        raise ValueError(
            f'family is {name!r}, accepted with a newer OpenCV; this is {cv2.__version__}'
        )
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, _member(name)))


def has_dictionary(name: str) -> bool:
    """Return whether this OpenCV has the dictionary of a family, one of `SQUARE_NAMES`."""
    return hasattr(cv2, 'aruco') and hasattr(cv2.aruco, 'ArucoDetector') and bool(_member(name))


@cache
def _member(name: str) -> str:
    """Return what cv2.aruco calls a dictionary, '' if it has none."""
    known = {member.lower(): member for member in dir(cv2.aruco)}
    members = (f'dict_{name}', f'dict_{name.removeprefix("aruco_")}')
    return next((known[member] for member in members if member in known), '')


def marker(name: str, number: int, cell: int) -> Any:
    """Return the print of a marker, ndarray of uint8, shape (side, side), 0 where there is ink.

    It has its black border and no margin; a cell has `cell` px. Raise a ValueError if there is no
    such ID in the dictionary `name`.
    """
    table = dictionary(name)
    count = table.bytesList.shape[0]
    if not 0 <= number < count:
        raise ValueError(f'number is {number}, accepted is an integer from 0 to {count - 1}')
    return cv2.aruco.generateImageMarker(table, number, cell * (table.markerSize + 2))


@lru_cache(maxsize=64)
def words(name: str) -> np.ndarray:
    """Return the cells of all markers of a dictionary, ndarray of bool, shape (k, side, side).

    They are those inside the border, True where there is no ink, by ID.
    """
    table = dictionary(name)
    count, side = len(table.bytesList), table.markerSize + 2
    prints = [cv2.aruco.generateImageMarker(table, number, side) for number in range(count)]
    return np.array(prints)[:, 1:-1, 1:-1] > 0


def corner_counts(name: str) -> np.ndarray:
    """Return how many corners what is white on the markers of a dictionary has, (k,), by ID."""
    cells = np.pad(words(name), ((0, 0), (1, 1), (1, 1)))
    corners = cells[:, :-1, :-1] ^ cells[:, :-1, 1:] ^ cells[:, 1:, :-1] ^ cells[:, 1:, 1:]
    return corners.sum(axis=(1, 2))


@lru_cache(maxsize=64)
def are_plain(name: str) -> np.ndarray:
    """Return which markers of a dictionary letters and windows look like, bool, shape (k,), by ID.

    What is white on them has few corners for the number of their cells.
    """
    return corner_counts(name) < _PLAIN * (words(name).shape[1] + 1) ** 2


def borders(name: str) -> tuple[int, ...]:
    """Return the widths that the border of a dictionary's markers may have, cells.

    Kalibr prints AprilTags with two in its AprilGrids.
    """
    return (1, 2) if name.startswith('apriltag_') else (1,)


def corner_order(name: str) -> tuple[int, int, int, int]:
    """Return which corner of a marker comes first, second, ... in `apriltag_msgs`.

    The corners of a `SquareMarker` are clockwise from the top left one of the marker as OpenCV
    prints it. Those of the AprilTag library are counter-clockwise from the bottom left one of the
    tag as it prints that itself: half a turn from the print of OpenCV [1]_. Markers of other
    families have no other print.

    References
    ----------
    .. [1] AprilRobotics/apriltag, `apriltag_detection_t` in apriltag.h; opencv-python #1195.
    """
    return (1, 0, 3, 2) if name in APRILTAG_NAMES else (3, 2, 1, 0)


def library_name(name: str) -> str:
    """Return what the library of a family calls it: tag36h11 is `apriltag_36h11` here."""
    return name.replace('apriltag_', 'tag') if name in APRILTAG_NAMES else name
