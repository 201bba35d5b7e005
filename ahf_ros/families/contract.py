"""What a detector is, and what detectors share: settings, and a base class for one family."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

from ahf_ros.base.settings.parameter import check_parameters, parameter
from ahf_ros.base.target import Target
from ahf_ros.prints.families import ACCEPTED, AUTO, FamilyPrint, prints_in

if TYPE_CHECKING:
    import numpy as np
    from typing_extensions import Self

    from ahf_ros.prints.prints import Print
    from ahf_ros.vision.parts import Part
    from ahf_ros.vision.pyramid import ImagePyramid

Code = TypeVar('Code', bound='Print')
"""The prints of one kind."""

Used = TypeVar('Used')
"""A detector, or any callable that stands for one."""

_MINIMUM_RADIUS = 4.0  # of a dot, px, where the user sets none
_MINIMUM_RADII = {'gsi': 2.0, 'dots': 2.5}  # of kinds whose dot is small beside the target

_SIGNS = {'both': (1, -1), 'dark': (1,), 'bright': (-1,)}  # of the colour of dots


class Unavailable(ValueError):
    """A detector cannot work at all, whatever the image is."""


@runtime_checkable
class Detector(Protocol):
    """A callable with a name: grayscale image in, targets out.

    A detector keeps nothing between calls, may be called from several threads at once and returns
    the same targets for the same image. The image is its only input, so a filtered image is as
    good as one taken by a camera. A detector may also be a `Refiner`, and a `Drafter` with it,
    `Confirming` and `Expecting`.

    Examples
    --------
    >>> from ahf_ros import create_detector
    >>> isinstance(create_detector('ring'), Detector)
    True
    """

    @property
    def name(self) -> str:
        """Name in the registry and in results."""
        ...

    @property
    def family(self) -> str:
        """Family of its targets, as in results, or several as the settings list them."""
        ...

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image.

        Parameters
        ----------
        image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
            Gray values, increasing with light.

        Returns
        -------
        list of Target
            Sorted by ID, undecoded targets first; coordinates in the pixels of `image`.

        Raises
        ------
        ValueError
            If `image` is not a two-dimensional, non-empty array of finite gray values.
        """
        ...


@runtime_checkable
class Refiner(Protocol):
    """A detector that measures centres in the image as received, wherever it found the targets."""

    def refine(self, image: np.ndarray, targets: Sequence[Target]) -> Sequence[Target]:
        """Return targets with the centres that an image gives them.

        Parameters
        ----------
        image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
            The image as received.
        targets : sequence of Target
            Found by this detector in a filtered version of `image`.

        Returns
        -------
        sequence of Target
            The same targets.
        """
        ...


