"""A report of many large images: its size, the time to write it, and its speed in a browser.

A few images are rendered and identified. They stand for all images under names of their own; each
is read and reduced on its own. Chromium opens the page without a window.

python -m benchmarks.report_page [--images 1000] [--scenes 8] [--folder DIR] [--output PATH]
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros import SceneSettings, identify, render
from ahf_ros.interchange.image_files import write_image
from ahf_ros.interchange.target_json import to_json
from support.browser import opened
from support.command_line import ahf

WIDTH, HEIGHT, TARGETS, RADIUS = 3984, 2656, 54, 20.0
LIGHTS = ('stripe', 'lattice', 'shadow', 'normal')
NOISE = (
    2.0  # gray levels, besides that of the renderings, so that pictures compress as photographs
)
REPEATS = 5


def make_images(folder: Path, count: int, scenes: int) -> Path:
    """Write images and their results to a folder, and return the file with the results."""
    records = []
    for number in range(scenes):
        settings = SceneSettings(
            width=WIDTH,
            height=HEIGHT,
            targets=TARGETS,
            dot_radius=RADIUS,
            light=LIGHTS[number % len(LIGHTS)],
            ambient=0.12,
            seed=number,
        )
        image = render(settings).image
        noise = np.random.default_rng(number).normal(0, NOISE, image.shape)
        image = np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)
        write_image(folder / 'scenes' / f'{number}.jpg', image)
        found = identify(image, expected_targets=TARGETS, report_undecoded=True)
        records.append(to_json(found, '', image.shape, 'metashape12', 'ring'))
    (folder / 'images').mkdir(exist_ok=True)
    lines = []
    for number in range(count):
        path = folder / 'images' / f'img_{number:04}.jpg'
        path.unlink(missing_ok=True)
        path.symlink_to(folder / 'scenes' / f'{number % scenes}.jpg')
        lines.append(json.dumps(records[number % scenes] | {'image': str(path)}))
    results = folder / 'results.jsonl'
    results.write_text('\n'.join(lines) + '\n')
    return results


def write_report(results: Path, page: Path) -> dict[str, float]:
    """Write a report with the default settings, in a process of its own, and measure that."""
    started = time.perf_counter()
    done = ahf('report', results, '-o', page, '--quiet', timeout=7200)
    seconds = time.perf_counter() - started
    assert (done.returncode, done.stderr) == (0, ''), done.stderr
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return {
        'seconds': round(seconds, 1),
        'MB': round(page.stat().st_size / 1e6, 2),
        'MB of memory at most': round(memory / 1e3),
    }


def open_page(page: Path) -> dict[str, float]:
    """Open a page, filter and sort its table, choose images, and return the times."""
    with opened(loading='none') as browser:
        browser.get(page.as_uri())
        until(browser, "performance.getEntriesByName('ahf-complete').length")
        until(browser, "performance.getEntriesByType('paint').length")
        browser.execute_script(_TIMES)
        figures = {name: mark(browser, name) for name in ('ahf-table', 'ahf-complete')}
        figures['first paint'] = browser.execute_script(
            "return performance.getEntriesByType('paint').at(-1).startTime"
        )
        for name, script in _ACTIONS.items():
            times = [
                browser.execute_async_script(f'timed({script}, arguments[0])')
                for _ in range(REPEATS)
            ]
            figures[name] = statistics.median(times)
        figures['MB of the heap'] = browser.execute_script(
            'return performance.memory.usedJSHeapSize / 1e6'
        )
        lines = [it for it in browser.get_log('browser') if it['level'] == 'SEVERE']
        assert not lines, lines
    return {name: round(value, 1) for name, value in figures.items()}


def until(browser: Any, condition: str) -> None:
    """Wait until a condition of the page holds."""
    while not browser.execute_script(f'return document.readyState && Boolean({condition})'):
        time.sleep(0.05)


def mark(browser: Any, name: str) -> float:
    """Return when the page set a mark, ms."""
    value: float = browser.execute_script(
        f"return performance.getEntriesByName('{name}')[0].startTime"
    )
    return value


# From the action to the second frame: the first one has been painted by then.
_TIMES = """
window.timed = (action, done) => {
  const started = performance.now();
  action();
  requestAnimationFrame(() => requestAnimationFrame(() => done(performance.now() - started)));
};
window.written = (id, text) => () => {
  document.getElementById(id).value = text;
  document.getElementById(id).dispatchEvent(new Event('input'));
};
"""

_ACTIONS = {
    'filter by name': "written('name-filter', '04')",
    'no filter': "written('name-filter', '')",
    'filter by ID': "written('id-filter', '7')",
    'no filter by ID': "written('id-filter', '')",
    'missed only': "() => document.querySelector('[value=missed]').click()",
    'all': "() => document.querySelector('[value=all]').click()",
    'sort': "() => sortBy('seconds')",
    'scroll': '() => { table.scroll.scrollTop = 20000 * Math.random(); }',
    'next image': '() => selectNext(1)',
    'zoom': '() => zoomBy(1.1)',
}


def markdown(figures: dict[str, Any]) -> str:
    """Return the page of the figures."""
    writing, browser = figures['writing'], figures['browser, ms']
    lines = [
        f'# A report of {figures["images"]} images',
        '',
        f'Images of {WIDTH} x {HEIGHT} px with {TARGETS} targets under different lights, the',
        'default settings, Chromium without a graphics card. Times in the browser are medians of',
        f'{REPEATS}, from the action to its second frame.',
        '',
        '| | |',
        '|---|---|',
        f'| size of the page | {writing["MB"]} MB |',
        f'| time to write it | {writing["seconds"]} s |',
        f'| memory, most of it for the results | {writing["MB of memory at most"]} MB |',
        f'| first table | {browser["ahf-table"]} ms |',
        f'| all pictures there | {browser["ahf-complete"]} ms |',
    ]
    lines += [f'| {name} | {browser[name]} ms |' for name in _ACTIONS]
    return '\n'.join([*lines, f'| memory of scripts | {browser["MB of the heap"]} MB |', ''])


def main(arguments: list[str] | None = None) -> int:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n')[0])
    parser.add_argument('--images', type=int, default=1000)
    parser.add_argument('--scenes', type=int, default=8)
    parser.add_argument('--folder', type=Path)
    parser.add_argument('--output', type=Path, help='Write PATH.json and PATH.md.')
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        results = make_images(folder, options.images, options.scenes)
        page = folder / 'report.html'
        figures = {
            'images': options.images,
            'writing': write_report(results, page),
            'browser, ms': open_page(page),
        }
    text = markdown(figures)
    print(text)
    if options.output:
        options.output.with_suffix('.json').write_text(json.dumps(figures, indent=1) + '\n')
        options.output.with_suffix('.md').write_text(text)
    return 0


if __name__ == '__main__':
    sys.exit(main())
