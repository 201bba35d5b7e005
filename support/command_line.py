"""The command `ahf` and other programs of Python as processes."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import partial

from support import ROOT


def python(
    *arguments: object, stdin: str = '', timeout: float = 300
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        input=stdin,
        capture_output=True,
        text=True,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        timeout=timeout,
    )


ahf = partial(python, '-m', 'ahf_ros.cli')
