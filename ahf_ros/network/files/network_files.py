"""A network from files: image points, cameras, scale bars and control points."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath

import numpy as np

from ahf_ros.base.text import counted
from ahf_ros.files.exif import Exif
from ahf_ros.files.tables import read_by_image
from ahf_ros.network.files.camera_files import CameraFile
from ahf_ros.network.files.observation_files import ImagePoint, ObservedPhotograph
from ahf_ros.network.network import (
    CameraView,
    ControlPoint,
    Network,
    Observations,
    ScaleBar,
    once_a_photograph,
    without,
)

_SINGULAR = 1e-9  # least ratio of the variances of an image point along its axes


def make_network(
    photographs: Sequence[ObservedPhotograph],
    cameras: CameraKnowledge | None = None,
    bars: Sequence[ScaleBar] = (),
    control: Sequence[ControlPoint] = (),
    *,
    unit: str = 'mm',
    sigma: float = 0.1,
) -> tuple[Network, list[str]]:
    """Return the network of what was observed and is known, and notes for its user.

    `sigma`, px, counts for image points whose covariance is not known. Both points of an ID that
    is twice in a photograph are set aside, and those with a singular covariance. Bars and control
    points that no photograph shows are left out, and named in the notes. A ValueError is raised
    if the size of a photograph is not known or not that of its calibration, or if bars or control
    points are given and none of them is seen.
    """
    notes: list[str] = []
    names = _photograph_names(photographs)
    views, camera_of = camera_views(photographs, names, cameras or CameraKnowledge(), notes)
    labels = _labels(photographs)
    rows: list[tuple[int, str, ImagePoint]] = []
    for index, photograph in enumerate(photographs):
        rows += [(index, labels(point), point) for point in photograph.points]
    targets = sorted({label for _, label, _ in rows}, key=_order)
    numbers = {label: index for index, label in enumerate(targets)}
    unknown = sum(point.covariance is None for *_, point in rows)
    if unknown:
        notes.append(f'{counted(unknown, "image point")} without covariance: {sigma:g} px assumed')
    assumed = sigma**2 * np.eye(2)
    known_bars = _seen_bars(bars, _by_id(targets), notes)
    known_control = _seen_control(control, _by_id(targets), notes)
    scaled = (
        any(not it.check for it in known_bars) or sum(not it.check for it in known_control) > 1
    )
    network = Network(
        photographs=tuple(names),
        camera_of=np.array(camera_of, np.int64),
        cameras=tuple(views),
        targets=tuple(targets),
        observations=Observations(
            photograph=np.array([index for index, _, _ in rows], np.int64),
            point=np.array([numbers[label] for _, label, _ in rows], np.int64),
            xy=np.array([it.xy for *_, it in rows], float).reshape(-1, 2),
            covariance=np.array(
                [assumed if it.covariance is None else it.covariance for *_, it in rows], float
            ).reshape(-1, 2, 2),
        ),
        bars=known_bars,
        control=known_control,
        unit=unit if scaled else '',
    )
    network = once_a_photograph(network)
    least, most = np.linalg.eigvalsh(network.observations.covariance).T
    singular = ~(least > _SINGULAR * most)
    return without(network, singular, 'its covariance is singular'), notes


def _photograph_names(photographs: Sequence[ObservedPhotograph]) -> list[str]:
    """Return names of files where these differ, and paths where they do not."""
    short = [PurePath(it.path).name for it in photographs]
    return short if len(set(short)) == len(short) else [it.path for it in photographs]


def _labels(photographs: Sequence[ObservedPhotograph]) -> Callable[[ImagePoint], str]:
    """Return what names targets: their IDs, with their families where there are several."""
    families = {point.family for it in photographs for point in it.points}
    if len(families) < 2:
        return lambda point: point.name
    return lambda point: f'{point.family}:{point.name}' if point.family else point.name


def _order(label: str) -> tuple[str, int, str]:
    """Return what sorts labels by family and by number."""
    family, _, number = label.rpartition(':')
    return (family, int(number), '') if number.isdecimal() else (family, -1, number)


def _by_id(targets: Sequence[str]) -> Callable[[str], str | None]:
    """Return what finds the label of a target by its label, or by its ID where that is enough."""
    labels = set(targets)
    by_id: dict[str, list[str]] = defaultdict(list)
    for label in targets:
        by_id[label.rpartition(':')[2]].append(label)

    def found(given: str) -> str | None:
        if given in labels:
            return given
        number = given.lstrip('0') or '0' if given.isdecimal() else given
        matching = by_id.get(given) or by_id.get(number) or []
        if len(matching) > 1:
            raise ValueError(f'{given!r} may be {" or ".join(matching)}, accepted is one of them')
        return matching[0] if matching else None

    return found


def _seen_bars(
    bars: Sequence[ScaleBar], label: Callable[[str], str | None], notes: list[str]
) -> tuple[ScaleBar, ...]:
    """Return the bars both of whose ends are seen, and note the others."""
    seen = []
    for bar in bars:
        ends = [label(end) for end in bar.ends]
        missing = [given for given, end in zip(bar.ends, ends, strict=True) if end is None]
        if ends[0] is not None and ends[1] is not None:
            seen.append(replace(bar, ends=(ends[0], ends[1])))
        else:
            notes.append(
                f'scale bar {bar.ends[0]} to {bar.ends[1]} is not used: no photograph shows '
                f'{" or ".join(missing)}'
            )
    if bars and not seen:
        raise ValueError(
            'no scale bar has both ends in a photograph, accepted is at least one: '
            + '; '.join(notes[-len(bars) :])
        )
    return tuple(seen)


def _seen_control(
    control: Sequence[ControlPoint], label: Callable[[str], str | None], notes: list[str]
) -> tuple[ControlPoint, ...]:
    """Return the control points that are seen, and note the others."""
    seen: dict[str, ControlPoint] = {}
    unseen = []
    for point in control:
        name = label(point.name)
        if name is None:
            unseen.append(point.name)
        elif name in seen:
            raise ValueError(f'control point {name} is there twice, accepted is once')
        else:
            seen[name] = replace(point, name=name)
    if control and not seen:
        raise ValueError(
            'no control point is in a photograph, accepted is at least one: '
            + ', '.join(unseen[:10])
        )
    if unseen:
        notes.append(f'control points that no photograph shows: {", ".join(unseen)}')
    return tuple(seen.values())


@dataclass(frozen=True)
class CameraKnowledge:
    """What is known of the cameras before anything is computed.

    `names` are cameras by photograph, by path or by file name; `exif` the Exif data by path, for
    photographs that are at hand, and `sizes` their width and height. `focal_length` returns a
    start value in px for a width and a height. `calibrations` are used as they are, unless they
    are `adjusted`, too. Without calibrations, lenses may be `equidistant`.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    exif: Mapping[str, Exif] = field(default_factory=dict)
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    calibrations: Sequence[CameraFile] = ()
    adjusted: bool = False
    focal_length: Callable[[int, int], float] | None = None
    equidistant: bool = False


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
            name,
            width,
            height,
            calibration=file.calibration,
            fixed=not known.adjusted,
            equidistant=file.equidistant,
        )
    if known.focal_length is not None:
        focal: float | None = known.focal_length(width, height)
    else:
        lengths = [it.pixels for it in exif if it.pixels is not None]
        focal = float(np.median(lengths)) if lengths else None
    return CameraView(name, width, height, focal, equidistant=known.equidistant)


def _distinct(views: Sequence[CameraView]) -> list[CameraView]:
    """Return views whose names differ: those of one name are followed by their sizes."""
    count = Counter(it.name for it in views)
    return [
        it if count[it.name] == 1 else replace(it, name=f'{it.name} {it.width} x {it.height}')
        for it in views
    ]
