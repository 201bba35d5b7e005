"""Write the tables of the documentation: parameters from the code, results from docs/figures/.

docs/figures.md has the commands that make these files.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from ahf_ros.nodes.settings import DetectorNodeSettings
from ahf_ros.settings.nested import flat_parameters
from ahf_ros.settings.parameter import Parameter
from ahf_ros.synthetic.patterns import LIGHT_NAMES
from benchmarks.disturbances import TABLES, Count, markdown

ROOT = Path(__file__).resolve().parent.parent
AMBIENT = ('0.3', '0.12', '0.04')
AHF_LIGHTS = ('normal 0.3', 'stripe 0.3', 'stripe 0.12', 'lattice 0.3', 'lattice 0.12')


def parameters() -> str:
    """Return the parameters of the node `detector`."""
    rows = [('parameter', 'default', 'accepted', 'meaning')]
    rows += [parameter(item) for item in flat_parameters(DetectorNodeSettings)]
    return table(rows)


def parameter(item: Parameter) -> tuple[str, ...]:
    """Return the cells of one parameter."""
    default = json.dumps(round(item.default, 6) if type(item.default) is float else item.default)
    return f'`{item.name}`', default, item.accepted, item.description


def lights() -> str:
    """Return what `ring` identifies under every light."""
    figures = read('ring')
    rows = [('light', *AMBIENT)]
    for light in LIGHT_NAMES:
        cells = [cell(figures.get(('light', f'{light} {ambient}'))) for ambient in AMBIENT]
        rows.append((light, *cells))
    return table(rows)


def summary() -> str:
    """Return what `traditional` identifies without and with AHF, and `ring`."""
    figures = [read(name) for name in ('traditional', 'traditional_ahf', 'ring')]
    rows = [('light', '`traditional`', '`traditional` with AHF', '`ring`')]
    rows += [(light, *(cell(of['light', light]) for of in figures)) for light in AHF_LIGHTS]
    return table(rows)


def others() -> str:
    """Return what `ring` identifies in other views, of other sizes, and in photographs."""
    names = {
        'tilt': 'oblique view',
        'radius': 'radius of the dot',
        'polarity': 'bright targets',
        'no targets': '100 distractors, no target',
        'photographs': 'ten photographs',
    }
    rows = [('', '', 'right', 'of', 'wrong', 'false', 'RMSE XY px')]
    for (group, name), of in read('ring').items():
        if group in names:
            error = '' if of['rmse_xy'] is None else f'{of["rmse_xy"]:.3f}'
            counts = (of['right'], of['expected'], of['wrong'], of['false_positives'])
            rows.append((names[group], name, *map(str, counts), error))
    return table(rows)


def disturbed(name: str, file: str = 'disturbances') -> str:
    """Return one of the tables of `benchmarks.disturbances`."""
    report = json.loads((ROOT / 'docs' / 'figures' / f'{file}.json').read_text())
    counts = {
        row: {column: Count(**of) for column, of in cells.items()}
        for row, cells in report[name].items()
    }
    return markdown(name, counts) + '\n'


def read(name: str) -> dict[tuple[str, str], dict[str, Any]]:
    """Return the rows of a benchmark by group and name."""
    report = json.loads((ROOT / 'docs' / 'figures' / f'{name}.json').read_text())
    return {(row['group'], row['name']): row for row in report['rows']}


def cell(of: dict[str, Any] | None) -> str:
    """Return right IDs, wrong ones if there are any, and the RMSE."""
    if of is None:
        return ''
    wrong = f', {of["wrong"]} wrong' if of['wrong'] else ''
    error = '' if of['rmse_xy'] is None else f' ({of["rmse_xy"]:.3f})'
    return f'{of["right"]}{wrong}{error}'


def table(rows: list[tuple[str, ...]]) -> str:
    """Return rows, the first of which is the head, as Markdown."""
    head, *body = (f'| {" | ".join(row)} |\n' for row in rows)
    return head + '|---' * len(rows[0]) + '|\n' + ''.join(body)


PAGES: dict[str, dict[str, Callable[[], str]]] = {
    'README.md': {'summary': summary},
    'docs/parameters.md': {'parameters': parameters},
    'docs/figures.md': {'lights': lights, 'others': others},
    'docs/figures/disturbances.md': {
        **{name: partial(disturbed, name) for name in TABLES},
        'other families': partial(disturbed, 'disturbances', 'disturbances_families'),
        'square markers': partial(disturbed, 'disturbances', 'disturbances_square'),
        'traditional': partial(disturbed, 'disturbances', 'disturbances_traditional'),
    },
}
"""The tables of each page."""


def with_tables(page: str, text: str) -> str:
    """Return the text of a page with tables that are current."""
    for name, make in PAGES[page].items():
        begin, end = f'<!-- {name} -->\n', f'<!-- end of {name} -->\n'
        before, rest = text.split(begin)
        _, after = rest.split(end)
        text = f'{before}{begin}{make()}{end}{after}'
    return text


if __name__ == '__main__':
    for name in PAGES:
        path = ROOT / name
        path.write_text(with_tables(name, path.read_text()))
