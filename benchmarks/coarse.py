"""Targets and time of AHF by the way it searches: genes of the paper or more, whole or coarse.

python -m benchmarks.coarse [--detector traditional] [--seeds 1 2] [--lights stripe lattice ...]
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from itertools import product

from ahf_ros.detectors import DETECTOR_NAMES, create_detector
from ahf_ros.evaluation import score
from ahf_ros.filtering.settings import EXTENDED, PUBLISHED
from ahf_ros.session import identify
from ahf_ros.synthetic.patterns import LIGHT_NAMES
from ahf_ros.synthetic.scene import SceneSettings, render

AMBIENTS = (0.3, 0.12)


def main() -> None:
    """Print the comparison as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--detector', choices=DETECTOR_NAMES, default='traditional')
    parser.add_argument('--seeds', type=int, nargs='+', default=[1, 2])
    parser.add_argument('--lights', nargs='+', default=LIGHT_NAMES, choices=LIGHT_NAMES)
    options = parser.parse_args()
    detector = create_detector(options.detector)
    ways = list(product((PUBLISHED, EXTENDED), (False, True)))
    names = [f'{genes}{", coarse" if coarse else ""}' for genes, coarse in ways]
    print(f'| light | without | {" | ".join(f"{name} | s" for name in names)} |')
    print('|---|---|' + '---|---|' * len(ways))
    for light, ambient in product(options.lights, AMBIENTS):
        right: defaultdict[str, int] = defaultdict(int)
        wrong: defaultdict[str, int] = defaultdict(int)
        duration: defaultdict[str, float] = defaultdict(float)
        for seed in options.seeds:
            scene = SceneSettings(light=light, ambient=ambient, seed=seed)
            rendering = render(scene)
            truth = rendering.targets
            right['without'] += score(truth, detector(rendering.image)).right
            for name, (genes, coarse) in zip(names, ways, strict=True):
                settings = {'expected_targets': scene.targets, 'search': genes, 'coarse': coarse}
                started = time.perf_counter()
                found = identify(rendering.image, detector=detector, **settings)
                duration[name] += time.perf_counter() - started
                figures = score(truth, found.targets)
                right[name] += figures.right
                wrong[name] += figures.wrong + figures.false_positives
        cells = [
            f'{right[name]}{f", {wrong[name]} wrong" if wrong[name] else ""} '
            f'| {duration[name] / len(options.seeds):.2f}'
            for name in names
        ]
        print(f'| {light} {ambient:g} | {right["without"]} | {" | ".join(cells)} |', flush=True)


if __name__ == '__main__':
    main()
