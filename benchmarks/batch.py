"""What many images cost: processes, memory, bytes read, and how it grows.

    python -m benchmarks.batch jobs [--images 200]            two processes against one
    python -m benchmarks.batch growth [--counts 100 300 1000] cost of an image, and of 10,000

Both render four photographs of 10.6 MP and identify copies of them, links of other
names. Each process reads its files whole, so the operating system has them in memory after the
first time; on a cold disk, add the time for the bytes that the tables tell.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ahf_ros.files.image_files import write_image
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks.report import number, table
from support.process_tree import ProcessTree

PHOTOGRAPHS = 4
SEED = 501
TARGET = 10_000
"""Number of images that costs are extended to."""


@dataclass(frozen=True, slots=True)
class Cost:
    """Cost of one command: s, s of all processors, MB of the largest worker and of the command."""

    elapsed: float
    processors: float
    worker: float
    command: float
    read: float
    written: float


def photographs(folder: Path, count: int) -> list[Path]:
    """Return images of 10.6 MP; only the first are different files."""
    originals = []
    for place in range(min(PHOTOGRAPHS, count)):
        path = folder / f'original_{place}.jpg'
        if not path.exists():
            write_image(path, render(SceneSettings(seed=SEED + place)).image)
        originals.append(path)
    images = folder / str(count)
    images.mkdir()
    for place in range(count):
        os.link(originals[place % len(originals)], images / f'{place:05}.jpg')
    return sorted(images.iterdir())


def cost(folder: Path, *options: object, **environment: str) -> Cost:
    """Return what `ahf identify` of the images in a folder costs."""
    output = folder.with_name(f'{folder.name}_results')
    command = [sys.executable, '-m', 'ahf_ros.cli', 'identify', str(folder), '--quiet']
    command += ['--output', str(output), *map(str, options)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    started = time.perf_counter()
    with (
        subprocess.Popen(command, env={**os.environ, **environment}) as process,
        ProcessTree(process.pid) as tree,
    ):
        status = process.wait()
    elapsed = time.perf_counter() - started
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if status:
        raise RuntimeError(f'ahf identify ended with status {status}')
    written = sum(file.stat().st_size for file in output.iterdir())
    for file in output.iterdir():
        file.unlink()
    processors = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    workers = tree.others or [tree.own]
    return Cost(
        elapsed,
        processors,
        max(usage.memory for usage in workers),
        tree.own.memory,
        sum(usage.read for usage in workers) / 1e6,
        written / 1e6,
    )


def compare_jobs(count: int, rounds: int) -> None:
    """Print the time of one process, of one that uses one thread, and of two."""
    with tempfile.TemporaryDirectory() as name:
        folder = photographs(Path(name), count)[0].parent
        variants: dict[str, tuple[tuple[object, ...], dict[str, str]]] = {
            'one job': (('--jobs', 1), {}),
            'one job, one thread': (
                ('--jobs', 1, '--threads', 1),
                {'OPENCV_FOR_THREADS_NUM': '1'},
            ),
            'two jobs': (('--jobs', 2), {}),
        }
        costs: dict[str, list[Cost]] = {variant: [] for variant in variants}
        for _ in range(rounds):
            for variant, (options, environment) in variants.items():
                costs[variant].append(cost(folder, *options, **environment))
    best = {variant: min(of, key=lambda it: it.elapsed) for variant, of in costs.items()}
    rows = [
        (
            variant,
            number(of.elapsed, 1),
            number(count / of.elapsed, 2),
            number(of.processors, 1),
            number(of.worker, 0),
            number(of.elapsed / best['two jobs'].elapsed, 2),
        )
        for variant, of in best.items()
    ]
    head = ('', 's', 'images/s', 'processor s', 'MB a worker', 'two jobs are faster by')
    print('\n'.join(table(head, rows)))


def grow(counts: Iterable[int], jobs: int) -> None:
    """Print the cost of several numbers of images, and what the fitted lines say of `TARGET`."""
    names = ('elapsed', 'processors', 'worker', 'command', 'read', 'written')
    rows = []
    print('| images | s | processor s | MB a worker | MB command | MB read | MB written |')
    print('|---|---|---|---|---|---|---|')
    with tempfile.TemporaryDirectory() as name:
        for count in counts:
            of = cost(photographs(Path(name), count)[0].parent, '--jobs', jobs)
            rows.append((count, *(getattr(of, it) for it in names)))
            print('| ' + ' | '.join(f'{value:.4g}' for value in rows[-1]) + ' |', flush=True)
    table = np.array(rows)
    if len(table) > 1:
        lines = [np.polyfit(table[:, 0], column, 1) for column in table[:, 1:].T]
        values = [np.polyval(line, TARGET) for line in lines]
        print(f'| {TARGET} (lines) | ' + ' | '.join(f'{value:.4g}' for value in values) + ' |')
        print('an image adds ' + ', '.join(f'{line[0]:.3g}' for line in lines))


def main() -> None:
    """Measure and print what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('what', choices=('jobs', 'growth'))
    parser.add_argument('--images', type=int, default=200)
    parser.add_argument('--rounds', type=int, default=3)
    parser.add_argument('--counts', type=int, nargs='+', default=[100, 300, 1000])
    parser.add_argument('--jobs', type=int, default=2)
    options = parser.parse_args()
    if options.what == 'jobs':
        compare_jobs(options.images, options.rounds)
    else:
        grow(options.counts, options.jobs)


if __name__ == '__main__':
    main()
