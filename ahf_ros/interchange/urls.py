"""Files behind a URL, in whatever storage fsspec reaches: https://, s3://, memory:// and so on."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from typing import Any

from ahf_ros.text import reason_of

_URL = re.compile(r'[a-z][a-z0-9+.-]*://', re.IGNORECASE)
_CHANGED = ('mtime', 'LastModified', 'last_modified', 'updated', 'ETag', 'created')
"""What storages call the time of the last change, or what stands for it."""


def is_url(name: str) -> bool:
    """Return whether a name is a URL.

    Examples
    --------
    >>> is_url('s3://bucket/a.jpg'), is_url('C:/a.jpg'), is_url('photos/a.jpg')
    (True, False, False)
    """
    return bool(_URL.match(name))


def read_url(url: str) -> bytes:
    """Return the content of a file.

    Raises
    ------
    ValueError
        If fsspec or its driver for this storage is not installed, or the file cannot be read.
    """
    with _errors(url):
        storage, path = _storage(url)
        return bytes(storage.cat_file(path))


def url_fingerprint(url: str) -> str:
    """Return size and time of change of a file; what of them is not known is None.

    Raises
    ------
    ValueError
        As `read_url` does.
    """
    with _errors(url):
        storage, path = _storage(url)
        found = storage.info(path)
        changed = (found[name] for name in _CHANGED if found.get(name))
        return f'{found.get("size")} {next(changed, None)}'


def urls_named(url: str, suffixes: Collection[str]) -> list[str]:
    """Return the URLs that a pattern with asterisks or a folder stands for, sorted.

    Parameters
    ----------
    url : str
    suffixes : collection of str
        Endings of the files that a folder stands for, in small letters.

    Returns
    -------
    list of str
        `url` itself if it is neither a pattern nor a folder.

    Raises
    ------
    ValueError
        As `read_url` does.
    """
    with _errors(url):
        storage, path = _storage(url)
        if '*' in path:
            found = storage.glob(path)
        elif not url.lower().startswith('http') and storage.isdir(path):
            found = [it for it in storage.ls(path, detail=False) if it.lower().endswith(suffixes)]
        else:
            return [url]
        return sorted(storage.unstrip_protocol(it) for it in found)


def _storage(url: str) -> tuple[Any, str]:
    try:
        from fsspec.core import url_to_fs
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("fsspec: pip install 'ahf_ros[urls]'") from error
    storage, path = url_to_fs(url, use_listings_cache=False)
    return storage, path


@contextmanager
def _errors(url: str) -> Iterator[None]:
    """Turn what the drivers of storages raise into a ValueError that names the file."""
    try:
        yield
    except Exception as error:
        raise ValueError(f'{url} cannot be read: {reason_of(error)}') from error
