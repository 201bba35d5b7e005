"""One way in: all files and URLs are opened and decoded here, and what is wrong names them.

Every function that reads what a user names is a `reader`: whatever a parser raises at it becomes
a ValueError. URLs are those of whatever storage fsspec reaches: https://, s3://, memory://, ...
"""

import codecs
import json
import os
import re
import stat
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, contextmanager
from enum import IntEnum
from functools import wraps
from io import BytesIO
from pathlib import Path
from typing import IO, Any, TypeVar, cast

from ahf_ros.base.extras import MissingExtra, need
from ahf_ros.base.inputs import register_input
from ahf_ros.base.text import reason_of

Function = TypeVar('Function', bound=Callable[..., Any])


class Most(IntEnum):
    """Bytes that a file may have, by what it holds."""

    YAML = 2_000_000  # two seconds of parsing
    TABLE = 2**26
    JSON = 2**30
    IMAGE = 2**31 - 1  # OpenCV counts them as an int
    ARRAYS = 2**32
    CLOUD = 2**33


LARGEST = 1e100
"""Largest number that files may have: its square is finite."""

READERS: list[Callable[..., Any]] = []
"""All functions that read what a user names, as far as their modules are imported."""

_SPECIAL = {
    stat.S_IFIFO: 'a named pipe',
    stat.S_IFSOCK: 'a socket',
    stat.S_IFCHR: 'a device',
    stat.S_IFBLK: 'a device',
    stat.S_IFDIR: 'a folder',
}
_URL = re.compile(r'[a-z][a-z0-9+.-]*://', re.IGNORECASE)
_CHANGED = ('mtime', 'LastModified', 'last_modified', 'updated', 'ETag', 'created')
"""What storages call the time of the last change, or what stands for it."""

_LONGEST_INTEGER = 19  # digits


@contextmanager
def file_errors(path: str | Path, action: str) -> Iterator[None]:
    """Turn errors of the operating system into a ValueError: the file 'cannot be' `action`."""
    try:
        yield
    except OSError as error:
        raise ValueError(f'{path} cannot be {action}: {error.strerror}') from error


@contextmanager
def parsing(name: object, accepted: str) -> Iterator[None]:
    """Turn whatever a parser raises into a ValueError that has the name of the file.

    A ValueError of ours says what was found and what is accepted, and may lack the name. Nothing
    is known of any other error than that the file is not what is `accepted`.
    """
    try:
        yield
    except MissingExtra:
        raise
    except Exception as error:
        if type(error) is not ValueError:
            raise ValueError(
                f'{name} is damaged or of another kind, accepted is {accepted}'
            ) from error
        if str(name) in str(error):
            raise
        raise ValueError(f'{name}: {error}') from error


def reader(accepted: str) -> Callable[[Function], Function]:
    """Return a decorator for functions that read the file which their first argument names."""

    def decorated(function: Function) -> Function:
        @wraps(function)
        def reading(*arguments: Any, **named: Any) -> Any:
            name = arguments[0] if arguments else next(iter(named.values()), '')
            with parsing(name, accepted):
                return function(*arguments, **named)

        READERS.append(reading)
        return cast(Function, reading)

    return decorated


def check_regular(path: str | Path, most: int) -> None:
    """Raise a ValueError for what is no regular file, and may never end, and for one too large.

    URLs are not looked at.
    """
    if not is_url(str(path)):
        with file_errors(path, 'read'):
            _check(path, Path(path).stat(), most)


def read_bytes(path: str | Path, most: int) -> bytes:
    """Return the content of a file or URL, as `opened` does."""
    with opened(path, most) as file, file_errors(path, 'read'):
        content = file.read(most + 1)
    if len(content) > most:
        raise ValueError(f'{path} has over {most} bytes, accepted are at most {most}')
    return content


