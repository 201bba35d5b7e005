"""Detectors, and the registry that makes one from a name or from a family of targets.

A family of targets is one folder here and one line below. What a line names is imported when it is
used: who only chooses, such as the command line, does without all detectors. Other packages add
detectors by entry points of the group `ahf_ros.detectors`: the name of a detector, and a callable
that makes it from `DetectorSettings`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib.metadata import EntryPoint, entry_points
from pkgutil import resolve_name
from typing import TYPE_CHECKING, NamedTuple

from ahf_ros.base.deprecation import deprecated_arguments
from ahf_ros.base.settings.nested import updated
from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.base.text import printable, reason_of, shown
from ahf_ros.families.contract import (
    Confirming,
    Contesting,
    Detector,
    DetectorSettings,
    Drafter,
    EarlyStopping,
    Expecting,
    Narrowing,
    Refiner,
)
from ahf_ros.prints import SQUARE_NAMES
from ahf_ros.prints.families import AUTO, FAMILY_NAMES, KINDS, FamilyPrint, check_numbers

if TYPE_CHECKING:
    import numpy as np
    from typing_extensions import Unpack

    from ahf_ros.base.options import DetectorOptions

__all__ = [
    'AUTO',
    'DETECTOR',
    'DETECTOR_NAMES',
    'FAMILY_NAMES',
    'GROUP',
    'Confirming',
    'Contesting',
    'Detector',
    'DetectorSettings',
    'Drafter',
    'EarlyStopping',
    'Expecting',
    'Narrowing',
    'Refiner',
    'check_listed_ids',
    'create_detector',
    'detector_name',
    'estimator',
    'is_foreign',
]

GROUP = 'ahf_ros.detectors'
"""Group of the entry points by which other packages add detectors."""

_AUTO = 'auto'  # stands for the detector of the family
_SEVERAL = 'several'  # what that is where no single one reads all families


class _Entry(NamedTuple):
    detector: str  # its module and name, below `ahf_ros`
    kinds: tuple[str, ...]  # of families
    several: bool = False  # families at a time


# The detector of a family is the first one that lists it.
_ENTRIES = {
    'ring': _Entry('families.ring.detector:RingDetector', ('ring',), several=True),
    'traditional': _Entry('families.published.traditional:TraditionalDetector', ('ring',)),
    'aruco': _Entry('families.square.detector:SquareDetector', ('aruco',), several=True),
    'apriltag': _Entry('families.square.detector:SquareDetector', ('apriltag',), several=True),
    'square': _Entry(
        'families.square.detector:SquareDetector', ('aruco', 'apriltag'), several=True
    ),
    'gsi': _Entry('families.gsi.detector:GsiDetector', ('gsi',)),
    'gsi_published': _Entry('families.published.gsi:PublishedGsiDetector', ('gsi',)),
    'dots': _Entry('families.dots.detector:DotsDetector', ('dots',)),
    'dots_published': _Entry('families.published.dots:PublishedDotsDetector', ('dots',)),
    'cctag': _Entry('families.cctag.detector:CctagDetector', ('cctag',), several=True),
    'command': _Entry('families.external.command:CommandDetector', tuple(KINDS), several=True),
}

_ADDED: dict[str, EntryPoint] = {
    point.name: point
    for point in entry_points(group=GROUP)
    if point.name not in (_AUTO, *_ENTRIES)
}

DETECTOR_NAMES = (*_ENTRIES, *sorted(_ADDED))
"""The names of all detectors; this package's come first."""

DETECTOR = Parameter(
    'detector',
    _AUTO,
    'How targets are identified; auto is the detector of the family.',
    choices=(_AUTO, *DETECTOR_NAMES),
)
"""The choice of a detector."""


@deprecated_arguments(positions=('settings',))
def create_detector(
    name: str = _AUTO,
    *,
    settings: DetectorSettings | None = None,
    **options: Unpack[DetectorOptions],
) -> Detector:
    """Return a detector.

    Parameters
    ----------
    name : str
        One of `DETECTOR_NAMES`, or 'auto' for the detector of the family.
    settings : DetectorSettings, optional
        What the targets look like; the defaults where None.
    **options
        Fields of `DetectorSettings` that differ from `settings`.

    Raises
    ------
    ValueError
        If there is no such detector, if it does not identify the family or does not accept other
        settings, or if it comes from another package that cannot be imported.

    Examples
    --------
    >>> create_detector('traditional', family='aicon14').family
    'aicon14'
    >>> create_detector(family='metashape20').name
    'ring'
    """
    if not (settings is None or isinstance(settings, DetectorSettings)):
        raise ValueError(f'settings is {shown(settings)}, accepted is a DetectorSettings')
    settings = updated(settings or DetectorSettings(), options)
    name = detector_name(name, settings)
    if name in _ADDED:
        return _added(_ADDED[name], settings)
    if name == _SEVERAL:
        return _several(settings)
    families = [it.name for it in _families(name, settings)]
    if len(families) < len(settings.families):
        settings = settings.narrowed(families)
    return resolve_name(f'ahf_ros.{_ENTRIES[name].detector}')(settings)


