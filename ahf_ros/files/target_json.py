"""Identifications as JSON: what `ahf identify --json` prints, and other programs may print."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from ahf_ros.base.doubt import doubt
from ahf_ros.base.opening import Most, parsed_json, read_text, reader
from ahf_ros.base.target import DottedTarget, Identification, SquareMarker, Target, UndecodedTarget
from ahf_ros.base.target_check import (
    MAXIMUM_ID,
    MAXIMUM_LENGTH_PX,
    checked_integer,
    checked_number,
    checked_targets,
    checked_text,
)
from ahf_ros.base.text import reason_of, shown
from ahf_ros.files.files import RESULTS_FILE, checked_file_name

_NAMES = [it.name for it in fields(Target)]
_ABSENT = {'id': None, 'x': None, 'y': None, 'code': 0, 'semi_major': 0.0, 'semi_minor': 0.0}
"""What the fields of a target without a default are where they are not given."""

_REASONS = 'unread', 'uncertain', 'contested', 'unsettled'  # see `UndecodedTarget`
_MAXIMUM_DOTS = 1000  # of one target
_MAXIMUM_CELLS = 1000  # of one marker


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

    `image` is the path of the image, as the user wrote it, and `shape` its height and width, px;
    `family` is what was looked for, a family or several as the settings list them. Where images
    are identified together, `stack` holds their paths, `image` is the first, and `split` says why
    a stack was split before it. `upright` says whether images were turned as their orientation
    says. `mapping` holds the other settings of the filter, see
    `ahf_ros.identification.filtering.homomorphic.FilterSettings`.
    """
    height, width = shape
    used = asdict(identification.filter) | dict(mapping or {})
    elapsed = used.pop('duration')
    targets = identification.targets
    families = dict.fromkeys(target.family for target in targets)
    prints = [identification.prints[it] for it in families if it in identification.prints]
    readings = {it.name: dict(it.reading) for it in prints if it.reading}
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
        'looked_for': identification.looked_for,
        'detector': detector,
        'expected': identification.expected,
        'estimated': identification.estimated,
        'expected_ids': list(identification.expected_ids),
        'mirrored': identification.mirrored,
        'edge_shift': identification.edge_shift,
        'codes': readings,
        'reach': {it.name: round(it.reach, 4) for it in prints},
        'targets': [
            asdict(target) | _remarks(target, readings.get(target.family), detector)
            for target in targets
        ],
        'repeated': [asdict(target) for target in identification.repeated],
        'unsettled': [asdict(target) for target in identification.unsettled],
        'filter': used,
        'search': asdict(identification.search) if identification.search else None,
        'elapsed_s': elapsed,
    }


def _remarks(target: Target, reading: Mapping[str, Any] | None, detector: str) -> dict[str, str]:
    """Return the bits of a code, highest first, if it has any, and why a target is doubtful."""
    bits = {'bits': f'{target.code:0{reading["bits"]}b}'} if reading else {}
    why = doubt(target, detector)
    return bits | ({'doubt': why} if why else {})


def targets_from_json(content: Any, name: str) -> list[Target]:
    """Return the targets of a JSON object, whose list 'targets' holds them.

    Each of them has 'id', 'x' and 'y' and may have the other fields of `Target`, and those of
    `DottedTarget`, of `SquareMarker` or of `UndecodedTarget`. If not, a ValueError calls the
    object `name` and names the field.
    """
    if not isinstance(content, dict) or not isinstance(content.get('targets'), list):
        raise ValueError(f'{name} is not an object with a list of targets')
    items = content['targets']
    given = []
    for item in items:
        if not isinstance(item, dict):
            raise ValueError(f'{name}: target is {shown(item)}, accepted is an object')
        values = {field: item[field] for field in _NAMES if field in item}
        given.append(Target(**_ABSENT | values))
    return [
        _of_its_kind(target, item, f'{name}: target {number}')
        for number, (target, item) in enumerate(
            zip(checked_targets(given, name), items, strict=True)
        )
    ]


