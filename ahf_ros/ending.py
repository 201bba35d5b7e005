"""Signals that end a process; imports neither ROS nor numpy, so that they are heeded at once."""

from __future__ import annotations

import signal

_WITH_NOHUP = (signal.SIGINT, signal.SIGTERM)
_ENDING = (*_WITH_NOHUP, signal.SIGHUP)


def ending_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end this process: SIGHUP as well unless nohup has it ignored."""
    ignored = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    return _WITH_NOHUP if ignored else _ENDING


def ignore_ending() -> None:
    """Ignore these signals from now on: a second one interrupts nothing."""
    for number in _ENDING:
        signal.signal(number, signal.SIG_IGN)
