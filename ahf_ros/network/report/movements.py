"""Movements of targets between two epochs, as a picture in SVG."""

import math
from collections.abc import Iterator
from html import escape

import numpy as np

from ahf_ros.network.congruence import Comparison, Movement
from ahf_ros.network.network import FloatArray
from ahf_ros.network.report.coordinates import (
    CONFIDENCE,
    apart,
    ellipse,
    principal_axes,
    round_number,
)

_VIEW = 700.0  # px, width and largest height of a view
_MARGIN = 60.0
_LINE = 18.0  # px, height of a line of text
_ARROW = 0.12  # of the width: the longest movement or ellipse
_SLIM = 0.25  # of the width: least height of a view

_STYLE = """
text { font: 12px sans-serif; fill: #222; }
.still { stroke: #2a7d2a; fill: #2a7d2a; }
.moved { stroke: #c81e1e; fill: #c81e1e; }
ellipse { fill-opacity: 0.12; stroke-width: 1; }
path { stroke-width: 2; fill: none; }
.scale { stroke: #222; }
text.moved { stroke: none; font-weight: bold; }
"""


def movements_figure(comparison: Comparison) -> str:
    """Return a picture of the movements with the ellipses that hold 95 % of their errors, SVG.

    The targets are seen from above and from the side: above is the direction in which they extend
    least. Movements and ellipses are enlarged alike, and an ellipse is about the end of its
    movement: where it holds the target, the movement is no more than its errors in this view.
    """
    places = np.array([it.place for it in comparison.movements])
    axes = principal_axes(places, np.array((0.0, 0.0, 1.0)))
    flat = (places - places.mean(axis=0)) @ axes.T
    scale = (_VIEW - 2 * _MARGIN) / float(np.ptp(flat[:, 0]))
    longest = max(_size(it) for it in comparison.movements)
    enlarged = round_number(_ARROW * _VIEW / scale / longest) if longest > 0 else 1.0
    parts: list[str] = []
    top = 0.0
    for title, second in (('From above', 1), ('From the side', 2)):
        height = max(scale * float(np.ptp(flat[:, second])), _SLIM * _VIEW) + 2 * _MARGIN
        parts.append(f'<text x="10" y="{top + _LINE:.0f}">{title}</text>')
        origin = np.array([_VIEW / 2, top + height / 2])
        middle = (flat.max(axis=0) + flat.min(axis=0))[[0, second]] / 2
        centres = origin + scale * (flat[:, [0, second]] - middle) * (1, -1)
        named: list[tuple[float, float]] = []
        pairs = zip(comparison.movements, centres.tolist(), strict=True)
        for item, (x, y) in sorted(pairs, key=lambda it: -it[0].moved):
            parts.append(_target(item, axes[[0, second]], (x, y), scale * enlarged))
            if apart((x, y), named):
                named.append((x, y))
                shown = 'class="moved" ' if item.moved else ''
                name = escape(item.name)
                parts.append(f'<text {shown}x="{x + 5:.1f}" y="{y - 5:.1f}">{name}</text>')
        top += height
    parts.extend(_scale_bar(top, scale, enlarged, comparison.unit))
    height = top + 3 * _LINE
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_VIEW:.0f} {height:.0f}" '
        f'width="{_VIEW:.0f}" height="{height:.0f}"><style>{_STYLE}</style>'
        f'<rect width="100%" height="100%" fill="#fff"/>{"".join(parts)}</svg>\n'
    )


def _size(item: Movement) -> float:
    """Return the length of a movement, or the major semi-axis of its ellipse if that is longer."""
    largest = float(np.linalg.eigvalsh(item.covariance)[-1])
    return max(item.length, CONFIDENCE * math.sqrt(max(largest, 0.0)))


def _target(item: Movement, axes: FloatArray, place: tuple[float, float], scale: float) -> str:
    """Return place, movement and ellipse of a target in a view along two axes."""
    kind = 'moved' if item.moved else 'still'
    major, minor, angle = ellipse(item.covariance, axes)
    (x, y), (across, down) = place, np.add(place, scale * (axes @ item.xyz) * (1, -1))
    return (
        f'<g class="{kind}"><title>{escape(item.name)}</title>'
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2"/><path d="M{x:.1f} {y:.1f}L{across:.1f} '
        f'{down:.1f}"/><ellipse rx="{scale * major:.2f}" ry="{scale * minor:.2f}" '
        f'transform="translate({across:.1f} {down:.1f}) rotate({angle:.1f})"/></g>'
    )


def _scale_bar(top: float, scale: float, enlarged: float, unit: str) -> Iterator[str]:
    """Yield bars of round lengths, of the object and of the movements, with their texts."""
    unit = f' {unit}' if unit else ''
    wanted = _VIEW / 6
    for row, (name, factor) in enumerate((('targets', scale), ('movements', scale * enlarged))):
        length = round_number(wanted / factor)
        y = top + (row + 0.7) * _LINE
        width = factor * length
        yield f'<path class="scale" d="M10 {y:.1f}h{width:.1f}"/>'
        text = f'{length:g}{unit} of the {name}'
        if name == 'movements':
            text += f', enlarged {enlarged:,.0f} times; ellipses hold 95 %'
        yield f'<text x="{width + 18:.1f}" y="{y + 4:.1f}">{text}</text>'
