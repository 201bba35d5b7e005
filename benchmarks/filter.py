"""Time and accuracy of one filter, against the published recipe in numpy in the same run.

The recipe is Eq. (1) to (7) as they stand: logarithm, `fft2`, H, `ifft2`, exponential, all in
double precision; the distances D and their median are given to it. Both map to 8 bit alike.

    python -m benchmarks.filter [--width 3984] [--height 2656] [--rounds 5] [--json]
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ahf_ros.filtering.homomorphic import HomomorphicFilter
from ahf_ros.filtering.settings import FilterSettings
from ahf_ros.filtering.transfer import median_distance
from ahf_ros.imaging.logarithm import logarithm, mapping
from ahf_ros.synthetic.scene import SceneSettings, render
from support.fourier import distances, filtered_fft, filtered_logarithm_fft, sampled

GAINS = [(1.0, 0.1), (1.2, 0.25), (1.5, 0.6), (2.8, 0.82), (3.7, 0.66)]
"""Filters that are timed and checked; the last two are those of the paper."""


class Recipe:
    """The published filter, as one writes it down in numpy."""

    def __init__(self, shape: tuple[int, int], settings: FilterSettings) -> None:
        self.distances = distances(*shape)
        self.median = median_distance(*shape)
        self.settings = settings

    def __call__(self, image: np.ndarray, gamma_high: float, gamma_low: float) -> np.ndarray:
        """Return the filtered image, 8 bit."""
        spectrum = np.fft.fft2(np.log(image / 255 + self.settings.log_offset))
        difference = gamma_high - gamma_low
        attenuated = np.exp(-difference * (self.distances / self.median) ** 2)
        response = difference * (1 - attenuated) + gamma_low
        values = np.fft.ifft2(response * spectrum).real
        scale, zero = mapping(
            sampled(values), self.settings.black_percentile, self.settings.white_percentile
        )
        return np.clip(np.rint(np.exp(values + scale) - zero), 0, 255).astype(np.uint8)


def seconds_each(work: Callable[[], list]) -> float:
    """Return the time that `work` takes for one of the results that it returns, s."""
    started = time.perf_counter()
    results = work()
    return (time.perf_counter() - started) / len(results)


def timings(image: np.ndarray, rounds: int, threads: int) -> dict[str, float]:
    """Return the median time of one filter, s, by the way it is computed.

    Every round times each way in turn, so that all of them meet the same machine.
    """
    recipe = Recipe(image.shape, FilterSettings())
    prepared = HomomorphicFilter(image)
    with ThreadPoolExecutor(threads) as executor:

        def shared(gains: tuple[float, float]) -> np.ndarray:
            return prepared.filtered(*gains, executor=executor)

        def alone(gains: tuple[float, float]) -> np.ndarray:
            return prepared.filtered(*gains)

        ways: dict[str, Callable[[], list]] = {
            'recipe': lambda: [recipe(image, *gains) for gains in GAINS[:1]],
            'preparation': lambda: [HomomorphicFilter(image)],
            'one thread': lambda: [alone(gains) for gains in GAINS],
            'shared': lambda: [shared(gains) for gains in GAINS],
            'together': lambda: list(executor.map(alone, GAINS * 2)),
        }
        times = [{name: seconds_each(way) for name, way in ways.items()} for _ in range(rounds)]
    return {name: statistics.median(row[name] for row in times) for name in ways}


def errors(image: np.ndarray) -> list[dict[str, float]]:
    """Return the deviations from the Fourier form, one row a filter."""
    prepared = HomomorphicFilter(image)
    spread = float(np.ptp(logarithm(image, FilterSettings().log_offset)))
    rows = []
    for gamma_high, gamma_low in GAINS:
        values = filtered_logarithm_fft(image, gamma_high, gamma_low)
        deviation = np.abs(prepared.filtered_logarithm(gamma_high, gamma_low) - values)
        levels = cv2.absdiff(
            prepared.filtered(gamma_high, gamma_low), filtered_fft(image, gamma_high, gamma_low)
        )
        rows.append(
            {
                'gamma_high': gamma_high,
                'gamma_low': gamma_low,
                'largest': float(deviation.max()),
                'largest_of_range': float(deviation.max()) / spread,
                'rms': float(np.sqrt(np.mean(deviation**2))),
                'largest_levels': int(levels.max()),
                'share_of_changed_pixels': float(np.mean(levels > 0)),
            }
        )
    return rows


def machine() -> dict[str, Any]:
    """Return what the figures depend on."""
    information = Path('/proc/cpuinfo')
    lines = information.read_text().splitlines() if information.exists() else []
    models = [line.split(':', 1)[1].strip() for line in lines if line.startswith('model name')]
    return {
        'processor': models[0] if models else platform.processor(),
        'cores': os.cpu_count(),
        'python': platform.python_version(),
        'numpy': np.__version__,
        'opencv': cv2.__version__,
    }


def markdown(report: dict[str, Any]) -> str:
    """Return the report as tables."""
    times, facts = report['seconds'], report['machine']
    names = {
        'recipe': 'published recipe, numpy FFT',
        'one thread': 'one filter in one thread',
        'shared': f'one filter in {report["threads"]} threads',
        'together': f'{report["threads"]} filters at a time, each',
        'preparation': 'logarithm, once an image',
    }
    lines = [
        f'One filter on {report["width"]} x {report["height"]} px, median of {report["rounds"]} '
        f'rounds; {facts["processor"]}, {facts["cores"]} cores, Python {facts["python"]}, '
        f'numpy {facts["numpy"]}, OpenCV {facts["opencv"]}',
        '',
        '| | ms | times faster |',
        '|---|---|---|',
    ]
    for name, text in names.items():
        lines.append(f'| {text} | {times[name] * 1e3:.1f} | {times["recipe"] / times[name]:.1f} |')
    lines += [
        '',
        'Deviation from the Fourier form (s: logarithm of the filtered image)',
        '',
        '| gamma_H, gamma_L | largest | of the range of z | RMS | gray levels | changed pixels |',
        '|---|---|---|---|---|---|',
    ]
    for row in report['errors']:
        lines.append(
            f'| {row["gamma_high"]}, {row["gamma_low"]} | {row["largest"]:.4f} '
            f'| {row["largest_of_range"]:.2%} | {row["rms"]:.5f} | {row["largest_levels"]} '
            f'| {row["share_of_changed_pixels"]:.2%} |'
        )
    return '\n'.join(lines)


def main() -> None:
    """Render a scene under stripes, measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--width', type=int, default=3984, help='px')
    parser.add_argument('--height', type=int, default=2656, help='px')
    parser.add_argument('--rounds', type=int, default=5)
    parser.add_argument('--threads', type=int, default=os.cpu_count())
    parser.add_argument('--json', action='store_true', help='one JSON object, no tables')
    options = parser.parse_args()
    scene = SceneSettings(width=options.width, height=options.height, light='stripe')
    image = render(scene).image
    report = {
        **vars(options),
        'seconds': timings(image, options.rounds, options.threads),
        'errors': errors(image),
        'machine': machine(),
    }
    report['times_faster'] = report['seconds']['recipe'] / report['seconds']['shared']
    print(json.dumps(report) if options.json else markdown(report))


if __name__ == '__main__':
    main()
