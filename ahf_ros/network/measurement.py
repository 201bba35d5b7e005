"""What is measured between targets: distances, deviations and errors of calibrated lengths.

Standard deviations come from the whole covariance: that of a distance depends on how the ends
are correlated, and not on the frame.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ahf_ros.base.text import counted
from ahf_ros.network.alignment import Alignment
from ahf_ros.network.network import FloatArray
from ahf_ros.network.points import MeasuredPoints, blocks, entries, standard_deviations
from ahf_ros.network.units import other_unit

LINES, LENGTHS_A_LINE, SHARE_OF_DIAGONAL = 7, 5, 2 / 3
"""What VDI/VDE 2634-1 wants at least: lines, lengths in each, and the longest length."""

_ROUNDING = 1e-9  # of lengths given in decimals


@dataclass(frozen=True)
class Distance:
    """A distance between two targets and its standard deviation, in the unit of the network."""

    ends: tuple[str, str]
    length: float
    sigma: float


@dataclass(frozen=True)
class Deviation:
    """Measured minus nominal coordinates of a target (3,), with their covariance (3, 3)."""

    name: str
    xyz: FloatArray
    covariance: FloatArray
    used: bool
    """Whether the alignment rests on this target, too."""

    @property
    def distance(self) -> float:
        """From the nominal place."""
        return float(np.linalg.norm(self.xyz))

    @property
    def sigmas(self) -> FloatArray:
        """Standard deviations in x, y and z."""
        return standard_deviations(self.covariance)


@dataclass(frozen=True)
class PermissibleError:
    """The maximum permissible error A + L/K of a length L, B at most; A and B in the unit of L."""

    constant: float
    divisor: float = np.inf
    largest: float = np.inf

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, value in (('A', self.constant), ('K', self.divisor), ('B', self.largest)):
            if not value > 0 and not (name == 'A' and value == 0):
                raise ValueError(
                    f'{name} of the permissible error is {value}, accepted is above 0'
                )
        if np.isinf(self.constant):
            raise ValueError('A of the permissible error is infinite, accepted is a finite number')

    def of(self, length: float) -> float:
        """Return the permissible error of a length."""
        return float(min(self.constant + length / self.divisor, self.largest))


@dataclass(frozen=True)
class CalibratedLength:
    """A calibrated length between two targets, with the name of the line that it is part of."""

    ends: tuple[str, str]
    length: float
    sigma: float = 0.0
    line: str = ''


@dataclass(frozen=True)
class LengthError:
    """Measured minus calibrated length; `sigma` has the parts of both."""

    ends: tuple[str, str]
    line: str
    calibrated: float
    measured: float
    sigma: float
    permissible: float | None

    @property
    def error(self) -> float:
        """Measured minus calibrated."""
        return self.measured - self.calibrated

    @property
    def within(self) -> bool | None:
        """Whether the error is permissible; None where nothing says what is."""
        return None if self.permissible is None else abs(self.error) <= self.permissible


@dataclass(frozen=True)
class LengthTest:
    """Errors of calibrated lengths, and in what these are not those of VDI/VDE 2634-1."""

    errors: tuple[LengthError, ...]
    remarks: tuple[str, ...]

    @property
    def largest(self) -> LengthError:
        """The error that is largest without its sign."""
        return max(self.errors, key=lambda it: abs(it.error))

    @property
    def passed(self) -> bool | None:
        """Whether all errors are permissible; None where nothing says what is."""
        verdicts = [it.within for it in self.errors]
        return None if None in verdicts else all(verdicts)


def distances(
    points: MeasuredPoints, pairs: Sequence[tuple[str, str]] | None = None
) -> list[Distance]:
    """Return the distances of pairs of targets, by default of all."""
    pairs = list(combinations(points.names, 2)) if pairs is None else pairs
    measured = []
    for pair in pairs:
        first, second = points.indices(pair)
        difference = points.xyz[second] - points.xyz[first]
        length = float(np.linalg.norm(difference))
        if not length > 0:
            raise ValueError(f'targets {pair[0]} and {pair[1]} are in one place, accepted are two')
        some = entries([first, second])
        slopes = np.concatenate((-difference, difference)) / length
        variance = max(float(slopes @ points.covariance[np.ix_(some, some)] @ slopes), 0.0)
        measured.append(Distance((pair[0], pair[1]), length, float(np.sqrt(variance))))
    return measured


def deviations(alignment: Alignment, nominal: Mapping[str, FloatArray]) -> list[Deviation]:
    """Return measured minus nominal coordinates of all targets that have both."""
    points, found = alignment.points, []
    own = blocks(points.covariance)
    for index, name in enumerate(points.names):
        if name in nominal:
            difference = points.xyz[index] - nominal[name]
            found.append(Deviation(name, difference, own[index], name in alignment.used))
    return found


def unit_remark(points: MeasuredPoints, nominal: Mapping[str, FloatArray]) -> str:
    """Return a remark on nominal coordinates that seem to be in another unit, empty on others."""
    both = {name: index for index, name in enumerate(points.names) if name in nominal}
    if len(both) < 2:
        return ''
    given = _diagonal(np.array([nominal[name] for name in both]))
    return other_unit(given, _diagonal(points.xyz[list(both.values())]), points.unit)


def length_errors(
    points: MeasuredPoints,
    lengths: Sequence[CalibratedLength],
    permissible: PermissibleError | None = None,
) -> LengthTest:
    """Return the errors of calibrated lengths as VDI/VDE 2634-1 defines them.

    Remarks say where there are fewer than seven lines, a line has fewer than five lengths, or the
    longest length is shorter than two thirds of the space diagonal of all targets. A ValueError
    says so if the network has no scale or an end is no measured target.
    """
    if not lengths:
        raise ValueError('there are no calibrated lengths, accepted is at least one')
    if not points.unit:
        raise ValueError('the network has no scale, accepted is one with a scale bar or control')
    for item in lengths:
        if not (np.isfinite(item.length) and item.length > 0 and 0 <= item.sigma < np.inf):
            raise ValueError(
                f'length of {" and ".join(item.ends)} is {item.length} with the standard '
                f'deviation {item.sigma}, accepted are a positive number and one of 0 or more'
            )
    measured = distances(points, [item.ends for item in lengths])
    errors = tuple(
        LengthError(
            item.ends,
            item.line,
            item.length,
            distance.length,
            float(np.hypot(distance.sigma, item.sigma)),
            None if permissible is None else permissible.of(item.length),
        )
        for item, distance in zip(lengths, measured, strict=True)
    )
    return LengthTest(errors, tuple(_remarks(errors, points.xyz)))


def _remarks(errors: Sequence[LengthError], xyz: FloatArray) -> list[str]:
    """Return in what lengths are not those of the guideline, as sentences."""
    remarks = []
    lines = Counter(it.line for it in errors if it.line)
    if len(lines) < LINES:
        remarks.append(
            f'Lengths are in {counted(len(lines), "named line")}, VDI/VDE 2634-1 wants {LINES}.'
        )
    for line, count in lines.items():
        if count < LENGTHS_A_LINE:
            text = f'Line {line} has {counted(count, "length")}'
            remarks.append(f'{text}, VDI/VDE 2634-1 wants {LENGTHS_A_LINE}.')
    longest = max(it.calibrated for it in errors)
    diagonal = _diagonal(xyz)
    if longest < (SHARE_OF_DIAGONAL - _ROUNDING) * diagonal:
        remarks.append(
            f'The longest length is {longest / diagonal:.2f} of the space diagonal of the '
            'targets, VDI/VDE 2634-1 wants two thirds.'
        )
    return remarks


def _diagonal(xyz: FloatArray) -> float:
    """Return the space diagonal of the box of points along their principal axes."""
    centred = xyz - xyz.mean(axis=0)
    axes = np.linalg.svd(centred, full_matrices=False)[2]
    return float(np.linalg.norm(np.ptp(centred @ axes.T, axis=0)))
