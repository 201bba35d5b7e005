"""What processes and their children use: memory and bytes read, as the kernel counts them."""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

INTERVAL = 0.1
"""Time between two looks, s."""

_GONE = (OSError, ValueError, LookupError)  # of a process that ends while it is looked at


def children_of(process: int) -> list[int]:
    """Return the processes that a process has started."""
    found = []
    for folder in Path('/proc').iterdir():
        if folder.name.isdigit():
            with suppress(*_GONE):
                fields = (folder / 'stat').read_text().rpartition(')')[2].split()
                if int(fields[1]) == process:
                    found.append(int(folder.name))
    return found


@dataclass(slots=True)
class Usage:
    """What one process has used so far: peak of its memory, MB, and bytes read."""

    memory: float = 0.0
    read: int = 0


@dataclass(slots=True)
class ProcessTree:
    """Looks at a process and its children until it is left."""

    process: int
    usage: dict[int, Usage] = field(default_factory=dict)
    _ended: threading.Event = field(default_factory=threading.Event)
    _thread: threading.Thread | None = None

    def __enter__(self) -> ProcessTree:
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        assert self._thread is not None
        self._thread.join()

    @property
    def own(self) -> Usage:
        return self.usage.get(self.process, Usage())

    @property
    def others(self) -> list[Usage]:
        return [usage for process, usage in self.usage.items() if process != self.process]

    def _look(self) -> None:
        while not self._ended.wait(INTERVAL):
            for process in (self.process, *children_of(self.process)):
                with suppress(*_GONE):
                    self.usage[process] = _usage_of(process)


def _usage_of(process: int) -> Usage:
    folder = Path(f'/proc/{process}')
    status = dict(
        line.split(':', 1) for line in (folder / 'status').read_text().splitlines() if ':' in line
    )
    read = (folder / 'io').read_text().splitlines()[0].split()[1]
    return Usage(int(status['VmHWM'].split()[0]) / 1024, int(read))