@reader('results of ahf identify --json')
def read_results(path: str | Path) -> dict[str, tuple[Target, ...]]:
    """Return what was identified in each image, by its name without folders.

    The file is the output of `ahf identify --json`, see `json_lines`: its objects have 'image'
    and 'targets', see `targets_from_json`. With a list 'images', the targets are those of each of
    them. A ValueError names a line that is not like that, or about an image of an earlier line.
    """
    results: dict[str, tuple[Target, ...]] = {}
    for where, content in json_lines(path):
        targets = tuple(targets_from_json(content, where))
        images = content.get('images', [content.get('image')])
        if not isinstance(images, list) or not images:
            raise ValueError(
                f'{where}: images is {shown(images)}, accepted is a list of file names'
            )
        for file in images:
            image = checked_file_name(file, f'{where}: image')
            if image in results:
                raise ValueError(
                    f'{where}: {image} was on an earlier line, accepted is one an image'
                )
            results[image] = targets
    return results


def json_lines(path: str | Path) -> Iterator[tuple[str, Any]]:
    """Yield what errors call each line of a file that is not empty, and the value of its JSON.

    A folder stands for the `RESULTS_FILE` in it, '-' for standard input. A ValueError names what
    cannot be read, or is not JSON.
    """
    if path == '-':
        try:
            text = sys.stdin.read()
        except (AttributeError, OSError, UnicodeDecodeError) as error:  # None where it is closed
            raise ValueError(f'- cannot be read: {reason_of(error)}') from error
    else:
        path = Path(path) / RESULTS_FILE if Path(path).is_dir() else path
        text = read_text(path, Most.JSON)
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip():
            where = f'{path}, line {number}'
            yield where, parsed_json(line, where)


def _of_its_kind(target: Target, item: dict[str, Any], name: str) -> Target:
    """Return a target with the fields of dotted, square or undecoded ones, if it has them."""
    known = {field: getattr(target, field) for field in _NAMES}
    if item.get('dots'):
        dots = _rows(item, 'dots', 5, _MAXIMUM_DOTS, name)
        template = checked_integer(
            item.get('template_dots', 0), f'{name}: template_dots', 0, len(dots)
        )
        known['polarity'] = known['polarity'] or 1
        return DottedTarget(**known, dots=dots, template_dots=template)
    if item.get('corners'):
        border = checked_integer(item.get('border', 1), f'{name}: border', 1, 2)
        hamming, margin = item.get('hamming'), item.get('decision_margin')
        if hamming is not None:
            hamming = checked_integer(hamming, f'{name}: hamming', 0, _MAXIMUM_CELLS)
        if margin is not None:
            margin = checked_number(margin, f'{name}: decision_margin', 0, 255)
        return SquareMarker(
            **known,
            corners=_rows(item, 'corners', 2, 4, name),
            border=border,
            hamming=hamming,
            decision_margin=margin,
        )
    if 'reason' not in item:
        return target
    if item['reason'] not in _REASONS:
        raise ValueError(
            f'{name}: reason is {shown(item["reason"])}, accepted is one of {", ".join(_REASONS)}'
        )
    likely = checked_integer(item.get('likely_id', -1), f'{name}: likely_id', -1, MAXIMUM_ID)
    family = checked_text(item.get('likely_family', ''), f'{name}: likely_family')
    return UndecodedTarget(**known, reason=item['reason'], likely_id=likely, likely_family=family)


def _rows(item: dict[str, Any], field: str, width: int, most: int, name: str) -> Any:
    """Return the rows of numbers in a field as a tuple of tuples of float."""
    rows = item[field]
    if not isinstance(rows, list) or len(rows) > most:
        raise ValueError(f'{name}: {field} is {shown(rows)}, accepted are at most {most} rows')
    for row in rows:
        if not isinstance(row, list) or len(row) != width:
            raise ValueError(
                f'{name}: {field} has {shown(row)}, accepted are rows of {width} numbers'
            )
    limit = MAXIMUM_LENGTH_PX
    return tuple(
        tuple(checked_number(it, f'{name}: {field}', -limit, limit) for it in row) for row in rows
    )
