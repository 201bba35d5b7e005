"""Bent sheets, photographed by the second maker: targets, their centres and what they cost.

Every picture has targets on six sheets that are bent to radii of 100 to 500 mm. Motion blur,
defocus, gloss, roughness, grain, distortion and vignetting are drawn for each seed, so that all
pictures of a seed have them in common. Each row is a light, with its ambient light, at one radius
of dots, for dark targets or for bright ones, which are on black discs as they are printed. It has
the targets with the right ID, wrong IDs and false positives; the NEES of the centres, 2 on average
where covariances are right; the share of centres that are more than 4 standard deviations off,
0.03 % where errors are normal; the largest error; and the function calls of an image.
Seeds from 101 on are for tests.

    python -m benchmarks.bent [--detector ring] [--family metashape12] [--sizes 10 6]
        [--polarities dark bright] [--lights 'stripe 0.12' ...] [--seeds 401 402] [--output FILE]
"""

import argparse
import sys
from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from ahf_ros.families import DETECTOR_NAMES
from ahf_ros.prints.families import FAMILY_NAMES
from ahf_ros.scenes.bent.picture import render_bent
from ahf_ros.scenes.evaluation import total
from benchmarks import report
from benchmarks.report import number
from benchmarks.rows import Case, Scene, Seen, detector, measured
from support.calls import calls_of
from support.pictures.bent import LIGHTS, settings

TARGETS = 54
"""In a picture."""

FAR = 4.0
"""Standard deviations beyond which a centre is counted."""

POLARITIES = ('dark', 'bright')
"""Of targets."""


def case(family: str, polarity: str, light: str, radius: float, targets: int = TARGETS) -> Case:
    """Return a row of the table."""

    def make(seed: int) -> Scene:
        rendering = render_bent(settings(family, polarity, light, radius, seed, targets))
        return rendering.image, rendering.targets

    return Case(f'{radius:g} px, {polarity}', light, make, family)


def records(
    cases: Sequence[Case], seeds: Sequence[int], detector_name: str
) -> list[dict[str, Any]]:
    """Return the figures of rows."""
    run = detector(detector_name)
    calls: list[int] = []

    def counted(image: np.ndarray, family: str, expected: int) -> Seen:
        seen: list[Seen] = []
        calls.append(calls_of(lambda: seen.append(run(image, family, expected))))
        return seen[0]

    made = []
    for by in measured(cases, seeds, {'': counted}):
        row = by['']
        squares = np.array(row.squares)
        errors = [np.hypot(*error) for error in total(row.scores).errors]
        record = row.record() | {
            'far': int((squares > FAR**2).sum()),
            'measured': len(squares),
            'largest_error': float(max(errors, default=0)),
            'calls': round(sum(calls) / len(calls)),
        }
        del record['seconds'], record['times_contours']  # those of counted calls
        calls.clear()
        made.append(record)
    return made


def markdown(figures: report.Report) -> str:
    """Return the report as a table."""

    def beyond(of: report.Report) -> str:
        return number(100 * of['far'] / of['measured'] if of['measured'] else None, 1)

    columns: dict[str, report.Column] = {
        **{'targets': 'group', 'light': 'name', 'N': 'expected'},
        **{'right': 'right', 'wrong': 'wrong', 'false': 'false_positives'},
        **{'RMSE XY px': ('rmse_xy', 3), 'largest px': ('largest_error', 2), 'NEES': ('nees', 1)},
        f'beyond {FAR:g} sigma %': beyond,
        'calls': lambda of: f'{of["calls"]:,}',
    }
    about = f'{figures["method"]}, family {figures["family"]}. {report.about_text(figures)}'
    table = report.record_table(figures['rows'], columns)
    return '\n'.join([about, '', *table, '', report.summary(figures['rows'])])


def parser() -> argparse.ArgumentParser:
    """Return what can be chosen."""
    made = report.parser(__doc__)
    made.add_argument('--detector', choices=DETECTOR_NAMES, default='ring')
    made.add_argument('--family', choices=FAMILY_NAMES, default='metashape12')
    made.add_argument('--sizes', nargs='+', type=float, default=[10.0, 6.0], help='px')
    made.add_argument('--polarities', nargs='+', choices=POLARITIES, default=POLARITIES)
    made.add_argument('--lights', nargs='+', choices=LIGHTS, default=LIGHTS)
    made.add_argument('--targets', type=int, default=TARGETS)
    return made


def measure(options: argparse.Namespace) -> report.Report:
    """Return the figures of all rows that are asked for."""
    kinds = product(options.polarities, options.sizes, options.lights)
    cases = [
        case(options.family, polarity, light, radius, options.targets)
        for polarity, radius, light in kinds
    ]
    rows = records(cases, options.seeds, options.detector)
    return {'method': options.detector, 'family': options.family, 'rows': rows}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    return report.run(parser(), measure, markdown, arguments)


if __name__ == '__main__':
    sys.exit(main())
