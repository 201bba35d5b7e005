"""A network from files: image points, cameras, scale bars and control points."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from ahf_ros.interchange.network_cameras import CameraKnowledge, camera_views
from ahf_ros.interchange.observation_files import ImagePoint, ObservedPhotograph
from ahf_ros.orientation.network import (
    ControlPoint,
    Network,
    Observations,
    ScaleBar,
    once_a_photograph,
    without,
)
from ahf_ros.text import counted

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
