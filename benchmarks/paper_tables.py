"""Tables of what benchmarks/paper.py measured, with the figures of the paper beside them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from statistics import median
from typing import Any

from ahf_ros.evaluation import Score, total

PAPER: dict[str, dict[str, str]] = {
    'AM': {
        'normal': '100 / 100 / 100 (truth)',
        'stripe': '0 / 0 / 0',
        'lattice': '100 / 22 / 22 (0.238)',
    },
    'AHF-AM': {
        'stripe': '100 / 100 / 100 (0.116)',
        'lattice': '100 / 78 / 78 (0.137)',
    },
    'TI': {
        'normal': '53 / 62 / 62 (0.378)',
        'stripe': '0 / 0 / 0',
        'lattice': '0 / 0 / 0',
    },
    'AHF-TI': {
        'normal': '63 / 68 / 68 (0.263)',
        'stripe': '80 / 83 / 83 (0.247)',
        'lattice': '35 / 26 / 26 (0.337)',
    },
}
"""What the paper reports: C / R / D in percent, and RMSE XY in px."""

PAPER_FILTERS = {
    'AHF-AM': {'stripe': '(2.8, 0.82)', 'lattice': '(2.6, 0.44)'},
    'AHF-TI': {'stripe': '(3.8, 0.70)', 'lattice': '(3.7, 0.66)'},
}
"""The filters (gH, gL) that the paper reports."""


def as_score(record: dict[str, Any]) -> Score:
    """Return the figures of a record, which may come from a file."""
    return Score(**{**record['score'], 'errors': tuple(map(tuple, record['score']['errors']))})


def cell(records: Sequence[dict[str, Any]]) -> str:
    """Return C / R / D in percent, RMSE XY in px and wrong IDs as a table has them."""
    figures = total(map(as_score, records))
    shares = (figures.correctness, figures.recall, figures.decoding)
    text = ' / '.join('-' if share is None else f'{100 * share:.0f}' for share in shares)
    if figures.rmse:
        text += f' ({figures.rmse[2]:.3f})'
    return text + (f', {figures.wrong} wrong' if figures.wrong else '')


def filters_found(records: Sequence[dict[str, Any]]) -> str:
    """Return the median filter, how many images needed one, and evaluations an image."""
    used = [record['filter'] for record in records if record['filter']]
    if not used:
        return 'none'
    high, low = (median(values) for values in zip(*used, strict=True))
    tried = median(record['evaluations'] for record in records)
    return f'({high:.1f}, {low:.2f}), {len(used)} of {len(records)} images, {tried:.0f} tried'


def markdown(report: dict[str, Any]) -> str:
    """Return the report as tables."""
    records, facts = report['records'], report['machine']
    names = list(dict.fromkeys(record['method'] for record in records))
    searching = [name for name in names if name.startswith('AHF-')]
    lines = [
        f'{report["images"]} images a light, {report["width"]} x {report["height"]} px, seeds '
        f'from {report["seed"]}, at most {report["evaluations"]} filters. {facts["processor"]}, '
        f'Python {facts["python"]}, numpy {facts["numpy"]}, OpenCV {facts["opencv"]}.',
    ]
    ambients = list(dict.fromkeys(record['ambient'] for record in records))
    for ambient in ambients:
        here = [record for record in records if record['ambient'] == ambient]
        first = ambient == ambients[0]
        lines += [
            '',
            f'Ambient light {ambient:g} of the projected: C / R / D in % (RMSE XY in px)',
            '',
        ]
        lines += grid(here, names, cell, PAPER if first else {})
        lines += ['', 'Filters (gH, gL), images that needed one, filters tried', '']
        lines += grid(here, searching, filters_found, PAPER_FILTERS if first else {})
        lines += ['', 'Processor seconds an image, in one thread', '']
        lines += grid(here, names, seconds, {})
    return '\n'.join(lines)


def grid(
    records: Sequence[dict[str, Any]],
    names: Iterable[str],
    show: Callable[[list[dict[str, Any]]], str],
    theirs: dict[str, dict[str, str]],
) -> list[str]:
    """Return the lines of a table with a row a method and a column a light."""
    lights = list(dict.fromkeys(record['light'] for record in records))
    rows = [('', *lights), ('---',) * (len(lights) + 1)]
    for name, told in theirs.items():
        rows.append((f'{name} in the paper', *(told.get(light, '') for light in lights)))
    for name in names:
        own = [it for it in records if it['method'] == name]
        rows.append((name, *(show([it for it in own if it['light'] == at]) for at in lights)))
    return [f'| {" | ".join(row)} |' for row in rows]


def seconds(records: Sequence[dict[str, Any]]) -> str:
    """Return the median processor time of one image, s."""
    return f'{median(record["seconds"] for record in records):.2f}'
