"""Libraries of point-distributed targets, read from data files and written to them."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import lru_cache
from itertools import combinations
from math import comb
from pathlib import Path

import numpy as np

from ahf_ros.codes.data_file import Entry, read_data_file
from ahf_ros.codes.gsi import PointFamily, Rule, positions_of, valid_words, value_of

GSI_LIBRARY = Path(__file__).with_name('gsi.json')
"""Template, positions and known numbers of GSI's targets."""

_POSITION_NUMBERS = (0, 31)  # a code of the messages has 32 bits
_MAXIMUM_CODES = 200_000  # that a rule may be tried on
_MAXIMUM_NUMBER = 2**31 - 1


@lru_cache(maxsize=8)
def point_family(path: str = '') -> PointFamily:
    """Return a family of point-distributed targets.

    Parameters
    ----------
    path : str
        Data file, JSON or YAML, as docs/gsi.md describes it; GSI's own where empty.

    Raises
    ------
    ValueError
        If the file cannot be read or does not describe such a family, naming line and field.

    Examples
    --------
    >>> family = point_family()
    >>> family.word(18), family.number(1 << 7 | 1 << 17 | 1 << 28)
    (16464, 505)
    """
    return parse_family(read_data_file(path or GSI_LIBRARY))


def parse_family(file: Entry) -> PointFamily:
    """Return the family that the content of a data file describes; see `point_family`."""
    fields = file.keys(
        ('family', 'dot_radius', 'reference', 'template', 'positions', 'rule'),
        ('unit', 'source', 'codes'),
    )
    radius = fields['dot_radius'].number(1e-9, 'a length above 0')
    template = {name: _dot(entry, radius) for name, entry in fields['template'].items()}
    if not 3 <= len(template) <= 12:
        fields['template'].refuse('a mapping of 3 to 12 names to [x, y] or [x, y, radius]')
    reference = fields['reference'].text()
    if reference not in template:
        fields['reference'].refuse(f'one of {", ".join(template)}')
    points = np.array(list(template.values()))
    _check_template(fields['template'], points)
    positions = _positions(fields['positions'], template, radius)
    numbers = np.array(sorted(positions))
    ordered = np.array([positions[number] for number in numbers.tolist()])
    rule, words, ids = _codes(fields, positions)
    for array in (points, ordered, numbers, words, ids):
        array.setflags(write=False)
    return PointFamily(
        name=fields['family'].text(),
        unit=fields['unit'].text() if 'unit' in fields else '',
        source=fields['source'].text() if 'source' in fields else '',
        dot_radius=radius,
        template_names=tuple(template),
        template=points[:, :2],
        template_radii=points[:, 2],
        reference=list(template).index(reference),
        position_numbers=numbers,
        positions=ordered[:, :2],
        position_radii=ordered[:, 2],
        rule=rule,
        words=words,
        numbers=ids,
    )


def library_text(family: PointFamily) -> str:
    """Return the data file that describes a family, one dot or code a line."""

    def block(name: str, table: dict[str, list[float]]) -> str:
        rows = [f'    {json.dumps(key)}: {json.dumps(value)}' for key, value in table.items()]
        return f'  "{name}": {{\n' + ',\n'.join(rows) + '\n  }'

    def dots(names: list[str], points: np.ndarray, radii: np.ndarray) -> dict[str, list[float]]:
        return {
            name: point if radius == family.dot_radius else [*point, radius]
            for name, point, radius in zip(names, points.tolist(), radii.tolist(), strict=True)
        }

    rule = family.rule
    head = {
        'family': family.name,
        'source': family.source,
        'unit': family.unit,
        'dot_radius': family.dot_radius,
        'reference': family.template_names[family.reference],
    }
    of_rule = {
        'dots': rule.dots,
        'minimum_distance': rule.minimum_distance,
        'groups': [sorted(group) for group in rule.groups],
        'first_own_number': rule.first_own_number,
    }
    numbers = [str(number) for number in family.position_numbers.tolist()]
    listed = {str(number): positions_of(word) for number, word in sorted(family.listed.items())}
    parts = [f'  {json.dumps(key)}: {json.dumps(value)}' for key, value in head.items() if value]
    parts += [
        block('template', dots([*family.template_names], family.template, family.template_radii)),
        block('positions', dots(numbers, family.positions, family.position_radii)),
        f'  "rule": {json.dumps({key: value for key, value in of_rule.items() if value})}',
        block('codes', {key: [*value] for key, value in listed.items()}),
    ]
    return '{\n' + ',\n'.join(parts) + '\n}\n'


