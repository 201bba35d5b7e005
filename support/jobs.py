"""A job for the tests of engines: it squares numbers, reports, fails or kills its process."""

import os
import signal
from pathlib import Path
from typing import Any

from ahf_ros.batch.engine import Report


def do_as_told(task: Any, report: Report) -> Any:
    what, value = task
    if what == 'die once' and not Path(value).exists():
        Path(value).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if what == 'die':
        os.kill(os.getpid(), signal.SIGKILL)
    if what == 'fail':
        raise ValueError(f'{value} is not accepted')
    report(f'{what} {value}')
    return value**2 if what == 'square' else os.getpid()