@runtime_checkable
class Drafter(Protocol):
    """A `Refiner` that also identifies faster, with centres good enough for `refine`.

    AHF tries its filters with drafts.
    """

    def draft(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image, as a call does but with rough centres."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Confirmed:
    """Known targets that an image shows again, and what searches it for others.

    Attributes
    ----------
    targets : sequence of Target
        As a call would report them. What shows no target any more, or a doubtful one, is missing.
    search : callable
        From parts of the image to all targets that it shows: these, and those in the parts, sorted
        by ID.
    """

    targets: Sequence[Target]
    search: Callable[[Sequence[Part]], list[Target]]


@runtime_checkable
class Confirming(Protocol):
    """A detector that reads targets again in the next image, without a search for them.

    Its targets have a dot, whose colour their polarity says.
    """

    def confirm(self, image: np.ndarray, targets: Sequence[Target]) -> Confirmed:
        """Return what an image shows in the places of targets.

        Parameters
        ----------
        image : ndarray of uint8, uint16, float32 or float64, shape (height, width)
        targets : sequence of Target
            With centres to about two pixels, and the shapes that they have in this image.
        """
        ...


@runtime_checkable
class EarlyStopping(Protocol):
    """A detector that identifies in an image as received nearly all that any filter shows it.

    AHF gives up early where filters show it no more.
    """

    @property
    def patience(self) -> int:
        """Filters in a row that show no more targets, after which a search ends."""
        ...


@runtime_checkable
class Expecting(Protocol):
    """A detector that reads doubtful targets better if it knows which IDs are likely."""

    def expecting(self, ids: frozenset[int]) -> Detector:
        """Return the same detector for images that show these IDs, and hardly any others.

        Parameters
        ----------
        ids : frozenset of int
            Others are reported where nothing speaks for one of these.
        """
        ...


@runtime_checkable
class Contesting(Protocol):
    """A detector that can also return targets whose ID others have, too."""

    def contesting(self) -> Detector:
        """Return the same detector with these targets among its results, undecoded."""
        ...


@runtime_checkable
class Stretching(Protocol):
    """A detector that also reads parts of an image whose contrast is faint, stretched."""

    def unstretched(self) -> Detector:
        """Return the same detector for clear contrast alone."""
        ...


def unstretched(detector: Used) -> Used | Detector:
    """Return a detector for clear contrast alone, the same one if it never stretches any."""
    return detector.unstretched() if isinstance(detector, Stretching) else detector


@runtime_checkable
class Searching(Protocol):
    """A detector that begins with the pyramid of an image, which detectors of one image share."""

    @property
    def contrast(self) -> int:
        """Times the contrast of edges in this pyramid."""
        ...

    def search(self, pyramid: ImagePyramid) -> list[Target]:
        """Identify the targets of one image, as a call does."""
        ...


@runtime_checkable
class Explaining(Searching, Protocol):
    """A detector that also tells which dots of an image its targets do not explain."""

    def explain(self, pyramid: ImagePyramid) -> tuple[list[Target], np.ndarray]:
        """Return the targets, and the frames of dots that are on none of them, (k, 3, 3), px."""
        ...


@runtime_checkable
class Narrowing(Protocol):
    """A detector of many families that can be made to look for some of them only."""

    @property
    def families(self) -> tuple[str, ...]:
        """All families, as its targets name them."""
        ...

    @property
    def groups(self) -> Sequence[Sequence[str]]:
        """The families that are read together, for each group of them."""
        ...

    def narrowed(self, families: Sequence[str]) -> Detector:
        """Return a detector of some of the families."""
        ...


@dataclass(frozen=True, slots=True)
class DetectorSettings:
    """What the targets in the image look like.

    Attributes
    ----------
    family : str
        One of `ahf_ros.prints.families.FAMILY_NAMES`, several separated by commas, or 'auto' for
        all; `families` has them one by one.
    family_file : str
        Paths of data files, separated by commas, that describe more families, or the design in
        the place of that of `gsi` or `dots`, which is then called as the file says.
    prints : dict of str to FamilyPrint
        The families by their names, as the files described them when the settings were made.
    polarity : str
        Colour of the dot against its surroundings, 'dark', 'bright', or 'auto' for that of
        the families.
    min_radius, max_radius : float
        Bounds of the semi-major axis of the dot, px; `radii` has them with the minimum of the
        family in the place of 0.
    report_undecoded : bool
        Whether targets whose code word is not certain are reported, with the ID `UNDECODED`.
    command : str
        Program and arguments of the detector `command`, quoted as for a shell; no shell runs.
    detector_timeout : float
        Time limit for one image of a detector that is not part of this package, s.

    Examples
    --------
    >>> DetectorSettings(family='aicon14', min_radius=6.0).polarity
    'auto'
    """

    family: str = parameter(
        AUTO,
        'Family of the coded targets, or several. It also chooses the detector where that is '
        'auto.',
        form=ACCEPTED,
    )
    family_file: str = parameter(
        '',
        'Data files that describe families, separated by commas: more rings, or gsi or dots in '
        'the place of the usual design.',
        read_only=True,
        files=True,
    )
    polarity: str = parameter(
        'auto',
        'Colour of the dot: dark on bright, bright on dark, or auto: as the family, either where '
        'it may be both.',
        choices=('auto', 'dark', 'bright'),
    )
    min_radius: float = parameter(
        0.0,
        'Minimum radius of a dot, px; 0: as for the family, 2 for point-distributed targets, 2.5 '
        'for rings of dots and 4 for others.',
        minimum=0.0,
        maximum=1e4,
    )
    max_radius: float = parameter(
        1e4, 'Maximum radius of a dot, px; by default there is no limit.', minimum=1.0, maximum=1e4
    )
    report_undecoded: bool = parameter(
        False, 'Whether to report targets whose code word is not certain, with the ID -1.'
    )
    command: str = parameter(
        '',
        'Program and arguments of the detector command; {image} is the path of a PNG file.',
        read_only=True,
    )
    detector_timeout: float = parameter(
        60.0,
        'Time limit for one image of a detector that is a command, a service or part of another '
        'package, s.',
        minimum=0.01,
        maximum=86400.0,
    )
    prints: dict[str, FamilyPrint] = field(init=False, repr=False, hash=False)

    def __post_init__(self) -> None:
        """Refuse values that are not accepted."""
        check_parameters(self)
        object.__setattr__(self, 'prints', prints_in(self.family, self.family_file))
        names = ','.join(self.prints)
        if self.family != AUTO and names != self.family.replace(' ', ''):
            object.__setattr__(self, 'family', names)  # as these families are written here
        minimum, maximum = self.radii
        if minimum > maximum:
            raise ValueError(
                f'min_radius is {minimum!r}, accepted is a number of at most max_radius, '
                f'{maximum!r}'
            )

    @property
    def families(self) -> tuple[str, ...]:
        """The families that `family` names."""
        return tuple(self.prints)

    def codes(self, kind: type[Code]) -> tuple[Code, ...]:
        """Return the prints of the families, all of one kind; raise a ValueError otherwise."""
        designs = [it.design for it in self.prints.values()]
        found = tuple(design for design in designs if isinstance(design, kind))
        if len(found) < len(designs):
            raise ValueError(f'family is {self.family!r}, accepted are other families')
        return found

    @property
    def radii(self) -> tuple[float, float]:
        """Bounds of the semi-major axis of the dot, px, where kinds have their own minimum."""
        smallest = min(_MINIMUM_RADII.get(it.kind, _MINIMUM_RADIUS) for it in self.prints.values())
        return self.min_radius or smallest, self.max_radius

    def of_size(self, radii: np.ndarray) -> np.ndarray:
        """Return which dots, of semi-major axes (k,) in px, are reported, bool, shape (k,).

        The minimum of a kind is where dots are looked for; smaller ones that are read are read.
        """
        return (radii >= self.min_radius) & (radii <= self.max_radius)

    def narrowed(self, families: Iterable[str]) -> DetectorSettings:
        """Return the same settings for some of the families."""
        return replace(self, family=','.join(families))

    @property
    def polarities(self) -> tuple[int, ...]:
        """1 where dots may be dark, -1 where they may be bright."""
        if self.polarity != 'auto':
            return _SIGNS[self.polarity]
        colours = {it.design.polarity for it in self.prints.values()}
        return _SIGNS[colours.pop() if len(colours) == 1 else 'both']


@dataclass(frozen=True, slots=True)
class FamilyDetector(ABC):
    """A detector of one family of targets, whose design is read from the settings.

    It raises a ValueError if the family, or the data file that describes it, is not accepted.
    """

    settings: DetectorSettings

    def __post_init__(self) -> None:
        """Refuse what is not accepted before the first image comes."""
        _ = self.design

    @property
    def family(self) -> str:
        """Family of the targets."""
        return self.settings.family

    @property
    @abstractmethod
    def design(self) -> Any:
        """Printed design of the family."""


@dataclass(frozen=True, slots=True)
class ExpectingDetector(FamilyDetector):
    """A detector that may know which IDs are likely; see `Expecting` and `Stretching`.

    Attributes
    ----------
    settings : DetectorSettings
    expected : frozenset of int
        IDs that are likely to be there. Empty: all IDs are equally likely.
    stretches : bool
        Whether parts of faint contrast are read as well.
    """

    expected: frozenset[int] = frozenset()
    stretches: bool = True

    def unstretched(self) -> Self:
        """Return a detector for clear contrast alone; see `Stretching`."""
        return replace(self, stretches=False)

    def expecting(self, ids: frozenset[int]) -> Self:
        """Return a detector that knows which IDs are likely; see `Expecting`."""
        return replace(self, expected=ids)


def moved_targets(
    targets: Sequence[Target],
    measured: Sequence[Target],
    places: Sequence[dict[str, Any]],
    good: np.ndarray,
) -> list[Target]:
    """Return targets, the measured ones with the fields of their new places where these are good.

    `good` is an ndarray of bool, one for each measured target.
    """
    better = {
        target: replace(target, **place)
        for target, place, is_good in zip(measured, places, good, strict=True)
        if is_good
    }
    return [better.get(target, target) for target in targets]
