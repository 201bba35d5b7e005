"""All families of coded targets, by the kind of their print, and lists of families.

Settings import this module, and with them the command line before it knows whether it computes
anything. Therefore the codes, which take numpy and OpenCV, are imported where they are needed.
"""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property, lru_cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ahf_ros.prints import APRILTAG_NAMES, ARUCO_NAMES, CCTAG_NAMES, RING_NAMES
from ahf_ros.prints.kept import kept_while_unchanged

if TYPE_CHECKING:
    from ahf_ros.prints.prints import Print

KINDS: dict[str, tuple[str, ...]] = {
    'ring': RING_NAMES,
    'aruco': ARUCO_NAMES,
    'apriltag': APRILTAG_NAMES,
    'gsi': ('gsi',),
    'dots': ('dots',),
    'cctag': CCTAG_NAMES,
}
"""The families of each kind."""

FAMILY_NAMES = tuple(name for names in KINDS.values() for name in names)
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

_ENDINGS = '.yaml', '.yml', '.json'  # of data files
_SHOWN = 10  # IDs in an error
_ALIKE = 0.65, 0.65, 0.85, 0.85  # share of letters of a name that is suggested, by `_ways`
_REPLACED = {'gsi', 'dots'}  # families in whose place data files of their kind come


@dataclass(frozen=True)
class FamilyPrint:
    """A family that a text named, and its print, which is read when something of it is needed.

    Attributes
    ----------
    name : str
        Its name in results.
    kind : str
        One of `KINDS`.
    file, digest : str
        The data file that describes it and a hash of that; empty for `FAMILY_NAMES`.
    """

    name: str
    kind: str
    file: str = ''
    digest: str = ''

    @cached_property
    def design(self) -> Print:
        """The print."""
        return _described(self.file).design if self.file else _usual_design(self)

    @cached_property
    def reach(self) -> float:
        """Radius of the circle that holds a target, in semi-axes of the reported ellipse."""
        common = self.design.proportions
        return common.reach / common.radius

    @property
    def reading(self) -> dict[str, int | str]:
        """How words are read, see `Print`; empty for square markers, whose code is no word."""
        return self.design.reading

    def mirrored(self, word: int) -> int | None:
        """Return the ID that a word has in a mirror, see `Print`."""
        return self.design.mirrored(word)

    def __reduce__(self) -> tuple[Any, ...]:
        """Leave the print to the process that needs it."""
        return FamilyPrint, (self.name, self.kind, self.file, self.digest)


_USUAL = {name: FamilyPrint(name, kind) for kind, names in KINDS.items() for name in names}


def prints_in(text: str, files: str = '') -> dict[str, FamilyPrint]:
    """Return the different families that a text names, by their names and in its order.

    It names a family, several separated by commas, or 'auto' for all. `files` are data files,
    separated by commas, that describe more families; one of the kind of `gsi` or `dots` takes the
    place of these, by its own name. Raise a ValueError if there is no family, if one is unknown or
    named twice, or if a file is not accepted.

    Examples
    --------
    >>> list(prints_in('metashape12, apriltag_36h11'))
    ['metashape12', 'apriltag_36h11']
    >>> [*prints_in('DICT_4X4_50'), *prints_in('tag36h11')]
    ['aruco_4x4_50', 'apriltag_36h11']
    >>> tuple(prints_in('auto')) == FAMILY_NAMES
    True
    >>> prints_in('gsi')['gsi'].design.word(18)
    16464
    """
    return _prints_in(text, files) if files else _usual_prints_in(text)


def _prints_in(text: str, files: str) -> dict[str, FamilyPrint]:
    given = [part.strip() for part in text.split(',')]
    own: dict[str, FamilyPrint] = {}
    if files and not {_usual_name(name, _USUAL) for name in given} <= set(_USUAL) - _REPLACED:
        own = prints_of(files)
    known = _USUAL | own
    of_kinds = {it.kind: it for it in reversed(own.values()) if it.kind in _REPLACED}
    if text == AUTO:
        return {name: it for name, it in known.items() if name in own or name not in of_kinds}
    found: dict[str, FamilyPrint] = {}
    shown = f'family is {text!r}'
    for name in (_usual_name(it, known) for it in given):
        if name not in known:
            where = f'{shown}, which names {name!r}' if len(given) > 1 else shown
            alike = [
                match
                for way, least in zip(_ways(name), _ALIKE, strict=True)
                for match in get_close_matches(way, list(known), 1, least)
                if name
            ]
            accepted = f'{alike[0]}, which is most like it, or another family' if alike else ''
            raise ValueError(f'{where}, accepted is {accepted or ACCEPTED}')
        resolved = known[name] if name in own else of_kinds.get(name, known[name])
        if resolved.name in found:
            raise ValueError(f'{shown}, which names {name} twice, accepted is each family once')
        found[resolved.name] = resolved
    return found


