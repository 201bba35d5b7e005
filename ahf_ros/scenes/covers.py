"""The ink of everything that is printed on the wall, as functions of the place."""

import math
import string
from collections.abc import Callable, Sequence

import cv2
import numpy as np

from ahf_ros.prints.prints import Cells, Disc, Ring, Sectors, Shape

_CELL = 32  # side of a cell in the picture of a square marker, px
_SIDE = 256  # px of the picture of a distractor, finer than any in an image
_FINE = 3  # fractional bits of drawing coordinates

Cover = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""From points (x, y) of a mark, float32 of one shape in units of its radius, to the ink, 0 to 1.

y points up, so that angles are counter-clockwise in the image. The third argument, shape (2, 2),
is the change of (x, y) across the width of an anti-aliased edge, along the columns and the rows.
"""


def ink_cover(ink: Sequence[Shape], turn: float, growth: float = 0.0) -> Cover:
    """Return the ink of shapes, turned counter-clockwise by an angle in rad.

    `growth` is the length by which it is larger on every edge, in radii of the dot, less than half
    of a sector or a cell. The signed distance to each edge, in widths of an anti-aliased edge,
    gives the covered fraction of a sample.
    """
    cells = [shape for shape in ink if isinstance(shape, Cells)]
    if cells:
        return _cells_cover(cells[0], turn, growth)
    middle = [shape for shape in ink if not isinstance(shape, Disc) or shape.x == shape.y == 0]
    dots = [shape for shape in ink if isinstance(shape, Disc) and shape not in middle]
    cosine, sine = math.cos(turn), math.sin(turn)
    places = np.array([(dot.x, dot.y) for dot in dots]).reshape(-1, 2)
    places = places @ np.array([[cosine, sine], [-sine, cosine]])

    def cover(x: np.ndarray, y: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        inked = np.zeros_like(x)
        if middle:
            distance = np.sqrt(x * x + y * y)
            width = _edge_width(jacobian, x, y, distance)
        for shape in middle:
            if isinstance(shape, Sectors):
                _add_band(inked, shape, x, y, distance, width, jacobian, turn, growth)
            elif isinstance(shape, Ring):
                share = _inside_share(distance - np.float32(shape.inner - growth), width)
                inked += share * _inside_share(np.float32(shape.outer + growth) - distance, width)
            elif isinstance(shape, Disc):
                inked += _disc_share(shape, distance, width, growth)
        for dot, place in zip(dots, places, strict=True):
            across, up = x - np.float32(place[0]), y - np.float32(place[1])
            size = dot.radius + growth + 2 * np.abs(jacobian).sum()
            near = np.maximum(np.abs(across), np.abs(up)) < size
            across, up = across[near], up[near]
            away = np.sqrt(across * across + up * up)
            inked[near] += _disc_share(dot, away, _edge_width(jacobian, across, up, away), growth)
        return np.minimum(inked, 1, out=inked)

    return cover


def _add_band(
    inked: np.ndarray,
    band: Sectors,
    x: np.ndarray,
    y: np.ndarray,
    distance: np.ndarray,
    width: np.ndarray,
    jacobian: np.ndarray,
    turn: float,
    growth: float,
) -> None:
    """Add the ink of a band to samples, in place; distance and width are those of its edges."""
    inner, outer = np.float32(band.inner - growth), np.float32(band.outer + growth)
    margin = np.float32(2 * width.max())
    near = (distance > inner - margin) & (distance < outer + margin)
    distance, width, x, y = distance[near], width[near], x[near], y[near]
    ring = _inside_share(distance - inner, width)
    ring *= _inside_share(outer - distance, width)
    around = _edge_width(jacobian, -y, x, distance) / distance
    angle, wider = np.arctan2(y, x) - turn, np.float32(growth) / distance
    ring *= _sector_cover(np.array(band.inked), angle, around, wider)
    inked[near] += ring


def _disc_share(disc: Disc, distance: np.ndarray, width: np.ndarray, growth: float) -> np.ndarray:
    """Return the fraction of each sample that a disc covers, without its hole.

    `distance` is that from its centre, `width` that of its edge, float32.
    """
    share = _inside_share(np.float32(disc.radius + growth) - distance, width)
    if disc.hole:
        share -= _inside_share(np.float32(disc.hole - growth) - distance, width)
    return np.maximum(share, 0, out=share)


def _sector_cover(
    colours: np.ndarray, angle: np.ndarray, width: np.ndarray, growth: np.ndarray
) -> np.ndarray:
    """Return the fraction of each sample that inked sectors cover.

    For each sample there are its angle, the width of an edge and the length by which ink is
    wider, less than half of a sector, all in rad.
    """
    bits = len(colours)
    position = angle * np.float32(bits / (2 * math.pi))
    edge = np.rint(position)
    after = edge.astype(np.int32) % bits
    shades = colours.astype(np.float32)
    beyond = (position - edge) * np.float32(2 * math.pi / bits)
    share = _inside_share(beyond + growth * (shades[after] - shades[after - 1]), width)
    return shades[after] * share + shades[after - 1] * (1 - share)


def _cells_cover(cells: Cells, turn: float, growth: float) -> Cover:
    """Return the ink of a square of cells."""
    ink = np.kron(np.array(cells.inked, np.uint8) * 255, np.ones((_CELL, _CELL), np.uint8))
    side = len(ink)
    ink = _grown(np.pad(ink, _CELL), growth * side / (2 * cells.half_side))
    return stamp_cover(ink, cells.half_side * len(ink) / side, turn)


def _grown(ink: np.ndarray, growth: float) -> np.ndarray:
    """Return a picture of ink, 255, that is larger by a length in px on every edge."""
    inside, outside = (
        cv2.distanceTransform(where.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        for where in (ink > 0, ink == 0)
    )
    beyond = np.where(ink > 0, inside - 0.5, 0.5 - outside) + growth  # an edge is between pixels
    return np.rint(_inside_share(beyond, np.float32(1)) * 255).astype(np.uint8)


def card_cover(half_width: float, turn: float) -> Cover:
    """Return a regular octagon, turned counter-clockwise by an angle in rad."""
    cosine, sine = np.float32(math.cos(turn)), np.float32(math.sin(turn))

    def cover(x: np.ndarray, y: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        width = np.float32(np.sqrt(abs(np.linalg.det(jacobian))))
        across, up = np.abs(x * cosine + y * sine), np.abs(y * cosine - x * sine)
        outermost = np.maximum(np.maximum(across, up), (across + up) * np.float32(math.sqrt(0.5)))
        return _inside_share(np.float32(half_width) - outermost, width)

    return cover


def stamp_cover(stamp: np.ndarray, half_side: float, turn: float) -> Cover:
    """Return the ink of a picture, uint8, shape (side, side), with 255 where there is ink.

    Half its side is in radii of the mark; it is turned counter-clockwise by an angle in rad.
    """
    cosine, sine = np.float32(math.cos(turn)), np.float32(math.sin(turn))
    half = np.float32(len(stamp) / 2)
    scale = half / np.float32(half_side)
    ink = stamp.astype(np.float32) / np.float32(255)

    def cover(x: np.ndarray, y: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        sample = float(np.sqrt(abs(np.linalg.det(jacobian)))) * float(scale)
        smooth = cv2.GaussianBlur(ink, (0, 0), max(sample / 2, 0.5))
        columns = (x * cosine + y * sine) * scale + (half - np.float32(0.5))
        rows = (x * sine - y * cosine) * scale + (half - np.float32(0.5))
        return cv2.remap(smooth, columns, rows, cv2.INTER_LINEAR)

    return cover


def _edge_width(
    jacobian: np.ndarray, x: np.ndarray, y: np.ndarray, distance: np.ndarray
) -> np.ndarray:
    """Return the width of an edge perpendicular to (x, y), a vector of length `distance`."""
    form = jacobian @ jacobian.T
    squared = x * (form[0, 0] * x + 2 * form[0, 1] * y) + form[1, 1] * y * y
    width: np.ndarray = np.sqrt(squared) / np.maximum(distance, np.float32(1e-6))
    return np.maximum(width, np.float32(1e-6), out=width)


def _inside_share(distance: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return the fraction of each sample on the positive side of an edge."""
    share: np.ndarray = distance / width + np.float32(0.5)
    return np.clip(share, 0, 1, out=share)


