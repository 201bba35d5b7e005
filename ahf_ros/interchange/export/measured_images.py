"""Images with the targets that were identified in them, from an identification or its JSON."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ahf_ros.interchange.fields import checked_file_name, parsed_integer
from ahf_ros.interchange.target_json import json_lines, targets_from_json
from ahf_ros.target import Target

MAXIMUM_SIDE = 2**15
"""Maximum side of an image, px."""


@dataclass(frozen=True, slots=True)
class MeasuredImage:
    """What was identified in an image.

    Attributes
    ----------
    path : str
        Path of the image, as the user wrote it.
    width, height : int
        Size of the image, px.
    targets : tuple of Target
        Undecoded ones may be among them.

    Examples
    --------
    >>> MeasuredImage('photos/a.jpg', 6000, 4000, ()).targets
    ()
    """

    path: str
    width: int
    height: int
    targets: tuple[Target, ...]


def read_measured_images(path: str | Path) -> tuple[MeasuredImage, ...]:
    """Return what was identified, from the output of `ahf identify --json`.

    Parameters
    ----------
    path : str or Path
        A JSON object a line with 'image', 'width', 'height' and 'targets', whose 'id', 'x' and
        'y' are required. A stack is measured once, in its first image. '-' stands for standard
        input.

    Returns
    -------
    tuple of MeasuredImage

    Raises
    ------
    ValueError
        If the file cannot be read or a line is not as described; the message names both.
    """
    return tuple(measured_image(content, where) for where, content in json_lines(path))


def measured_image(content: Any, where: str) -> MeasuredImage:
    """Return what a record of `ahf identify --json` says, see `read_measured_images`.

    Parameters
    ----------
    content : dict
    where : str
        What errors call the record.

    Raises
    ------
    ValueError
        If the record is not as described.
    """
    targets = tuple(targets_from_json(content, where))
    checked_file_name(content.get('image'), f'{where}: image')
    width, height = (
        parsed_integer(content.get(name), f'{where}: {name}', 1, MAXIMUM_SIDE)
        for name in ('width', 'height')
    )
    return MeasuredImage(content['image'], width, height, targets)
