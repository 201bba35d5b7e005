"""Where the discs of rings of dots may be, judged by a glance at disc and border.

Any dot may be a disc, and any circle one of the edges of a border. Most are not: of the steps of
ln I at disc and border, as the design has them, only targets show nearly all. Discs are looked for
where edges are left that no known target explains and that are not straight.

Any light has steps. Those of a target lie on three circles at once and have one height.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ahf_ros.families.contract import DetectorSettings
from ahf_ros.prints.dots import DotRingPrint
from ahf_ros.vision.dot_search import voted_dots, whole_dots
from ahf_ros.vision.dots import NO_DOTS, Dots, distinct
from ahf_ros.vision.frame import circle_outlines, ellipse_axes, enlarged, scaled
from ahf_ros.vision.log_edges import LOG_SCALE, LogEdges, mask_of
from ahf_ros.vision.pyramid import ImagePyramid
from ahf_ros.vision.robust import medians
from ahf_ros.vision.sampling import sample_circles
from ahf_ros.vision.small_dots import BLURRED, LARGEST, small_dots

_STRAIGHT = 8.0  # length of an edge that is no small dot's, px of the image at half its size
_TILE = 64  # side, px of the image at half its size
_MINIMUM_EDGES = 20  # of four tiles, px; disc and border of the smallest target have twice as many

_SCALES = np.geomspace(0.76, 1.32, 11)  # of the radius of a disc, in radii of its candidate
_MINIMUM_SHARE = 0.55  # of the steps of ln at disc and border; lattices of light reach 0.54
_MARGIN = 0.3  # about the border of a known target, disc radii

_RAYS = 20
_ANGLES = 2 * np.pi * np.arange(_RAYS) / _RAYS
MINIMUM_STEP = 0.12  # step of ln of a disc
_EDGE_SIDES = 5  # radii between which the edges lie
_PART = 500_000  # samples at a time, which bounds the memory


def open_regions(edges: LogEdges, outlines: np.ndarray) -> list[tuple[slice, slice]]:
    """Return the regions that hold edges which nothing explains, rows and columns of each.

    Edges, outlines of what is known, shape (k, m, 2), and regions, which may overlap, are in px of
    the image at half its size.
    """
    height, width = edges.marked.shape
    rest = edges.unmasked(mask_of(outlines, edges.marked.shape)).curved(_STRAIGHT)
    rows, columns = -(-height // _TILE), -(-width // _TILE)
    of_tiles = np.bincount(
        rest.y // _TILE * columns + rest.x // _TILE, minlength=rows * columns
    ).reshape(rows, columns)
    of_four = 4 * cv2.blur(of_tiles.astype(np.float32), (2, 2), borderType=cv2.BORDER_CONSTANT)
    wide = cv2.dilate((of_four >= _MINIMUM_EDGES).astype(np.uint8), np.ones((3, 3), np.uint8))
    contours, _ = cv2.findContours(wide, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    boxes = [cv2.boundingRect(contour) for contour in contours]
    return [
        (
            slice(_TILE * top, min(_TILE * (top + tall), height)),
            slice(_TILE * left, min(_TILE * (left + across), width)),
        )
        for left, top, across, tall in boxes
    ]


def whole_discs(
    pyramid: ImagePyramid, settings: DetectorSettings, code: DotRingPrint, _known: np.ndarray
) -> Dots:
    """Return dots with a whole outline, which may be a disc or the border of one."""
    low, high = settings.radii
    circles = whole_dots(pyramid, low, high * code.border_radius, (1, -1))
    found = []
    # The outer edge of the border has the polarity of the disc, the inner one the opposite.
    for radius, side in ((1.0, 1), (code.border_radius, 1), (code.ground_radius, -1)):
        frames = circles.frames.copy()
        frames[:, :2, :2] /= radius
        found.append(replace(circles, frames=frames, polarity=side * circles.polarity))
    dots = Dots.joined(found)
    major = ellipse_axes(dots.frames)[0]
    of_size = (major * _SCALES[-1] >= low) & (major * _SCALES[0] <= high)
    return dots.select(of_size & np.isin(dots.polarity, settings.polarities))


def voted_discs(
    pyramid: ImagePyramid, settings: DetectorSettings, code: DotRingPrint, known: np.ndarray
) -> Dots:
    """Return dots whose outline edges of light interrupt, outside of known targets."""
    outlines = _outlines(known, code, _MARGIN)
    return voted_dots(pyramid, *settings.radii, settings.polarities, outlines)


def small_discs(
    pyramid: ImagePyramid, settings: DetectorSettings, code: DotRingPrint, known: np.ndarray
) -> Dots:
    """Return small dots, and those seen at steep angles, where edges are left to explain."""
    # Edges of light end at a target, and look like no straight ones there.
    margin = 2 * _STRAIGHT / np.maximum(ellipse_axes(known)[1], 1)
    outlines = (_outlines(known, code, margin) + 0.5) / 2 - 0.5
    found = [NO_DOTS]
    for region in open_regions(pyramid.edges[0], outlines):
        found += _blobs(pyramid, region, settings)
    return Dots.joined(found)


def _outlines(known: np.ndarray, code: DotRingPrint, margin: float | np.ndarray) -> np.ndarray:
    """Return polygons about targets, px of the image, at a distance in disc radii."""
    return circle_outlines(known, np.zeros(len(known)) + code.border_radius + margin)


def _blobs(
    pyramid: ImagePyramid, region: tuple[slice, slice], settings: DetectorSettings
) -> list[Dots]:
    """Return the blobs of a region of the image at half its size, there and at full size."""
    low, high = settings.radii
    found = []
    for level in (0, 1):
        scale = 2**level
        smallest, largest = BLURRED * low / scale, min(high / scale, LARGEST)
        if smallest > largest:
            continue
        rows, columns = (slice(2 * it.start // scale, 2 * it.stop // scale) for it in region)
        log = np.ascontiguousarray(pyramid.logs[level][rows, columns])
        blobs = small_dots(log, smallest, largest, settings.polarities, LOG_SCALE)
        frames = blobs.frames.copy()
        frames[:, :2, 2] += (columns.start, rows.start)
        found.append(replace(blobs, frames=enlarged(frames, level)))
    return found


def judged(pyramid: ImagePyramid, dots: Dots, known: np.ndarray, code: DotRingPrint) -> Dots:
    """Return the dots outside of known targets about which a border is seen.

    Their radius is the one that fits disc and border best, their share that of the expected steps.
    No two of them are the same.
    """
    outside = np.ones(len(dots.frames), bool)
    for back in np.linalg.inv(known):
        x, y, depth = back @ dots.frames[:, :, 2].T
        outside &= x * x + y * y >= (code.border_radius * depth) ** 2
    dots = dots.select(outside)
    scores = border_steps(pyramid.logs[0], dots.frames, dots.polarity, code, _SCALES)
    smooth = scores.copy()
    smooth[:, 1:-1] = (scores[:, :-2] + 2 * scores[:, 1:-1] + scores[:, 2:]) / 4
    best = smooth.argmax(axis=1)
    share = scores[np.arange(len(best)), best]
    good = share > _MINIMUM_SHARE
    frames = scaled(dots.frames, _SCALES[best])
    return distinct(Dots(frames[good], dots.polarity[good], share[good]))


def border_steps(
    log: np.ndarray,
    frames: np.ndarray,
    polarity: np.ndarray,
    code: DotRingPrint,
    scales: np.ndarray,
) -> np.ndarray:
    """Return the mean step of ln I at the edges of disc and border, in steps of the disc.

    Parameters
    ----------
    log : ndarray of int16, shape (height, width)
        LOG_SCALE ln(I + 8).
    frames : ndarray of float64, shape (k, 3, 3)
        Of the discs.
    polarity : ndarray of int, shape (k,)
    code : DotRingPrint
    scales : ndarray of float, shape (n,)
        Radii that the discs may have, in radii of the frames.

    Returns
    -------
    ndarray of float64, shape (k, n)
        At most 1.
    """
    gap = (code.dot_circle - code.dot_radius - 1) / 2
    ground = (code.dot_circle + code.dot_radius + code.ground_radius) / 2
    ink = (code.ground_radius + code.border_radius) / 2
    beside = np.array([1 - gap, 1 + gap, ground, ink, 2 * code.border_radius - ink])
    radii = (scales[:, None] * beside).ravel()
    count = max(_PART // (_RAYS * len(radii)), 1)
    parts = [
        _mean_steps(sample_circles(log, frames[part], _ANGLES, radii), polarity[part], len(scales))
        for part in (slice(it, it + count) for it in range(0, max(len(frames), 1), count))
    ]
    return np.concatenate(parts)


def _mean_steps(values: np.ndarray, polarity: np.ndarray, count: int) -> np.ndarray:
    """Return the mean steps from values of the log on rays, shape (k, rays, 5 count)."""
    values = values.reshape(len(values), _RAYS, count, _EDGE_SIDES).astype(np.float32)
    steps = values[..., [1, 2, 4]] - values[..., [0, 3, 3]]
    steps *= (polarity / LOG_SCALE)[:, None, None, None]
    usual = medians(steps[..., 0].swapaxes(1, 2).reshape(-1, _RAYS)).reshape(-1, count)
    usual = np.maximum(usual, MINIMUM_STEP)
    means: np.ndarray = np.clip(steps / usual[:, None, :, None], -1, 1).mean(axis=(1, 3))
    return means.astype(np.float64)