def distractor_cover(generator: np.random.Generator) -> tuple[Cover, float]:
    """Return the ink of a random distractor in the unit circle, and its radius in dot radii.

    Distractors are marks that are not coded targets: plain dots, rings, text, leaves.
    """
    kinds = ((_draw_dot, 1.0), (_draw_ring, 2.0), (_draw_text, 3.0), (_draw_leaf, 4.0))
    draw, radius = kinds[generator.integers(len(kinds))]
    stamp = np.zeros((_SIDE, _SIDE), np.uint8)
    draw(stamp, generator)
    turned = generator.uniform(0, 2 * math.pi)
    return stamp_cover(stamp, 1.0, turned), radius * generator.uniform(0.6, 1.3)


def _fixed(points: np.ndarray) -> np.ndarray:
    """Return points of the unit circle as fixed-point drawing coordinates."""
    pixels = (np.asarray(points) + 1) * (_SIDE / 2) - 0.5
    return np.rint(pixels * 2**_FINE).astype(np.int32)


def _draw_disc(stamp: np.ndarray, radius: float, shade: int) -> None:
    middle = tuple(_fixed(np.zeros(2)).tolist())
    cv2.circle(stamp, middle, int(radius * _SIDE / 2 * 2**_FINE), shade, -1, cv2.LINE_AA, _FINE)


