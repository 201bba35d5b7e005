"""The command line `ahf`.

Standard output is for programs: JSON or nothing. Messages for people go to standard error. The
exit status is 0; 1 if a file could not be read or written, while the others are processed; 2 if an
argument is not accepted; 3 if `ahf orient` wrote all, but what it was given does not agree.
"""

import os
import sys
from collections.abc import Sequence

from ahf_ros.base import ending
from ahf_ros.base.text import printable


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command that arguments name, by default those of `sys.argv`; return its status."""
    # What OpenCV warns of, such as tags of TIFF files that it does not know, is not for users.
    os.environ.setdefault('OPENCV_LOG_LEVEL', 'ERROR')
    try:
        with ending.handled():
            # Imported here, so that a signal during the imports ends in order, too.
            from ahf_ros.cli import commands

            _replace_closed()
            status = commands.run(arguments)
            sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # Without this, the interpreter reports an error when it flushes the closed pipe.
        _discard_output()
    except ImportError as error:
        if error.name not in ('cv2', 'numpy', 'ahf_ros.kernels'):
            raise
        missing = isinstance(error, ModuleNotFoundError)
        text = f'{error.name} is missing, see ahf doctor' if missing else error
        print(f'ahf: error: {text}', file=sys.stderr)
    except OSError as error:  # of standard output: a full disk
        _discard_output()
        print(f'ahf: error: {error.strerror or error}', file=sys.stderr)
    return 1


def tell(command: str, problem: object) -> None:
    """Say on standard error what a command could not do."""
    say(f'ahf {command}: {problem}')


def say(text: str) -> None:
    """Say a line on standard error; names in it cannot command a terminal."""
    print(printable(text, len(text)), file=sys.stderr)


def _replace_closed() -> None:
    """Give a process that was started without standard output or error places to write to."""
    for name in ('stdout', 'stderr'):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, 'w'))  # noqa: PTH123, SIM115


def _discard_output() -> None:
    """Leave what could not be written to standard output."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
