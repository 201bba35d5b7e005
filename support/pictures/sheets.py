"""Sheets of targets that are occluded, glossy, faint or badly exposed, with exact truth.

A sheet is a grid of cells with one mark each. Marks and occluders are drawn in samples finer than
pixels and blurred alike by the lens. Glare is added before the sensor saturates; noise comes last.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.target import TrueTarget
from ahf_ros.prints import RING_NAMES
from ahf_ros.prints.prints import Cells
from ahf_ros.prints.ring import family
from ahf_ros.prints.square import CellPrint, dictionary
from ahf_ros.scenes.covers import Cover, ink_cover
from support.pictures.exposure import GAMMA, INK, WHITE, Cell, Exposure

Ink = Callable[[float], Cover]
"""The ink of a mark that is turned by an angle, rad."""

COLUMNS, ROWS = 9, 6
"""Cells of a whole sheet."""

CELL = 5.0
"""Half of the usual side of a cell, in dot radii."""

_SAMPLES = 3  # a pixel and axis
_SQUARE = 2.4  # half of the side of a square marker, in radii of the dot of a ring target
_PINHOLE = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """A mark on a sheet.

    Attributes
    ----------
    number : int
        ID of a target; 0 for a mark that is none.
    x, y : float
        Its centre on the sheet, px.
    plane : ndarray of float64, shape (2, 2)
        From dot radii, y up, to px.
    turn : float
        Direction in which the first sector starts, rad counter-clockwise.
    ink : ndarray of uint8, shape (n, n)
        In samples of its cell.
    """

    number: int
    x: float
    y: float
    plane: np.ndarray
    turn: float
    ink: np.ndarray = field(default_factory=lambda: np.empty((0, 0), np.uint8))


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """A grid of marks, before it is photographed.

    Attributes
    ----------
    name : str
        Family of the targets; '' where the marks are none.
    seed : int
        Of places, sizes, directions and of what happens to the sheet.
    radius : float
        Usual radius of the dots, px.
    columns : int
        Of the grid, which is filled row by row.
    spread : float
        Largest deviation of a radius, as a share of it.
    bright : bool
        Whether ink and paper have changed places.
    cell : float
        Half of the side of a cell, dot radii.
    marks : tuple of Mark
    """

    name: str
    seed: int
    radius: float = 12.0
    columns: int = COLUMNS
    spread: float = 0.1
    bright: bool = False
    cell: float = CELL
    marks: tuple[Mark, ...] = ()

    @property
    def side(self) -> int:
        """Side of a cell, px."""
        return cell_pixels(self.radius, self.cell)

    @property
    def truth(self) -> list[TrueTarget]:
        """The targets of the sheet."""
        return [TrueTarget(mark.number, mark.x, mark.y) for mark in self.marks if mark.number]

    def photograph(self, exposure: Exposure) -> np.ndarray:
        """Return an image of the sheet, ndarray of uint8; the same exposure gives the same one."""
        generator = np.random.default_rng([self.seed, 1])
        rows = -(-len(self.marks) // self.columns)
        side = self.side
        shape = rows * side, self.columns * side
        share, glare = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        share[:] = 1.0 if not self.bright else INK
        for index, mark in enumerate(self.marks):
            row, column = divmod(index, self.columns)
            top, left = row * side, column * side
            cell = slice(top, top + side), slice(left, left + side)
            share[cell], glare[cell] = self._cell(mark, (left, top), exposure, generator)
        return exposure.photograph(share, glare, generator)

    def drawn(self, inks: Iterable[tuple[int, Ink]]) -> Sheet:
        """Return the sheet with marks, each given by its number and its ink."""
        generator = np.random.default_rng([self.seed, 0])
        side, marks = self.side, []
        for index, (number, ink) in enumerate(inks):
            row, column = divmod(index, self.columns)
            middle = np.array([column + 0.5, row + 0.5]) * side - 0.5
            x, y = (middle + generator.uniform(-0.5, 0.5, 2)).tolist()
            radius = self.radius * (1 + self.spread * generator.uniform(-1, 1))
            plane = _random_plane(radius, generator)
            turn = generator.uniform(0, 2 * math.pi)
            mark = Mark(number, x, y, plane, turn)
            places = _plane_samples(mark, (column * side, row * side), side)
            jacobian = np.linalg.inv(plane) / _SAMPLES * 1.5
            share = ink(turn)(*places, jacobian.astype(np.float32))
            samples = np.rint(np.clip(share, 0, 1) * 255).astype(np.uint8)
            marks.append(replace(mark, ink=samples))
        return replace(self, marks=tuple(marks))

    def _cell(
        self,
        mark: Mark,
        corner: tuple[int, int],
        exposure: Exposure,
        generator: np.random.Generator,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the reflectance of a cell and the gray values of the glare on it."""
        ink = mark.ink.astype(np.float32) / np.float32(255)
        share = INK + (1 - INK) * ink if self.bright else 1 - (1 - INK) * ink
        size = (self.side, self.side)
        glare: np.ndarray = np.zeros(size, np.float32)
        if exposure.occluder or exposure.glare:
            cell = self._samples(mark, corner)
            if exposure.occluder:
                covered, gray = exposure.occluder(cell, generator)
                share += covered * (np.asarray((gray / WHITE) ** GAMMA, np.float32) - share)
            if exposure.glare:
                added = exposure.glare(cell, generator)
                glare = cv2.resize(added, size, interpolation=cv2.INTER_AREA)
        return cv2.resize(share, size, interpolation=cv2.INTER_AREA), glare

    def _samples(self, mark: Mark, corner: tuple[int, int]) -> Cell:
        x, y = _plane_samples(mark, corner, self.side)
        bits, inner, outer = 12, 2.25, 3.5
        if self.name in RING_NAMES:
            code = family(self.name)
            bits, inner, outer = code.bits, code.band_inner, code.band_outer
        width = 1 / _SAMPLES / self.radius
        return Cell(x, y, mark.turn, bits, inner, outer, width)


