"""The design and the codes of printed targets, learnt from measured coordinates of their dots.

What was learnt is written as the data file that `ahf_ros.prints.gsi.point_family` reads.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from ahf_ros.prints.gsi import PointPrint, positions_of, value_of

_REFERENCE_LABEL = re.compile(r'CODE(\d+)')
_DOT_LABEL = re.compile(r'NUGGET(\d+)_(\w+)')
_MAXIMUM_DISTANCE = 0.1  # of a template dot from the design, in the spread of the template
_DECIMALS = 3  # of learnt coordinates: exports have as many


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredTarget:
    """A target as it was measured, laid onto its design.

    `scale` is the length in the design of one unit of the coordinates. `template` has the template
    dots, float64, shape (n, 2), and `dots` the decoding dots by the numbers of their positions,
    both in the unit of the design.
    """

    number: int
    scale: float
    template: np.ndarray
    dots: dict[int, np.ndarray]


@dataclass(frozen=True, slots=True, eq=False)
class Learnt:
    """What a point list says about a family.

    `family` has the design in the unit of the coordinates, and the codes of the base alone;
    `codes` the values by ID of the targets that are complete; `left_out` says by ID why others
    were not used.
    """

    family: PointPrint
    codes: dict[int, int]
    targets: tuple[MeasuredTarget, ...]
    left_out: dict[int, str]


def learn_family(points: Mapping[str, np.ndarray], base: PointPrint, name: str) -> Learnt:
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
    base : PointPrint
        Design with the names of the template dots and about their places, at any scale. Positions
        that no target shows are taken from it.
    name : str
        Name of the new family.

    Raises
    ------
    ValueError
        If there is no complete target, or if two of them have one code.
    """
    grouped = _grouped(points, base)
    if not grouped:
        corners = [of for of in base.template_names if of != _reference_name(base)]
        raise ValueError(
            'the point list has no rows of coded targets, accepted are rows CODEn and NUGGETn_'
            f'{", NUGGETn_".join(corners)} and NUGGETn_<position>'
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
    known: dict[int, int] = {}
    for target in targets:
        other = known.setdefault(value_of(target.dots), target.number)
        if other != target.number:
            raise ValueError(
                f'targets {other} and {target.number} have the same dots '
                f'{sorted(target.dots)}, accepted is one number a code'
            )
    return Learnt(
        family=_averaged(targets, base, name),
        codes={number: value for value, number in known.items()},
        targets=tuple(targets),
        left_out=left_out,
    )


def with_codes(family: PointPrint, codes: dict[int, int]) -> PointPrint:
    """Return a family that lists more codes, values by ID.

    They take the place of listed codes that have the same ID or value.
    """
    codes = {number: word for number, word in codes.items() if family.number(word) != number}
    listed = {
        word: number
        for number, word in family.listed.items()
        if number not in codes and word not in codes.values()
    }
    listed |= {word: number for number, word in codes.items()}
    words = np.array(sorted(listed), np.int64)
    numbers = np.array([listed[word] for word in words.tolist()], np.int64)
    first = family.rule.first_own_number
    if first is not None and numbers.max(initial=0) >= first:
        first = 10 ** len(str(numbers.max())) + 1
    rule = replace(family.rule, first_own_number=first)
    return replace(family, words=words, numbers=numbers, rule=rule)


def library_text(family: PointPrint) -> str:
    """Return the data file that describes a family, one dot or code a line."""

    def block(name: str, table: Mapping[str, Sequence[float]]) -> str:
        rows = [f'    {json.dumps(key)}: {json.dumps(value)}' for key, value in table.items()]
        return f'  "{name}": {{\n' + ',\n'.join(rows) + '\n  }'

    def dots(
        names: Iterable[str], points: np.ndarray, radii: np.ndarray
    ) -> dict[str, list[float]]:
        return {
            name: point if radius == family.dot_radius else [*point, radius]
            for name, point, radius in zip(names, points.tolist(), radii.tolist(), strict=True)
        }

    head = {
        'family': family.name,
        'source': family.source,
        'unit': family.unit,
        'dot_radius': family.dot_radius,
        'reference': _reference_name(family),
    }
    rule = asdict(family.rule) | {'groups': [sorted(group) for group in family.rule.groups]}
    numbers = map(str, family.position_numbers.tolist())
    listed = {str(number): positions_of(word) for number, word in sorted(family.listed.items())}
    parts = [f'  {json.dumps(key)}: {json.dumps(value)}' for key, value in head.items() if value]
    parts += [
        block('template', dots(family.template_names, family.template, family.template_radii)),
        block('positions', dots(numbers, family.positions, family.position_radii)),
        f'  "rule": {json.dumps({key: value for key, value in rule.items() if value})}',
        block('codes', listed),
    ]
    return '{\n' + ',\n'.join(parts) + '\n}\n'


def _reference_name(family: PointPrint) -> str:
    return family.template_names[family.reference]


def _grouped(
    points: Mapping[str, np.ndarray], base: PointPrint
) -> dict[int, dict[str, np.ndarray]]:
    """Return the dots of each target by their names."""
    grouped: dict[int, dict[str, np.ndarray]] = {}
    for label, point in points.items():
        if found := _REFERENCE_LABEL.fullmatch(label):
            name = _reference_name(base)
        elif found := _DOT_LABEL.fullmatch(label):
            name = found[2]
        else:
            continue
        grouped.setdefault(int(found[1]), {})[name] = np.asarray(point, np.float64)
    # V-STARS names its scale bars' and single targets CODEn as well, without any NUGGET.
    return {number: dots for number, dots in grouped.items() if len(dots) > 1}


def _measured(number: int, dots: dict[str, np.ndarray], base: PointPrint) -> MeasuredTarget:
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
    flat = every @ np.linalg.svd(every)[2][:2].T @ [1, 1j]
    numbers = [int(name) for name in decoding]
    known = dict(zip(base.position_numbers.tolist(), base.positions.tolist(), strict=True))
    places = [*base.template.tolist(), *(known.get(it, (np.nan, np.nan)) for it in numbers)]
    design = np.array(places) @ [1, 1j]
    count = len(base.template)
    of_template = np.arange(len(design)) < count
    spread = np.abs(design[:count] - design[:count].mean()).max()

    def distances(side: np.ndarray) -> np.ndarray:
        return np.abs(_laid(side, design, of_template)[0] - design)

    side = min(flat, flat.conj(), key=lambda side: distances(side)[:count].max())
    apart = distances(side)
    error = apart[:count].max()
    if error > _MAXIMUM_DISTANCE * spread:
        raise ValueError(f'differs from the template by up to {error:.2f} {base.unit}'.rstrip())
    # A position that is new is farther away.
    laid, scale = _laid(side, design, apart < _MAXIMUM_DISTANCE * spread)
    points = np.stack([laid.real, laid.imag], axis=1)
    return MeasuredTarget(
        number=number,
        scale=scale,
        template=points[:count],
        dots=dict(zip(numbers, points[count:], strict=True)),
    )


def _laid(points: np.ndarray, design: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, float]:
    """Return points turned, scaled and moved so that some of them lie on a design; the scale.

    Points and design are complex: x + i y.
    """
    middle, wanted = points[which].mean(), design[which].mean()
    centred = points[which] - middle
    turn = np.vdot(centred, design[which] - wanted) / np.vdot(centred, centred).real
    return (points - middle) * turn + wanted, float(abs(turn))


def _averaged(targets: list[MeasuredTarget], base: PointPrint, name: str) -> PointPrint:
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
    distance = round(base.rule.minimum_distance / scale, _DECIMALS)
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
        rule=replace(base.rule, minimum_distance=distance),
    )
