"""The experiment of the paper on rendered images: C, R, D, RMSE and filters, a table a light.

Shang & Liu, Remote Sens. 2023, 15, 3151, identify 54 targets in 50 images a light, without AHF and
with it (Tables 3 to 6). Here every method sees the same images, rendered with known truth; rival
preprocessors stand beside AHF. The paper's own figures are those of its photographs.

    python -m benchmarks.paper [--images 2] [--json paper.json] [--plots plots]

50 images a light and ratio take hours; each is a process of its own. With --read, tables and plots
come from an earlier --json.
"""

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.target import Identification
from ahf_ros.families import Drafter, Refiner, create_detector
from ahf_ros.identification.filtering.identifier import Identifier
from ahf_ros.identification.filtering.settings import (
    EXTENDED,
    PUBLISHED,
    AdaptiveSettings,
    GeneticSettings,
    TuningSettings,
)
from ahf_ros.scenes.evaluation import Score, score, total
from ahf_ros.scenes.patterns import LIGHT_NAMES
from ahf_ros.scenes.scene import Rendering, SceneSettings, render
from benchmarks import report
from benchmarks.report import number, table
from support.preprocessors import PREPROCESSORS

FAMILIES = {'ring': 'metashape12', 'traditional': 'metashape12', 'aruco': 'aruco_4x4_100'}
"""Ring targets as in the paper, and a dictionary with as many markers as there are targets."""

QUICK: dict[str, Any] = {'width': 1200, 'height': 900, 'targets': 6}