@lru_cache(maxsize=256)
def _usual_prints_in(text: str) -> dict[str, FamilyPrint]:
    return _prints_in(text, '')


def _usual_name(name: str, kinds: Container[str]) -> str:
    """Return the name that a family has here, where other programs write it in another way."""
    return next((way for way in _ways(name) if way in kinds), name)


def _ways(name: str) -> tuple[str, ...]:
    """Return the names that a name may stand for."""
    plain = name.lower().replace('-', '_').removeprefix('dict_')
    return name, plain, f'aruco_{plain}', f'apriltag_{plain.removeprefix("tag")}'


def print_in(text: str, files: str = '') -> FamilyPrint:
    """Return the one family that a text names; `files` are as for `prints_in`.

    Raise a ValueError if it names none, or several.
    """
    found = prints_in(text, files)
    if len(found) > 1 or text == AUTO:
        raise ValueError(f'family is {text!r}, accepted is one family')
    return next(iter(found.values()))


def _usual_design(of: FamilyPrint) -> Print:
    """Return the print of a family that this package brings along."""
    from ahf_ros.prints import cctag, dots, gsi, ring, square

    if of.kind == 'ring':
        return ring.family(of.name)
    if of.kind == 'cctag':
        return cctag.circle_family(of.name)
    if of.kind == 'gsi':
        return gsi.point_family()
    return dots.dot_family() if of.kind == 'dots' else square.CellPrint(of.name)


def prints_of(files: str) -> dict[str, FamilyPrint]:
    """Return the families that data files describe, by their names.

    The names of the files are separated by commas. Each is of point-distributed targets, rings of
    dots, or rings, as its fields tell. Raise a ValueError, which names file, line and field, if
    one is not accepted.
    """
    found: dict[str, FamilyPrint] = {}
    for path in (part.strip() for part in files.split(',')):
        of = _described(path)
        if of.name in found or (of.name in _USUAL and of.name not in _REPLACED):
            from ahf_ros.prints.data_file import read_data_file

            name = dict(read_data_file(path).items())['family']
            name.refuse('a name that no other family has')
        found[of.name] = of
    return found


@kept_while_unchanged
def _described(path: str) -> FamilyPrint:
    """Return the family that a data file describes, with its print."""
    from ahf_ros.base.opening import Most, read_bytes
    from ahf_ros.prints import dots, gsi, ring
    from ahf_ros.prints.data_file import read_data_file

    fields = dict(read_data_file(path).items())
    kind = 'gsi' if 'template' in fields else 'dots' if 'dot_circle' in fields else 'ring'
    read = {'gsi': gsi.point_family, 'dots': dots.dot_family, 'ring': ring.ring_family}[kind]
    design: Print = read(path)
    of = FamilyPrint(design.name, kind, path, sha256(read_bytes(path, Most.YAML)).hexdigest())
    vars(of)['design'] = design  # as if it had been asked for, while the file is like that
    return of


def files_by_name(text: str, files: str, folders: Iterable[Path]) -> str:
    """Return data files, separated by commas, with those of families that nothing else describes.

    A family NAME of the text is described by NAME.yaml, NAME.yml or NAME.json in a folder.
    """
    found = [files] if files else []
    places = list(folders)
    for name in (part.strip() for part in text.split(',')):
        if name == AUTO or _usual_name(name, FAMILY_NAMES) in FAMILY_NAMES:
            continue
        if not name.isidentifier() or (files and name in prints_of(files)):
            continue
        paths = [folder / f'{name}{ending}' for folder in places for ending in _ENDINGS]
        found += [str(path) for path in paths if path.is_file()][:1]
    return ','.join(found)


def check_numbers(field: str, numbers: Iterable[int], prints: Iterable[FamilyPrint]) -> None:
    """Refuse numbers that are no ID of any of some families.

    The ValueError calls them `field` and names them.
    """
    known = {it.name: it.design.all_ids for it in prints}
    missing = sorted(set(numbers).difference(*known.values()))
    if not missing:
        return
    shown = ', '.join(map(str, missing[:_SHOWN]))
    if len(missing) > _SHOWN:
        shown += f' and {len(missing) - _SHOWN} more'
    accepted = ', '.join(f'{name} from {ids[0]} to {ids[-1]}' for name, ids in known.items())
    raise ValueError(f'{field} has {shown}, accepted are IDs of {accepted}')
