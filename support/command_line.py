"""The command `ahf` as a process."""

from __future__ import annotations

import os
import subprocess
import sys

from support import ROOT


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
