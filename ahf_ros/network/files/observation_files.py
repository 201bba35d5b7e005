"""Image points of targets, as `ahf identify --json` prints them or as CSV of other programs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.base.opening import reader
from ahf_ros.base.target import UNDECODED
from ahf_ros.base.target_check import MAXIMUM_LENGTH_PX
from ahf_ros.base.text import shown
from ahf_ros.files.files import checked_file_name
from ahf_ros.files.tables import Row, one_of, read_table
from ahf_ros.files.target_json import json_lines
from ahf_ros.network.export.survey import MAXIMUM_SIDE, measured_image
from ahf_ros.network.network import FloatArray

_PRECISIONS = (('sigma',), ('sigma_x', 'sigma_y'), ('variance_x', 'covariance_xy', 'variance_y'))
"""Columns of a table that say how precise its image points are; one of these groups."""

_SIZE = 'width', 'height'


@dataclass(frozen=True)
class ImagePoint:
    """Where a photograph shows a target: family, ID as text, (x, y) in px and its covariance.

    (0, 0) is the centre of the first pixel. The covariance is None where it is not known.
    """

    family: str
    name: str
    xy: tuple[float, float]
    covariance: FloatArray | None


@dataclass(frozen=True)
class ObservedPhotograph:
    """The image points of a photograph, whose path is as the user wrote it.

    Width and height, px, are 0 where they are not known. `upright` says whether it was turned.
    """

    path: str
    width: int
    height: int
    points: tuple[ImagePoint, ...]
    upright: bool = False


@reader('results of ahf identify --json, or a table that ends with .csv')
def read_observations(path: str | Path, origin: float = 0.0) -> tuple[ObservedPhotograph, ...]:
    """Return the photographs in a file with their image points.

    A file that ends with .csv is a table with the columns image, id, x and y; width and height,
    family, and sigma (px), sigma_x and sigma_y, or variance_x, covariance_xy and variance_y may be
    there, too. `origin` is what its coordinates are at the centre of the first pixel. Any other
    file is the output of `ahf identify --json`, in which a stack is measured once, in its first
    image. A ValueError names the file or line that cannot be used.
    """
    if str(path).lower().endswith('.csv'):
        photographs = _of_table(path, origin)
    else:
        photographs = [_of_record(content, where) for where, content in json_lines(path)]
    seen: set[str] = set()
    for photograph in photographs:
        if photograph.path in seen:
            raise ValueError(f'{path}: {photograph.path} is there twice, accepted is once')
        seen.add(photograph.path)
    if not any(it.points for it in photographs):
        raise ValueError(
            f'{path} has no identified target, accepted are photographs that show some'
        )
    return tuple(photographs)


def _of_record(content: Any, where: str) -> ObservedPhotograph:
    """Return the photograph of a record of `ahf identify --json`."""
    targets = content.get('targets') if isinstance(content, dict) else None
    for holder, fields in ((content, ('image', 'width', 'height', 'targets')), *_items(targets)):
        if missing := [name for name in fields if name not in holder]:
            raise ValueError(
                f'{where} has no {missing[0]!r}, accepted are results of ahf identify --json of '
                'this version; identify the photographs again'
            )
    image = measured_image(content, where)
    points = [
        ImagePoint(it.family, str(it.id), (it.x, it.y), _known(it.covariance))
        for it in image.targets
        if it.id != UNDECODED
    ]
    upright = content.get('upright') is True
    return ObservedPhotograph(image.path, image.width, image.height, tuple(points), upright)


def _items(targets: Any) -> Iterator[tuple[Any, tuple[str, ...]]]:
    for target in targets if isinstance(targets, list) else []:
        if isinstance(target, dict) and target.get('id') != UNDECODED:
            yield target, ('covariance',)


def _known(covariance: Sequence[float]) -> FloatArray | None:
    """Return a covariance of detectors, for which zero means that it is not known."""
    matrix = np.array(covariance, float).reshape(2, 2)
    return matrix if matrix.any() else None


def _of_table(path: str | Path, origin: float) -> list[ObservedPhotograph]:
    columns, rows = read_table(path, ('image', 'id', 'x', 'y'))
    precision = one_of(path, columns, _PRECISIONS)
    sized = one_of(path, columns, [_SIZE]) == 0
    points: dict[str, list[ImagePoint]] = {}
    sizes: dict[str, tuple[int, int]] = {}
    for row in rows:
        image = row.text('image')
        checked_file_name(image, f'{row.where}: image')
        width, height = (row.integer(it, 1, MAXIMUM_SIDE) if sized else 0 for it in _SIZE)
        size = width, height
        if sizes.setdefault(image, size) != size:
            raise ValueError(
                f'{row.where}: {image} has the size {size[0]} x {size[1]} px, above it was '
                f'{sizes[image][0]} x {sizes[image][1]} px'
            )
        points.setdefault(image, []).append(_point(row, precision, origin))
    return [ObservedPhotograph(name, *sizes[name], tuple(it)) for name, it in points.items()]


def _point(row: Row, precision: int, origin: float) -> ImagePoint:
    x, y = row.number('x') - origin, row.number('y') - origin
    if max(abs(x), abs(y)) > MAXIMUM_LENGTH_PX:
        raise ValueError(
            f'{row.where}: x, y are {x:g}, {y:g}, accepted are at most {MAXIMUM_LENGTH_PX:g} px'
        )
    covariance = None
    if precision == 0:
        covariance = row.positive('sigma') ** 2 * np.eye(2)
    elif precision == 1:
        covariance = np.diag([row.positive('sigma_x') ** 2, row.positive('sigma_y') ** 2])
    elif precision == 2:
        xx, xy, yy = (row.number(name) for name in _PRECISIONS[2])
        covariance = np.array([[xx, xy], [xy, yy]])
        if not (xx > 0 and yy > 0 and xx * yy > xy * xy):
            raise ValueError(
                f'{row.where}: the covariance is {shown([xx, xy, yy])}, accepted is one that is '
                'positive definite'
            )
    return ImagePoint(row.cells.get('family', ''), row.label('id'), (x, y), covariance)
