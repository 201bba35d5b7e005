"""The one way out: files that are whole or not there, and sets of files that are all of one run.

A file is written beside its place, as a part that is safe on disk, and takes its place in one
step. The parts of a set are all there before the first of them takes its place. A list of them is
there by then, too, so that whoever reads or writes the set next completes what a killed process
has left. The main file of a set may have a manifest, by which readers see that the others are of
the same run. No output takes the place of an input (`ahf_ros.base.inputs`).

Writes and `fsync` raise auditing events (PEP 578), as the functions of `os` do by themselves.
"""

import errno
import json
import os
import stat
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from importlib import import_module
from pathlib import Path, PurePath
from typing import IO, Any, BinaryIO

from ahf_ros.base.inputs import check_output
from ahf_ros.base.opening import Most, file_errors, inside, opened
from ahf_ros.base.text import shown

_fcntl: Any
try:
    _fcntl = import_module('fcntl')
except ImportError:  # on Windows
    _fcntl = None

MANIFEST = 'files'
"""Field of the main file of a set: the other files by name, with size and SHA-256."""

_PART = 2**20  # bytes that are read at once
_MOVES = '.unfinished.json'  # the files of a set that are about to take their places
_LOCK_FILE = '.lock'
_TRY_LOCK = 0.1  # s between two attempts
_LOCK_TIMEOUT = 1.0  # s; another set takes its place in far less


def write_whole(path: str | Path, content: bytes) -> None:
    """Write a file that is never there in part, as `whole_file` does."""
    with whole_file(path) as file:
        _write(file, content)


@contextmanager
def whole_file(path: str | Path) -> Iterator[BinaryIO]:
    """Open a file to write that is never there in part, whatever fails.

    An existing file is replaced once the new one is complete, which then has its permissions; a
    missing folder is created. What is no ordinary file, such as a pipe, is written to directly. A
    ValueError names a file that is an input or cannot be written.
    """
    with file_errors(path, 'written'):
        final = Path(path).resolve()
        if final.exists() and not final.is_file():
            with final.open('wb') as file:
                yield file
            return
        with ExitStack() as parts:
            with _part(final, parts) as file:
                yield file
            _move(_part_of(final), final)
            _sync_folder(final.parent)


def write_files(
    folder: str | Path, files: Iterable[tuple[str, bytes]], former: Collection[str] = ()
) -> tuple[Path, ...]:
    """Write files that belong together to a folder, all or none, and return their paths.

    They are names in the folder and contents, taken one after the other. `former` are names of
    files in it that go if they are not among these. A ValueError says what cannot be written.
    """
    root, names = Path(folder).resolve(), []
    with ExitStack() as parts:
        for name, content in files:
            with file_errors(Path(folder, name), 'written'), _part(root / name, parts) as file:
                _write(file, content)
            names.append(name)
        if not names:
            return ()
        moves = {'process': os.getpid(), 'parts': names, 'removed': [*{*former} - {*names}]}
        with file_errors(folder, 'written'), ExitStack() as lock:
            with suppress(OSError, ValueError):  # no locks here, or results that are being kept
                lock.enter_context(locked(root, _LOCK_TIMEOUT))
            complete(root)
            try:
                write_whole(root / _MOVES, json.dumps(moves).encode())
            finally:
                if (root / _MOVES).exists():
                    parts.pop_all()  # the set is as good as there
            complete(root)
    return tuple(Path(folder, name) for name in names)


def write_set(
    folder: str | Path, main: str, record: Mapping[str, Any], files: Iterable[tuple[str, bytes]]
) -> tuple[Path, ...]:
    """Write files as `write_files` does, and the record with their manifest as JSON, the last.

    Files of the set that was there before go with it, unless they have been changed since.
    """
    complete(folder)
    manifest: dict[str, dict[str, Any]] = {}

    def contents() -> Iterator[tuple[str, bytes]]:
        for name, content in files:
            manifest[name] = _about(content)
            yield name, content
        whole = {**record, MANIFEST: manifest}
        yield main, json.dumps(whole, indent=1, allow_nan=False).encode() + b'\n'

    return write_files(folder, contents(), list(_former(Path(folder), main)))


def check_set(main: Path, record: Mapping[str, Any]) -> None:
    """Refuse a set if files beside its main file are not those that were written with it.

    They are registered as inputs. A set of an earlier version has no manifest.
    """
    manifest = record.get(MANIFEST, {})
    if not isinstance(manifest, dict):
        raise ValueError(f'{main}: {MANIFEST} is {shown(manifest)}, accepted are names of files')
    for name, about in manifest.items():
        path = inside(main.parent, name)
        if path.is_file():
            with opened(path, Most.ARRAYS) as file, file_errors(path, 'read'):
                whole = _is_as_written(file, about)
            if not whole:
                raise ValueError(
                    f'{path} is of another run than {main.name} or was changed, accepted is a '
                    'folder as it was written'
                )


def complete(folder: str | Path) -> None:
    """Let the files of a set take their places, where a killed process left some beside them.

    A ValueError says so if that is not possible, for then the set is neither old nor new.
    """
    root, listed = Path(folder), Path(folder, _MOVES)
    if not listed.is_file():
        return
    with file_errors(folder, 'completed'):
        try:
            with listed.open('rb') as file:
                moves = json.loads(file.read(Most.YAML))
            process, names, removed = int(moves['process']), moves['parts'], moves['removed']
            if not all(map(_is_inside, names)) or not all(map(_is_beside, removed)):
                raise ValueError(f'{shown(moves)} has names outside of the folder')
        except (ValueError, LookupError, TypeError, RecursionError) as error:
            raise ValueError(f'{listed} is damaged, accepted is to remove it: {error}') from error
        for name in names:
            with suppress(FileNotFoundError):  # it is in its place
                _move(_part_of(root / name, process), root / name)
        for name in removed:
            check_output(root / name)
            (root / name).unlink(missing_ok=True)
        _sync_folder(root)
        listed.unlink(missing_ok=True)