def cell_pixels(radius: float, cell: float = CELL) -> int:
    """Return the side of a cell for dots of a radius, px."""
    return 2 * math.ceil(cell * radius)


def target_sheet(
    name: str, numbers: np.ndarray | Sequence[int], seed: int, **layout: Any
) -> Sheet:
    """Return a sheet of targets.

    Parameters
    ----------
    name : str
        Family of ring codes, or of square markers.
    numbers : ndarray or sequence of int
        IDs.
    seed : int
    **layout
        Other fields of `Sheet`.
    """

    def ink(number: int) -> Ink:
        if name in RING_NAMES:
            code = family(name)
            return lambda turn: ink_cover(code.ink(code.word(number), _PINHOLE), turn)
        (cells,) = CellPrint(name).ink(number)
        assert isinstance(cells, Cells)
        return lambda turn: ink_cover([replace(cells, half_side=_SQUARE)], turn)

    every = map(int, numbers)
    return Sheet(name, seed, **layout).drawn((number, ink(number)) for number in every)


def mark_sheet(inks: Iterable[Ink], seed: int, *, radius: float = 12.0) -> Sheet:
    """Return a sheet of marks that are no targets."""
    return Sheet('', seed, radius=radius).drawn((0, ink) for ink in inks)


def random_numbers(
    name: str, count: int, seed: int, among: Sequence[int] = ()
) -> list[np.ndarray]:
    """Return the IDs of as many sheets as `count` targets fill; none twice on one sheet.

    They are some of `among`, of all where it is empty.
    """
    if among:
        every = np.array(among)
    elif name in RING_NAMES:
        every = np.sort(family(name).numbers)
    else:
        every = np.arange(len(dictionary(name).bytesList))
        every = every[every > 0]  # a mark without a target has the number 0
    generator = np.random.default_rng([seed, 2])
    size = min(COLUMNS * ROWS, len(every))
    return [
        generator.permutation(every)[: min(size, count - start)] for start in range(0, count, size)
    ]


def _random_plane(radius: float, generator: np.random.Generator) -> np.ndarray:
    """Return the map to px of a plane that is seen at up to 30 degrees, in any direction."""
    angle, aspect = generator.uniform(0, math.pi), math.cos(generator.uniform(0, math.pi / 6))
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return radius * turn @ np.diag([1.0, aspect]) @ turn.T @ np.diag([1.0, -1.0])


def _plane_samples(
    mark: Mark, corner: tuple[int, int], side: int
) -> tuple[np.ndarray, np.ndarray]:
    along = (np.arange(side * _SAMPLES) + 0.5) / _SAMPLES - 0.5
    across, down = (along + corner[0] - mark.x)[None, :], (along + corner[1] - mark.y)[:, None]
    back = np.linalg.inv(mark.plane)
    x, y = (row[0] * across + row[1] * down for row in back)
    return x.astype(np.float32), y.astype(np.float32)
