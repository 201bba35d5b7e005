"""Write docs/pictures/report.jpg: a report of rendered scenes, as Chromium shows it.

PYTHONPATH=. .venv/bin/python scripts/write_report_picture.py
"""

from __future__ import annotations

import csv
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from support.browser import opened
from support.command_line import ahf

PICTURE = Path(__file__).resolve().parent.parent / 'docs' / 'pictures' / 'report.jpg'
LIGHTS = ('normal', 'stripe', 'lattice', 'shadow', 'fringe', 'spots', 'diagonal_stripe')
SIZES = ('--width', 1200, '--height', 800, '--targets', 24, '--dot-radius', 9)
CHOSEN = 'stripe_0.3_7.png'
WIDTH, HEIGHT = 1500, 1060


def main() -> int:
    """Render, identify, report and take the picture."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        scenes = folder / 'scenes'
        checked('render', scenes, '--light', *LIGHTS, '--ambient', 0.3, *SIZES, '--seed', 7)
        with (scenes / 'truth.csv').open() as file:
            ids = sorted({int(row['id']) for row in csv.DictReader(file)})
        listed = ','.join(map(str, ids))
        identified = checked(
            *('identify', scenes, '--detector', 'traditional', '--expected-ids', listed),
            *('--report-undecoded', '--json', '--quiet'),
        )
        results, page = folder / 'results.jsonl', folder / 'report.html'
        results.write_text(identified.replace(f'{folder}/', ''))
        checked(
            *('report', results, '-o', page, '--truth', scenes / 'truth.csv', '--quiet'),
            *('--title', 'Hall 3, projected light'),
        )
        PICTURE.write_bytes(photographed(page))
    return 0


def checked(*arguments: object) -> str:
    """Run a command, and return what it prints on standard output."""
    done = ahf(*arguments, timeout=1800)
    assert done.returncode == 0, done.stderr
    return done.stdout


def photographed(page: Path) -> bytes:
    """Return a picture of the page as JPEG."""
    with opened() as browser:
        browser.set_window_size(WIDTH, HEIGHT)
        browser.get(page.as_uri())
        browser.execute_script(
            'document.documentElement.dataset.theme = "light";'
            f'select(records.find((it) => it.name === {CHOSEN!r})); setMode("both");'
            'document.getElementById("tab-search").click();'
        )
        content = np.frombuffer(browser.get_screenshot_as_png(), np.uint8)
    image = np.asarray(cv2.imdecode(content, 1))
    _, encoded = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, 86])
    return encoded.tobytes()


if __name__ == '__main__':
    sys.exit(main())
