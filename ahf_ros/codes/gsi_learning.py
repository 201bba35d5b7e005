"""The design and the codes of printed targets, learnt from measured coordinates of their dots."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ahf_ros.codes.gsi import PointFamily, value_of

_REFERENCE_LABEL = re.compile(r'CODE(\d+)')
_DOT_LABEL = re.compile(r'NUGGET(\d+)_(\w+)')
_MAXIMUM_DISTANCE = 0.1  # of a template dot from the design, in the spread of the template
_DECIMALS = 3  # of learnt coordinates: exports have as many


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredTarget:
    """A target as it was measured, in the plane of its design.

    Attributes
    ----------
    number : int
        Its ID.
    scale : float
        Length in the design of one unit of the coordinates.
    template : ndarray of float64, shape (n, 2)
        Template dots, laid onto the design and in its unit.
    dots : dict of int to ndarray
        Decoding dots by the numbers of their positions, likewise.
    """

    number: int
    scale: float
    template: np.ndarray
    dots: dict[int, np.ndarray]


@dataclass(frozen=True, slots=True, eq=False)
class Learnt:
    """What a point list says about a family.

    Attributes
    ----------
    family : PointFamily
        The design in the unit of the coordinates; its codes are the base's alone.
    codes : dict of int to int
        Values by ID, of all the targets that are complete.
    targets : tuple of MeasuredTarget
    left_out : dict of int to str
        Why other targets were not used.
    """

    family: PointFamily
    codes: dict[int, int]
    targets: tuple[MeasuredTarget, ...]
    left_out: dict[int, str]


def learn_family(points: Mapping[str, np.ndarray], base: PointFamily, name: str) -> Learnt:
    """Learn a family from the coordinates of the dots of its targets.

    Each target is laid into its plane and turned so that its template lies on the template of
    a design known in rough. The names of the dots say which is which, so that front and back
    cannot be mistaken.

    Parameters
    ----------
    points : mapping of str to ndarray of float64, shape (3,)
        Coordinates by label, as V-STARS writes them: CODEn is the reference point of target n,
        NUGGETn_A the template dot A, NUGGETn_7 the decoding dot at position 7. Other labels are
        left alone.
    base : PointFamily
        Design with the names of the template dots and about their places, at any scale. Positions
        that no target shows are taken from it.
    name : str
        Name of the new family.

    Returns
    -------
    Learnt

    Raises
    ------
    ValueError
        If there is no complete target, or if two of them have one code.
    """
    grouped = _grouped(points, base)
    if not grouped:
        raise ValueError(
            'the point list has no rows of coded targets, accepted are rows CODEn and NUGGETn_'
            f'{", NUGGETn_".join(_corner_names(base))} and NUGGETn_<position>'
        )
    targets, left_out = [], {}
    for number, dots in sorted(grouped.items()):
        try:
            targets.append(_measured(number, dots, base))
        except ValueError as error:
            left_out[number] = str(error)
    if not targets:
        number, reason = next(iter(left_out.items()))
        raise ValueError(f'the point list has no complete target; target {number} {reason}')
    codes: dict[int, int] = {}
    for target in targets:
        value = value_of(target.dots)
        for other, known in codes.items():
            if known == value:
                raise ValueError(
                    f'targets {other} and {target.number} have the same dots '
                    f'{sorted(target.dots)}, accepted is one number a code'
                )
        codes[target.number] = value
    return Learnt(_averaged(targets, base, name), codes, tuple(targets), left_out)


def _corner_names(base: PointFamily) -> list[str]:
    """Return the names of the template dots except the reference."""
    reference = base.template_names[base.reference]
    return [name for name in base.template_names if name != reference]


def _grouped(
    points: Mapping[str, np.ndarray], base: PointFamily
) -> dict[int, dict[str, np.ndarray]]:
    """Return the dots of each target by their names."""
    grouped: dict[int, dict[str, np.ndarray]] = {}
    for label, point in points.items():
        if found := _REFERENCE_LABEL.fullmatch(label):
            name = base.template_names[base.reference]
        elif found := _DOT_LABEL.fullmatch(label):
            name = found[2]
        else:
            continue
        grouped.setdefault(int(found[1]), {})[name] = np.asarray(point, np.float64)
    # V-STARS names its scale bars' and single targets CODEn as well, without any NUGGET.
    return {number: dots for number, dots in grouped.items() if len(dots) > 1}


def _measured(number: int, dots: dict[str, np.ndarray], base: PointFamily) -> MeasuredTarget:
    """Return a target laid onto the design; refuse one that is not complete or does not fit."""
    missing = [name for name in base.template_names if name not in dots]
    if missing:
        raise ValueError(f'has no template dot {", ".join(missing)}')
    decoding = {name: point for name, point in dots.items() if name not in base.template_names}
    if len(decoding) != base.rule.dots or not all(name.isdecimal() for name in decoding):
        told = ', '.join(sorted(decoding)) or 'none'
        raise ValueError(f'has the decoding dots {told}, accepted are {base.rule.dots} positions')
    every = np.array([dots[name] for name in (*base.template_names, *decoding)])
    every -= every.mean(axis=0)
    flat = every @ np.linalg.svd(every)[2][:2].T
    numbers = [int(name) for name in decoding]
    design = np.concatenate([base.template, _base_positions(numbers, base)])
    of_template = np.arange(len(design)) < len(base.template)
    sides = [flat, flat * [1, -1]]
    fits = [_laid(side, design, of_template) for side in sides]
    errors = [np.hypot(*(fit[0] - design)[of_template].T).max() for fit in fits]
    side = int(np.argmin(errors))
    spread = np.hypot(*(base.template - base.template.mean(axis=0)).T).max()
    if errors[side] > _MAXIMUM_DISTANCE * spread:
        raise ValueError(
            f'differs from the template by up to {errors[side]:.2f} {base.unit}'.rstrip()
        )
    laid, _ = fits[side]
    # A position that is new is farther away.
    near = np.hypot(*(laid - design).T) < _MAXIMUM_DISTANCE * spread
    laid, scale = _laid(sides[side], design, near)
    count = len(base.template)
    return MeasuredTarget(
        number, scale, laid[:count], dict(zip(numbers, laid[count:], strict=True))
    )


def _base_positions(numbers: list[int], base: PointFamily) -> np.ndarray:
    """Return the places that a design has for positions, NaN for those that it does not have."""
    known = dict(zip(base.position_numbers.tolist(), base.positions, strict=True))
    return np.array([known.get(number, (np.nan, np.nan)) for number in numbers]).reshape(-1, 2)


def _laid(points: np.ndarray, design: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, float]:
    """Return points turned, scaled and moved so that some of them lie on a design; the scale."""
    middle, wanted = points[which].mean(axis=0), design[which].mean(axis=0)
    centred, aim = points[which] - middle, design[which] - wanted
    across = (centred * aim).sum()
    around = (centred[:, 0] * aim[:, 1] - centred[:, 1] * aim[:, 0]).sum()
    turn = np.array([[across, -around], [around, across]]) / (centred**2).sum()
    return (points - middle) @ turn.T + wanted, float(
        np.hypot(across, around) / (centred**2).sum()
    )


def _averaged(targets: list[MeasuredTarget], base: PointFamily, name: str) -> PointFamily:
    """Return the mean design, with the positions of the base that no target shows."""
    scale = float(np.mean([target.scale for target in targets]))
    template = np.mean([target.template for target in targets], axis=0) / scale
    places = dict(zip(base.position_numbers.tolist(), base.positions / scale, strict=True))
    radii = dict(zip(base.position_numbers.tolist(), base.position_radii / scale, strict=True))
    seen: dict[int, list[np.ndarray]] = {}
    for target in targets:
        for number, point in target.dots.items():
            seen.setdefault(number, []).append(point / scale)
    places |= {number: np.mean(points, axis=0) for number, points in seen.items()}
    numbers = sorted(places)
    radius = round(base.dot_radius / scale, _DECIMALS)
    rule = replace(base.rule, minimum_distance=base.rule.minimum_distance / scale)
    rule = replace(rule, minimum_distance=round(rule.minimum_distance, _DECIMALS))
    return replace(
        base,
        name=name,
        source='',
        dot_radius=radius,
        template=template.round(_DECIMALS),
        template_radii=(base.template_radii / scale).round(_DECIMALS),
        position_numbers=np.array(numbers),
        positions=np.array([places[number] for number in numbers]).round(_DECIMALS),
        position_radii=np.array([radii.get(it, radius) for it in numbers]).round(_DECIMALS),
        rule=rule,
    )
