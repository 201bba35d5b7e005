"""The experiment of the paper on rendered images: C, R, D, RMSE and filters, a table a light.

Shang & Liu, Remote Sens. 2023, 15, 3151, identify 54 targets in 50 images a light, without AHF and
with it (Tables 3 to 6). Here every method sees the same images, rendered with known truth; rival
preprocessors stand beside AHF. The paper's own figures are those of its photographs.

    python -m benchmarks.paper [--images 2] [--json paper.json] [--plots plots]

50 images a light and ratio take hours; each is a process of its own. With --read, tables and plots
come from an earlier --json.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

# isort: split
import cv2
import numpy as np
from rich.console import Console
from rich.progress import track

from ahf_ros.detectors import Drafter, Refiner, create_detector
from ahf_ros.evaluation import RIGHT, judge, score
from ahf_ros.filtering.identifier import Identifier
from ahf_ros.filtering.settings import (
    EXTENDED,
    PUBLISHED,
    AdaptiveSettings,
    GeneticSettings,
    TuningSettings,
)
from ahf_ros.filtering.trials import DetectorFunction
from ahf_ros.synthetic.patterns import LIGHT_NAMES
from ahf_ros.synthetic.scene import Rendering, SceneSettings, render
from ahf_ros.target import Identification, Target, TrueTarget, count_codes
from benchmarks.filter import machine
from benchmarks.paper_tables import markdown
from benchmarks.preprocessors import PREPROCESSORS

FAMILIES = {'ring': 'metashape12', 'traditional': 'metashape12', 'aruco': 'aruco_4x4_100'}
"""Ring targets as in the paper, and a dictionary with as many markers as there are targets."""

QUICK = {'width': 1200, 'height': 900, 'targets': 6}

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
        What AHF tunes, see `ahf_ros.filtering.genes`.
    """

    name: str
    detector: str
    ahf: bool = False
    preprocessor: str = ''
    search: str = EXTENDED

    def identify(
        self, image: np.ndarray, expected: int, most: int
    ) -> tuple[Identification, list[int]]:
        """Return what an image shows, and n of every identification that was tried for it.

        Centres are taken from the image as it is, whatever the detector saw.
        """
        detector = create_detector(self.detector, family=FAMILIES[self.detector])
        assert isinstance(detector, Refiner)
        if self.preprocessor:
            found = detector(PREPROCESSORS[self.preprocessor](image))
            return Identification(tuple(detector.refine(image, found))), []
        tried: list[int] = []

        def counted(identify: DetectorFunction, shown: np.ndarray) -> list[Target]:
            targets = identify(shown)
            tried.append(count_codes(targets))
            return targets

        settings = AdaptiveSettings(
            ahf=self.ahf,
            threads=1,
            tuning=TuningSettings(search=self.search),
            genetic=GeneticSettings(max_evaluations=most),
        )
        draft = detector.draft if isinstance(detector, Drafter) else detector
        identifier = Identifier(
            partial(counted, detector),
            settings,
            refine=detector.refine,
            draft=partial(counted, draft),
        )
        return identifier.identify(image, expected_targets=expected), tried


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
        found, tried = method.identify(rendering.image, len(truth), most)
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
                'expected': len(truth),
                'tried': tried,
                'vectors': error_vectors(truth, found.targets),
                'seconds': seconds,
            }
        )
    return records


def error_vectors(
    truth: Sequence[TrueTarget | Target], targets: Sequence[Target]
) -> list[tuple[float, float, float, float]]:
    """Return the places of the targets identified right, and their errors, px."""
    return [
        (verdict.target.x, verdict.target.y, it.x - verdict.target.x, it.y - verdict.target.y)
        for verdict, it in zip(judge(truth, targets), targets, strict=True)
        if verdict.kind == RIGHT and verdict.target
    ]


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
        futures = [executor.submit(run_scene, it, options.evaluations) for it in todo]
        console = Console(stderr=True)
        for future in track(as_completed(futures), 'scenes', len(futures), console=console):
            future.result()
    return [record for future in futures for record in future.result()]


def parser() -> argparse.ArgumentParser:
    """Return what can be chosen."""
    made = argparse.ArgumentParser(
        description=__doc__.split('\n\n')[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    made.add_argument('--images', type=int, default=50, help='images a light and ratio')
    made.add_argument('--seed', type=int, default=101, help='seed of the first image')
    made.add_argument('--lights', nargs='+', choices=LIGHT_NAMES, default=PAPER_LIGHTS)
    made.add_argument('--ambients', nargs='+', type=float, default=[0.3, 0.12, 0.04])
    made.add_argument('--evaluations', type=int, default=100, help='most filters tried an image')
    made.add_argument('--jobs', type=int, default=os.cpu_count(), help='processes')
    made.add_argument('--quick', action='store_true', help='small images with six targets')
    made.add_argument('--json', type=Path, metavar='FILE', help='also write a JSON object')
    made.add_argument('--plots', type=Path, metavar='DIR', help='also draw, needs matplotlib')
    made.add_argument('--read', type=Path, metavar='FILE', help='what --json wrote; runs nothing')
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print and draw."""
    options = parser().parse_args(arguments)
    if options.read:
        report = json.loads(options.read.read_text())
    else:
        size = SceneSettings(**QUICK) if options.quick else SceneSettings()
        report = {
            'images': options.images,
            'width': size.width,
            'height': size.height,
            'seed': options.seed,
            'evaluations': options.evaluations,
            'machine': machine(),
            'records': run(options),
        }
    if options.json:
        options.json.write_text(json.dumps(report))
    print(markdown(report))
    if options.plots:
        from paper_plots import draw_all  # matplotlib is needed for nothing else

        draw_all(report, options.plots)
    return 0


if __name__ == '__main__':
    sys.exit(main())
