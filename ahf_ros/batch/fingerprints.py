"""Fingerprints of settings and files, which show whether a result is still valid."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

from ahf_ros.batch.task import ImageTask
from ahf_ros.interchange.files import read_bytes
from ahf_ros.interchange.urls import is_url, url_fingerprint
from ahf_ros.settings.nested import flat_values

_IRRELEVANT = ('threads',)  # settings that do not change results


def settings_fingerprint(task: ImageTask) -> str:
    """Return a text that differs where settings of a task lead to other results.

    Raises
    ------
    ValueError
        If the data file of the family cannot be read.

    Examples
    --------
    >>> settings_fingerprint(ImageTask(('a.jpg',))) == settings_fingerprint(ImageTask(('b.jpg',)))
    True
    """
    values = flat_values(task.settings)
    if file := task.settings.detection.family_file:
        values['family_file'] = hashlib.sha256(read_bytes(file)).hexdigest()
    values = {name: value for name, value in values.items() if name not in _IRRELEVANT}
    values |= {'stack_movement': task.stacking.stack_movement, 'stacked': task.stacked}
    values |= {'upright': task.upright}
    text = json.dumps(values, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def file_fingerprint(path: str) -> str:
    """Return size and time of change of a file; empty where it cannot be looked at.

    Examples
    --------
    >>> file_fingerprint('missing.png')
    ''
    """
    try:
        if is_url(path):
            return url_fingerprint(path)
        status = Path(path).stat()
    except (OSError, ValueError):  # ValueError: of a URL, or a zero byte in the name
        return ''
    return f'{status.st_size} {status.st_mtime_ns}'
