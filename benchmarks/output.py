"""Reports of benchmarks as files: an object for programs and a page for people."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any


def add_output(parser: argparse.ArgumentParser) -> None:
    """Give a parser the option that says where a report goes."""
    parser.add_argument(
        '--output', type=Path, metavar='FILE', help='also write FILE.json and FILE.md'
    )


def publish(report: dict[str, Any], page: str, output: Path | None) -> None:
    """Print the page of a report, and write both where `output` says so."""
    if output:
        Path(f'{output}.json').write_text(json.dumps(report, indent=1))
        Path(f'{output}.md').write_text(page + '\n')
    print(page)
