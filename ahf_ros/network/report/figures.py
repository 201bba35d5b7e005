"""Figures of a network as SVG: where targets and cameras are, and what is left of image points."""

import math
from collections.abc import Iterator, Sequence
from html import escape

import numpy as np

from ahf_ros.network.network import FloatArray
from ahf_ros.network.report.coordinates import apart, ellipse, principal_axes, round_number
from ahf_ros.network.solution import Solution

VIEW = 620, 460  # px, of a view of the network
PICTURE = 300  # px, width of a figure of an image
CELLS = 12  # columns of the map of a sensor
NAMED = 150  # targets, above which they have no names in the figures
_MARGIN = 28
_STRIP = 26  # px, below a view: its scale bars
_BAR = 120  # px, that a scale bar has at the most
_ALONE = 0.6  # of the extent of the network, below which targets are shown alone, too
_ELLIPSE = 0.025  # of the width of a view: size that the median ellipse is enlarged to
_ARROW = 0.03  # of the width of an image: size that the median residual is enlarged to


def views(solution: Solution) -> list[tuple[str, str]]:
    """Return the network from above and from the side: captions and figures.

    With control points these are along the axes of the coordinates. Without, the frame has no
    meaning, and above is the direction in which the targets extend least. Where the targets are
    small beside the network, they are shown alone, too.
    """
    axes, names = axes_of(solution)
    points = solution.state.points[solution.determined]
    cameras = solution.state.positions[solution.oriented]
    whole, alone = _extent(np.concatenate((points, cameras)), axes), _extent(points, axes)
    shown = [('From above', (0, 1), True), ('From the side', (0, 2), True)]
    if alone < _ALONE * whole:
        shown.append(('The targets alone, from above', (0, 1), False))
    unit = f' {solution.network.unit}' if solution.network.unit else ''
    figures = []
    for view, (right, up), with_cameras in shown:
        figure, step, enlarged = _view(solution, axes[[right, up]], with_cameras)
        caption = (
            f'{view}: {names[right]} to the right, {names[up]} up; grid of {step:g}{unit}. '
            f'Ellipses hold 95 %, enlarged {enlarged:,.0f} times.'
        )
        figures.append((caption, figure))
    return figures


def _extent(places: FloatArray, axes: FloatArray) -> float:
    low, high = _bounds(places @ axes[:2].T)
    return float(np.max(high - low))