def with_codes(family: PointFamily, codes: dict[int, int]) -> PointFamily:
    """Return a family that lists more codes.

    Parameters
    ----------
    family : PointFamily
    codes : dict of int to int
        Values by ID. They take the place of listed codes that have the same ID or value.
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


def _dot(entry: Entry, radius: float) -> tuple[float, float, float]:
    """Return x, y and radius of a dot."""
    accepted = '[x, y] or [x, y, radius], of finite numbers'
    values = entry.list(accepted, (2, 3))
    x, y = (value.number(accepted=accepted) for value in values[:2])
    if len(values) == 3:
        radius = values[2].number(1e-9, 'a length above 0')
    return x, y, radius


def _overlap(first: tuple[float, float, float], second: tuple[float, float, float]) -> bool:
    distance = np.hypot(first[0] - second[0], first[1] - second[1])
    return bool(distance < first[2] + second[2])


def _check_template(entry: Entry, points: np.ndarray) -> None:
    """Refuse dots that overlap, and templates that a homography cannot be told from."""
    for first, second in combinations(points.tolist(), 2):
        if _overlap(first, second):
            entry.refuse(f'dots that do not overlap, as those at {first[:2]} and {second[:2]} do')
    spread = np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0), compute_uv=False)
    if spread[1] < 0.05 * spread[0]:
        entry.refuse('dots that do not lie on one line')


def _positions(
    table: Entry, template: dict[str, tuple[float, float, float]], radius: float
) -> dict[int, tuple[float, float, float]]:
    """Return the dots of the positions by their numbers."""
    positions: dict[int, tuple[float, float, float]] = {}
    for key, entry in table.items():
        lowest, highest = _POSITION_NUMBERS
        if not key.isdecimal() or not lowest <= int(key) <= highest:
            entry.refuse(f'a dot with a number from {lowest} to {highest} as its name')
        dot = _dot(entry, radius)
        for name, other in template.items():
            if _overlap(dot, other):
                entry.refuse(f'a place clear of the template dot {name}, at {list(other[:2])}')
        for number, other in positions.items():
            if dot[:2] == other[:2]:
                entry.refuse(f'a place other than that of position {number}')
        if int(key) in positions:
            entry.refuse(f'one place for position {int(key)}')
        positions[int(key)] = dot
    if not positions:
        table.refuse('a mapping of numbers to [x, y] or [x, y, radius]')
    return positions


def _codes(
    fields: dict[str, Entry], positions: dict[int, tuple[float, float, float]]
) -> tuple[Rule, np.ndarray, np.ndarray]:
    """Return the rule, the values of all codes, ascending, and their IDs."""
    rule = _rule(fields['rule'], positions)
    known: dict[int, int] = {}
    for key, entry in fields['codes'].items() if 'codes' in fields else ():
        if not key.isdecimal() or not 0 <= int(key) <= _MAXIMUM_NUMBER:
            entry.refuse('a list of positions with an ID of at least 0 as its name')
        value = value_of(_code_dots(entry, rule.dots, positions))
        if value in known:
            entry.refuse(f'a code other than that of number {known[value]}')
        if int(key) in known.values():
            entry.refuse(f'one code for number {int(key)}')
        known[value] = int(key)
    first = rule.first_own_number
    if first is not None:
        if max(known.values(), default=-1) >= first:
            fields['rule'].refuse('a first_own_number above the numbers of all codes')
        places = {number: (x, y) for number, (x, y, _) in positions.items()}
        allowed = valid_words(places, rule)
        if not allowed.size:
            fields['rule'].refuse('a rule that allows at least one code')
        # The rank counts all, so that a number learnt moves no other.
        known = (
            dict(zip(allowed.tolist(), range(first, first + allowed.size), strict=True)) | known
        )
    if not known:
        fields['rule'].refuse('a rule with first_own_number, where no codes are listed')
    words = np.array(sorted(known), np.int64)
    return rule, words, np.array([known[word] for word in words.tolist()], np.int64)


def _rule(entry: Entry, positions: dict[int, tuple[float, float, float]]) -> Rule:
    """Return the rule of a file."""
    fields = entry.keys(('dots',), ('minimum_distance', 'groups', 'first_own_number'))
    dots = fields['dots'].integer(1, len(positions))
    least, groups, first = 0.0, [], None
    if 'minimum_distance' in fields:
        least = fields['minimum_distance'].number(0.0, 'a length of at least 0')
    for group in fields['groups'].list('a list of lists') if 'groups' in fields else ():
        accepted = 'a list of positions'
        numbers = {item.integer(*_POSITION_NUMBERS) for item in group.list(accepted)}
        if not numbers or not numbers <= set(positions):
            group.refuse(accepted)
        groups.append(frozenset(numbers))
    if 'first_own_number' in fields:
        first = fields['first_own_number'].integer(0, _MAXIMUM_NUMBER - _MAXIMUM_CODES)
        if comb(len(positions), dots) > _MAXIMUM_CODES:
            entry.refuse(f'a rule of at most {_MAXIMUM_CODES} combinations of positions')
        widest = 2 * max(radius for *_, radius in positions.values())
        if least < widest and dots > 1:
            entry.refuse(f'a minimum_distance of at least {widest:g}, so that no dots overlap')
    return Rule(dots, least, tuple(groups), first)


def _code_dots(
    entry: Entry, dots: int, positions: dict[int, tuple[float, float, float]]
) -> list[int]:
    """Return the positions of a listed code."""
    accepted = f'a list of {dots} different positions'
    numbers = [item.integer(*_POSITION_NUMBERS) for item in entry.list(accepted, lengths=(dots,))]
    for number in numbers:
        if number not in positions:
            entry.refuse(f'{accepted}; {number} is none')
    if len(set(numbers)) < dots:
        entry.refuse(accepted)
    for first, second in combinations(numbers, 2):
        if _overlap(positions[first], positions[second]):
            entry.refuse(f'a code whose dots do not overlap, as {first} and {second} do')
    return numbers
