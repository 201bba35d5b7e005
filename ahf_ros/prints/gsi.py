"""Point-distributed targets, such as GSI's, and the data files that describe them.

A target is a template of dots, the same on every target, and a few decoding dots on numbered
positions. The value of a code is the sum of 2^position of its decoding dots. Lengths are in the
unit of the printed design, with x to the right and y upwards as printed.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb, dist
from pathlib import Path

import numpy as np

from ahf_ros.base.opening import reader
from ahf_ros.prints.data_file import Entry, read_data_file
from ahf_ros.prints.kept import kept_while_unchanged
from ahf_ros.prints.prints import Disc, Print, Proportions, Shape

GSI_LIBRARY = Path(__file__).with_name('gsi.json')
"""Template, positions and known numbers of GSI's targets."""

_POSITION_NUMBERS = (0, 31)  # a code of the messages has 32 bits
_MAXIMUM_CODES = 200_000  # that a rule may be tried on
_MAXIMUM_NUMBER = 2**31 - 1
_MARGIN = 1.0  # of the quiet zone about the outermost dot, in radii of the dot

Dot = tuple[float, float, float]
"""x, y and radius of a dot."""


@dataclass(frozen=True, slots=True)
class Rule:
    """Which combinations of `dots` positions are codes.

    No two of their dots have centres nearer than `minimum_distance`, and at least one position is
    of each of `groups`. The codes that are not listed have IDs from `first_own_number` on, which
    is above the IDs of all listed codes, so that none can be taken for its vendor's; where it is
    None, only listed codes are codes.
    """

    dots: int
    minimum_distance: float = 0.0
    groups: tuple[frozenset[int], ...] = ()
    first_own_number: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PointPrint(Print):
    """The printed design and the codes of one family of point-distributed targets.

    Attributes
    ----------
    unit, source : str
        Unit of the lengths, and where the design comes from; may be empty.
    dot_radius : float
        Radius of a dot that has none of its own.
    template, positions : ndarray of float64, shape (n, 2) and (m, 2)
        Places of the template dots and of the positions.
    template_radii, position_radii : ndarray of float64, shape (n,) and (m,)
        Radii of their dots.
    reference : int
        Index of the template dot that is the target's centre.
    position_numbers : ndarray of int64, shape (m,)
        Numbers of the positions, ascending.
    words, numbers : ndarray of int64, shape (k,)
        The values of the codes, ascending and read-only, and the ID of each.
    """

    name: str
    unit: str
    source: str
    dot_radius: float
    template_names: tuple[str, ...]
    template: np.ndarray
    template_radii: np.ndarray
    reference: int
    position_numbers: np.ndarray
    positions: np.ndarray
    position_radii: np.ndarray
    rule: Rule
    words: np.ndarray
    numbers: np.ndarray

    def number(self, word: int) -> int | None:
        """Return the ID of a value; None where the family does not have it."""
        found = self.numbers[self.words == word]
        return int(found[0]) if found.size else None

    def word(self, number: int) -> int:
        """Return the value of the code with an ID; raise a ValueError if there is none."""
        found = self.words[self.numbers == number]
        if not found.size:
            raise ValueError(
                f'number is {number!r}, accepted is one of the {self.numbers.size} IDs of '
                f'{self.name}, from {self.numbers.min()} to {self.numbers.max()}'
            )
        return int(found[0])

    @property
    def reading(self) -> dict[str, int | str]:
        """How words are read."""
        bits = int(self.position_numbers.max()) + 1
        return {'bits': bits, 'first_bit': 'lowest', 'direction': 'by position'}

    @property
    def proportions(self) -> Proportions:
        """What all targets have in common."""
        reach = self.reach / self.dot_radius
        return Proportions(
            reach=reach,
            radius=float(self.template_radii[self.reference] / self.dot_radius),
            quiet_zone=reach + _MARGIN,
            radii={'dot': 1.0},
        )

    def ink(self, word: int, pinhole: float = 0.0) -> tuple[Shape, ...]:
        """Return the dots of a value."""
        places, radii = self.dots(word)
        dots = np.column_stack([radii, np.zeros_like(radii), places]) / self.dot_radius
        return tuple(Disc(*dot) for dot in dots.tolist())

    def decoding_dots(self, word: int) -> np.ndarray:
        """Return the indices of the positions that have a dot, ndarray of int."""
        return np.flatnonzero(np.int64(word) >> self.position_numbers & 1)

    def dots(self, word: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the places of all dots of a value, relative to the centre, and their radii."""
        count = len(self.template)
        shown = np.r_[:count, count + self.decoding_dots(word)]
        return self.places[shown], self.radii[shown]

    @property
    def listed(self) -> dict[int, int]:
        """The values of the codes that the library lists, by ID."""
        first = self.rule.first_own_number
        pairs = zip(self.numbers.tolist(), self.words.tolist(), strict=True)
        return {number: word for number, word in pairs if first is None or number < first}

    @property
    def places(self) -> np.ndarray:
        """Places of the template dots, then of the positions, relative to the centre."""
        every = np.concatenate([self.template, self.positions])
        return every - self.template[self.reference]

    @property
    def radii(self) -> np.ndarray:
        """Radii of the dots at `places`."""
        return np.concatenate([self.template_radii, self.position_radii])

    @property
    def reach(self) -> float:
        """Radius of the circle about the centre that holds every dot there may be."""
        return float((np.hypot(*self.places.T) + self.radii).max())


def value_of(positions: Iterable[int]) -> int:
    """Return the sum of 2^position.

    Examples
    --------
    >>> value_of((4, 6, 14))
    16464
    """
    return sum(1 << position for position in positions)


def positions_of(value: int) -> list[int]:
    """Return the positions whose 2^position a value is the sum of, ascending."""
    return [bit for bit in range(value.bit_length()) if value >> bit & 1]


def valid_words(places: Mapping[int, Sequence[float]], rule: Rule) -> np.ndarray:
    """Return the values that a rule allows, ndarray of int64, ascending.

    `places` are those of the positions by their numbers, each beginning with x and y.
    """
    least = rule.minimum_distance - 1e-9
    near = {
        pair
        for pair in combinations(places, 2)
        if dist(places[pair[0]][:2], places[pair[1]][:2]) < least
    }
    words = [
        value_of(numbers)
        for numbers in combinations(places, rule.dots)
        if not any(group.isdisjoint(numbers) for group in rule.groups)
        and near.isdisjoint(combinations(numbers, 2))
    ]
    return np.array(sorted(words), np.int64)


@kept_while_unchanged
@reader('a data file of point-distributed targets')
def point_family(path: str = '') -> PointPrint:
    """Return the family of point-distributed targets in a data file; GSI's own where empty.

    The file is JSON or YAML, see docs/gsi.md. A ValueError names line and field of what is not
    accepted.

    Examples
    --------
    >>> family = point_family()
    >>> family.word(18), family.number(1 << 7 | 1 << 17 | 1 << 28)
    (16464, 505)
    """
    fields = read_data_file(path or GSI_LIBRARY).keys(
        ('family', 'dot_radius', 'reference', 'template', 'positions', 'rule'),
        ('unit', 'source', 'codes'),
    )
    radius = fields['dot_radius'].number('a length above 0', 1e-9)
    template = _template(fields['template'], radius)
    reference = fields['reference'].text()
    if reference not in template:
        fields['reference'].refuse(f'one of {", ".join(template)}')
    positions = _positions(fields['positions'], template, radius)
    rule = _rule(fields['rule'], positions)
    codes = _codes(fields, rule, positions)
    points, dots = np.array(list(template.values())), np.array(list(positions.values()))
    numbers = np.array(list(positions))
    words, ids = (np.array(list(of), np.int64) for of in (codes, codes.values()))
    for array in (points, dots, numbers, words, ids):
        array.setflags(write=False)
    return PointPrint(
        name=fields['family'].text(),
        unit=fields['unit'].text() if 'unit' in fields else '',
        source=fields['source'].text() if 'source' in fields else '',
        dot_radius=radius,
        template_names=tuple(template),
        template=points[:, :2],
        template_radii=points[:, 2],
        reference=list(template).index(reference),
        position_numbers=numbers,
        positions=dots[:, :2],
        position_radii=dots[:, 2],
        rule=rule,
        words=words,
        numbers=ids,
    )


def _dot(entry: Entry, radius: float) -> Dot:
    """Return a dot, of a radius where it has none of its own."""
    accepted = '[x, y] or [x, y, radius], of finite numbers'
    values = entry.list(accepted, (2, 3))
    x, y = (value.number(accepted) for value in values[:2])
    if len(values) == 3:
        radius = values[2].number('a length above 0', 1e-9)
    return x, y, radius


def _overlap(first: Dot, second: Dot) -> bool:
    distance = np.hypot(first[0] - second[0], first[1] - second[1])
    return bool(distance < first[2] + second[2])


def _template(table: Entry, radius: float) -> dict[str, Dot]:
    """Return the dots of the template by their names, which a homography can be told from."""
    template = {name: _dot(entry, radius) for name, entry in table.items()}
    if not 3 <= len(template) <= 12:
        table.refuse('a mapping of 3 to 12 names to [x, y] or [x, y, radius]')
    for first, second in combinations(template.values(), 2):
        if _overlap(first, second):
            places = f'{list(first[:2])} and {list(second[:2])}'
            table.refuse(f'dots that do not overlap, as those at {places} do')
    points = np.array(list(template.values()))[:, :2]
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if spread[1] < 0.05 * spread[0]:
        table.refuse('dots that do not lie on one line')
    return template


def _positions(table: Entry, template: dict[str, Dot], radius: float) -> dict[int, Dot]:
    """Return the dots of the positions by their numbers, ascending."""
    positions: dict[int, Dot] = {}
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
    return dict(sorted(positions.items()))


def _rule(entry: Entry, positions: dict[int, Dot]) -> Rule:
    """Return the rule of a file."""
    fields = entry.keys(('dots',), ('minimum_distance', 'groups', 'first_own_number'))
    dots = fields['dots'].integer(1, len(positions))
    least, groups, first = 0.0, [], None
    if 'minimum_distance' in fields:
        least = fields['minimum_distance'].number('a length of at least 0', 0.0)
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
    return Rule(dots=dots, minimum_distance=least, groups=tuple(groups), first_own_number=first)


def _codes(fields: dict[str, Entry], rule: Rule, positions: dict[int, Dot]) -> dict[int, int]:
    """Return the IDs of all codes by their values, ascending."""
    codes: dict[int, int] = {}
    for key, entry in fields['codes'].items() if 'codes' in fields else ():
        if not key.isdecimal() or not 0 <= int(key) <= _MAXIMUM_NUMBER:
            entry.refuse('a list of positions with an ID of at least 0 as its name')
        value = value_of(_code_dots(entry, rule.dots, positions))
        if value in codes:
            entry.refuse(f'a code other than that of number {codes[value]}')
        if int(key) in codes.values():
            entry.refuse(f'one code for number {int(key)}')
        codes[value] = int(key)
    first = rule.first_own_number
    if first is not None:
        if max(codes.values(), default=-1) >= first:
            fields['rule'].refuse('a first_own_number above the numbers of all codes')
        allowed = valid_words(positions, rule).tolist()
        if not allowed:
            fields['rule'].refuse('a rule that allows at least one code')
        # The rank counts all, so that a number learnt moves no other.
        codes = {word: first + rank for rank, word in enumerate(allowed)} | codes
    if not codes:
        fields['rule'].refuse('a rule with first_own_number, where no codes are listed')
    return dict(sorted(codes.items()))


def _code_dots(entry: Entry, dots: int, positions: dict[int, Dot]) -> list[int]:
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