def image_figure(solution: Solution, photograph: int, enlarged: float) -> str:
    """Return the residuals of a photograph as arrows; what is not used has another colour."""
    network = solution.network
    view = network.cameras[network.camera_of[photograph]]
    seen = network.observations
    rows = np.flatnonzero(seen.photograph == photograph)
    parts = []
    scale = PICTURE / view.width
    for row in rows:
        x, y = scale * (seen.xy[row] + 0.5)
        residual = solution.residuals[row]
        kind = 'arrow' if solution.state.used[row] else 'arrow lost'
        name = escape(network.targets[seen.point[row]])
        if np.isfinite(residual).all():
            dx, dy = scale * enlarged * residual
            length = math.hypot(*residual)
            title = f'<title>{name}: {length:.3f} px</title>'
            parts.append(_arrow(x, y, dx, dy, kind, title))
        else:
            parts.append(f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="2"/>')
    return _svg(PICTURE, scale * view.height, parts, 'image')


def enlargement(solution: Solution) -> float:
    """Return by how much residuals are enlarged in figures of images: a round number."""
    lengths = np.linalg.norm(solution.residuals[solution.state.used], axis=1)
    width = float(np.median([view.width for view in solution.network.cameras]))
    median = float(np.median(lengths)) if len(lengths) else 0.0
    return round_number(_ARROW * width / median) if median > 0 else 1.0


def sensor_map(solution: Solution, camera: int, enlarged: float) -> str:
    """Return a map of the sensor: the mean residual of each cell, and how often it was used."""
    network, seen = solution.network, solution.network.observations
    view = network.cameras[camera]
    scale = 1.6 * PICTURE / view.width
    side = view.width / CELLS
    down = max(1, round(view.height / side))
    rows = solution.state.used & (network.camera_of[seen.photograph] == camera)
    column = np.clip((seen.xy[rows, 0] + 0.5) / side, 0, CELLS - 1).astype(int)
    line = np.clip((seen.xy[rows, 1] + 0.5) / view.height * down, 0, down - 1).astype(int)
    cell = line * CELLS + column
    count = np.bincount(cell, minlength=CELLS * down)
    most = max(int(count.max(initial=0)), 1)
    with np.errstate(invalid='ignore'):
        means = np.column_stack(
            [
                np.bincount(cell, weights=solution.residuals[rows, axis], minlength=CELLS * down)
                / count
                for axis in (0, 1)
            ]
        )
    parts = []
    width, height = scale * side, scale * view.height / down
    for index in range(CELLS * down):
        x, y = index % CELLS * width, index // CELLS * height
        share = 0.45 * math.sqrt(count[index] / most)
        parts.append(
            f'<rect class="cell" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" '
            f'height="{height:.1f}" fill-opacity="{share:.2f}"/>'
        )
        if count[index]:
            dx, dy = scale * enlarged * means[index]
            title = f'<title>{count[index]} image points</title>'
            parts.append(_arrow(x + width / 2, y + height / 2, dx, dy, 'arrow', title))
    return _svg(scale * view.width, scale * view.height, parts, 'image')


def axes_of(solution: Solution) -> tuple[FloatArray, tuple[str, str, str]]:
    """Return the directions (3, 3) that figures have to the right, up, and towards the viewer."""
    points = solution.state.points[solution.determined]
    if solution.network.control or len(points) < 3:
        return np.eye(3), ('x', 'y', 'z')
    cameras = solution.state.positions[solution.oriented]
    towards = cameras.mean(axis=0) - points.mean(axis=0) if len(cameras) else np.zeros(3)
    return principal_axes(points, towards), ('length', 'width', 'height')


def _view(solution: Solution, axes: FloatArray, with_cameras: bool) -> tuple[str, float, float]:
    """Return a view along two directions, the step of its grid, and how it enlarges ellipses."""
    known = solution.determined
    posed = solution.oriented & with_cameras
    points = solution.state.points[known] @ axes.T
    cameras = solution.state.positions[posed] @ axes.T
    low, high = _bounds(np.concatenate((points, cameras)))
    scale = float(np.min((np.array(VIEW) - 2 * _MARGIN) / np.maximum(high - low, 1e-12)))
    middle, step = (low + high) / 2, _step(high - low)

    def placed(places: FloatArray) -> FloatArray:
        moved = (places - middle) * (scale, -scale)
        return np.asarray(moved + np.array(VIEW) / 2)

    ellipses = [ellipse(block, axes) for block in solution.point_covariances[known]]
    sizes = [major for major, _, _ in ellipses if major > 0]
    wanted = _ELLIPSE * VIEW[0] / scale
    enlarged = round_number(wanted / float(np.median(sizes))) if sizes else 1.0
    parts = list(_grid_lines(step, middle, scale))
    for index, place in zip(np.flatnonzero(posed), placed(cameras), strict=True):
        forward = solution.state.rotations[index][2] @ axes.T
        parts.append(_camera(place, forward, solution.network.photographs[index]))
    names = [solution.network.targets[index] for index in np.flatnonzero(known)]
    parts += _knowledge(solution, dict(zip(names, placed(points), strict=True)))
    written: list[tuple[float, float]] = []
    for name, (x, y), (major, minor, angle) in zip(names, placed(points), ellipses, strict=True):
        parts.append(
            f'<g class="target"><title>{escape(name)}</title><ellipse '
            f'rx="{scale * enlarged * major:.2f}" ry="{scale * enlarged * minor:.2f}" '
            f'transform="translate({x:.1f} {y:.1f}) rotate({angle:.1f})"/>'
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="1.4"/>'
        )
        if len(names) <= NAMED and apart((x, y), written):
            written.append((x, y))
            parts.append(f'<text x="{x + 4:.1f}" y="{y - 4:.1f}">{escape(name)}</text>')
        parts.append('</g>')
    unit = solution.network.unit
    parts += _scale_bar(16, scale, unit, '')
    parts += _scale_bar(VIEW[0] // 2, scale * enlarged, unit, 'ellipses: ')
    return _svg(VIEW[0], VIEW[1] + _STRIP, parts, 'view'), step, enlarged


def _scale_bar(x: float, scale: float, unit: str, of: str) -> Iterator[str]:
    """Return a bar of a round length below a view; `scale` are px for a unit."""
    length = round_number(_BAR / scale)
    y, end = VIEW[1] + 0.5 * _STRIP, x + scale * length
    yield f'<path class="bar" d="M{x:.1f} {y - 4:.1f}v8m0-4H{end:.1f}m0-4v8"/>'
    yield f'<text x="{end + 6:.1f}" y="{y + 3:.1f}">{of}{length:g} {escape(unit)}</text>'


def _knowledge(solution: Solution, places: dict[str, FloatArray]) -> Iterator[str]:
    """Return scale bars as lines and control points as squares; those of checks are dashed."""
    for bar in solution.network.bars:
        if all(end in places for end in bar.ends):
            (x, y), (u, v) = (places[end] for end in bar.ends)
            yield _known(f'M{x:.1f} {y:.1f}L{u:.1f} {v:.1f}', bar.check)
    for point in solution.network.control:
        if point.name in places:
            x, y = places[point.name]
            yield _known(f'M{x - 6:.1f} {y - 6:.1f}h12v12h-12Z', point.check)


def _known(path: str, check: bool) -> str:
    return f'<path class="known{" check" * check}" d="{path}"/>'


def _bounds(places: FloatArray) -> tuple[FloatArray, FloatArray]:
    if not len(places):
        return np.zeros(2), np.ones(2)
    return places.min(axis=0), places.max(axis=0)


def _step(extent: FloatArray) -> float:
    """Return the width of a grid of round numbers, about six lines."""
    return round_number(float(np.max(extent)) / 6) if np.max(extent) > 0 else 1.0


def _grid_lines(step: float, middle: FloatArray, scale: float) -> Iterator[str]:
    width, height = VIEW
    for axis, size in ((0, width), (1, height)):
        half = size / 2 / scale
        for number in range(
            math.ceil((middle[axis] - half) / step), math.floor((middle[axis] + half) / step) + 1
        ):
            at = (number * step - middle[axis]) * scale
            if axis == 0:
                x = width / 2 + at
                yield f'<path class="grid" d="M{x:.1f} 0V{height}"/>'
            else:
                y = height / 2 - at
                yield f'<path class="grid" d="M0 {y:.1f}H{width}"/>'


def _camera(place: FloatArray, forward: FloatArray, name: str) -> str:
    """Return a camera as a triangle that opens in its viewing direction."""
    x, y = place
    angle = math.degrees(math.atan2(-forward[1], forward[0]))
    length = 4 + 10 * float(np.hypot(*forward))
    return (
        f'<path class="camera" d="M0 0L{length:.1f} 5V-5Z" '
        f'transform="translate({x:.1f} {y:.1f}) rotate({angle:.1f})">'
        f'<title>{escape(name)}</title></path>'
    )


def _arrow(x: float, y: float, dx: float, dy: float, kind: str, title: str = '') -> str:
    return (
        f'<g class="{kind}">{title}<circle cx="{x:.1f}" cy="{y:.1f}" r="1.5"/>'
        f'<path d="M{x:.1f} {y:.1f}l{dx:.1f} {dy:.1f}"/></g>'
    )


def _svg(width: float, height: float, parts: Sequence[str], kind: str) -> str:
    return (
        f'<svg class="{kind}" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" role="img">{"".join(parts)}</svg>'
    )
