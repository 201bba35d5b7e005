"""A survey: measured photographs, the labelled marks in them, and control points."""

import os
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from ahf_ros.base.opening import reader
from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.base.target_check import checked_integer
from ahf_ros.base.text import listed, shown
from ahf_ros.files.files import checked_file_name
from ahf_ros.files.target_json import json_lines, targets_from_json

_NAMED = 10  # labels in a message

MAXIMUM_SIDE = 2**15
"""Maximum side of an image, px."""

UNKNOWN_VARIANCE = 1.0
"""Variance of a coordinate of a mark whose covariance is not known, px^2."""


@dataclass(frozen=True, slots=True)
class MeasuredImage:
    """What was identified in an image of `width` and `height` px, undecoded targets included.

    `path` is as the user wrote it.
    """

    path: str
    width: int
    height: int
    targets: tuple[Target, ...]

    @property
    def name(self) -> str:
        """Name of the file, without folders."""
        return PurePath(self.path).name


@reader('results of ahf identify --json')
def read_measured_images(path: str | Path) -> tuple[MeasuredImage, ...]:
    """Return what was identified, from the output of `ahf identify --json`, see `json_lines`.

    A stack is measured once, in its first image. A ValueError names the file or line that cannot
    be used.
    """
    return tuple(measured_image(content, where) for where, content in json_lines(path))


def measured_image(content: Any, where: str) -> MeasuredImage:
    """Return what a record of `ahf identify --json` says, with 'image', 'width' and 'height'.

    Its targets are as for `targets_from_json`. A ValueError calls the record `where`.
    """
    targets = tuple(targets_from_json(content, where))
    checked_file_name(content.get('image'), f'{where}: image')
    width, height = (
        checked_integer(content.get(name), f'{where}: {name}', 1, MAXIMUM_SIDE)
        for name in ('width', 'height')
    )
    return MeasuredImage(content['image'], width, height, targets)


@dataclass(frozen=True, slots=True)
class Control:
    """Control points as they were given: coordinates, float64 of shape (3,), by their labels.

    `crs` is the coordinate reference system, such as 'EPSG:25832'; empty for a local system in
    metres. `sigma` is the standard deviation of a coordinate, in the unit of the coordinates; 0
    where unknown.
    """

    points: Mapping[str, np.ndarray] = field(default_factory=dict)
    crs: str = ''
    sigma: float = 0.0


@dataclass(frozen=True, slots=True)
class Mark:
    """A target in a photograph, at `x`, `y` px from the origin of the format.

    `label` is the name of the point, the same in all photographs; `covariance` is variance of x,
    covariance, variance of y, px^2. `target` is what was identified, from our origin.
    """

    label: str
    x: float
    y: float
    covariance: tuple[float, float, float]
    target: Target


@dataclass(frozen=True, slots=True)
class Photograph(MeasuredImage):
    """A measured image with its marks, in the order of family and ID."""

    marks: tuple[Mark, ...]


@dataclass(frozen=True, slots=True)
class Survey:
    """What is handed over: photographs, and the labels of all points that they show.

    `control` has the coordinates of those of the points that are control points, by our label;
    `crs` and `sigma` are those of `Control`. Points are in the order of their family and ID.
    """

    photographs: tuple[Photograph, ...]
    labels: tuple[str, ...]
    control: Mapping[str, np.ndarray]
    crs: str = ''
    sigma: float = 0.0


