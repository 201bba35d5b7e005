"""How the memory of a node is managed: it is reused instead of given back and asked for again."""

from __future__ import annotations

import ctypes
from contextlib import suppress

ARENAS = 2
"""Number of memory arenas that the threads of a node share; glibc would give each its own."""

MAXIMUM_KEPT = 32 * 2**20
"""Size from which on memory is taken from the system each time, bytes; the maximum of glibc."""

KEPT = 256 * 2**20
"""Free memory at the end of an arena that a node keeps, bytes: buffers of an image of 10 MP."""

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # of glibc's malloc.h


def reuse_memory() -> None:
    """Let the threads of a node share memory, and keep what an image needs for the next one.

    Each search starts threads, and memory that a thread frees stays in its arena. With an arena
    each, the process grew for hours. By default, glibc also takes the memory of every large array
    from the system, which clears it page by page: for an image of 10.6 MP, that took two thirds of
    the time between the middleware and the node, and a tenth of the identification.
    """
    with suppress(AttributeError):  # where malloc is not glibc's
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_M_ARENA_MAX, ARENAS)
        mallopt(_M_MMAP_THRESHOLD, MAXIMUM_KEPT)
        mallopt(_M_TRIM_THRESHOLD, KEPT)
