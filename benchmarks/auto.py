"""Each built-in family, read as named and among all families as `auto`, under every light.

    python -m benchmarks.auto [--seeds 301] [--targets 12] [--families gsi dots ...] [--lights ...]

A row is a family under one light. Each image is the first one that `auto` sees.
"""

import sys
from collections.abc import Sequence
from itertools import product

import numpy as np

from ahf_ros.base.target import Target, TrueTarget
from ahf_ros.identification.session import identify
from ahf_ros.prints.families import AUTO, FAMILY_NAMES, print_in
from ahf_ros.scenes.evaluation import score, total
from ahf_ros.scenes.patterns import LIGHT_NAMES
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks import report
from support.pictures.lights import LIT

RADII = {'gsi': 4.0, 'cctag': 24.0}
"""Of dots, px, of kinds for which 12 px is not usual; CCTags have no dot, but an outer circle."""


def farthest(named: Sequence[Target | TrueTarget], found: Sequence[Target | TrueTarget]) -> float:
    """Return the largest distance of a target from the next that is named with its ID, px."""
    nearest = [
        min(np.hypot(it.x - of.x, it.y - of.y) for it in named if it.id == of.id)
        for of in found
        if of.id in {it.id for it in named}
    ]
    return float(max(nearest, default=0.0))


def main(arguments: Sequence[str] | None = None) -> int:
    """Identify as named and as `auto`, print both, and return 1 where a count differs."""
    made = report.parser(__doc__)
    made.add_argument('--families', nargs='+', choices=FAMILY_NAMES, default=FAMILY_NAMES)
    made.add_argument('--lights', nargs='+', choices=LIGHT_NAMES, default=LIGHT_NAMES)
    made.add_argument('--targets', type=int, default=12, help='of a scene')
    options = report.parsed(made, arguments)
    lights = [of for of in LIT if of[0] in options.lights]
    spacious, rows = max(1.0, (options.targets / 12) ** 0.5), []
    print(*report.table(('', 'light', 'named', AUTO, 'apart (px)'), ()), sep='\n', flush=True)
    for name, (light, ambient) in report.progress([*product(options.families, lights)], 'scenes'):
        counts, apart = [], 0.0
        for seed in options.seeds:
            settings = SceneSettings(
                width=round(1400 * spacious),
                height=round(1000 * spacious),
                targets=options.targets,
                dot_radius=RADII.get(print_in(name).kind, 12.0),
                family=name,
                light=light,
                ambient=ambient,
                seed=seed,
            )
            scene = render(settings)
            both = [identify(scene.image, family=of).targets for of in (name, AUTO)]
            apart = max(apart, farthest(*both))
            counts.append([score(scene.targets, found) for found in both])
        named, found = (
            (of.right, of.wrong, of.false_positives)
            for of in map(total, zip(*counts, strict=True))
        )
        rows.append({'family': name, 'light': light, 'ambient': ambient, 'named': named})
        rows[-1] |= {'auto': found, 'apart': apart}
        print(f'| {name} | {light} {ambient:g} | {named} | {found} | {apart:.3f} |', flush=True)
    different = sum(row['named'] != row['auto'] for row in rows)
    print(f'\n{different} of {len(rows)} rows differ; right, wrong and false of each')
    report.write({**report.about(options.seeds), 'rows': rows}, options)
    return int(different > 0)


if __name__ == '__main__':
    sys.exit(main())