def make_survey(
    images: Sequence[MeasuredImage], control: Control | None = None, origin: float = 0.0
) -> Survey:
    """Return a survey of what was identified.

    A point is labelled with its ID; where the images show several families, with the family and
    the ID, such as 'aicon14_7'. Undecoded targets are left out. Control points may be labelled
    with an ID, also with leading zeros, or with our label. `origin` is added to our coordinates,
    px: 0.5 where (0, 0) is the corner of the first pixel.

    A ValueError is raised if an image is there twice, has a name that does not print, or shows a
    target twice, if no image shows a target, or if the labels of the control points are ambiguous
    or none of them is that of a point.
    """
    seen = set()
    for image in images:
        if not image.path.isprintable():
            raise ValueError(f'image is {shown(image.path)}, accepted is a name that prints')
        path = os.path.abspath(image.path)  # noqa: PTH100  the file need not be there
        if path in seen:
            raise ValueError(f'{image.path!r} is there twice, accepted is one result an image')
        seen.add(path)
    targets = [it for image in images for it in image.targets if it.id != UNDECODED]
    twofold = {it.key for it in targets if it.polarity > 0}
    twofold &= {it.key for it in targets if it.polarity < 0}
    keys = sorted({_point(it, twofold) for it in targets})
    if not keys:
        raise ValueError('no image shows an identified target, accepted is at least one')
    several = len({family for family, *_ in keys}) > 1
    labels = {
        (family, number, colour): f'{family}_{number}'.lstrip('_') + colour
        if several
        else f'{number}{colour}'
        for family, number, colour in keys
    }
    photographs = tuple(_photograph(image, labels, twofold, origin) for image in images)
    known = tuple(labels.values())
    if control is None:
        return Survey(photographs, known, {})
    points = _control_points(control.points, labels)
    return Survey(
        photographs=photographs, labels=known, control=points, crs=control.crs, sigma=control.sigma
    )


def notes_on(control: Control, survey: Survey) -> list[str]:
    """Return what a user should know about control points and the points of a survey."""
    notes = []
    used = {id(point) for point in survey.control.values()}
    unseen = [label for label, point in control.points.items() if id(point) not in used]
    without = [label for label in survey.labels if label not in survey.control]
    if unseen:
        notes.append(f'control points that no image shows: {listed(unseen, _NAMED)}')
    if without:
        notes.append(f'targets that are no control points: {listed(without, _NAMED)}')
    return notes


_Point = tuple[str, int, str]  # family, ID, and what tells a bright target from a dark one


def _point(target: Target, twofold: Collection[tuple[str, int]]) -> _Point:
    """Return which point a target is; those whose family and ID have both colours are two."""
    return (*target.key, '_bright' if target.polarity < 0 and target.key in twofold else '')


def _photograph(
    image: MeasuredImage,
    labels: Mapping[_Point, str],
    twofold: Collection[tuple[str, int]],
    origin: float,
) -> Photograph:
    marks: dict[_Point, Mark] = {}
    for target in image.targets:
        if target.id == UNDECODED:
            continue
        point = _point(target, twofold)
        if point in marks:
            raise ValueError(f'{image.path} shows target {labels[point]} twice, accepted is once')
        xx, xy, _, yy = target.covariance
        known = (xx, xy, yy) if xx > 0 and yy > 0 else (UNKNOWN_VARIANCE, 0.0, UNKNOWN_VARIANCE)
        label, x, y = labels[point], target.x + origin, target.y + origin
        marks[point] = Mark(label=label, x=x, y=y, covariance=known, target=target)
    ordered = tuple(marks[key] for key in sorted(marks))
    return Photograph(image.path, image.width, image.height, image.targets, ordered)


def _control_points(
    points: Mapping[str, np.ndarray], labels: Mapping[_Point, str]
) -> dict[str, np.ndarray]:
    """Return the coordinates by our labels, from those by the labels of the list."""
    by_id = defaultdict(list)
    for (_, number, _), label in labels.items():
        by_id[number].append(label)
    ours = set(labels.values())
    found: dict[str, np.ndarray] = {}
    for given, point in points.items():
        matching = [given] if given in ours else by_id[int(given)] if given.isdecimal() else []
        if len(matching) > 1:
            raise ValueError(
                f'control point {given!r} may be {" or ".join(matching)}, accepted is one of them'
            )
        for label in matching:
            if label in found:
                raise ValueError(f'control point {label} is there twice, accepted is one')
            found[label] = point
    if not found:
        raise ValueError(
            'no control point is a target of the images: the list has '
            f'{listed(list(points), _NAMED)}, the images show '
            f'{listed(list(labels.values()), _NAMED)}'
        )
    return {label: found[label] for label in labels.values() if label in found}
