"""Identify the targets in a folder of photographs, and write a table of their coordinates.

Run it as `python photographs.py photos --family aicon14 --output results`.
"""

from __future__ import annotations

import argparse
import csv
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from ahf_ros import create_identifier, draw, read_image, write_image

ENDINGS = ('.png', '.jpg', '.jpeg', '.tif', '.tiff')


def main(arguments: Sequence[str] | None = None) -> None:
    """Write targets.csv and a picture of each result."""
    parser = argparse.ArgumentParser(description='Identify the targets in photographs.')
    parser.add_argument('photographs', type=Path, help='a folder')
    parser.add_argument('--family', default='auto')
    parser.add_argument(
        '--expected-targets', type=int, default=0, help='targets in each; 0: unknown'
    )
    parser.add_argument('--network-ids', default='', help='IDs that exist, such as 1-54')
    parser.add_argument('--output', type=Path, default=Path('results'))
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)

    # One identifier for all: it starts with the filter that worked for the photograph before.
    identifier = create_identifier(
        family=options.family,
        expected_targets=options.expected_targets,
        network_ids=options.network_ids,
    )
    seen: Counter[int] = Counter()
    with (options.output / 'targets.csv').open('w', newline='') as file:
        table = csv.writer(file)
        table.writerow(('image', 'id', 'x', 'y', 'confidence'))
        for path in sorted(options.photographs.iterdir()):
            if path.suffix.lower() not in ENDINGS:
                continue
            image = read_image(str(path))
            found = identifier.identify(image)
            for target in found:
                x, y = f'{target.x:.3f}', f'{target.y:.3f}'
                table.writerow((path.name, target.id, x, y, f'{target.confidence:.3f}'))
            seen.update(target.id for target in found)
            write_image(options.output / f'{path.stem}_targets.jpg', draw(image, found))
            print(f'{path.name}: {len(found)} targets')

    # A point in space takes two rays, and a third one to check them.
    weak = sorted(number for number, count in seen.items() if count < 3)
    print(f'{len(seen)} targets in all; seen in fewer than three photographs: {weak or "none"}')


if __name__ == '__main__':
    main()
