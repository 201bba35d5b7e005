"""What many images cost: processes, a cluster, memory, bytes read, and how it grows.

    python -m benchmarks.batch jobs [--images 200]            two processes against one
    python -m benchmarks.batch growth [--counts 100 300 1000] cost of an image, and of 10,000
    python -m benchmarks.batch start                          start of a worker
    python -m benchmarks.batch cluster [--tiny 10000]         what dask.distributed adds

`jobs` and `growth` render four photographs of 10.6 MP and identify copies of them, links of other
names. Each process reads its files whole, so the operating system has them in memory after the
first time; on a cold disk, add the time for the bytes that the tables tell.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ahf_ros.batch.engine import Engine, finished_tasks
from ahf_ros.batch.identification import identify_images
from ahf_ros.batch.processes import ProcessEngine
from ahf_ros.batch.task import ImageTask
from ahf_ros.interchange.image_files import write_image
from ahf_ros.synthetic.scene import SceneSettings, render
from support.jobs import sleep
from support.process_tree import ProcessTree

PHOTOGRAPHS = 4
SEED = 501
TARGET = 10_000
"""Number of images that costs are extended to."""

NAP = 0.1
"""Time of a task whose overhead is measured, s."""


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
    for number in range(min(PHOTOGRAPHS, count)):
        path = folder / f'original_{number}.jpg'
        if not path.exists():
            write_image(path, render(SceneSettings(seed=SEED + number)).image)
        originals.append(path)
    images = folder / str(count)
    images.mkdir()
    for number in range(count):
        os.link(originals[number % len(originals)], images / f'{number:05}.jpg')
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
    print('| | s | images/s | processor s | MB a worker | two jobs are faster by |')
    print('|---|---|---|---|---|---|')
    best = {variant: min(of, key=lambda it: it.elapsed) for variant, of in costs.items()}
    for variant, of in best.items():
        ratio = of.elapsed / best['two jobs'].elapsed
        print(
            f'| {variant} | {of.elapsed:.1f} | {count / of.elapsed:.2f} | {of.processors:.1f} '
            f'| {of.worker:.0f} | {ratio:.2f} |'
        )


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


def start_workers(rounds: int) -> None:
    """Print the time from nothing to the first result of a worker."""
    times = []
    for _ in range(rounds):
        began = time.perf_counter()
        with closing(ProcessEngine(identify_images, 1)) as engine:
            list(finished_tasks(engine, [ImageTask(('missing.png',))]))
            times.append(time.perf_counter() - began)
    print(f'start of a worker: {statistics.median(times):.2f} s, at most {max(times):.2f} s')


def overhead(engine: Engine, count: int, workers: int) -> float:
    """Return by how much tasks of `NAP` take longer than they sleep."""
    list(finished_tasks(engine, [0.0] * 2 * workers))
    began = time.perf_counter()
    list(finished_tasks(engine, [NAP] * count))
    return (time.perf_counter() - began) / (NAP * count / workers) - 1


def measure_cluster(tiny: int, workers: int = 2) -> None:
    """Print what a scheduler adds to tasks, and its memory under very many small ones."""
    from ahf_ros.batch.cluster import DaskEngine
    from support.cluster import LocalCluster

    with tempfile.TemporaryDirectory() as name, LocalCluster(Path(name)) as local:
        scheduler = local.scheduler()
        for number in range(workers):
            local.worker(str(number))
        local.wait_for_workers(workers)
        with closing(ProcessEngine(sleep, workers)) as processes:
            print(f'processes: {overhead(processes, 200, workers):.1%} over {NAP} s a task')
        with closing(DaskEngine(sleep, local.address)) as cluster:
            print(f'dask: {overhead(cluster, 200, workers):.1%} over {NAP} s a task')
        image = Path(name, 'tiny.png')
        write_image(image, render(SceneSettings(width=64, height=48, targets=0)).image)
        for count in (tiny // 10, tiny):
            with (
                ProcessTree(scheduler.pid) as tree,
                ProcessTree(os.getpid()) as own,
                closing(DaskEngine(identify_images, local.address)) as cluster,
            ):
                began = time.perf_counter()
                done = sum(1 for _ in finished_tasks(cluster, _tiny_tasks(image, count)))
                elapsed = time.perf_counter() - began
            print(
                f'{done} tiny images: {elapsed:.0f} s, {1000 * elapsed / done:.1f} ms each; peak '
                f'{tree.own.memory:.0f} MB scheduler, {own.own.memory:.0f} MB command'
            )


def _tiny_tasks(image: Path, count: int) -> Iterable[ImageTask]:
    return (ImageTask((str(image),)) for _ in range(count))


def main() -> None:
    """Measure and print what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('what', choices=('jobs', 'growth', 'start', 'cluster'))
    parser.add_argument('--images', type=int, default=200)
    parser.add_argument('--rounds', type=int, default=3)
    parser.add_argument('--counts', type=int, nargs='+', default=[100, 300, 1000])
    parser.add_argument('--jobs', type=int, default=2)
    parser.add_argument('--tiny', type=int, default=10_000)
    options = parser.parse_args()
    if options.what == 'jobs':
        compare_jobs(options.images, options.rounds)
    elif options.what == 'growth':
        grow(options.counts, options.jobs)
    elif options.what == 'start':
        start_workers(options.rounds)
    else:
        measure_cluster(options.tiny)


if __name__ == '__main__':
    main()
