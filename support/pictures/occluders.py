"""Objects before targets, and reflections on them."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from ahf_ros.prints.ring import family
from ahf_ros.scenes.covers import ink_cover
from support.pictures.exposure import GAMMA, INK, WHITE, Cell, Covered, Glare, Occluder

_LABEL = 3.8  # radius of the paper that another target is printed on, dot radii
_DIRTY = 3.8  # radius of the area that dirt lies in, dot radii
_DARKEST, _MAXIMUM_LEVEL = 40.0, 235.0  # gray values of dirt, beyond those of ink and of paper


def over_sectors(count: float, gray: float, *, whole: bool = False) -> Occluder:
    """Return a wedge across the band, as wide as some sectors.

    Parameters
    ----------
    count : float
        Width of the wedge, sectors.
    gray : float
        Its gray value.
    whole : bool
        Whether its sides lie on edges of sectors, instead of anywhere.
    """

    def wedge(cell: Cell, generator: np.random.Generator) -> Covered:
        step = 2 * math.pi / cell.bits
        position = generator.integers(cell.bits) if whole else generator.uniform(0, cell.bits)
        start = cell.turn + step * position
        inner = generator.uniform(1.2, cell.inner - 0.2)
        outer = generator.uniform(cell.outer + 0.2, 4.6)
        distance = np.hypot(cell.x, cell.y)
        sides = np.minimum(_beside(cell, start), -_beside(cell, start + count * step))
        ends = np.minimum(distance - inner, outer - distance)
        return _share(np.minimum(sides, ends), cell), gray

    return wedge


def finger(width: float, gray: float) -> Occluder:
    """Return a bar, so many dot radii wide, whose round end reaches across the band."""

    def bar(cell: Cell, generator: np.random.Generator) -> Covered:
        direction = generator.uniform(0, 2 * math.pi)
        end = generator.uniform(1.2, cell.inner - 0.2) + width / 2
        along = cell.x * math.cos(direction) + cell.y * math.sin(direction)
        across = cell.y * math.cos(direction) - cell.x * math.sin(direction)
        return _share(width / 2 - np.hypot(np.minimum(along - end, 0), across), cell), gray

    return bar


def paper(distance: float, gray: float) -> Occluder:
    """Return a sheet with a straight edge at a distance from the centre, dot radii."""

    def sheet(cell: Cell, generator: np.random.Generator) -> Covered:
        direction = generator.uniform(0, 2 * math.pi)
        along = cell.x * math.cos(direction) + cell.y * math.sin(direction)
        return _share(along - distance, cell), gray

    return sheet


def disc(radius: float, gray: float) -> Occluder:
    """Return a disc on the middle of the band, of a radius in dot radii."""
    return lambda cell, generator: (_share(radius - _from_band(cell, generator), cell), gray)


def specks(count: int, widths: tuple[float, float]) -> Occluder:
    """Return so many specks of dirt of any gray value on a target, `widths` in dot radii."""
    return partial(_dirt, _speck, count, widths)


def scratches(count: int, widths: tuple[float, float]) -> Occluder:
    """Return so many straight scratches of any gray value across it, `widths` in dot radii."""
    return partial(_dirt, _scratch, count, widths)


def _dirt(
    draw: Callable[[Cell, np.random.Generator], np.ndarray],
    count: int,
    widths: tuple[float, float],
    cell: Cell,
    generator: np.random.Generator,
) -> Covered:
    covered, gray = np.zeros_like(cell.x), np.full_like(cell.x, WHITE)
    for _ in range(count):
        distance = draw(cell, generator)
        share = _share(np.float32(generator.uniform(*widths) / 2) - distance, cell)
        gray[share > 0] = generator.uniform(_DARKEST, _MAXIMUM_LEVEL)
        np.maximum(covered, share, out=covered)
    return covered, gray


def _speck(cell: Cell, generator: np.random.Generator) -> np.ndarray:
    """Return the distances of the samples from a random point of the target."""
    direction = generator.uniform(0, 2 * math.pi)
    reach = _DIRTY * math.sqrt(generator.uniform())
    x = cell.x - np.float32(reach * math.cos(direction))
    y = cell.y - np.float32(reach * math.sin(direction))
    return np.sqrt(x * x + y * y)


def _scratch(cell: Cell, generator: np.random.Generator) -> np.ndarray:
    """Return the distances of the samples from a random line across the target."""
    offset = np.float32(generator.uniform(-cell.outer, cell.outer))
    return np.abs(_beside(cell, generator.uniform(0, math.pi)) - offset)


def other_targets(
    name: str, numbers: Sequence[int], distance: float, directions: Sequence[float]
) -> Occluder:
    """Return the round papers of other targets, one after the other for each cell.

    Parameters
    ----------
    name : str
        Their family.
    numbers : sequence of int
        Their IDs.
    distance : float
        Of their centres, dot radii.
    directions : sequence of float
        To their centres, rad counter-clockwise.
    """
    code = family(name)
    others = iter(zip(numbers, directions, strict=True))

    def other(cell: Cell, generator: np.random.Generator) -> Covered:
        number, direction = next(others)
        turn = generator.uniform(0, 2 * math.pi)
        x = cell.x - np.float32(distance * math.cos(direction))
        y = cell.y - np.float32(distance * math.sin(direction))
        ink = ink_cover(code.ink(code.word(number), 0.0), turn)(
            x, y, np.eye(2, dtype=np.float32) * cell.width
        )
        gray = WHITE * (1 - (1 - INK) * ink) ** (1 / GAMMA)
        return _share(_LABEL - np.hypot(x, y), cell), gray

    return other


def highlight(radius: float, levels: float) -> Glare:
    """Return a reflection on the band that falls off smoothly.

    Parameters
    ----------
    radius : float
        Standard deviation, dot radii.
    levels : float
        Gray values that it adds in its middle.
    """

    def added(cell: Cell, generator: np.random.Generator) -> np.ndarray:
        distance = _from_band(cell, generator)
        return (levels * np.exp(-0.5 * (distance / radius) ** 2)).astype(np.float32)

    return added


def _from_band(cell: Cell, generator: np.random.Generator) -> np.ndarray:
    """Return the distances of the samples from a random place in the middle of the band."""
    direction = generator.uniform(0, 2 * math.pi)
    middle = (cell.inner + cell.outer) / 2
    x, y = middle * math.cos(direction), middle * math.sin(direction)
    return np.hypot(cell.x - np.float32(x), cell.y - np.float32(y))


def _beside(cell: Cell, direction: float) -> np.ndarray:
    """Return the distances of the samples from a line through the centre, positive to its left."""
    cosine, sine = np.float32(math.cos(direction)), np.float32(math.sin(direction))
    return cell.y * cosine - cell.x * sine


def _share(inside: np.ndarray, cell: Cell) -> np.ndarray:
    """Return the share of each sample that is covered, from the distance inside the edge."""
    share: np.ndarray = inside / np.float32(cell.width) + np.float32(0.5)
    return np.clip(share, 0, 1).astype(np.float32, copy=False)
