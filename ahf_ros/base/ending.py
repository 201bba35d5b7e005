"""The end of this process by a signal; imports neither ROS nor numpy, so it is heeded at once.

A signal handler that raises an exception does so wherever the program is. During an import the
exception may be lost or become another one, because C code discards or replaces what it does not
expect. So `interrupt` waits for the end of an import, and loops that go on call `check`.
"""

import os
import select
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from types import FrameType

POLL = 0.02
"""Time between two looks at what is waited for, s."""

GRACE = 3.0
"""Time to end in order, s; of processors, where others may be busy."""

_WITH_NOHUP = (signal.SIGINT, signal.SIGTERM)
_HANGUP = getattr(signal, 'SIGHUP', None)  # not on Windows, nor are there timers
_ENDING = (*_WITH_NOHUP, *((_HANGUP,) if _HANGUP else ()))
_IMPORT = '<frozen importlib'  # file of the code that imports

# Signal handlers set and read these, so they have no lock.
_number: int | None = None
_raised = False
_limit = 0.0
_actions: list[Callable[[], None]] = []


def ending_signals() -> tuple[signal.Signals, ...]:
    """Return the signals that end this process: SIGHUP as well unless nohup has it ignored."""
    ignored = _HANGUP and signal.getsignal(_HANGUP) == signal.SIG_IGN
    return _WITH_NOHUP if ignored else _ENDING


def ignore_ending() -> None:
    """Ignore these signals from now on: a second one interrupts nothing."""
    for number in _ENDING:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def handled() -> Iterator[None]:
    """Let the first of these signals end this process in order; others have no effect then.

    The signal raises what `check` does, see `interrupt`. Other threads than the main one get none.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, _end) for number in ending_signals()}
    try:
        yield
    finally:
        if hasattr(signal, 'setitimer'):
            signal.setitimer(signal.ITIMER_REAL, 0)
        if has_begun():
            ignore_ending()
        else:
            for number, handler in before.items():
                signal.signal(number, handler)


def _end(number: int, frame: FrameType | None) -> None:
    # Not SIG_IGN: two signals at once would be reported as a race.
    for other in _ENDING:
        signal.signal(other, _pass)
    begin(number)
    interrupt(frame)


def _pass(_: int, __: FrameType | None) -> None:
    """Handle a signal that has no effect."""


def interrupt(frame: FrameType | None) -> None:
    """Raise what `check` does in the main thread, after an import if that is not too long.

    The handler of a signal calls this with the frame where the signal interrupts that thread.
    """
    global _limit
    _limit = time.monotonic() + GRACE
    _raise_after_import(0, frame)


def _raise_after_import(_: int, frame: FrameType | None) -> None:
    while frame and time.monotonic() < _limit:
        if frame.f_code.co_filename.startswith(_IMPORT) and hasattr(signal, 'setitimer'):
            signal.signal(signal.SIGALRM, _raise_after_import)
            signal.setitimer(signal.ITIMER_REAL, POLL)
            return
        frame = frame.f_back
    if not _raised:  # by a loop that has called `check` meanwhile
        check()


def at_begin(action: Callable[[], None]) -> None:
    """Let `begin` call a function, which a signal handler can run."""
    _actions.append(action)


def begin(number: int = signal.SIGTERM) -> None:
    """Say that this process ends, and by which signal: nobody waits for programs any more."""
    global _number
    _number = number
    for action in _actions:
        action()


def has_begun() -> bool:
    """Return whether this process ends."""
    return _number is not None


def check() -> None:
    """Go on, unless this process ends.

    It raises a KeyboardInterrupt if that is by SIGINT, otherwise a SystemExit whose code is 128
    and the number of the signal.
    """
    global _raised
    if _number is None:
        return
    if threading.current_thread() is threading.main_thread():
        _raised = True
    if _number == signal.SIGINT:
        raise KeyboardInterrupt
    raise SystemExit(128 + _number)


@cache
def signalled() -> int:
    """Return a file descriptor that becomes readable after a signal that ends a node.

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
