"""Identifications as JSON: what `ahf identify --json` prints, and other programs may print."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from ahf_ros.interchange.fields import checked_file_name
from ahf_ros.interchange.files import RESULTS_FILE, read_text
from ahf_ros.target import DottedTarget, Identification, SquareMarker, Target, UndecodedTarget
from ahf_ros.target_check import (
    MAXIMUM_ID,
    MAXIMUM_LENGTH_PX,
    checked_integer,
    checked_number,
    checked_targets,
    checked_text,
)
from ahf_ros.text import reason_of, shown

_FIELDS = fields(Target)
_ABSENT = {
    'code': 0,
    'semi_major': 0.0,
    'semi_minor': 0.0,
    'angle': 0.0,
    'confidence': 1.0,
    'covariance': (0.0, 0.0, 0.0, 0.0),
    'family': '',
    'edge_shift': None,
}
"""What the optional fields of a target are where they are not given."""

REASONS = ('unread', 'uncertain', 'contested')
"""Why a target is not decoded, see `ahf_ros.target.UndecodedTarget`."""

_MAXIMUM_DOTS = 1000  # of one target


def to_json(
    identification: Identification,
    image: str,
    shape: tuple[int, int],
    family: str,
    detector: str,
    stack: Sequence[str] = (),
    split: str = '',
    upright: bool = False,
    mapping: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Return the JSON object of an identification.

    Parameters
    ----------
    identification : Identification
        What was identified.
    image : str
        Path of the image, as the user wrote it.
    shape : tuple of int
        Height and width of the image, px.
    family : str
        What was looked for: a family, or several as the settings list them.
    detector : str
        Name of the detector.
    stack : sequence of str
        Paths of the images, where images are identified together; `image` is the first.
    split : str
        Why a stack was split before the first of these images; empty if it was not.
    upright : bool
        Whether images were turned as their orientation says.
    mapping : mapping of str to float, optional
        The other settings of the filter, see `ahf_ros.filtering.homomorphic.FilterSettings`.
    """
    height, width = shape
    used = asdict(identification.filter) | dict(mapping or {})
    elapsed = used.pop('duration')
    several = {}
    if stack:
        several = {
            'images': list(stack),
            'combination': identification.combination,
            'split': split,
        }
    return {
        'image': image,
        **several,
        'width': width,
        'height': height,
        'upright': upright,
        'family': family,
        'detector': detector,
        'expected': identification.expected,
        'estimated': identification.estimated,
        'expected_ids': list(identification.expected_ids),
        'mirrored': identification.mirrored,
        'edge_shift': identification.edge_shift,
        'targets': [asdict(target) for target in identification.targets],
        'filter': used,
        'search': asdict(identification.search) if identification.search else None,
        'elapsed_s': elapsed,
    }


def targets_from_json(content: Any, name: str) -> list[Target]:
    """Return the targets of a JSON object.

    Parameters
    ----------
    content : dict
        Has the list 'targets'. Each of them has 'id', 'x' and 'y' and may have the other fields
        of `Target`, and those of `DottedTarget`, of `SquareMarker` or of `UndecodedTarget`.
    name : str
        What errors call the object.

    Raises
    ------
    ValueError
        If the object is not like that or a field is not accepted; the message names the field.
    """
    if not isinstance(content, dict) or not isinstance(content.get('targets'), list):
        raise ValueError(f'{name} is not an object with a list of targets')
    targets = checked_targets(list(_targets(content['targets'], name)), name)
    return [
        _of_its_kind(target, item, f'{name}: target {number}')
        for number, (target, item) in enumerate(zip(targets, content['targets'], strict=True))
    ]


def read_results(path: str | Path) -> dict[str, tuple[Target, ...]]:
    """Return what was identified, from the output of `ahf identify --json`.

    Parameters
    ----------
    path : str or Path
        A JSON object a line with 'image' and 'targets'; these need 'id', 'x' and 'y';
        empty lines are ignored. With a list 'images', the targets are those of each of them. '-'
        stands for standard input.

    Returns
    -------
    dict of str to tuple of Target
        By the name of the image, without folders.

    Raises
    ------
    ValueError
        If the file cannot be read, a line is not as described, or two lines are about images of
        the same name; the message names both.
    """
    results: dict[str, tuple[Target, ...]] = {}
    for where, content in json_lines(path):
        targets = tuple(targets_from_json(content, where))
        for image in _image_names(content, where):
            if image in results:
                raise ValueError(
                    f'{where}: {image} was on an earlier line, accepted is one an image'
                )
            results[image] = targets
    return results


