"""Entry points of the nodes: a signal that comes during the imports ends them in order, too."""

import atexit
import os
import sys
import threading
from functools import partial
from pkgutil import resolve_name

from ahf_ros.base.ending import has_arrived, ignore_ending, signalled
from ahf_ros.base.inputs import inputs_kept
from ahf_ros.base.text import printable

NODES = {
    'detector': 'ahf_ros.nodes.detector:DetectorNode',
    'illumination': 'ahf_ros.nodes.illumination:IlluminationNode',
    'pose': 'ahf_ros.nodes.pose:PoseNode',
    'registration': 'ahf_ros.nodes.registration:RegistrationNode',
    'scoreboard': 'ahf_ros.nodes.scoreboard:Scoreboard',
}
"""Modules and classes of the nodes."""

INSTALL = (
    'nodes need ROS 2: source an installation, or install it from PyPI in the sources of ahf_ros '
    'with pip install . ./ros'
)


_exit = os._exit  # before what a detector calls is refused
_status: int | None = None


def start(node: str, arguments: list[str] | None = None) -> int:
    """Run one of `NODES` and return its exit status.

    Where there are no arguments, `sys.argv` has them. `--help` before those that ROS reads prints
    what the node does.
    """
    global _status
    signalled()
    os.environ.setdefault(
        'OPENBLAS_NUM_THREADS', '1'
    )  # before numpy is loaded; see ahf_ros.base.blas
    atexit.register(_leave_threads)  # before all others, so that it is called last
    own = sys.argv[1:] if arguments is None else arguments
    if '--ros-args' in own:
        own = own[: own.index('--ros-args')]
    if not {'-h', '--help'}.isdisjoint(own):
        from ahf_ros.nodes.interfaces import help_text

        print(help_text(node), end='')
        return 0
    try:
        node_class = resolve_name(NODES[node])
        from ahf_ros.nodes.process import run
    except ModuleNotFoundError as error:
        print(f'ahf_{node}: {error.name} is missing, {INSTALL}', file=sys.stderr)
        return 1
    except ImportError as error:  # what is there is of another distribution, or another Python
        said = printable(str(error).split('\n')[0])
        print(f'ahf_{node}: ROS 2 cannot be used: {said}; see ahf doctor', file=sys.stderr)
        return 1
    if has_arrived():
        ignore_ending()
        return 0
    with inputs_kept():
        _status = run(node_class, arguments)
    return _status


def _leave_threads() -> None:
    """End with the status of the node where threads go on, by a second look or in a detector.

    As Python ends, it ends those in the middle of a call, which aborts the process if this is C++.
    """
    if _status is not None and any(it.daemon for it in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        _exit(_status)


detector, illumination, pose, registration, scoreboard = (partial(start, node) for node in NODES)
