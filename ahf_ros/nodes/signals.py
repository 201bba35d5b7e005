"""Signals that end a node, from the first moment on; imports neither ROS nor numpy."""

from __future__ import annotations

import os
import select
import signal
from functools import cache

from ahf_ros.ending import ending_signals


@cache
def signalled() -> int:
    """Return a file descriptor that becomes readable after a signal.

    So a node shuts down in order, and a second signal does not interrupt that: a terminal and a
    launch file both send one for the same Ctrl-C.
    """
    readable, written = os.pipe()
    os.set_blocking(written, False)
    signal.set_wakeup_fd(written)
    for number in ending_signals():
        signal.signal(number, lambda *_: None)
    return readable


def has_arrived() -> bool:
    """Return whether there was a signal."""
    return bool(select.select([signalled()], [], [], 0)[0])
