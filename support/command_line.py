"""The command `ahf`, in this process or in one of its own, and other programs of Python."""

import subprocess
import sys
from functools import partial

from ahf_ros.cli import main
from support import environment


def python(
    *arguments: object, stdin: str = '', timeout: float = 300
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        input=stdin,
        capture_output=True,
        text=True,
        env=environment(),
        timeout=timeout,
    )


ahf = partial(python, '-m', 'ahf_ros.cli')


def status(*arguments: object) -> int:
    """Return the exit status of the command line in this process."""
    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as left:
        return int(left.code or 0)
