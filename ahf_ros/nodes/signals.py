"""Signals that end a node, from the first moment on; imports neither ROS nor numpy."""

from __future__ import annotations

import os
import select
import signal
from functools import cache

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a node; the last one unless nohup has it ignored."""


@cache
def signalled() -> int:
    """Return a file descriptor that becomes readable after a signal.

    So a node shuts down in order, and a second signal does not interrupt that: a terminal and a
    launch file both send one for the same Ctrl-C.
    """
    readable, written = os.pipe()
    os.set_blocking(written, False)
    signal.set_wakeup_fd(written)
    ignored = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    for number in ENDING[:-1] if ignored else ENDING:
        signal.signal(number, lambda *_: None)
    return readable


def has_arrived() -> bool:
    """Return whether there was a signal."""
    return bool(select.select([signalled()], [], [], 0)[0])


def ignore() -> None:
    """Ignore signals until the process ends: Python and the middleware take a while to do so."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
