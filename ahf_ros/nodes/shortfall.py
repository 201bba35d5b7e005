"""Images in a row that do not show what was expected, and what to set."""

from __future__ import annotations

from collections import deque

from ahf_ros.target import Identification
from ahf_ros.text import counted, listed

IN_A_ROW = 10
"""Images with n other than N after which it is said."""


class Shortfall:
    """Looks at the identifications of a stream; `line` says what is wrong with the last ones.

    Only an N that was given counts, by a number or by IDs: an estimate is nobody's mistake.
    """

    def __init__(self) -> None:
        self.line = ''
        self._in_a_row = 0
        self._last: deque[Identification] = deque(maxlen=IN_A_ROW)

    def see(self, found: Identification) -> None:
        """Take note of the next identification."""
        if not found.expected or found.estimated or found.count == found.expected:
            self._in_a_row, self.line = 0, ''
            self._last.clear()
            return
        self._in_a_row += 1
        self._last.append(found)
        if len(self._last) == IN_A_ROW:
            self.line = f'{self._in_a_row} images in a row {_of(tuple(self._last))}'


def _of(last: tuple[Identification, ...]) -> str:
    """Return what images show in place of what was expected, and a remedy."""
    expected, ids = last[-1].expected, last[-1].expected_ids
    counts = sorted({found.count for found in last})
    if ids:
        others = sorted({number for found in last for number in found.other_ids})
        seen = {target.id for found in last for target in found}
        missing = [str(number) for number in ids if number not in seen]
        if others and counts == [0] and not last[-1].mirrored:
            return (
                f'show IDs {listed([*map(str, others)])} and none of expected_ids: set '
                'expected_ids to those of the targets that are there'
            )
        if missing and counts != [0]:
            return (
                f'lack IDs {listed(missing)} of expected_ids: leave out of expected_ids what is '
                'not in view'
            )
    if counts == [0]:
        return (
            f'show no target, N is {expected}: family, polarity, min_radius and max_radius say '
            'what is looked for'
        )
    name = 'expected_ids' if ids else 'expected_targets'
    fewest = f'{counts[0]} to ' if len(counts) > 1 else ''
    shown = f'{fewest}{counted(counts[-1], "target")}'
    return f'show {shown}, N is {expected}: set {name} to what is in view'