@contextmanager
def locked(folder: str | Path, lock_timeout: float = 0.0) -> Iterator[None]:
    """Lock a folder against other processes, until this process ends at the latest.

    Raises a ValueError if another process still has locked it after `lock_timeout` s.
    """
    limit = time.monotonic() + lock_timeout
    with _lock_of(folder) as try_lock:
        while not try_lock():
            if time.monotonic() >= limit:
                raise ValueError(f'{folder} is being written by another process')
            time.sleep(_TRY_LOCK)
        yield


@contextmanager
def _lock_of(folder: str | Path) -> Iterator[Callable[[], bool]]:
    """Yield what tries to lock a folder and returns whether it could."""
    if _fcntl is None:  # folders cannot be locked; a database can, by any process
        import sqlite3

        database = sqlite3.connect(Path(folder, _LOCK_FILE), timeout=0, isolation_level=None)

        def locked_database() -> bool:
            with suppress(sqlite3.OperationalError):
                database.execute('BEGIN EXCLUSIVE')
                return True
            return False

        try:
            yield locked_database
        finally:
            database.close()
        return
    descriptor = os.open(folder, os.O_RDONLY)

    def locked_folder() -> bool:
        with suppress(BlockingIOError):
            _fcntl.flock(descriptor, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
            return True
        return False

    try:
        yield locked_folder
    finally:
        os.close(descriptor)


def place(part: Path, final: Path) -> None:
    """Make a file that another library has written safe on disk, and let it take its place."""
    with part.open('rb+') as file:
        _sync(file)
    _move(part, final)
    _sync_folder(final.parent)


def _move(part: Path, final: Path) -> None:
    check_output(final)
    part.replace(final)


def _part_of(final: Path, process: int | None = None) -> Path:
    return final.with_name(f'.{final.name[:200]}.{process or os.getpid()}.part')


@contextmanager
def _part(final: Path, parts: ExitStack) -> Iterator[BinaryIO]:
    """Open the part of a file, which is removed with `parts` unless it takes its place.

    It has the permissions of the file whose place it takes, which must not be protected.
    """
    check_output(final)
    final.parent.mkdir(parents=True, exist_ok=True)
    part = _part_of(final)
    part.unlink(missing_ok=True)  # of a killed process of that number, as in containers
    parts.callback(_remove, part)
    with part.open('xb') as file:
        if final.exists():
            with final.open('rb+'):  # which a protected file and a folder do not let
                status = final.stat()
            if not stat.S_ISREG(status.st_mode):
                raise OSError(errno.EINVAL, 'it is no regular file')
            if hasattr(os, 'chown'):
                with suppress(PermissionError):  # it is somebody else's
                    os.chown(part, status.st_uid, status.st_gid)
            part.chmod(stat.S_IMODE(status.st_mode))
        yield file
        _sync(file)


def _remove(part: Path) -> None:
    with suppress(OSError):  # what made it fail is said
        part.unlink()


def _write(file: BinaryIO, content: bytes) -> None:
    sys.audit('ahf_ros.write', file.name)
    file.write(content)


def _sync(file: BinaryIO) -> None:
    file.flush()
    sys.audit('ahf_ros.fsync', file.name)
    os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    """Make names in a folder safe on disk, where there is a way to."""
    if hasattr(os, 'O_DIRECTORY'):
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            sys.audit('ahf_ros.fsync', str(folder))
            os.fsync(descriptor)
        except OSError as error:
            if error.errno != errno.EINVAL:  # of file systems that do so by themselves
                raise
        finally:
            os.close(descriptor)


def _is_as_written(file: IO[bytes], about: object) -> bool:
    """Return whether a file is what a manifest has about it."""
    if not isinstance(about, dict) or about.get('size') != os.fstat(file.fileno()).st_size:
        return False
    return about.get('sha256') == _sha256(iter(lambda: file.read(_PART), b''))


def _sha256(parts: Iterable[bytes]) -> str:
    from hashlib import sha256  # it loads OpenSSL, which nodes do without

    digest = sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()


def _about(content: bytes) -> dict[str, Any]:
    return {'size': len(content), 'sha256': _sha256([content])}


def _former(folder: Path, main: str) -> Iterator[str]:
    """Yield the files of the set that is there, as far as they are as they were written."""
    try:
        manifest = dict(json.loads((folder / main).read_bytes())[MANIFEST])
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return  # there is no such set, or somebody else's
    for name in filter(_is_beside, manifest):
        with suppress(OSError, ValueError):  # it is gone, or an input
            check_output(folder / name)
            with (folder / name).open('rb') as file:
                unchanged = _is_as_written(file, manifest[name])
            if unchanged:
                yield name


def _is_inside(name: object) -> bool:
    """Return whether a text is a relative path that leads nowhere else."""
    if not isinstance(name, str) or not name or '\0' in name:
        return False
    path = PurePath(name)
    return not path.is_absolute() and '..' not in path.parts and not path.drive


def _is_beside(name: object) -> bool:
    return _is_inside(name) and PurePath(str(name)).name == name
