"""Marks that look like ring targets and are none, and clutter."""

import math
import string
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from ahf_ros.prints.ring import BITS, RingPrint, sectors
from ahf_ros.scenes.covers import Cover, ink_cover, stamp_cover
from support.pictures.sheets import CELL, Ink

_FINE = 61  # sectors of arcs of any length; a prime, so that they meet no sectors of a family
_SHIFTS = np.linspace(-0.2, 0.2, 41)  # of edges, dot radii
_APART = 0.15  # of radii from those that a shift of edges explains, dot radii
_SIDE = 256  # px of a stamp
_MIDDLE = (_SIDE // 2, _SIDE // 2)
_REACH = 3.8  # half of the side of clutter, dot radii


def random_arcs(family: RingPrint, generator: np.random.Generator) -> Ink:
    """Return a dot, and arcs of any length in the band of a family."""
    edges = np.sort(generator.choice(_FINE, 2 * generator.integers(2, 6), replace=False))
    inked = np.searchsorted(edges, np.arange(_FINE), side='right') % 2
    return _ring(replace(family, bits=_FINE), int(inked @ (1 << np.arange(_FINE))))


def other_sectors(family: RingPrint, generator: np.random.Generator) -> Ink:
    """Return a dot and a band whose number of sectors is not that of a family."""
    while True:
        bits = int(generator.integers(BITS[0], BITS[1] + 1))
        word = int(generator.integers(1, (1 << bits) - 1))
        if not _fits(word, bits, family.bits):
            return _ring(replace(family, bits=bits), word)


def other_words(family: RingPrint, generator: np.random.Generator) -> Ink:
    """Return a dot and a band with a word that a family does not have."""
    while True:
        word = int(generator.integers(1, (1 << family.bits) - 1))
        if family.number(word) is None:
            return _ring(family, word)


def other_radii(family: RingPrint, generator: np.random.Generator) -> Ink:
    """Return a dot and a codeword of a family in a band whose radii no shift of edges explains."""
    word = int(generator.choice(family.words))
    inner, outer = family.band
    explained = np.stack([inner - _SHIFTS, outer + _SHIFTS], axis=1) / (1 + _SHIFTS[:, None])
    while True:
        start = generator.uniform(1.4, 2.8)
        band = start, start + generator.uniform(0.45, 1.4)
        if np.abs(explained - band).max(axis=1).min() > _APART:
            return _ring(replace(family, band_inner=band[0], band_outer=band[1]), word)


def two_bands(family: RingPrint, generator: np.random.Generator) -> Ink:
    """Return a dot and two bands, as RAD targets have, of as many sectors as a family has."""
    radii = 1 + np.cumsum(generator.uniform(0.3, 0.8, 4))
    words = generator.integers(1, (1 << family.bits) - 1, 2).tolist()
    first, second = (
        _ring(replace(family, band_inner=inner, band_outer=outer), word)
        for (inner, outer), word in zip(radii.reshape(2, 2).tolist(), words, strict=True)
    )

    def ink(turn: float) -> Cover:
        covers = first(turn), second(turn)
        return lambda *place: np.maximum(*(cover(*place) for cover in covers))

    return ink


def cctag(_family: RingPrint, generator: np.random.Generator) -> Ink:
    """Return concentric circles of three or four rings, about paper or about a dot."""
    stamp = np.zeros((_SIDE, _SIDE), np.uint8)
    widths = generator.uniform(1, 3, 2 * generator.integers(3, 5))
    radii = np.cumsum(widths) / widths.sum()
    first = int(generator.integers(2))
    for index, radius in enumerate(radii[::-1].tolist()):
        _circle(stamp, 0.95 * radius, 255 * ((index + first + 1) % 2))
    return lambda turn: stamp_cover(stamp, min(1 / radii[0], CELL - 0.2), turn)


def clutter(_family: RingPrint, generator: np.random.Generator) -> Ink:
    """Return a matrix code, text, a gear, a clock, a dartboard, a bar code or closed rings."""
    kinds = (_matrix_code, _text, _gear, _clock, _dartboard, _bars, _closed_rings)
    stamp = np.zeros((_SIDE, _SIDE), np.uint8)
    kinds[generator.integers(len(kinds))](stamp, generator)
    return lambda turn: stamp_cover(stamp, _REACH, turn)


LOOKALIKES: dict[str, Callable[[RingPrint, np.random.Generator], Ink]] = {
    'random arcs': random_arcs,
    'other numbers of sectors': other_sectors,
    'other words': other_words,
    'other radii of the band': other_radii,
    'two bands (RAD)': two_bands,
    'concentric circles (CCTag)': cctag,
    'clutter': clutter,
}
"""Kinds of marks that are no targets of a family."""


def _ring(family: RingPrint, word: int) -> Ink:
    return lambda turn: ink_cover(family.ink(word, 0.05), turn)


def _fits(word: int, bits: int, others: int) -> bool:
    """Return whether all edges of a word lie on edges of another number of sectors."""
    marked = sectors(word, bits)
    edges = np.flatnonzero(marked != np.roll(marked, 1)) * others
    return any(np.all((edges - shift) % bits == 0) for shift in range(bits))


def _points(radii: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return the corners of a polygon about the middle of a stamp, radii in half sides."""
    places = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1)
    return np.rint((places + 1) * _SIDE / 2).astype(np.int32)


def _circle(stamp: np.ndarray, radius: float, shade: int, width: int = -1) -> None:
    cv2.circle(stamp, _MIDDLE, round(radius * _SIDE / 2), shade, width, cv2.LINE_AA)


def _matrix_code(stamp: np.ndarray, generator: np.random.Generator) -> None:
    cells = generator.integers(0, 2, (21, 21)).astype(np.uint8)
    for top, left in ((0, 0), (0, 14), (14, 0)):
        cells[max(top - 1, 0) : top + 8, max(left - 1, 0) : left + 8] = 0
        cells[top : top + 7, left : left + 7] = 1
        cells[top + 1 : top + 6, left + 1 : left + 6] = 0
        cells[top + 2 : top + 5, left + 2 : left + 5] = 1
    stamp[:] = cv2.resize(255 * cells, stamp.shape, interpolation=cv2.INTER_NEAREST)


def _text(stamp: np.ndarray, generator: np.random.Generator) -> None:
    letters = np.array(list(string.ascii_letters + string.digits))
    for line in range(5):
        text = ''.join(generator.choice(letters, 9))
        scale = generator.uniform(1.0, 1.5)
        origin = (4, 45 + 48 * line)
        cv2.putText(stamp, text, origin, cv2.FONT_HERSHEY_DUPLEX, scale, 255, 3, cv2.LINE_AA)


def _gear(stamp: np.ndarray, generator: np.random.Generator) -> None:
    angles = np.linspace(0, 2 * math.pi, 720, endpoint=False)
    teeth = generator.integers(8, 25)
    radii = np.where(np.sin(teeth * angles) > 0, 0.92, generator.uniform(0.6, 0.75))
    cv2.fillPoly(stamp, [_points(radii, angles)], 255, cv2.LINE_AA)
    _circle(stamp, generator.uniform(0.4, 0.58), 0)
    _circle(stamp, generator.uniform(0.2, 0.3), 255)


def _clock(stamp: np.ndarray, generator: np.random.Generator) -> None:
    for mark in range(12):
        angle, width = mark * math.pi / 6, generator.uniform(0.02, 0.15)
        angles = angle + np.array([-width, width, width, -width])
        corners = _points(np.array([0.6, 0.6, 0.9, 0.9]), angles)
        cv2.fillPoly(stamp, [corners], 255, cv2.LINE_AA)
    for length in (0.4, 0.55):
        end = _points(np.array([length]), generator.uniform(0, 2 * math.pi, 1))[0]
        cv2.line(stamp, _MIDDLE, end.tolist(), 255, 8, cv2.LINE_AA)
    _circle(stamp, 0.26, 255)


def _dartboard(stamp: np.ndarray, generator: np.random.Generator) -> None:
    number = int(generator.choice([10, 12, 14, 16, 20]))
    step = 2 * math.pi / number
    for inner, outer, first in ((0.0, 0.6, 0), (0.6, 0.92, 1)):
        for sector in range(first, number, 2):
            angles = np.linspace(sector * step, (sector + 1) * step, 20)
            radii = np.concatenate([np.full(20, inner), np.full(20, outer)])
            corners = _points(radii, np.concatenate([angles, angles[::-1]]))
            cv2.fillPoly(stamp, [corners], 255, cv2.LINE_AA)
    _circle(stamp, generator.uniform(0.4, 0.58), 0)
    _circle(stamp, 0.26, 255)


def _bars(stamp: np.ndarray, generator: np.random.Generator) -> None:
    widths = generator.integers(3, 14, 30)
    starts = np.cumsum(widths)
    for start, width in zip(starts[:-1:2], widths[1::2], strict=True):
        stamp[20:-20, start : start + width] = 255


def _closed_rings(stamp: np.ndarray, generator: np.random.Generator) -> None:
    radii = np.sort(generator.uniform(0.15, 0.95, 2 * generator.integers(1, 4)))[::-1]
    for index, radius in enumerate(radii):
        _circle(stamp, radius, 255 * (1 - index % 2))
    _circle(stamp, min(0.26, 0.8 * radii[-1]), 255)
