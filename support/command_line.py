"""The command `ahf`, in this process or in one of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from ahf_ros.cli import main

ROOT = Path(__file__).resolve().parent.parent


def status(*arguments: object) -> int:
    """Return the exit status of the command line in this process."""
    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as left:
        return int(left.code or 0)


def ahf(
    *arguments: object, stdin: str = '', timeout: float = 300
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-m', 'ahf_ros.cli', *map(str, arguments)],
        input=stdin,
        capture_output=True,
        text=True,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        timeout=timeout,
    )
