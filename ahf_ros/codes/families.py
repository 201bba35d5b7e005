"""All families of coded targets, by the kind of their print, and lists of families.

Settings import this module, and with them the command line before it knows whether it computes
anything. Therefore the codes, which take numpy and OpenCV, are imported where they are needed.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from contextlib import suppress
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from ahf_ros.codes import APRILTAG_NAMES, ARUCO_NAMES, CCTAG_NAMES, RING_NAMES, SQUARE_NAMES
from ahf_ros.codes.kept import kept_while_unchanged

if TYPE_CHECKING:
    from ahf_ros.codes.cctag import CircleFamily
    from ahf_ros.codes.dots import DotFamily
    from ahf_ros.codes.gsi import PointFamily
    from ahf_ros.codes.ring import Family

KINDS: dict[str, tuple[str, ...]] = {
    'ring': RING_NAMES,
    'aruco': ARUCO_NAMES,
    'apriltag': APRILTAG_NAMES,
    'gsi': ('gsi',),
    'dots': ('dots',),
    'cctag': CCTAG_NAMES,
}
"""The families of each kind."""

_KIND_OF = {name: kind for kind, names in KINDS.items() for name in names}

FAMILY_NAMES = tuple(_KIND_OF)
"""The families that `family` accepts."""

AUTO = 'auto'
"""Stands for all families of `FAMILY_NAMES` and of data files."""

ACCEPTED = (
    f'one of {", ".join(FAMILY_NAMES)}, or of a family_file; several of these, separated by '
    f'commas; or {AUTO} for all of them'
)
"""Description of what `family` accepts."""

ONE = f'one of {", ".join(FAMILY_NAMES)}, or the family of a family_file'
"""The same where it is a single family."""

Code = TypeVar('Code', 'Family', 'DotFamily', 'PointFamily', 'CircleFamily')
"""The codes of families of one kind."""

_ENDINGS = '.yaml', '.yml', '.json'  # of data files
_SHOWN = 10  # IDs in an error
_ALIKE = 0.65, 0.65, 0.85, 0.85  # share of letters of a name that is suggested, by `_ways`


def families_in(text: str, files: str = '') -> tuple[str, ...]:
    """Return the different families that a text names, in its order.

    It names a family, several separated by commas, or 'auto' for all. `files` are data files,
    separated by commas, that describe more families. Raise a ValueError if there is no family, if
    one is unknown or named twice, or if a file is not accepted.

    Examples
    --------
    >>> families_in('metashape12, apriltag_36h11')
    ('metashape12', 'apriltag_36h11')
    >>> families_in('DICT_4X4_50'), families_in('tag36h11')
    (('aruco_4x4_50',), ('apriltag_36h11',))
    >>> families_in('auto') == FAMILY_NAMES
    True
    """
    return _families_in(text, files) if files else _usual_families_in(text)


def _families_in(text: str, files: str) -> tuple[str, ...]:
    kinds = {name: kind for kind, of_kind in KINDS.items() for name in of_kind}
    given = [part.strip() for part in text.split(',')]
    own: dict[str, str] = {}
    if files and not {_usual_name(name, kinds) for name in given} <= set(kinds):
        own = {name: code.kind for name, code in families_of(files).items()}
        kinds |= own
    if text == AUTO:  # a file takes the place of a usual design
        return tuple(name for name in kinds if name in own or name not in own.values())
    names = tuple(_usual_name(name, kinds) for name in given)
    shown = f'family is {text!r}'
    for name in names:
        if name not in kinds:
            where = f'{shown}, which names {name!r}' if len(names) > 1 else shown
            alike = [
                match
                for way, least in zip(_ways(name), _ALIKE, strict=True)
                for match in get_close_matches(way, list(kinds), 1, least)
                if name
            ]
            accepted = f'{alike[0]}, which is most like it, or another family' if alike else ''
            raise ValueError(f'{where}, accepted is {accepted or ACCEPTED}')
        if sum(name in (it, own.get(it)) for it in names) > 1:
            raise ValueError(f'{shown}, which names {name} twice, accepted is each family once')
    return names


@lru_cache(maxsize=256)
def _usual_families_in(text: str) -> tuple[str, ...]:
    return _families_in(text, '')


def _usual_name(name: str, kinds: Container[str]) -> str:
    """Return the name that a family has here, where other programs write it in another way."""
    return next((way for way in _ways(name) if way in kinds), name)


def _ways(name: str) -> tuple[str, ...]:
    """Return the names that a name may stand for."""
    plain = name.lower().replace('-', '_').removeprefix('dict_')
    return name, plain, f'aruco_{plain}', f'apriltag_{plain.removeprefix("tag")}'


def family_in(text: str, files: str = '') -> str:
    """Return the one family that a text names; `files` are as for `families_in`.

    Raise a ValueError if it names none, or several.
    """
    names = families_in(text, files)
    if len(names) > 1 or text == AUTO:
        raise ValueError(f'family is {text!r}, accepted is one family')
    return names[0]


def kind_of(name: str, files: str = '') -> str:
    """Return the kind of a family, see `KINDS`; `files` are as for `families_in`."""
    return _KIND_OF.get(name) or families_of(files)[name].kind


def code_family(name: str, files: str = '') -> Family | DotFamily | PointFamily | CircleFamily:
    """Return the codes and the proportions of a family that is not of square markers.

    `files` are data files, separated by commas: of families of their own names, or of `gsi` and
    `dots` in the place of the usual design. Raise a ValueError if there is no such family, or a
    data file is not accepted.
    """
    from ahf_ros.codes import cctag, dots, gsi, ring

    if name in CCTAG_NAMES:
        return cctag.circle_family(name)
    if files and name not in RING_NAMES:
        own = families_of(files)
        for code in own.values():
            if name in (code.name, code.kind):
                return code
        if name not in FAMILY_NAMES:
            raise ValueError(
                f'family is {name!r}, and family_file is {files!r}, which describes '
                f'{", ".join(own)}; accepted is one of these'
            )
    if name == 'gsi':
        return gsi.point_family()
    return dots.dot_family() if name == 'dots' else ring.family(name)


def family_of(of_kind: type[Code], families: Sequence[str], files: str = '') -> tuple[Code, ...]:
    """Return the codes of families of one kind, each as for `code_family`.

    Raise a ValueError if one of them is of another kind.
    """
    codes = [code_family(name, files) for name in families]
    found = tuple(code for code in codes if isinstance(code, of_kind))
    if len(found) < len(codes):
        raise ValueError(f'family is {", ".join(families)!r}, accepted are other families')
    return found


def families_of(files: str) -> dict[str, Family | DotFamily | PointFamily]:
    """Return the families that data files describe, by their names.

    The names of the files are separated by commas. Each is of point-distributed targets, rings of
    dots, or rings, as its fields tell. Raise a ValueError, which names file, line and field, if
    one is not accepted.
    """
    found: dict[str, Family | DotFamily | PointFamily] = {}
    for path in (part.strip() for part in files.split(',')):
        code = _described(path)
        if code.name in (*RING_NAMES, *SQUARE_NAMES, *CCTAG_NAMES, *found):
            from ahf_ros.codes.data_file import read_data_file

            name = dict(read_data_file(path).items())['family']
            name.refuse('a name that no other family has')
        found[code.name] = code
    return found


@kept_while_unchanged
def _described(path: str) -> Family | DotFamily | PointFamily:
    """Return the family that a data file describes."""
    from ahf_ros.codes import dots, gsi, ring
    from ahf_ros.codes.data_file import read_data_file

    fields = dict(read_data_file(path).items())
    if 'template' in fields:
        return gsi.point_family(path)
    return dots.dot_family(path) if 'dot_circle' in fields else ring.ring_family(path)


def colours_of(families: Sequence[str], files: str) -> str:
    """Return the colour of the dots of families, 'dark', 'bright' or 'both'; see `code_family`."""
    kinds = [kind_of(name, files) for name in families]
    colours = {
        getattr(code_family(name, files), 'polarity', 'both') if kind == 'ring' else 'both'
        for name, kind in zip(families, kinds, strict=True)
    }
    return colours.pop() if len(colours) == 1 else 'both'


def files_by_name(text: str, files: str, folders: Iterable[Path]) -> str:
    """Return data files, separated by commas, with those of families that nothing else describes.

    A family NAME of the text is described by NAME.yaml, NAME.yml or NAME.json in a folder.
    """
    found = [files] if files else []
    places = list(folders)
    for name in (part.strip() for part in text.split(',')):
        if name == AUTO or _usual_name(name, FAMILY_NAMES) in FAMILY_NAMES:
            continue
        if not name.isidentifier() or (files and name in families_of(files)):
            continue
        paths = [folder / f'{name}{ending}' for folder in places for ending in _ENDINGS]
        found += [str(path) for path in paths if path.is_file()][:1]
    return ','.join(found)


def numbers_of(name: str, file: str = '') -> Sequence[int]:
    """Return the IDs of a family, ascending; `file` is as for `code_family`."""
    from ahf_ros.codes import square

    if name in SQUARE_NAMES:
        return range(len(square.dictionary(name).bytesList))
    return sorted(code_family(name, file).numbers.tolist())


def code_reading(name: str, files: str = '') -> dict[str, int | str]:
    """Return how code words of a family are read: `bits`, `first_bit` and `direction`.

    It is empty for families whose code is no word, such as square markers, and for unknown ones.
    `files` are as for `families_in`.
    """
    from ahf_ros.codes import cyclic, gsi

    bits, direction = 0, 'by position'
    with suppress(ValueError):
        code = code_family(name, files)
        if isinstance(code, gsi.PointFamily):
            bits = int(code.position_numbers.max()) + 1
        elif isinstance(code, cyclic.CyclicFamily):
            bits, direction = code.bits, 'either' if code.kind == 'dots' else 'counter-clockwise'
    return {'bits': bits, 'first_bit': 'lowest', 'direction': direction} if bits else {}


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
