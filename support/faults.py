"""A process that fails, or is killed, at one step of writing files."""

import errno
import os
import signal
import sys
import traceback
from collections.abc import Callable
from typing import Any

_STEPS = (
    *('ahf_ros.write', 'ahf_ros.fsync', 'os.rename', 'os.remove', 'os.mkdir', 'os.chmod'),
    *('os.chown', 'fcntl.flock'),
)


def with_fault(step: int, kill: bool, work: Callable[[], object]) -> int:
    """Do work in a process of its own, whose n-th step of writing fails or is not come to.

    Steps count from 1. A step that fails does nothing and raises ENOSPC. Returned is 0 if there
    are fewer steps, 2 if the fault did no harm, 1 if a ValueError said what was not done, and the
    signal, negative, of a process that was killed.
    """
    child = os.fork()
    if not child:
        status = 70
        try:
            sys.addaudithook(fault := _Fault(step, kill))
            work()
            status = 0 if fault.left > 0 else 2
        except ValueError as error:
            status = 1 if 'No space left on device' in str(error) else 71
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


class _Fault:
    """A hook for auditing events that counts those of writing."""

    def __init__(self, step: int, kill: bool) -> None:
        self.left = step
        self._kill = kill

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == 'open':  # to write
            counts = bool(arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT))
        else:
            counts = event in _STEPS
        self.left -= counts
        if counts and not self.left:
            if self._kill:
                os.kill(os.getpid(), signal.SIGKILL)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
