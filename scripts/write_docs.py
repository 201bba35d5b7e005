"""Write the tables of the documentation: parameters from the code, results from docs/figures/.

docs/figures.md has the commands that make these files.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.nodes.drivers import DRIVERS
from ahf_ros.nodes.interfaces import NODES
from ahf_ros.nodes.settings import DetectorNodeSettings, PoseNodeSettings
from benchmarks.disturbances import TABLES, Count, markdown
from benchmarks.photographs import share
from support.pictures.lights import EVERY_LIGHT

ROOT = Path(__file__).resolve().parent.parent
AMBIENT = ('0.3', '0.12', '0.04')
RADII = {
    'radius 6, 0.3': '6 px, 0.3',
    'radius 6, 0.12': '6 px, 0.12',
    'radius 10, 0.12': '10 px, 0.12',
    'radius 20, 0.04': '20 px, 0.04',
    'radius 20, 0.02': '20 px, 0.02',
}
ANGLES = {'55 deg, 0.12': '55°, 0.12', '62 deg, 0.12': '62°, 0.12'}
BLURS = {'blur 2 px, 0.12': '2 px, 0.12'}
AHF_LIGHTS = ('normal 0.3', 'stripe 0.3', 'stripe 0.12', 'lattice 0.3', 'lattice 0.12')


def parameters(settings: type = DetectorNodeSettings) -> str:
    """Return the parameters of a node."""
    rows: list[tuple[str, ...]] = [('parameter', 'default', 'accepted', 'meaning')]
    rows += [parameter(item) for item in flat_parameters(settings)]
    return table(rows)


def parameter(item: Parameter) -> tuple[str, ...]:
    """Return the cells of one parameter."""
    default = json.dumps(round(item.default, 6) if type(item.default) is float else item.default)
    return f'`{item.name}`', default, item.accepted, item.description


def interfaces() -> str:
    """Return the topics and services of the nodes."""
    rows: list[tuple[str, ...]] = [('node', '', 'name', 'type')]
    for node, about in NODES.items():
        for number, it in enumerate(about.interfaces):
            text = f'`{it.kind}`, {it.text}'
            rows.append((f'`{node}`' if number == 0 else '', it.use, f'`{it.name}`', text))
    return table(rows)


def drivers() -> str:
    """Return what the drivers of scanners publish."""
    head = 'driver', 'image', 'calibration', 'cloud', 'bytes per point, missing points', 'stamps'
    rows: list[tuple[str, ...]] = [(*head, 'QoS')]
    for name, driver in DRIVERS.items():
        cells = (
            f'`{name}`: {driver.package}',
            f'`{driver.image}`, {driver.encoding}',
            f'`{driver.camera_info}`' if driver.calibrated else 'none',
            f'`{driver.points}`{", before the image" if driver.cloud_first else ""}',
            f'{driver.point_step}, {driver.missing}',
            driver.stamps,
            'reliable' if driver.reliable else 'best effort',
        )
        rows.append(cells)
    return table(rows)


def strangers() -> str:
    """Return how many targets are read in photographs by strangers."""
    rows = results('photographs')['rows']
    repositories = len({of['repository'] for of in rows})
    return (
        f'[figures/photographs.md](figures/photographs.md) has all {len(rows)} photographs of '
        f'{repositories} repositories: {share(rows, "named")}\n'
        f'targets are read with their family named, and {share(rows, "auto")} without; '
        'it names what is missed.\n'
    )


def driver_settings() -> str:
    """Return what is to be set for each driver, in the node and in the driver."""
    rows: list[tuple[str, ...]] = [
        ('driver', 'set in the detector', 'in `pose`', 'in the driver', 'what else to do')
    ]
    for name, driver in DRIVERS.items():
        settings = {'cloud': 'true', **driver.settings}
        if not driver.reliable:
            settings['reliability'] = 'best_effort'
        cells = map(_assigned, (settings, driver.pose, driver.parameters))
        rows.append((f'`{name}`', *cells, driver.setup))
    return table(rows)


def _assigned(values: Mapping[str, object]) -> str:
    """Return values by their names, as a command line has them."""
    texts = {name: str(value).lower() for name, value in values.items()}
    return ', '.join(f'`{name}:={text}`' for name, text in texts.items())


def lights() -> str:
    """Return what `ring` identifies under every light."""
    figures = read('ring')
    rows: list[tuple[str, ...]] = [('light', *AMBIENT)]
    for light in EVERY_LIGHT:
        cells = [cell(figures.get(('light', f'{light} {ambient}'))) for ambient in AMBIENT]
        rows.append((light, *cells))
    return table(rows)


def summary() -> str:
    """Return what `traditional` identifies without and with AHF, and `ring`."""
    figures = [read(name) for name in ('traditional', 'traditional_ahf', 'ring')]
    rows: list[tuple[str, ...]] = [('light', '`traditional`', '`traditional` with AHF', '`ring`')]
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
    rows: list[tuple[str, ...]] = [('', '', 'right', 'of', 'wrong', 'false', 'RMSE XY px')]
    for (group, name), of in read('ring').items():
        if group in names:
            error = '' if of['rmse_xy'] is None else f'{of["rmse_xy"]:.3f}'
            counts = (of['right'], of['expected'], of['wrong'], of['false_positives'])
            rows.append((names[group], name, *map(str, counts), error))
    return table(rows)


def limits(head: str, rows: dict[str, str]) -> str:
    """Return what `ring` identifies under patterns, in some rows of `benchmarks.limits`.

    Rows are given by the names of `benchmarks.limits`, and what the table calls them.
    """
    figures = read('limits')
    lights = tuple(dict.fromkeys(light for _, light in figures))
    body = [
        (text, *(right_and_wrong(figures[row, light]) for light in lights))
        for row, text in rows.items()
    ]
    return table([(head, *(f'`{light}`' for light in lights)), *body])


def disturbed(name: str, file: str = 'disturbances') -> str:
    """Return one of the tables of `benchmarks.disturbances`."""
    counts = {
        row: {column: Count(**of) for column, of in cells.items()}
        for row, cells in results(file)[name].items()
    }
    return markdown(name, counts) + '\n'


def read(name: str) -> dict[tuple[str, str], dict[str, Any]]:
    """Return the rows of a benchmark by group and name."""
    return {(row['group'], row['name']): row for row in results(name)['rows']}


def results(name: str) -> dict[str, Any]:
    """Return what a benchmark recorded."""
    recorded: dict[str, Any] = json.loads((ROOT / 'docs/figures' / f'{name}.json').read_text())
    return recorded


def cell(of: dict[str, Any] | None) -> str:
    """Return right IDs, wrong ones if there are any, and the RMSE."""
    if of is None:
        return ''
    error = '' if of['rmse_xy'] is None else f' ({of["rmse_xy"]:.3f})'
    return f'{right_and_wrong(of)}{error}'


def right_and_wrong(of: dict[str, Any]) -> str:
    """Return the number of right IDs, and of wrong ones and false positives if there are any."""
    wrong = f', {of["wrong"]} wrong' if of['wrong'] else ''
    false = f', {of["false_positives"]} false' if of['false_positives'] else ''
    return f'{of["right"]}{wrong}{false}'


def table(rows: list[tuple[str, ...]]) -> str:
    """Return rows as Markdown; the first one is the head."""
    head, *body = (f'| {" | ".join(row)} |\n' for row in rows)
    return head + '|---' * len(rows[0]) + '|\n' + ''.join(body)


PAGES: dict[str, dict[str, Callable[[], str]]] = {
    'README.md': {'summary': summary},
    'docs/photograph.md': {
        'radii': partial(limits, 'radius of the dot, ambient light', RADII),
        'angles': partial(limits, 'angle, ambient light', ANGLES),
        'blurs': partial(limits, 'blur, ambient light', BLURS),
        'strangers': strangers,
    },
    'docs/parameters.md': {'parameters': parameters},
    'docs/pose.md': {'parameters of pose': partial(parameters, PoseNodeSettings)},
    'docs/ros.md': {'interfaces': interfaces},
    'docs/rig.md': {'drivers': drivers, 'settings of drivers': driver_settings},
    'docs/figures.md': {'summary': summary, 'lights': lights, 'others': others},
    'docs/figures/disturbances.md': {
        **{name: partial(disturbed, name) for name in TABLES},
        'bright': partial(disturbed, 'disturbances', 'disturbances_bright'),
        'look-alikes': partial(disturbed, 'look-alikes', 'disturbances_lookalikes'),
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
