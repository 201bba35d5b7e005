"""One BLAS thread while targets are identified and networks adjusted.

An identification uses the cores for filters and pixels. Beside that, the threads of OpenBLAS spin
between short products and take two to three times the processor time. The last bits of a product
depend on their number, and so would coordinates.

Where threadpoolctl is not installed, as beside packages of ROS, which have no key for it, nothing
is limited here: nodes set `OPENBLAS_NUM_THREADS`, and others may.
"""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any

_KNOWN = find_spec('threadpoolctl') is not None

_WITH_BLAS = frozenset({'scipy.linalg', 'scipy.special'})

_lock = threading.Lock()
_holders = 0
_limit: Any = None


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Hold the BLAS libraries of this process to one thread; may be nested, and a decorator.

    The number of threads is one number of the process. So the first of several threads that
    identify at the same time lowers it, and the last one restores what it was.

    Examples
    --------
    >>> import numpy as np
    >>> with one_blas_thread():
    ...     float(np.linalg.det(np.eye(2)))
    1.0
    """
    global _holders, _limit
    with _lock:
        if not _holders and _KNOWN:
            _limit = _libraries(frozenset(_WITH_BLAS & sys.modules.keys())).limit(limits=1)
        _holders += 1
    try:
        yield
    finally:
        with _lock:
            _holders -= 1
            if not _holders and _limit:
                _limit.restore_original_limits()


@cache
def _libraries(modules: frozenset[str]) -> Any:
    """Return the BLAS libraries of numpy, and of scipy where modules that bring it are loaded.

    They are found once: it takes 2 ms, a limit 10 us.

    OpenCV's own takes no time. Where both are limited in a process that was forked, the process
    crashes at its end.
    """
    loaded = import_module('threadpoolctl').ThreadpoolController().select(user_api='blas')
    paths = [library['filepath'] for library in loaded.info()]
    return loaded.select(filepath=[path for path in paths if 'opencv' not in path])
