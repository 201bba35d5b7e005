"""Prints the targets of every family, renders the PDF, and identifies them.

.venv/bin/python -m benchmarks.printed --output docs/figures/printed.md
.venv/bin/python -m benchmarks.printed --families metashape12 gsi --sample 50
"""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from ahf_ros import FAMILY_NAMES
from ahf_ros.prints.families import KINDS
from ahf_ros.scenes.evaluation import total
from benchmarks.report import number, table
from benchmarks.speed import seconds
from support.printed import identified, largest_error, sample, settings_of

HEAD = """# Printed targets

Every ID of every family, printed by `ahf targets` on A5 as PDF, rendered by PDFium at 8 px/mm and
identified. The radius of the dot is 4 to 12 px (`RADII` in `support/printed.py`). Ink reflects
6 % of the light, the blur of the lens is 0.7 px. The error is the largest distance of a centre
from where it was printed. Bright targets of `metashape20` have dots of 12 px: with dots of 8 px,
542 of them were left undecoded, none was wrong. The machine was busy.
"""
"""What the page begins with."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line a family and polarity; return 1 unless every target was identified."""
    made = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    made.add_argument('--families', nargs='+', choices=FAMILY_NAMES, default=FAMILY_NAMES)
    made.add_argument('--sample', type=int, default=0, help='IDs of each family; 0: all.')
    made.add_argument('--output', type=Path, help='File for the table, in Markdown.')
    options = made.parse_args(arguments)
    scores, rows = [], []
    for name in options.families:
        ids = sample(name, options.sample) if options.sample else ''
        square = name in (*KINDS['aruco'], *KINDS['apriltag'])
        for polarity in ('dark',) if square else ('dark', 'bright'):
            elapsed, of = seconds(partial(identified, settings_of(name, polarity, ids)))
            wrong = of.wrong + of.false_positives
            ends = number(largest_error(of), 4), number(elapsed, 1)
            rows.append((name, polarity, of.expected, of.right, wrong, *ends))
            print(*rows[-1], file=sys.stderr)
            scores.append(of)
    every = total(scores)
    wrong = every.wrong + every.false_positives
    head = ('family', 'polarity', 'printed', 'right', 'wrong', 'largest error, mm', 's')
    summary = f'{every.expected} printed, {every.right} right, {wrong} wrong.'
    page = '\n'.join([HEAD, *table(head, rows), '', summary])
    print(page)
    if options.output:
        options.output.write_text(page + '\n', encoding='utf-8')
    return int(every.right < every.expected or wrong > 0)


if __name__ == '__main__':
    sys.exit(main())
