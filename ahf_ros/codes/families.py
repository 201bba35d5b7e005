"""All families of coded targets, by the kind of their print, and lists of families.

Settings import this module, and with them the command line before it knows whether it computes
anything. Therefore the codes, which take numpy and OpenCV, are imported where they are needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from itertools import combinations
from typing import TYPE_CHECKING

from ahf_ros.codes import APRILTAG_NAMES, ARUCO_NAMES, RING_NAMES, SQUARE_NAMES, VENDOR_NAMES

if TYPE_CHECKING:
    from ahf_ros.codes.dots import DotFamily
    from ahf_ros.codes.gsi import PointFamily
    from ahf_ros.codes.ring import Family

KINDS: dict[str, tuple[str, ...]] = {
    'ring': RING_NAMES,
    'aruco': ARUCO_NAMES,
    'apriltag': APRILTAG_NAMES,
    'gsi': ('gsi',),
    'dots': ('dots',),
}
"""The families of each kind."""

FAMILY_NAMES = tuple(name for names in KINDS.values() for name in names)
"""The families that `family` accepts."""

AUTO = 'auto'
"""Stands for all families of `VENDOR_NAMES`."""

LISTED = KINDS['ring']
"""Families that may be given together, separated by commas: they are read together."""

ACCEPTED = (
    f'one of {", ".join(FAMILY_NAMES)}; several of {", ".join(LISTED)}, separated by commas; or '
    f'{AUTO} for {", ".join(VENDOR_NAMES)}, which are rings, and no others'
)
"""Description of what `family` accepts."""

_SHOWN = 10  # IDs in an error
_ALIKE = 0.65  # share of letters of a name that is suggested; tag36h11 and apriltag_36h11: 0.73


def families_in(text: str) -> tuple[str, ...]:
    """Return the different families that a text names, in its order.

    It names a family, several ring families separated by commas, or 'auto' for those of vendors. Raise
    a ValueError if there is no family; if one is unknown or named twice; if two are of different
    kinds or have the same print; or if families of their kind are not read together.

    Examples
    --------
    >>> families_in('metashape12, aicon14')
    ('metashape12', 'aicon14')
    >>> families_in('auto') == VENDOR_NAMES
    True
    """
    if text == AUTO:
        return VENDOR_NAMES
    names = tuple(part.strip() for part in text.split(','))
    shown = f'family is {text!r}'
    for name in names:
        if name not in FAMILY_NAMES:
            where = f'{shown}, which names {name!r}' if len(names) > 1 else shown
            alike = get_close_matches(name.lower(), FAMILY_NAMES, 1, _ALIKE)
            accepted = f'{alike[0]}, which is most like it, or another family' if alike else ''
            raise ValueError(f'{where}, accepted is {accepted or ACCEPTED}')
    if len(names) > 1:
        _check_list(names, shown)
    return names


def code_family(name: str, file: str = '') -> Family | DotFamily | PointFamily:
    """Return the codes and the proportions of a family that is not of square markers.

    `file` is the data file that describes the family, of `gsi` and `dots`; the usual one where
    empty. Raise a ValueError if there is no such family, or the data file is not accepted.
    """
    from ahf_ros.codes import dots, gsi, ring

    if name == 'gsi':
        return gsi.point_family(file)
    return dots.dot_family(file) if name == 'dots' else ring.family(name)


def numbers_of(name: str, file: str = '') -> Sequence[int]:
    """Return the IDs of a family, ascending; `file` is as for `code_family`."""
    from ahf_ros.codes import square

    if name in SQUARE_NAMES:
        return range(len(square.dictionary(name).bytesList))
    return sorted(code_family(name, file).numbers.tolist())


def check_numbers(field: str, numbers: Iterable[int], families: Sequence[str], file: str) -> None:
    """Refuse numbers that are no ID of any of some families.

    The ValueError calls them `field` and names them; `file` is as for `code_family`.
    """
    known = {name: numbers_of(name, file) for name in families}
    missing = sorted(set(numbers).difference(*known.values()))
    if not missing:
        return
    shown = ', '.join(map(str, missing[:_SHOWN]))
    if len(missing) > _SHOWN:
        shown += f' and {len(missing) - _SHOWN} more'
    accepted = ', '.join(f'{name} from {ids[0]} to {ids[-1]}' for name, ids in known.items())
    raise ValueError(f'{field} has {shown}, accepted are IDs of {accepted}')


def mirrored_number(name: str, code: int) -> int | None:
    """Return the ID that a code word of a family has in a mirror.

    It is the same ID for a symmetric target, and None for families that cannot be read in a
    mirror.

    Examples
    --------
    >>> mirrored_number('metashape12', 71)
    12
    """
    from ahf_ros.codes import cyclic, ring

    if name not in RING_NAMES:
        return None
    family = ring.family(name)
    return family.number(cyclic.mirrored_words(code, family.bits))


def _check_list(names: Sequence[str], shown: str) -> None:
    """Refuse families that cannot be read together."""
    kinds = {name: kind for kind, of_kind in KINDS.items() for name in of_kind}
    for first, second in combinations(names, 2):
        if first == second:
            raise ValueError(f'{shown}, which names {first} twice, accepted is each family once')
        if kinds[first] != kinds[second]:
            raise ValueError(
                f'{shown}, but {first} is read by the detector {kinds[first]} and {second} by the '
                f'detector {kinds[second]}; accepted are families of one detector, which reads '
                'them together'
            )
        # Dictionaries with one number of cells begin with the same markers.
        if first in ARUCO_NAMES and first.rpartition('_')[0] == second.rpartition('_')[0]:
            raise ValueError(
                f'{shown}, but targets of {first} and {second} have the same print; accepted is '
                'one of them'
            )
    if names[0] not in LISTED:
        raise ValueError(
            f'{shown}, but the detector {kinds[names[0]]} reads one family; accepted are several '
            f'of {", ".join(LISTED)}'
        )