@contextmanager
def opened(path: str | Path, most: int) -> Iterator[IO[bytes]]:
    """Open a regular file or URL of at most `most` bytes; a ValueError says why that cannot be."""
    if is_url(str(path)):
        with _storage(str(path)) as (storage, place):
            content = bytes(storage.cat_file(place))
        yield BytesIO(content)
        return
    check_regular(path, most)
    with ExitStack() as stack:
        with file_errors(path, 'read'):
            # A pipe may have taken its place meanwhile.
            file = stack.enter_context(open(path, 'rb', opener=_without_waiting))
        _check(path, os.fstat(file.fileno()), most)
        register_input(path)
        yield file


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, 'O_NONBLOCK', 0))


def _check(path: str | Path, status: os.stat_result, most: int) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = _SPECIAL.get(stat.S_IFMT(status.st_mode), 'something else')
        raise ValueError(f'{path} cannot be read: it is {kind}, accepted is a regular file')
    if status.st_size > most:
        raise ValueError(f'{path} has {status.st_size} bytes, accepted are at most {most}')


def read_text(path: str | Path, most: int) -> str:
    """Return the text of a file in UTF-8 or UTF-16, with or without a byte order mark."""
    content = read_bytes(path, most)
    try:
        return content.decode(_encoding(content))
    except UnicodeDecodeError as error:
        raise ValueError(
            f'{path} is not a text: byte {error.start} is wrong, accepted are UTF-8 and UTF-16'
        ) from error


def _encoding(content: bytes) -> str:
    """Return the encoding of a text that begins with a byte order mark, or in ASCII."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return 'utf-16'
    if content[1:2] == b'\0' and content[:1] != b'\0':
        return 'utf-16-le'
    if content[:1] == b'\0' and content[1:2] != b'\0':
        return 'utf-16-be'
    return 'utf-8-sig'


def inside(folder: Path, name: str) -> Path:
    """Return the path of a file in a folder; a ValueError unless it is in it, links followed."""
    path = folder / name
    if path.resolve().parent != folder.resolve():
        raise ValueError(f'{path} leads out of {folder}, accepted are files in it')
    return path


def parsed_json(text: str, where: str) -> Any:
    """Return the value of a JSON text, or raise a ValueError that calls it `where`."""
    try:
        return json.loads(text, parse_int=_integer)
    except json.JSONDecodeError as error:
        at = f'{error.msg}, line {error.lineno} column {error.colno}'
        raise ValueError(f'{where} is not JSON: {at}') from error
    except RecursionError as error:
        raise ValueError(f'{where} is not JSON: it is nested too deep') from error


def _integer(digits: str) -> float:
    """Return an integer; one of many digits as a float, which is infinite if it is too large."""
    return int(digits) if len(digits) <= _LONGEST_INTEGER else float(digits)


def is_url(name: str) -> bool:
    """Return whether a name is a URL: 's3://bucket/a.jpg' is one, 'C:/a.jpg' is a path."""
    return bool(_URL.match(name))


def url_fingerprint(url: str) -> str:
    """Return size and time of change of a file; what of them is not known is None."""
    with _storage(url) as (storage, place):
        found = storage.info(place)
    changed = (found[name] for name in _CHANGED if found.get(name))
    return f'{found.get("size")} {next(changed, None)}'


def urls_named(url: str, suffixes: Collection[str]) -> list[str]:
    """Return the URLs that a pattern with asterisks or a folder stands for, sorted.

    In a folder, files with one of the endings `suffixes`, in small letters, are meant. A URL that
    is neither a pattern nor a folder stands for itself.
    """
    with _storage(url) as (storage, place):
        if '*' in place:
            found = storage.glob(place)
        elif not url.lower().startswith('http') and storage.isdir(place):
            found = [it for it in storage.ls(place, detail=False) if it.lower().endswith(suffixes)]
        else:
            return [url]
        return sorted(storage.unstrip_protocol(it) for it in found)


@contextmanager
def _storage(url: str) -> Iterator[tuple[Any, str]]:
    """Open the storage of a URL, and turn what its driver raises into a ValueError with the URL.

    A driver, or fsspec itself, may not be installed.
    """
    try:
        need('urls')
        from fsspec.core import url_to_fs

        yield url_to_fs(url, use_listings_cache=False)
    except Exception as error:
        raise ValueError(f'{url} cannot be read: {reason_of(error)}') from error
