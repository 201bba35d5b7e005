"""Whether a measurement is good, in words and numbers, and what to do next.

The relative precision is the standard deviation of a coordinate over the largest dimension of the
object, as measuring systems are compared by it [1]_.

References
----------
.. [1] Luhmann et al., Close-Range Photogrammetry and 3D Imaging, 3rd ed. 2019, 7.1.
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ahf_ros.base.text import counted, listed
from ahf_ros.network.calibration import usual_deviations
from ahf_ros.network.deviations import bar_deviations, control_deviations, with_unit
from ahf_ros.network.points import standard_deviations
from ahf_ros.network.solution import Solution
from ahf_ros.network.strength import NO_CHECKS, weaknesses
from ahf_ros.network.testing import MISFIT

Grade = Literal['good', 'weak', 'bad']

_WORDS = {'good': 'Good', 'weak': 'Usable, with weaknesses', 'bad': 'Not to be trusted yet'}
_MANY = 0.02  # of the image points, which should not be left out beside those that chance rejects
_OFTEN = 3  # image points of one photograph or target that were left out, which are no accident
_AS_USUAL = 0.5  # of what is usual of lenses: a standard deviation that photographs hardly reduce


@dataclass(frozen=True)
class Finding:
    """One thing that a measurement is judged by.

    `text` says it with all numbers, `short` in few words, `remedy` what to do, if there is any.
    """

    grade: Grade
    text: str
    short: str
    remedy: str = ''


@dataclass(frozen=True)
class Verdict:
    """What a measurement is worth: the worst grade of its findings, the first line, and these."""

    grade: Grade
    line: str
    findings: tuple[Finding, ...]

    @property
    def to_do(self) -> tuple[str, ...]:
        """What to do next, the most urgent first."""
        order: tuple[Grade, ...] = 'bad', 'weak', 'good'
        return tuple(
            it.remedy for grade in order for it in self.findings if it.grade == grade and it.remedy
        )


def verdict(solution: Solution) -> Verdict:
    """Return whether a measurement is good, and what to do next.

    It is bad if a check fails, known lengths or points contradict each other, image points do not
    fit, or the adjustment did not converge; weak if anything else could be stronger.

    Parameters
    ----------
    solution : Solution
        An adjusted network.

    Returns
    -------
    Verdict
    """
    measured = [_precision(solution), _checks(solution), _sigma0(solution)]
    others = [*_contradictions(solution), *_image_points(solution)]
    weak = [Finding('weak', it.what, it.what, it.remedy) for it in weaknesses(solution)]
    findings = [*measured, *others, *weak]
    grades = {it.grade for it in findings}
    grade: Grade = 'bad' if 'bad' in grades else 'weak' if 'weak' in grades else 'good'
    told = [it.short for it in (*others, *weak) if it.grade != 'good' and it.short != NO_CHECKS]
    weak_ones = [f'weak: {listed(told, 4)}'] if told else ['nothing is weak'] * (grade == 'good')
    line = '; '.join((*(it.short for it in measured), *weak_ones))
    return Verdict(grade, f'{_WORDS[grade]}: {line}.', tuple(it for it in findings if it.text))


def contradicted(solution: Solution) -> bool:
    """Return whether image points do not fit, or known lengths, points or checks contradict them.

    An adjustment that did not converge says that they do not fit, too.
    """
    return bool(solution.suspects) or solution.sigma0 > MISFIT or not solution.converged


def relative_precision(solution: Solution) -> float:
    """Return N of 1 : N, the largest dimension over the standard deviation of a coordinate.

    It is NaN where nothing has a standard deviation.
    """
    extent, sigma = largest_dimension(solution), coordinate_deviation(solution)
    return extent / sigma if sigma > 0 else math.nan


def largest_dimension(solution: Solution) -> float:
    """Return the largest distance between two targets, 0 without any."""
    points = solution.state.points[solution.determined]
    return max((float(np.linalg.norm(points - it, axis=1).max()) for it in points), default=0.0)


def coordinate_deviation(solution: Solution) -> float:
    """Return the root of the mean variance of all coordinates, NaN without any."""
    variances = np.diagonal(solution.point_covariances[solution.determined], axis1=1, axis2=2)
    return float(np.sqrt(variances.mean())) if variances.size else math.nan


def undetermined_parameters(solution: Solution, camera: int) -> list[str]:
    """Return parameters of a camera that photographs hardly determine: as usual of lenses."""
    sigmas = standard_deviations(solution.camera_covariances[camera])
    focal = solution.state.calibrations[camera, 0]
    usual = usual_deviations(solution.network.cameras[camera], focal).items()
    return [
        name
        for (name, before), sigma in zip(usual, sigmas, strict=True)
        if name in solution.released[camera] and sigma > _AS_USUAL * before
    ]


def _precision(solution: Solution) -> Finding:
    number, unit = relative_precision(solution), solution.network.unit
    if coordinate_deviation(solution) == 0:
        return Finding('good', 'all coordinates were given as exact', 'exact coordinates')
    if not math.isfinite(number):
        return Finding('bad', 'no standard deviations are known', 'no relative precision')
    digits = 10 ** max(math.floor(math.log10(number)) - 1, 0)
    short = f'relative precision 1 : {round(number / digits) * digits:,}'
    text = (
        f'{short}: the largest dimension is {with_unit(largest_dimension(solution), unit)}, the '
        f'standard deviation of a coordinate {with_unit(coordinate_deviation(solution), unit)}'
    )
    return Finding('good', text, short)


def _checks(solution: Solution) -> Finding:
    """Return how the checks of a network come out; what was left out is none."""
    unused = {it.name for it in solution.suspects if it.verdict != 'failed'}
    failed = [it for it in solution.suspects if it.verdict == 'failed']
    checks = [it.bar.title for it in bar_deviations(solution) if it.bar.check]
    checks += [it.point.title for it in control_deviations(solution) if it.point.check]
    names = [it for it in checks if it not in unused]
    if not names:  # the weaknesses say what that means
        return Finding('good', '', NO_CHECKS)
    if not failed:
        of = f'{len(names)} of {counted(len(names), "check")} passed'
        return Finding('good', f'{of}: {listed(names)}', of)
    of = f'{len(failed)} of {counted(len(names), "check")} failed'
    worst = max(failed, key=lambda it: it.gap / it.sigma)
    text = (
        f'{of}: {listed([it.name for it in failed])}, by up to '
        f'{worst.gap / worst.sigma:.1f} standard deviations'
    )
    remedy = (
        f'Measure {listed([it.name for it in failed])} again: either the table is wrong, or the '
        'scale and the coordinates are, by as much.'
    )
    return Finding('bad', text, of, remedy)


def _sigma0(solution: Solution) -> Finding:
    value = solution.sigma0
    short = f'sigma0 {value:.2f}'
    if solution.redundancy <= 0:
        text = 'nothing is measured twice, so that no error can show itself'
        remedy = 'Take more photographs of the same targets.'
        return Finding('bad', f'{short}: {text}', f'{short}, without redundancy', remedy)
    if value > MISFIT:
        text = 'image points do not fit: something is wrong that larger weights do not describe'
        remedy = (
            'Find out why image points do not fit: wrong IDs, targets that moved, a zoom or focus '
            'that changed, a calibration of another camera.'
        )
        return Finding('bad', f'{short}: {text}', f'{short}, image points do not fit', remedy)
    if not solution.scaled:
        return Finding(
            'good', f'{short}: image points are as precise as they say', f'{short}, as expected'
        )
    times, how = (value, 'less') if value > 1 else (1 / value, 'more')
    said = f'image points are {times:.1f} times {how} precise than they say'
    return Finding(
        'good', f'{short}: {said}; all standard deviations are scaled by it', f'{short}, {said}'
    )


def _contradictions(solution: Solution) -> Iterator[Finding]:
    """Yield bars and points that contradict the rest, and an adjustment that did not converge."""
    for it in solution.suspects:
        names = listed([it.name, *it.rivals])
        if it.verdict == 'left out':
            short = f'{names} is wrong and left out'
            yield Finding('weak', short, short, f'Measure {names} again, or correct the table.')
        elif it.verdict != 'failed':
            short = f'{names} contradict each other' if it.rivals else f'{names} is wrong and kept'
            yield Finding('bad', short, short, f'Measure {names} again, or correct the table.')
    if not solution.converged:
        short = 'the adjustment did not converge'
        remedy = 'Give a focal length or a calibration, or leave out photographs of few targets.'
        yield Finding('bad', short, short, remedy)


def _image_points(solution: Solution) -> Iterator[Finding]:
    """Yield how many image points were rejected beside those that chance rejects."""
    rejected = [it for it in solution.rejected if it.normalised_residual is not None]
    every = len(solution.residuals)
    many = len(rejected) > solution.expected_rejections + _MANY * every
    often = [
        f'{noun} {name} ({number})'
        for noun, names in (
            ('photograph', (it.photograph for it in rejected)),
            ('target', (it.target for it in rejected)),
        )
        for name, number in Counter(names).most_common(2)
        if number >= _OFTEN
    ]
    yield Finding(
        'weak' if many else 'good',
        f'{len(rejected)} of {counted(every, "image point")} left out; chance leaves out '
        f'{solution.expected_rejections:.1f}',
        f'{counted(len(rejected), "image point")} left out',
        f'Look at what was left out, most of {listed(often)}.' if often else '',
    )
    for camera in np.flatnonzero(solution.calibrated).tolist():
        if names := undetermined_parameters(solution, camera):
            view = solution.network.cameras[camera]
            text = f'camera {view.name}: the photographs do not determine {listed(names, 10)}'
            yield Finding('good', f'{text}; they are as usual of lenses', text)