def detector_name(name: str, settings: DetectorSettings) -> str:
    """Return the name of a detector that identifies the families of settings.

    It is 'several' where each family has its own, and raises a ValueError if there is no such
    detector, or it does not identify these families.
    """
    DETECTOR.check(name)
    families = _families(name, settings)
    kinds = {of.kind for of in families}
    fitting = [
        fit
        for fit, entry in _ENTRIES.items()
        if kinds <= set(entry.kinds) and (entry.several or len(families) == 1)
    ]
    if name == _AUTO:
        return _SEVERAL if fitting[0] == 'command' else fitting[0]
    if name in _ENTRIES and name not in fitting:
        several = ', alone or together' if _ENTRIES[name].several else ''
        raise ValueError(
            f'detector is {name!r} and family is {settings.family!r}; accepted with this family '
            f'is one of {", ".join((_AUTO, *fitting, *_ADDED))}, and with this detector one of '
            f'{", ".join(of for kind in _ENTRIES[name].kinds for of in KINDS[kind])}{several}'
        )
    return name


def _families(name: str, settings: DetectorSettings) -> tuple[FamilyPrint, ...]:
    """Return the families of settings; of all, those that a detector reads.

    A detector that reads one at a time reads the first.
    """
    families = tuple(settings.prints.values())
    if settings.family != AUTO or name not in _ENTRIES:
        return families
    own = tuple(of for of in families if of.kind in _ENTRIES[name].kinds)
    return own if _ENTRIES[name].several else own[:1]


def _several(settings: DetectorSettings) -> Detector:
    """Return a detector for each family, or for all that one reads at once, as one detector.

    Of all families, those of square markers are left out that an old OpenCV does not have.
    """
    from ahf_ros.families.several import SeveralDetector
    from ahf_ros.prints.square import has_dictionary

    groups: dict[str, list[str]] = {}
    for family, of in settings.prints.items():
        if settings.family == AUTO and family in SQUARE_NAMES and not has_dictionary(family):
            continue
        entry = next(it for it in _ENTRIES.values() if of.kind in it.kinds)
        groups.setdefault(entry.detector if entry.several else family, []).append(family)
    parts = tuple(create_detector(settings=settings.narrowed(of)) for of in groups.values())
    return SeveralDetector(
        settings,
        parts,
        tuple(map(tuple, groups.values())),
        lambda families: create_detector(settings=settings.narrowed(families)),
    )


def is_foreign(name: str) -> bool:
    """Return whether a detector is of another package, which may end its process."""
    return name in _ADDED


def check_listed_ids(
    field: str, ids: Iterable[int], name: str, settings: DetectorSettings
) -> None:
    """Refuse IDs of a field that a detector cannot report, by a ValueError.

    Detectors that are no part of this package, also as a command, may report any.
    """
    if name in (_SEVERAL, *_ENTRIES) and name != 'command':
        check_numbers(field, ids, settings.prints.values())


def estimator(settings: DetectorSettings) -> Callable[[np.ndarray], int]:
    """Return the function that estimates how many targets an image shows, of all the rings.

    It raises a ValueError if there are families whose targets cannot be counted.
    """
    rings = _families('ring', settings)
    if any(of.kind != 'ring' for of in rings):
        raise ValueError(
            f'estimate_expected is True and family is {settings.family!r}; accepted with this '
            f'family is False, and True with one of {", ".join(KINDS["ring"])}'
        )

    def count(image: np.ndarray) -> int:
        from ahf_ros.families.ring.counting import estimate_count

        return estimate_count(image, settings.narrowed(of.name for of in rings))

    return count


def _added(point: EntryPoint, settings: DetectorSettings) -> Detector:
    """Return a detector of another package, which may raise anything."""
    from ahf_ros.families.external.guarded import guarded

    try:
        return guarded(point.load()(settings), settings.detector_timeout)
    except (Exception, SystemExit) as error:
        reason = printable(str(error)) if isinstance(error, ValueError) else reason_of(error)
        raise ValueError(
            f'detector is {point.name!r}, but {point.value} cannot be loaded: {reason}'
        ) from error
