"""Write docs/pictures/network.jpg: the page of the panel's network, as Chromium shows it.

PYTHONPATH=. .venv/bin/python scripts/write_network_picture.py
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from support import ROOT
from support.browser import opened
from support.command_line import status

PICTURE = ROOT / 'docs' / 'pictures' / 'network.jpg'
EXAMPLES = ROOT / 'docs' / 'examples'
WIDTH, HEIGHT = 1400, 1000
QUALITY = 85


def main() -> int:
    """Orient the panel and take the picture."""
    with tempfile.TemporaryDirectory() as folder:
        bars = '--scale-bars', EXAMPLES / 'panel_bars.csv'
        done = status('orient', EXAMPLES / 'panel.csv', *bars, '-o', folder, '--quiet')
        assert done == 0
        with opened() as browser:
            browser.set_window_size(WIDTH, HEIGHT)
            browser.get((Path(folder) / 'report.html').as_uri())
            content = np.frombuffer(browser.get_screenshot_as_png(), np.uint8)
    image = np.asarray(cv2.imdecode(content, cv2.IMREAD_COLOR))
    _, encoded = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    PICTURE.write_bytes(encoded.tobytes())
    return 0


if __name__ == '__main__':
    sys.exit(main())
