"""An independent reader of the SVG files of sheets: what is black, as an image."""

import math
import re
import xml.etree.ElementTree as ElementTree

import cv2
import numpy as np

SPACE = '{http://www.w3.org/2000/svg}'
_FINE = 4  # samples a pixel and axis
_SHIFT = 10  # bits of a fraction of a sample


def rastered(svg: bytes, scale: float) -> np.ndarray:
    """Return the filled paths of a page, `scale` px in a mm, without lines and texts."""
    root = ElementTree.fromstring(svg)
    width, height = (float(root.attrib[side].removesuffix('mm')) for side in ('width', 'height'))
    assert root.attrib['viewBox'] == f'0 0 {width:g} {height:g}'
    size = round(width * scale), round(height * scale)
    image = np.full((size[1] * _FINE, size[0] * _FINE), 255, np.uint8)
    for path in root.iter(f'{SPACE}path'):
        assert path.attrib['fill-rule'] == 'evenodd'
        corners = [
            np.rint((contour * scale * _FINE - 0.5) * (1 << _SHIFT)).astype(np.int32)
            for contour in contours(path.attrib['d'])
        ]
        cv2.fillPoly(image, corners, 0, shift=_SHIFT)
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def contours(commands: str) -> list[np.ndarray]:
    """Return the corners of the closed outlines of a path, arcs as many corners."""
    found: list[list[tuple[float, float]]] = []
    for letter, text in re.findall(r'([MLAZ])([^MLAZ]*)', commands):
        values = [float(value) for value in text.split()]
        if letter == 'M':
            found.append([(values[0], values[1])])
        elif letter == 'L':
            found[-1].append((values[0], values[1]))
        elif letter == 'A':
            radius, same, turn, large, sweep, *end = values
            assert (same, turn, large) == (radius, 0, 0)
            found[-1] += _arc(found[-1][-1], (end[0], end[1]), radius, sweep == 1)
    return [np.array(corners) for corners in found]


def _arc(
    start: tuple[float, float], end: tuple[float, float], radius: float, clockwise: bool
) -> list[tuple[float, float]]:
    """Return the points of an arc of less than 180 degrees after its start, y down."""
    chord = math.dist(start, end)
    away = math.sqrt(max(radius**2 - chord**2 / 4, 0)) * (1 if clockwise else -1)
    across, down = (end[0] - start[0]) / chord, (end[1] - start[1]) / chord
    x = (start[0] + end[0]) / 2 - away * down
    y = (start[1] + end[1]) / 2 + away * across
    first = math.atan2(start[1] - y, start[0] - x)
    extent = 2 * math.asin(min(chord / 2 / radius, 1)) * (1 if clockwise else -1)
    angles = first + extent * np.linspace(0, 1, 41)[1:]
    return [(x + radius * math.cos(angle), y + radius * math.sin(angle)) for angle in angles]
