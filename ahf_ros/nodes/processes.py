"""Which publishers are of processes on this machine that have ended.

A process that is killed keeps its place in the graph until its lease ends, with Fast DDS for 20 s.
Fast DDS writes into the first 12 bytes of the identifier of a publisher, which are those of its
participant, the vendor (0 and 1), the host (2 and 3) and the lower half of the process ID (4 and
5), so that on Linux its process can be looked for.
"""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

_FAST_DDS = bytes((1, 15))

_PROC = Path('/proc')

_MAXIMUM = 1000
"""Number of participants beyond which all are looked for anew."""


class Processes:
    """The processes of publishers on this machine, as far as their identifiers name them."""

    def __init__(self, identifiers: Iterable[Sequence[int]]) -> None:
        """Learn the host from the identifiers of publishers, of which one is of this process."""
        of_this = (it for it in map(bytes, identifiers) if _process(it) == os.getpid() % 2**16)
        self._host = next((it[:4] for it in of_this if it.startswith(_FAST_DDS)), b'')
        self._found: dict[bytes, list[Path]] = {}  # where the process may be, by participant

    def ended(self, identifier: Sequence[int]) -> bool:
        """Return whether the process of a publisher was there once, and has ended."""
        participant = bytes(identifier[:12])
        if not self._host or not participant.startswith(self._host):
            return False
        if participant not in self._found:
            if len(self._found) >= _MAXIMUM:
                self._found.clear()
            numbered = (it for it in _PROC.iterdir() if it.name.isdecimal())
            wanted = _process(participant)
            self._found[participant] = [it for it in numbered if int(it.name) % 2**16 == wanted]
        found = self._found[participant]
        return bool(found) and not any(map(_runs, found))


def _process(identifier: bytes) -> int:
    """Return the lower half of the process ID."""
    return int.from_bytes(identifier[4:6], 'little')


def _runs(process: Path) -> bool:
    """Return whether a process is there, and not only its status for who has started it."""
    try:
        status = (process / 'stat').read_text(encoding='utf-8', errors='replace')
    except OSError:
        return False
    return status.rpartition(')')[2].split()[0] not in 'ZX'