def json_lines(path: str | Path) -> Iterator[tuple[str, Any]]:
    """Yield what errors call each line of a file that is not empty, and the value of its JSON.

    A folder stands for the `RESULTS_FILE` in it.

    Raises
    ------
    ValueError
        If the file, or standard input for '-', cannot be read, or a line is not JSON.
    """
    if path != '-' and Path(path).is_dir():
        path = Path(path) / RESULTS_FILE
    text = _standard_input() if path == '-' else read_text(path)
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            continue
        where = f'{path}, line {number}'
        yield where, parsed_json(line, where)


def parsed_json(text: str, where: str) -> Any:
    """Return the value of a JSON text, or raise a ValueError that calls it `where`."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:  # also too deep, or a number too long
        raise ValueError(f'{where} is not JSON: {reason_of(error)}') from error


def _standard_input() -> str:
    try:
        return sys.stdin.read()
    except (AttributeError, OSError, UnicodeDecodeError) as error:  # None where it is closed
        raise ValueError(f'- cannot be read: {reason_of(error)}') from error


def _image_names(content: dict[str, Any], where: str) -> list[str]:
    """Return the names of the image or of the images that a line is about."""
    images = content.get('images', [content.get('image')])
    if not isinstance(images, list) or not images:
        raise ValueError(f'{where}: images is {shown(images)}, accepted is a list of file names')
    return [checked_file_name(image, f'{where}: image') for image in images]


def _targets(items: list[Any], name: str) -> Iterator[Target]:
    """Yield targets whose fields are as they were read."""
    for item in items:
        if not isinstance(item, dict):
            raise ValueError(f'{name}: target is {shown(item)}, accepted is an object')
        values = {field.name: item.get(field.name, _ABSENT.get(field.name)) for field in _FIELDS}
        yield Target(**values)


def _of_its_kind(target: Target, item: dict[str, Any], name: str) -> Target:
    """Return a target with the fields of dotted, square or undecoded ones, if it has them."""
    known = {field.name: getattr(target, field.name) for field in _FIELDS}
    if item.get('dots'):
        return DottedTarget(**known, **_dots(item, name))
    if item.get('corners'):
        corners = tuple((x, y) for x, y in _rows(item, 'corners', 2, 4, name))
        return SquareMarker(**known, corners=corners)
    if 'reason' not in item:
        return target
    if item['reason'] not in REASONS:
        raise ValueError(
            f'{name}: reason is {shown(item["reason"])}, accepted is one of {", ".join(REASONS)}'
        )
    likely = checked_integer(item.get('likely_id', -1), f'{name}: likely_id', -1, MAXIMUM_ID)
    family = checked_text(item.get('likely_family', ''), f'{name}: likely_family')
    return UndecodedTarget(**known, reason=item['reason'], likely_id=likely, likely_family=family)


def _dots(item: dict[str, Any], name: str) -> dict[str, Any]:
    dots = _rows(item, 'dots', 5, _MAXIMUM_DOTS, name)
    count = checked_integer(item.get('template_dots', 0), f'{name}: template_dots', 0, len(dots))
    polarity = checked_integer(item.get('polarity', 1), f'{name}: polarity', -1, 1)
    return {'dots': tuple(dots), 'template_dots': count, 'polarity': polarity}


def _rows(
    item: dict[str, Any], field: str, width: int, most: int, name: str
) -> list[tuple[float, ...]]:
    """Return the rows of numbers in a field."""
    rows = item[field]
    if not isinstance(rows, list) or len(rows) > most:
        raise ValueError(f'{name}: {field} is {shown(rows)}, accepted are at most {most} rows')
    checked = []
    for row in rows:
        if not isinstance(row, list) or len(row) != width:
            raise ValueError(
                f'{name}: {field} has {shown(row)}, accepted are rows of {width} numbers'
            )
        limit = MAXIMUM_LENGTH_PX
        checked.append(tuple(checked_number(it, f'{name}: {field}', -limit, limit) for it in row))
    return checked
