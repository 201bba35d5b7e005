"""Files and URLs, read and written with errors that name them.

URLs are those of whatever storage fsspec reaches: https://, s3://, memory:// and so on.
"""

from __future__ import annotations

import csv
import io
import re
import stat
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Any

from ahf_ros.extras import need
from ahf_ros.inputs import register_input
from ahf_ros.opening import file_errors
from ahf_ros.text import printable, reason_of, shown

RESULTS_FILE = 'results.jsonl'
"""Name of the file in a folder that `ahf identify --output` writes."""

_APOSTROPHE = "'"
_FORMULA = frozenset('=+-@')  # how a formula begins; tabs and line ends are escaped
_URL = re.compile(r'[a-z][a-z0-9+.-]*://', re.IGNORECASE)
_CHANGED = ('mtime', 'LastModified', 'last_modified', 'updated', 'ETag', 'created')
"""What storages call the time of the last change, or what stands for it."""


def read_bytes(path: str | Path) -> bytes:
    """Return the content of a file or URL, or raise a ValueError that names it."""
    if is_url(str(path)):
        with _storage(str(path)) as (storage, place):
            return bytes(storage.cat_file(place))
    register_input(path)
    with file_errors(path, 'read'):
        return Path(path).read_bytes()


def check_regular(path: str | Path, most: int) -> None:
    """Raise a ValueError for a pipe or device, which may never end, and a file over `most` bytes.

    URLs are not looked at.
    """
    if is_url(str(path)):
        return
    with file_errors(path, 'read'):
        status = Path(path).stat()
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        raise ValueError(f'{path} cannot be read: it is not a regular file')
    if status.st_size > most:
        raise ValueError(f'{path} has {status.st_size} bytes, accepted are at most {most}')


def read_text(path: str | Path) -> str:
    """Return the text of a UTF-8 file, or raise a ValueError that names the file."""
    try:
        return read_bytes(path).decode('utf-8-sig')
    except UnicodeDecodeError as error:
        raise ValueError(f'{path} is not in UTF-8, accepted is a text file') from error


def checked_file_name(value: Any, name: str) -> str:
    """Return the file name of a path without folders, or raise a ValueError that calls it so."""
    if not isinstance(value, str) or not PurePath(value).name:
        raise ValueError(f'{name} is {shown(value)}, accepted is the name of a file')
    return PurePath(value).name


def csv_table(rows: Iterable[Sequence[object]]) -> bytes:
    """Return rows as CSV in UTF-8, in which no text is a formula or has control characters.

    Before a text that a spreadsheet would compute stands an apostrophe, as OWASP advises;
    `csv_text` takes it away.
    """
    file = io.StringIO()
    lines = csv.writer(file, lineterminator='\n')
    lines.writerows([_csv_cell(cell) for cell in row] for row in rows)
    return file.getvalue().encode()


def csv_text(cell: str) -> str:
    """Return the text of a cell that `csv_table` has written.

    Examples
    --------
    >>> csv_text("'=1+1"), csv_text("'a'"), csv_text('-1')
    ('=1+1', "'a'", '-1')
    """
    return cell[1:] if cell.startswith(_APOSTROPHE) and _is_formula(cell) else cell


def _csv_cell(value: object) -> object:
    if not isinstance(value, str):
        return value
    text = printable(value, len(value))
    return _APOSTROPHE + text if _is_formula(text) else text


def _is_formula(text: str) -> bool:
    """Return whether a spreadsheet would compute a text without the apostrophes before it."""
    if text.lstrip(_APOSTROPHE)[:1] not in _FORMULA:
        return False
    try:
        float(text)
    except ValueError:
        return True
    return False


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
