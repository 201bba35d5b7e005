"""Records that the whole package shares."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Protocol, overload

from ahf_ros.base.extras import need

if TYPE_CHECKING:
    import numpy as np

UNDECODED = -1
"""ID of a target whose code word could not be read for certain."""


@dataclass(frozen=True, slots=True)
class Target:
    """One identified target, in the pixels of the image as received.

    Attributes
    ----------
    id : int
        Number that the vendor gives the code word, or `UNDECODED`.
    code : int
        Code word, 0 if undecoded; for ring codes the minimum over all rotations.
    x, y : float
        Image of the physical centre, px. (0, 0) is the centre of the first pixel, x points right
        and y down.
    semi_major, semi_minor : float
        Semi-axes of the ellipse of the central dot, px.
    angle : float
        Direction of the major axis, rad in (-pi/2, pi/2], from +x towards +y.
    confidence : float
        Probability that `id` is right, 0 to 1.
    covariance : tuple of 4 float
        Row-major covariance of (x, y), px^2.
    family : str
        Name of the family of the code; empty if undecoded or unknown.
    edge_shift : float, optional
        Length by which dark areas are larger in the light that fell on the sensor than in the
        print, on every edge, px: positive if ink has grown, negative if light has. The gamma of
        gray values is taken out. None where it was not measured.
    polarity : int
        1 for a dark dot on bright ground, -1 for a bright one on dark, 0 where it is unknown.
    followed : bool
        Whether it was read again where the image before showed it, without a search.

    Examples
    --------
    >>> Target(id=7, code=19, x=10.5, y=20.0, semi_major=8.0, semi_minor=7.5).confidence
    1.0
    """

    id: int
    code: int
    x: float
    y: float
    semi_major: float
    semi_minor: float
    angle: float = 0.0
    confidence: float = 1.0
    covariance: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    family: str = ''
    # By name only, so that the fields of the classes below follow `family` in their order.
    edge_shift: float | None = field(default=None, kw_only=True)
    polarity: int = field(default=0, kw_only=True)
    followed: bool = field(default=False, kw_only=True)

    @property
    def key(self) -> tuple[str, int]:
        """Family and ID, which no two targets of one colour share."""
        return self.family, self.id

    @property
    def print(self) -> tuple[str, int, int]:
        """Family, ID and polarity, which no two targets share."""
        return self.family, self.id, self.polarity


@dataclass(frozen=True, slots=True)
class DottedTarget(Target):
    """A target that consists of dots.

    Attributes
    ----------
    dots : tuple of tuple of 5 float
        Ellipses of its dots: centre x and y, semi-major and semi-minor axis, px, and direction,
        rad. Those of the template come first, in the order of the printed design, then those of
        the code.
    template_dots : int
        Number of the former.

    Examples
    --------
    >>> dots = ((10.0, 20.0, 3.0, 3.0, 0.0), (22.0, 20.0, 2.0, 2.0, 0.0))
    >>> target = DottedTarget(7, 19, 10.0, 20.0, 3.0, 3.0, dots=dots, template_dots=1)
    >>> len(target.dots) - target.template_dots
    1
    """

    dots: tuple[tuple[float, float, float, float, float], ...] = ()
    template_dots: int = 0


@dataclass(frozen=True, slots=True)
class SquareMarker(Target):
    """One identified square marker.

    Its centre is the intersection of its diagonals, which is the image of the physical centre in
    any view. Its ellipse is the inscribed one, its code is its ID.

    Attributes
    ----------
    corners : tuple of 4 tuples of 2 float
        Corners, px, clockwise from the top left corner of the upright marker.
    border : int
        Width of the dark border, cells: 1, or 2 as in the AprilGrids of Kalibr.
    hamming : int, optional
        Number of its cells whose colour in the image as received is not that of the marker. None
        where they were not looked at.
    decision_margin : float, optional
        Mean distance of its cells in the image as received from the threshold between ink and
        paper, 0 to 255, as the AprilTag library has it. None where they were not looked at.

    Examples
    --------
    >>> corners = ((5.0, 5.0), (15.0, 5.0), (15.0, 15.0), (5.0, 15.0))
    >>> SquareMarker(3, 3, 10.0, 10.0, 5.0, 5.0, corners=corners).corners[0]
    (5.0, 5.0)
    """

    corners: tuple[tuple[float, float], ...] = ()
    border: int = 1
    hamming: int | None = None
    decision_margin: float | None = None


@dataclass(frozen=True, slots=True)
class UndecodedTarget(Target):
    """A target with the ID `UNDECODED`, and why it has no other.

    Attributes
    ----------
    reason : str
        'unread' if no code word is likely, 'uncertain' if one is but not certain, 'contested' if
        another target contradicts it: by its ID, by its place, or by lying on top of it, and
        'unsettled' if all families were looked for and the image does not show this one for
        certain.
    likely_id : int
        ID of the most likely code word, whose probability is `confidence`; `UNDECODED` if no code
        word is likely.
    likely_family : str
        Family of the most likely code word; empty if no code word is likely.

    Examples
    --------
    >>> UndecodedTarget(-1, 0, 10.5, 20.0, 8.0, 7.5, confidence=0.0).reason
    'unread'
    """

    reason: str = 'unread'
    likely_id: int = UNDECODED
    likely_family: str = ''

    @property
    def is_contested(self) -> bool:
        """Whether its code word is certain, and only another target contradicts it."""
        return self.reason == 'contested'

    @property
    def is_unsettled(self) -> bool:
        """Whether its code word is certain, and only its family is not."""
        return self.reason == 'unsettled'


@dataclass(frozen=True, slots=True)
class TrueTarget:
    """A target that an image shows.

    Attributes
    ----------
    id : int
        Its ID.
    x, y : float
        Image of its centre, px.
    confirmed : bool
        Whether it is certainly visible. If not, it counts neither when identified nor when
        missed, but a wrong ID in its place is a wrong ID.

    Examples
    --------
    >>> TrueTarget(id=7, x=10.5, y=20.0).confirmed
    True
    """

    id: int
    x: float
    y: float
    confirmed: bool = True

    @classmethod
    def of(cls, target: Target) -> TrueTarget:
        """Return the truth of a target whose ID and centre are exact, as in a rendering."""
        return cls(target.id, target.x, target.y)


Truth = Mapping[str, Sequence[TrueTarget]]
"""The targets of each image, by file name without folders."""


class FamilyRecord(Protocol):
    """What results know of a family; `prints.families.FamilyPrint` has all of its print."""

    @property
    def name(self) -> str:
        """Its name, as targets have it."""

    @property
    def reach(self) -> float:
        """Radius of the circle that holds a target, in semi-axes of the reported ellipse."""

    @property
    def reading(self) -> Mapping[str, int | str]:
        """How code words are read: `bits`, `first_bit` and `direction`; empty if none are read."""


Prints = Mapping[str, FamilyRecord]
"""Families by their names."""


def reach_of(target: Target, prints: Prints) -> float:
    """Return the radius of a target in semi-axes of its ellipse; 1 if its family is unknown."""
    of = prints.get(target.family)
    return of.reach if of else 1.0


@dataclass(frozen=True, slots=True)
class FilterState:
    """The homomorphic filter that led to an identification, and what it cost to find.

    Attributes
    ----------
    applied : bool
        False if the result comes from the unfiltered image; the filter is then the identity.
    gamma_high, gamma_low : float
        Gains of the high and the low frequencies, dimensionless.
    cutoff : float
        D0, cycles per image; 0 if no filter was applied.
    attenuation : float
        c, dimensionless.
    evaluations, generations : int
        Number of identifications, the unfiltered one included, and of generations of the search.
    duration : float
        Time from the image to the result, s.

    Examples
    --------
    >>> FilterState().applied
    False
    """

    applied: bool = False
    gamma_high: float = 1.0
    gamma_low: float = 1.0
    cutoff: float = 0.0
    attenuation: float = 0.0
    evaluations: int = 0
    generations: int = 0
    duration: float = 0.0


@dataclass(frozen=True, slots=True)
class SearchTrace:
    """The filters that a search tried, in the order in which they counted, and how each did.

    Attributes
    ----------
    reason : str
        Why the search ended, see `ahf_ros.identification.filtering.genetic.SearchResult`.
    discrepancies : tuple of int
        |N - n| through each filter.
    gamma_high, gamma_low, cutoff, attenuation : tuple of float
        The filters, as in `FilterState`.
    generations : tuple of int
        Number of filters tried by the end of each generation.
    combinations : tuple of str
        Combination of the stack that each filter was applied to; empty for one image.

    Examples
    --------
    >>> SearchTrace('found', (2, 0), (2.0, 3.1), (0.5, 0.8), (90.0, 80.0), (1.5, 2.3), (2,)).reason
    'found'
    """

    reason: str
    discrepancies: tuple[int, ...]
    gamma_high: tuple[float, ...]
    gamma_low: tuple[float, ...]
    cutoff: tuple[float, ...]
    attenuation: tuple[float, ...]
    generations: tuple[int, ...]
    combinations: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Identification:
    """The targets that were identified in one image: a sequence of them, and how they were found.

    Attributes
    ----------
    targets : tuple of Target
        Sorted by `id`, undecoded targets first.
    expected : int
        N, the number of coded targets that the image shows; 0 if unknown.
    filter : FilterState
        The filter that gave the targets.
    estimated : bool
        Whether `expected` was estimated from the image.
    mirrored : bool
        Whether the image seems to be mirrored: most IDs read are not among the expected ones, and
        most would be in a mirror.
    combination : str
        Combination of the stack that gave the targets, see `ahf_ros.vision.stack`; empty for one
        image.
    expected_ids : tuple of int
        The IDs that the image was expected to show, in ascending order; empty if they are unknown.
    search : SearchTrace or None
        The search for a filter; None if there was none.
    edge_shift : float, optional
        Edge shift of the image, px, as in `Target`; None where it is unknown.
    other_ids : tuple of int
        IDs that were read but are not among those that were listed as expected, or as those of
        the network, in ascending order.
    repeated : tuple of UndecodedTarget
        Targets whose likely ID others have, too, so that none of them is reported with it.
    unsettled : tuple of UndecodedTarget
        Targets that would be reported if their family was named: all were looked for, and this
        image alone does not show theirs for certain.
    looked_for : str
        The families that were looked for in this image, separated by commas, or 'auto' for all;
        empty for a detector without families.
    prints : mapping of str to FamilyRecord
        The families of the settings by their names, with what is printed of each.

    Examples
    --------
    >>> target = Target(id=7, code=19, x=10.5, y=20.0, semi_major=8.0, semi_minor=7.5)
    >>> found = Identification((target,), expected=2)
    >>> found.count, len(found), found[0].id, [target.x for target in found]
    (1, 1, 7, [10.5])
    >>> found.ids, found.centres, found.covariances.shape
    (array([7]), array([[10.5, 20. ]]), (1, 2, 2))
    """

    targets: tuple[Target, ...]
    expected: int = 0
    filter: FilterState = field(default_factory=FilterState)
    estimated: bool = False
    mirrored: bool = False
    combination: str = ''
    expected_ids: tuple[int, ...] = ()
    search: SearchTrace | None = None
    edge_shift: float | None = None
    other_ids: tuple[int, ...] = ()
    repeated: tuple[UndecodedTarget, ...] = ()
    unsettled: tuple[UndecodedTarget, ...] = ()
    looked_for: str = ''
    prints: Prints = field(default_factory=dict, repr=False, compare=False)

    def __len__(self) -> int:
        """Return the number of targets, undecoded ones included."""
        return len(self.targets)

    def __iter__(self) -> Iterator[Target]:
        """Iterate over the targets."""
        return iter(self.targets)

    @overload
    def __getitem__(self, index: int) -> Target: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Target, ...]: ...

    def __getitem__(self, index: int | slice) -> Target | tuple[Target, ...]:
        """Return a target, or several."""
        return self.targets[index]

    @property
    def count(self) -> int:
        """n, the number of distinct targets identified, by family, ID and colour."""
        return count_codes(self.targets)

    @property
    def ids(self) -> np.ndarray:
        """IDs of the targets, an array of int64 of shape (n,)."""
        import numpy as np

        return np.array([target.id for target in self], np.int64)

    @property
    def centres(self) -> np.ndarray:
        """Centres of the targets, px, an array of float64 of shape (n, 2): x and y."""
        import numpy as np

        return np.array([(target.x, target.y) for target in self], float).reshape(-1, 2)

    @property
    def covariances(self) -> np.ndarray:
        """Covariances of the centres, px^2, an array of float64 of shape (n, 2, 2)."""
        import numpy as np

        return np.array([target.covariance for target in self], float).reshape(-1, 2, 2)

    def to_dataframe(self) -> Any:
        """Return the targets as a `pandas.DataFrame`, a row each.

        Its columns are the fields of `Target`; the covariance has three, `covariance_xx`,
        `covariance_xy` and `covariance_yy`.

        Raises
        ------
        ModuleNotFoundError
            If pandas is not installed.
        """
        need('dataframe')
        import pandas

        table: dict[str, Any] = {
            it.name: [getattr(target, it.name) for target in self] for it in fields(Target)
        }
        del table['covariance']
        for row, column, name in ((0, 0, 'xx'), (0, 1, 'xy'), (1, 1, 'yy')):
            table[f'covariance_{name}'] = self.covariances[:, row, column]
        return pandas.DataFrame(table)


def sorted_targets(targets: Iterable[Target]) -> list[Target]:
    """Return targets by ascending ID, then by family, from top to bottom, from left."""
    return sorted(targets, key=lambda target: (target.id, target.family, target.y, target.x))


def repeated_targets(targets: Iterable[Target]) -> tuple[UndecodedTarget, ...]:
    """Return the contested targets that have their likely ID in common with another one."""
    contested = [it for it in targets if isinstance(it, UndecodedTarget) and it.is_contested]
    counts = Counter((it.likely_family, it.likely_id, it.polarity) for it in contested)
    return tuple(it for it in contested if counts[it.likely_family, it.likely_id, it.polarity] > 1)


def count_codes(targets: Iterable[Target]) -> int:
    """Return the number of distinct targets by family, ID and colour, undecoded ones excluded."""
    return len({target.print for target in targets if target.id != UNDECODED})
