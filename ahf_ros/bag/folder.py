"""The files of a bag, and what its metadata say of them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from ahf_ros.bag.compression import zstd
from ahf_ros.bag.mcap import Mcap
from ahf_ros.bag.records import BagFile, Lost
from ahf_ros.bag.ros1 import Ros1
from ahf_ros.bag.sqlite import Sqlite
from ahf_ros.text import reason_of

METADATA = 'metadata.yaml'

MALFORMED = (OSError, YAMLError, LookupError, TypeError, ValueError, RecursionError)
"""What reading metadata that are missing, damaged or of another kind raises."""

_KINDS: dict[str, Callable[[Path], BagFile]] = {'.bag': Ros1, '.db3': Sqlite, '.mcap': Mcap}
_COMPRESSED = '.zstd'
_PART = 2**20  # bytes that are decompressed at once
_SHARE = 2  # of the free disk space, the part that a decompressed file may take


@dataclass(frozen=True, slots=True)
class Metadata:
    """What metadata.yaml says.

    Attributes
    ----------
    files : tuple of str
        Names of the files, in their order; empty where it does not say.
    compressed : bool or None
        Whether every message is compressed; None where it does not say.
    counts : dict of str to int
        Number of messages by topic.
    custom : dict of str to str
        What somebody has added.
    """

    files: tuple[str, ...] = ()
    compressed: bool | None = None
    counts: dict[str, int] = field(default_factory=dict)
    custom: dict[str, str] = field(default_factory=dict)


def read_metadata(folder: Path) -> Metadata:
    """Return what the metadata of a bag say.

    Raises
    ------
    ValueError
        If there are none, or they are not as ROS 2 writes them.
    """
    try:
        about = load_metadata(folder)['rosbag2_bagfile_information']
        counts: dict[str, int] = {}
        for item in about['topics_with_message_count']:
            topic = str(item['topic_metadata']['name'])
            counts[topic] = counts.get(topic, 0) + int(item['message_count'])
        custom = about.get('custom_data') or {}
        return Metadata(
            tuple(PurePath(name).name for name in about['relative_file_paths']),
            str(about.get('compression_mode', '')).lower() == 'message',
            counts,
            {str(name): str(value) for name, value in custom.items()},
        )
    except (*MALFORMED, AttributeError, OverflowError) as error:
        raise ValueError(f'{METADATA}: {reason_of(error)}') from error


def load_metadata(folder: Path) -> Any:
    """Return the content of the metadata of a bag; raises what `MALFORMED` lists."""
    text = (folder / METADATA).read_text(encoding='utf-8')
    try:
        return json.loads(text)  # as this package writes it; YAML takes far longer to parse
    except ValueError:
        return YAML(typ='safe').load(text)


def open_files(
    path: Path, names: tuple[str, ...], scratch: Path
) -> tuple[list[BagFile], list[Lost]]:
    """Open the files of a bag.

    Parameters
    ----------
    path : Path
        Folder or file.
    names : tuple of str
        Of the files in the folder; empty for all, in the order of their time.
    scratch : Path
        Folder for what has to be decompressed.

    Returns
    -------
    list of BagFile
    list of Lost
        The files that cannot be opened.

    Raises
    ------
    ValueError
        If none can be opened; the message names the bag and says why.
    """
    paths = [path / name for name in names] if names else [path]
    if path.is_dir() and not names:
        paths = sorted(it for it in path.iterdir() if _kind(it) in _KINDS)
    files: list[BagFile] = []
    lost: list[Lost] = []
    for file in paths:
        try:
            files.append(_opened(file, scratch, lost))
        except Exception as error:
            # Damaged files make a library raise anything.
            reason = str(error) if isinstance(error, ValueError) else reason_of(error)
            lost.append(Lost((), None, None, f'{file.name} cannot be read: {reason}'))
    if not files:
        why = '; '.join(it.reason for it in lost) or 'it holds no files .bag, .db3 or .mcap'
        raise ValueError(f'{path} is not a bag that can be read: {why}')
    return (files if names else sorted(files, key=lambda file: file.start)), lost


def unlisted_files(path: Path, names: tuple[str, ...]) -> list[str]:
    """Return a line about each file of a bag that its metadata do not list, if they list any."""
    if not names:
        return []
    found = sorted(it.name for it in path.iterdir() if _kind(it) in _KINDS)
    return [f'{name}, which {METADATA} does not list' for name in found if name not in names]


def _kind(path: Path) -> str:
    return Path(path.stem).suffix if path.suffix == _COMPRESSED else path.suffix


def _opened(path: Path, scratch: Path, lost: list[Lost]) -> BagFile:
    """Open a file, decompressed where it is compressed."""
    kind = _kind(path)
    if kind not in _KINDS:
        raise ValueError(f'its ending is {path.suffix!r}, accepted is {", ".join(_KINDS)}')
    if not path.is_dir() and path.exists() and not path.is_file():
        raise ValueError('it is not a regular file')
    if path.suffix == _COMPRESSED:
        path = _decompressed(path, scratch, lost)
    return _KINDS[kind](path)


def _decompressed(path: Path, scratch: Path, lost: list[Lost]) -> Path:
    """Return a decompressed copy of a file, up to where it is damaged."""
    copy = scratch / path.stem
    limit = shutil.disk_usage(scratch).free // _SHARE
    with copy.open('wb') as target:
        try:
            with zstd.open(path, 'rb') as source:
                while part := source.read(_PART):
                    if target.tell() > limit:
                        raise ValueError(f'it has more than {limit} bytes when decompressed')
                    target.write(part)
        except (EOFError, ValueError, zstd.ZstdError) as error:
            lost.append(Lost((), None, None, f'{path.name}: {error}'))
    return copy
