"""Build the documentation as a site: scripts/build_site.py build/site

A warning of Sphinx is an error, and so is a page that loads anything from another host.
"""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
START = 'docs/index'
PAGES = ('docs/**', 'CHANGELOG.rst', 'CONTRIBUTING.md', 'QUALITY_DECLARATION.md')
SKIPPED = ('.*', 'build', 'docs/examples')
FORWARD = f'<!doctype html><meta http-equiv="refresh" content="0; url={START}.html">\n'

LOADED = re.compile(
    r"""<(?:img|script|iframe|source|video)\b[^>]*\ssrc="?(?:https?:)?//"""
    r"""|<link\b[^>]*\shref="?(?:https?:)?//"""
    r"""|url\(\s*['"]?(?:https?:)?//|@import\s*['"](?:https?:)?//"""
)
"""What a browser would load from another host; links that a reader follows are none."""


def main(arguments: list[str]) -> int:
    """Build the site into a folder, which is emptied first."""
    from sphinx.cmd.build import main as sphinx

    folder = Path(arguments[0])
    shutil.rmtree(folder, ignore_errors=True)
    settings = {
        'root_doc': START,
        'include_patterns': ','.join(PAGES),
        'exclude_patterns': ','.join(SKIPPED),
    }
    options = [f'--define={name}={value}' for name, value in settings.items()]
    options += ['--quiet', '--fail-on-warning', '--keep-going', f'--conf-dir={ROOT / "docs"}']
    status = sphinx([*options, str(ROOT), str(folder)])
    (folder / 'index.html').write_text(FORWARD)
    status = status or oriented(folder / 'docs' / 'network_example')
    for page in loading(folder):
        print(f'{page}: loads from another host', file=sys.stderr)
        status = 1
    return status


def oriented(folder: Path) -> int:
    """Orient the example of docs/network.md, and return the exit status."""
    from ahf_ros.cli import main as ahf

    points, bars = (ROOT / 'docs' / 'examples' / f'panel{it}.csv' for it in ('', '_bars'))
    return ahf(['orient', str(points), '--scale-bars', str(bars), '-o', str(folder), '--quiet'])


def loading(folder: Path) -> list[Path]:
    """Return the pages and style sheets that load anything from another host."""
    files = [path for ending in ('html', 'css') for path in sorted(folder.rglob(f'*.{ending}'))]
    return [path for path in files if LOADED.search(path.read_text(errors='replace'))]


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
