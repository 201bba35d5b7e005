"""A batch without an end: the images that arrive in a folder."""

import os
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from ahf_ros.base import ending
from ahf_ros.batch.engine import Engine
from ahf_ros.batch.identification import file_fingerprint
from ahf_ros.batch.results import Results, outcome_of
from ahf_ros.batch.task import ImageOutcome, ImageTask, Message

_BUSY = 0.2  # s after which waiting is interrupted
_EMPTY = '0 '  # how the fingerprint of an empty file begins


@dataclass(slots=True)
class _Seen:
    """A file as it was when it was looked at, since when, and whether it was taken."""

    fingerprint: str
    since: float
    taken: bool = False


class Arrivals:
    """The files of a folder, as they arrive: each is taken once it has stopped changing.

    Files count that end in one of `suffixes`, in small or capital letters, and do not begin with a
    dot; those of folders in the folder only if `recursive`. They have to be unchanged for
    `settling` seconds of `clock`. `away` says why the folder cannot be read; it is empty if it
    can.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     arrivals = Arrivals(Path(folder), ('.png',), False, 0.0)
    ...     _ = Path(folder, 'a.png').write_bytes(b'image')
    ...     [Path(path).name for path in arrivals.take()], arrivals.take()
    (['a.png'], [])
    """

    def __init__(
        self,
        folder: Path,
        suffixes: Collection[str],
        recursive: bool,
        settling: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.away = ''
        self._folder = folder
        self._suffixes = tuple(suffixes)
        self._recursive = recursive
        self._settling = settling
        self._clock = clock
        self._seen: dict[str, _Seen] = {}

    def take(self) -> list[str]:
        """Return the files that are there, unchanged for long enough, and not taken as they are.

        They are sorted by name. A file that changes afterwards is taken again.
        """
        try:
            paths = sorted(self._paths())
        except OSError as error:
            self.away = error.strerror or str(error)
            return []
        self.away = ''
        now = self._clock()
        before, self._seen = self._seen, {}
        for path in paths:
            fingerprint = file_fingerprint(path)
            if fingerprint and not fingerprint.startswith(_EMPTY):
                seen = before.get(path)
                same = seen is not None and seen.fingerprint == fingerprint
                self._seen[path] = seen if seen and same else _Seen(fingerprint, now)
        ready = [
            path
            for path, seen in self._seen.items()
            if not seen.taken and now - seen.since >= self._settling
        ]
        for path in ready:
            self._seen[path].taken = True
        return ready

    @property
    def settling(self) -> bool:
        """Whether there are files that may still change."""
        return any(not seen.taken for seen in self._seen.values())

    def _paths(self) -> Iterator[str]:
        with os.scandir(self._folder):
            pass  # raises an OSError if the folder is away, which `walk` keeps to itself
        for folder, folders, names in os.walk(self._folder):
            if not self._recursive:
                folders.clear()
            for name in names:
                if name.lower().endswith(self._suffixes) and not name.startswith('.'):
                    yield str(Path(folder, name))


def watch(
    engine: Engine,
    arrivals: Arrivals,
    results: Results,
    task_of: Callable[[str], ImageTask],
    interval: float,
    say: Callable[[str], None],
) -> Iterator[ImageOutcome]:
    """Yield the outcome of each image that arrives, once its result is written, without an end.

    The job of the engine is `ahf_ros.batch.identification.identify_images`. What `results` have
    already is not done again. `task_of` is called with the path of an image, `say` with what there
    is to say about the folder, which is looked at every `interval` seconds.
    """
    running: dict[int, ImageTask] = {}
    waiting: list[ImageTask] = []
    begun = 0
    looked = -interval
    while True:
        if not running or time.monotonic() - looked >= interval:
            looked = time.monotonic()
            before = arrivals.away
            paths = arrivals.take()
            if arrivals.away and not before:
                say(f'the folder cannot be read, waiting for it: {arrivals.away}')
            if before and not arrivals.away:
                say('the folder is back')
            pending, notes = results.pending(list(map(task_of, paths)))
            if notes:
                texts = (f'{results.path}: {note}' for note in notes)
                yield ImageOutcome(messages=tuple(map(Message, texts)))
            waiting += pending
        for task in list(waiting):
            if len(running) < engine.capacity and task not in running.values():
                waiting.remove(task)
                if not results.has(task):
                    running[begun] = task
                    engine.submit(begun, task)
                    begun += 1
        if not running:
            time.sleep(min(interval, _BUSY) if arrivals.settling else interval)
            continue
        found = engine.wait(_BUSY)
        ending.check()
        if found is not None:
            task = running.pop(found[0])
            outcome = outcome_of(task, found[1])
            results.append(task, outcome)
            yield outcome
