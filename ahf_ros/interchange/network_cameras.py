"""The cameras of a network: which photographs each took, and what is known of it."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ahf_ros.interchange.camera_files import CameraFile
from ahf_ros.interchange.exif import Exif
from ahf_ros.interchange.observation_files import ObservedPhotograph
from ahf_ros.interchange.tables import read_by_image
from ahf_ros.orientation.network import CameraView


@dataclass(frozen=True)
class CameraKnowledge:
    """What is known of the cameras before anything is computed.

    `names` are cameras by photograph, by path or by file name; `exif` the Exif data by path, for
    photographs that are at hand, and `sizes` their width and height. `focal_length` returns a
    start value in px for a width and a height. `calibrations` are used as they are, unless they
    are `adjusted`, too.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    exif: Mapping[str, Exif] = field(default_factory=dict)
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    calibrations: Sequence[CameraFile] = ()
    adjusted: bool = False
    focal_length: Callable[[int, int], float] | None = None


def read_cameras(path: str | Path) -> dict[str, str]:
    """Return the name of the camera of each photograph, from a table with image and camera."""
    return read_by_image(path, 'camera')


def camera_views(
    photographs: Sequence[ObservedPhotograph],
    names: Sequence[str],
    known: CameraKnowledge,
    notes: list[str],
) -> tuple[list[CameraView], list[int]]:
    """Return the cameras and which of them took each photograph.

    A camera is what `names` say, or all photographs with the same size and the same camera, serial
    number and focal length in their Exif data.
    """
    groups: dict[tuple[str, int, int], list[int]] = defaultdict(list)
    for index, photograph in enumerate(photographs):
        size = _size_of(photograph, known)
        given = known.names.get(photograph.path) or known.names.get(names[index])
        if known.names and not given:
            raise ValueError(f'{names[index]} has no camera in the table of cameras')
        exif = known.exif.get(photograph.path, Exif())
        noted = f'{exif.camera} {exif.serial_number}'.strip()
        noted += f' {exif.focal_length:.4g} mm' if exif.focal_length else ''
        key = (given or noted.strip(), size[0], size[1])
        groups[key].append(index)
    _check_names(groups, names, bool(known.names))
    sizes = {key[1:] for key in groups}
    turned = [size for size in sizes if size[::-1] in sizes and size[0] > size[1]]
    for width, height in turned:
        notes.append(
            f'portrait and landscape photographs of {width} x {height} px are taken for two '
            'cameras; identified without --upright they are one'
        )
    views, camera_of = [], [0] * len(photographs)
    for number, ((name, width, height), members) in enumerate(groups.items()):
        for index in members:
            camera_of[index] = number
        noted_by = [known.exif.get(photographs[it].path, Exif()) for it in members]
        name = name or f'{width} x {height}'
        views.append(_view(name, width, height, noted_by, known, names[members[0]]))
    return _distinct(views), camera_of


def _size_of(photograph: ObservedPhotograph, known: CameraKnowledge) -> tuple[int, int]:
    """Return width and height of a photograph, px."""
    if photograph.width:
        return photograph.width, photograph.height
    if photograph.path in known.sizes:
        return known.sizes[photograph.path]
    sizes = {(it.width, it.height) for it in known.calibrations}
    if len(sizes) == 1:
        return sizes.pop()
    raise ValueError(
        f'the size of {photograph.path} is not known, accepted are columns width and height, the '
        'photograph itself (--images says where it is), or a calibration'
    )


def _check_names(
    groups: Mapping[tuple[str, int, int], Sequence[int]], names: Sequence[str], given: bool
) -> None:
    """Raise a ValueError if photographs of one named camera have different sizes."""
    sizes: dict[str, tuple[int, int, int]] = {}
    for (name, width, height), members in groups.items():
        other = sizes.setdefault(name, (width, height, members[0]))
        if given and other[:2] != (width, height):
            raise ValueError(
                f'camera {name} has photographs of {other[0]} x {other[1]} px '
                f'({names[other[2]]}) and of {width} x {height} px ({names[members[0]]}), '
                'accepted is one size a camera'
            )


def _view(
    name: str,
    width: int,
    height: int,
    exif: Sequence[Exif],
    known: CameraKnowledge,
    photograph: str,
) -> CameraView:
    """Return what is known of a camera: a calibration, or where its focal length starts."""
    if known.calibrations:
        fitting = [it for it in known.calibrations if it.name == name] or [
            it for it in known.calibrations if (it.width, it.height) == (width, height)
        ]
        file = (fitting or list(known.calibrations))[0]
        file.check(photograph, width, height)
        if len(fitting) > 1:
            paths = ', '.join(it.path for it in fitting)
            raise ValueError(
                f'camera {name} may have any of the calibrations {paths}, accepted is one whose '
                'camera_name is that of the camera'
            )
        return CameraView(
            name, width, height, calibration=file.calibration, fixed=not known.adjusted
        )
    if known.focal_length is not None:
        return CameraView(name, width, height, known.focal_length(width, height))
    lengths = [it.pixels for it in exif if it.pixels is not None]
    return CameraView(name, width, height, float(np.median(lengths)) if lengths else None)


def _distinct(views: Sequence[CameraView]) -> list[CameraView]:
    """Return views whose names differ: those of one name are followed by their sizes."""
    count = Counter(it.name for it in views)
    return [
        it if count[it.name] == 1 else replace(it, name=f'{it.name} {it.width} x {it.height}')
        for it in views
    ]