def _draw_dot(stamp: np.ndarray, _generator: np.random.Generator) -> None:
    _draw_disc(stamp, 0.95, 255)


def _draw_ring(stamp: np.ndarray, generator: np.random.Generator) -> None:
    """Draw a closed ring, like a letter O or a washer."""
    _draw_disc(stamp, 0.95, 255)
    _draw_disc(stamp, 0.95 * generator.uniform(0.4, 0.8), 0)


def _draw_text(stamp: np.ndarray, generator: np.random.Generator) -> None:
    characters = np.array(list(string.ascii_uppercase + string.digits))
    count = int(generator.integers(1, 4))
    height = 1.3 / count
    for line in range(count):
        text = ''.join(generator.choice(characters, int(generator.integers(2, 6))))
        font, weight = cv2.FONT_HERSHEY_DUPLEX, int(generator.integers(2, 6))
        (width, ascent), _ = cv2.getTextSize(text, font, 1.0, weight)
        scale = min(1.2 * _SIDE / 2 / width, 0.7 * height * _SIDE / 2 / ascent)
        baseline = (-0.65 + height * (line + 0.8) + 1) * _SIDE / 2
        origin = (int(0.2 * _SIDE), int(baseline))
        cv2.putText(stamp, text, origin, font, scale, 255, weight, cv2.LINE_AA)


def _draw_leaf(stamp: np.ndarray, generator: np.random.Generator) -> None:
    """Draw a pointed leaf with a stalk, lighter than ink and with a light vein."""
    along = np.linspace(0, 1, 40)
    breadth = generator.uniform(0.2, 0.45)
    edge = breadth * np.sin(math.pi * along ** generator.uniform(0.6, 1.0))
    bend = generator.uniform(-0.3, 0.3) * np.sin(math.pi * along)
    spine = np.stack((1.3 * along - 0.4, bend), axis=1)
    side = np.stack((np.zeros_like(edge), edge), axis=1)
    outline = np.concatenate((spine + side, (spine - side)[::-1]))
    shade = int(generator.integers(120, 240))
    cv2.fillPoly(stamp, [_fixed(outline)], shade, cv2.LINE_AA, _FINE)
    stalk = np.array([[-0.9, generator.uniform(-0.2, 0.2)], [-0.4, 0.0]])
    cv2.polylines(stamp, [_fixed(stalk)], False, shade, 6, cv2.LINE_AA, _FINE)
    cv2.polylines(stamp, [_fixed(spine)], False, shade // 2, 3, cv2.LINE_AA, _FINE)