PAPER: dict[str, dict[str, str]] = {
    'AM': {
        'normal': '100 / 100 / 100 (truth)',
        'stripe': '0 / 0 / 0',
        'lattice': '100 / 22 / 22 (0.238)',
    },
    'AHF-AM': {'stripe': '100 / 100 / 100 (0.116)', 'lattice': '100 / 78 / 78 (0.137)'},
    'TI': {'normal': '53 / 62 / 62 (0.378)', 'stripe': '0 / 0 / 0', 'lattice': '0 / 0 / 0'},
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

PAPER_LIGHTS = ('normal', 'stripe', 'lattice')


@dataclass(frozen=True, slots=True)
class Method:
    """A way to identify targets.

    Attributes
    ----------
    name : str
    detector : str
        Name in the registry.
    ahf : bool
        Whether AHF drives the detector.
    preprocessor : str
        Name in `PREPROCESSORS`; '' for none.
    search : str
        What AHF tunes, see `ahf_ros.identification.filtering.genes`.
    """

    name: str
    detector: str
    ahf: bool = False
    preprocessor: str = ''
    search: str = EXTENDED

    def identify(self, image: np.ndarray, expected: int, most: int) -> Identification:
        """Return what an image shows.

        Centres are taken from the image as it is, whatever the detector saw.
        """
        detector = create_detector(self.detector, family=FAMILIES[self.detector])
        assert isinstance(detector, Refiner)
        if self.preprocessor:
            found = detector(PREPROCESSORS[self.preprocessor](image))
            return Identification(tuple(detector.refine(image, found)))
        settings = AdaptiveSettings(
            ahf=self.ahf,
            threads=1,
            tuning=TuningSettings(search=self.search),
            genetic=GeneticSettings(max_evaluations=most),
        )
        draft = detector.draft if isinstance(detector, Drafter) else detector
        identifier = Identifier(detector, settings, refine=detector.refine, draft=draft)
        return identifier.identify(image, expected_targets=expected)


METHODS = (
    Method('traditional', 'traditional'),
    Method('AHF-traditional', 'traditional', ahf=True, search=PUBLISHED),
    Method('AHF-traditional, extended', 'traditional', ahf=True),
    *(Method(f'{name} + traditional', 'traditional', preprocessor=name) for name in PREPROCESSORS),
    Method('ring', 'ring'),
    Method('AHF-ring', 'ring', ahf=True),
    Method('aruco', 'aruco'),
    Method('AHF-aruco', 'aruco', ahf=True),
)
"""All that is compared. TI of the paper is `traditional`, and its search `PUBLISHED`."""


def run_scene(scene: SceneSettings, most: int) -> list[dict[str, Any]]:
    """Identify one scene in every way.

    Returns
    -------
    list of dict
        One a method.
    """
    cv2.setNumThreads(1)  # every process has a core
    renderings: dict[str, Rendering] = {}
    records = []
    for method in METHODS:
        family = FAMILIES[method.detector]
        if family not in renderings:
            renderings[family] = render(replace(scene, family=family))
        rendering = renderings[family]
        truth = rendering.targets
        method.identify(rendering.image[:400, :400], 0, most)  # tables that are made once
        started = time.process_time()
        found = method.identify(rendering.image, len(truth), most)
        seconds = time.process_time() - started
        used = found.filter
        records.append(
            {
                'method': method.name,
                'light': scene.light,
                'ambient': scene.ambient,
                'seed': scene.seed,
                'score': asdict(score(truth, found.targets)),
                'filter': [used.gamma_high, used.gamma_low] if used.applied else None,
                'evaluations': used.evaluations,
                'seconds': seconds,
            }
        )
    return records


def scenes(options: argparse.Namespace) -> list[SceneSettings]:
    """Return the scenes; normal light, which has no ratio that matters, at the first one only."""
    base = SceneSettings(**QUICK) if options.quick else SceneSettings()
    kinds = [
        (light, ambient)
        for ambient in options.ambients
        for light in options.lights
        if light != 'normal' or ambient == options.ambients[0]
    ]
    seeds = range(options.seed, options.seed + options.images)
    return [
        replace(base, light=light, ambient=ambient, seed=seed)
        for seed in seeds
        for light, ambient in kinds
    ]


def run(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Return the records of all scenes and methods, in the order of the scenes."""
    todo = scenes(options)
    context = multiprocessing.get_context('spawn')
    with ProcessPoolExecutor(options.jobs, mp_context=context) as executor:
        done = executor.map(partial(run_scene, most=options.evaluations), todo)
        shown = report.progress(done, 'scenes', len(todo))
        return [record for records in shown for record in records]


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


def markdown(figures: report.Report) -> str:
    """Return the report as tables."""
    records = figures['records']
    names = _values(records, 'method')
    searching = [name for name in names if name.startswith('AHF-')]
    lines = [
        f'{figures["images"]} images a light, {figures["width"]} x {figures["height"]} px, seeds '
        f'from {figures["seed"]}, at most {figures["evaluations"]} filters. '
        + report.machine_text(figures['machine'])
    ]
    ambients = _values(records, 'ambient')
    for ambient in ambients:
        here = [record for record in records if record['ambient'] == ambient]
        first = ambient == ambients[0]
        for title, methods, show, told in (
            (
                f'Ambient light {ambient:g} of the projected: C / R / D in % (RMSE XY in px)',
                *(names, cell, PAPER),
            ),
            (
                'Filters (gH, gL), images that needed one, filters tried',
                *(searching, filters_found, PAPER_FILTERS),
            ),
            ('Processor seconds an image, in one thread', names, seconds, {}),
        ):
            lines += ['', title, '', *grid(here, methods, show, told if first else {})]
    return '\n'.join(lines)


def grid(
    records: Sequence[dict[str, Any]],
    names: Iterable[str],
    show: Callable[[list[dict[str, Any]]], str],
    theirs: dict[str, dict[str, str]],
) -> list[str]:
    """Return the lines of a table with a row a method and a column a light."""
    lights = _values(records, 'light')
    rows = [
        (f'{name} in the paper', *(told.get(light, '') for light in lights))
        for name, told in theirs.items()
    ]
    for name in names:
        own = [it for it in records if it['method'] == name]
        rows.append((name, *(show([it for it in own if it['light'] == at]) for at in lights)))
    return table(('', *lights), rows)


def seconds(records: Sequence[dict[str, Any]]) -> str:
    """Return the median processor time of one image, s."""
    return number(median(record['seconds'] for record in records), 2)


def draw(records: Sequence[dict[str, Any]], file: Path) -> None:
    """Draw recall (decoded right, of N) against the ambient ratio, a panel a light."""
    from matplotlib.figure import Figure  # needed for nothing else

    lights = [light for light in _values(records, 'light') if light != 'normal'] or ['normal']
    figure = Figure(figsize=(4.2 * len(lights), 3.4), layout='constrained')
    panels = figure.subplots(1, len(lights), squeeze=False)[0]
    for panel, light in zip(panels, lights, strict=True):
        for place, method in enumerate(_values(records, 'method')):
            chosen = [it for it in records if (it['method'], it['light']) == (method, light)]
            ratios = sorted({it['ambient'] for it in chosen})
            scores = [
                total([as_score(it) for it in chosen if it['ambient'] == ratio])
                for ratio in ratios
            ]
            shares = [100 * of.right / max(of.expected, 1) for of in scores]
            style: dict[str, Any] = {'linestyle': '--'}
            if method.startswith('AHF-'):
                style = {'linestyle': '-', 'linewidth': 3, 'alpha': 0.6}
            panel.plot(ratios, shares, color=f'C{place}', marker='o', label=method, **style)
        panel.set(title=light, xscale='log', ylim=(-2, 102), xlabel='ambient light / projected')
        panel.set_xticks(ratios, [f'{ratio:g}' for ratio in ratios])
        panel.minorticks_off()
        panel.grid(alpha=0.3)
    panels[0].set_ylabel('decoded right, % of N')
    panels[-1].legend(fontsize=7, loc='center left', bbox_to_anchor=(1, 0.5))
    figure.savefig(file, dpi=150, bbox_inches='tight', pad_inches=0.2)


def _values(records: Sequence[dict[str, Any]], name: str) -> list[Any]:
    """Return the different values of one entry, in the order of the records."""
    return list(dict.fromkeys(record[name] for record in records))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print and draw."""
    made = report.parser(__doc__, seeds=False)
    made.add_argument('--images', type=int, default=50, help='images a light and ratio')
    made.add_argument('--seed', type=int, default=101, help='seed of the first image')
    made.add_argument('--lights', nargs='+', choices=LIGHT_NAMES, default=PAPER_LIGHTS)
    made.add_argument('--ambients', nargs='+', type=float, default=[0.3, 0.12, 0.04])
    made.add_argument('--evaluations', type=int, default=100, help='most filters tried an image')
    made.add_argument('--jobs', type=int, default=os.cpu_count(), help='processes')
    made.add_argument('--quick', action='store_true', help='small images with six targets')
    made.add_argument('--plots', type=Path, metavar='DIR', help='also draw, needs matplotlib')
    made.add_argument('--read', type=Path, metavar='FILE', help='what --json wrote; runs nothing')
    options = made.parse_args(arguments)
    if options.read:
        figures = json.loads(options.read.read_text())
    else:
        size = SceneSettings(**QUICK) if options.quick else SceneSettings()
        figures = {
            'images': options.images,
            'width': size.width,
            'height': size.height,
            'seed': options.seed,
            'evaluations': options.evaluations,
            'machine': report.machine(),
            'records': run(options),
        }
    report.publish(figures, markdown(figures), options)
    if options.plots:
        options.plots.mkdir(parents=True, exist_ok=True)
        draw(figures['records'], options.plots / 'recall.png')
    return 0


if __name__ == '__main__':
    sys.exit(main())
