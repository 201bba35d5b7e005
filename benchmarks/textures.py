"""Textured images without targets: grain, bricks, foliage, pebbles, text, grids of dots, rings.

    python -m benchmarks.textures [--seed 301] [--count 500] [--family auto] [--only photographs]

Textures from a seed on and the images that scikit-image ships are identified as `ahf identify`
does. Every report is false.
"""

import sys
import time
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from itertools import chain
from pathlib import Path

import cv2
import numpy as np

from ahf_ros.base.target import Target
from ahf_ros.families import create_detector
from ahf_ros.identification.settling import evident
from benchmarks import report
from support.pictures.textures import lookalikes, textured_image


def natural_images() -> Iterator[tuple[str, np.ndarray]]:
    """Yield names and gray values of the images that scikit-image ships, if it is installed."""
    found = find_spec('skimage')
    folder = Path(found.origin).parent / 'data' if found and found.origin else Path()
    for file in sorted(folder.glob('*.[jp][pn]g') if found else ()):
        image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        if image is not None:
            yield file.name, image


def textures(seed: int, count: int) -> Iterator[tuple[str, np.ndarray]]:
    """Yield names and gray values of textures, every eighth of them rings in rings."""
    for number in range(seed, seed + count):
        make = textured_image if number % 8 else lookalikes
        yield f'texture {number}', make(number)


def main(arguments: Sequence[str] | None = None) -> int:
    """Identify, and print what is reported."""
    made = report.parser(__doc__, seeds=False)
    made.add_argument('--seed', type=int, default=301, help='of the first texture')
    made.add_argument('--count', type=int, default=500, help='textures')
    made.add_argument('--family', default='auto')
    made.add_argument('--only', choices=('textures', 'photographs'))
    options = made.parse_args(arguments)
    detector = create_detector(family=options.family)
    images = [] if options.only == 'photographs' else [textures(options.seed, options.count)]
    images += [] if options.only == 'textures' else [natural_images()]
    shown: dict[str, list[Target]] = {}
    started = time.process_time()
    for name, image in report.progress(chain.from_iterable(images), 'images'):
        shown[name] = evident(detector(image))
        for target in shown[name]:
            print(f'{name}: {target.family} {target.id}, {target.confidence:.4f}', flush=True)
    seconds = (time.process_time() - started) / max(len(shown), 1)
    total = sum(map(len, shown.values()))
    print(f'{total} reports in {len(shown)} images, {seconds:.1f} s each')
    figures = {name: [target.key for target in found] for name, found in shown.items()}
    report.write({'family': options.family, 'seed': options.seed, 'reports': figures}, options)
    return 0


if __name__ == '__main__':
    sys.exit(main())
