"""Write the pictures of the documentation, docs/pictures/, from rendered scenes and the package.

PYTHONPATH=. .venv/bin/python scripts/write_pictures.py [NAME ...]
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ahf_ros import ImageStack, SceneSettings, create_detector, create_identifier, render
from ahf_ros.families.contract import DetectorSettings
from ahf_ros.families.ring.circles import REACH
from ahf_ros.families.ring.decoding import Words, decode
from ahf_ros.families.ring.detector import find_hypotheses
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.families.ring.light import predicted_light
from ahf_ros.families.ring.likelihood import (
    Evidence,
    edge_evidence,
    level_evidence,
)
from ahf_ros.families.ring.polar import angles_of, on_circles, polar_images
from ahf_ros.identification.filtering.homomorphic import HomomorphicFilter
from ahf_ros.prints.designs import contours
from ahf_ros.prints.families import print_in
from ahf_ros.prints.printing.drawing import Drawing, Ink
from ahf_ros.prints.printing.files import svg_bytes
from ahf_ros.prints.ring import canonical, family
from ahf_ros.scenes.patterns import LIGHT_NAMES
from ahf_ros.vision.circle_fit import fit_dots
from ahf_ros.vision.dot_search import voted_dots, whole_dots
from ahf_ros.vision.frame import circle_outlines, project
from ahf_ros.vision.logarithm import logarithm
from ahf_ros.vision.pyramid import image_pyramid
from ahf_ros.vision.sampling import sample, sample_circles
from ahf_ros.vision.stack import COMBINATIONS

FOLDER = Path(__file__).resolve().parent.parent / 'docs' / 'pictures'
DPI = 110
TABLE = family('metashape12')
SIDE = 24.0  # of the picture of a target, mm

SCENE = SceneSettings(
    width=640,
    height=400,
    targets=6,
    dot_radius=14.0,
    light='stripe',
    ambient=0.12,
    texture=0.0,
    full_well=100000.0,
    seed=2,
)
"""The scene of docs/get_started.md."""

FAMILIES = {
    'metashape12': 17,
    'aicon14': 7,
    'cct12': 71,
    'gsi': 18,
    'dots': 23,
    'cctag3': 9,
    'aruco_4x4_50': 7,
    'apriltag_36h11': 7,
}
"""A target of each kind."""


def targets() -> None:
    """Write a target of each kind, as it is printed."""
    for name, content in printed().items():
        (FOLDER / f'{name}.svg').write_bytes(content)


def printed() -> dict[str, bytes]:
    """Return the picture of each family."""
    contents = {}
    for name, number in FAMILIES.items():
        design = print_in(name).design
        radius = SIDE / 2 / design.proportions.quiet_zone
        outlines = contours(design.ink(design.word(number)))
        ink = Ink(f'{name} {number}', SIDE / 2, SIDE / 2, radius, outlines)
        page = Drawing(SIDE, SIDE, (ink,), (), ())
        contents[name] = svg_bytes(page, ink.name)
    return contents


def lights() -> Figure:
    """Return a part of a scene under each pattern of light."""
    figure, panels = _panels(2, (len(LIGHT_NAMES) + 1) // 2, 2.1, 2.3)
    for panel, name in zip(panels, LIGHT_NAMES, strict=True):
        scene = SceneSettings(width=400, height=400, targets=2, dot_radius=14.0, light=name)
        _show(panel, render(replace(scene, ambient=0.12, seed=3)).image, name)
    return figure


def homomorphic() -> Figure:
    """Return an image, its logarithm, and what the filter found by a search makes of it."""
    image = render(SCENE).image
    found = create_identifier(detector='traditional', expected_targets=6).identify(image)
    chosen = found.filter
    gains = (chosen.gamma_high, chosen.gamma_low, chosen.cutoff, chosen.attenuation)
    filtered = HomomorphicFilter(image).filtered(*gains)
    detector = create_detector('traditional')
    figure, panels = _panels(1, 3, 3.6, 2.6)
    _show(panels[0], image, f'image: {len(detector(image))} of 6 identified')
    _show(panels[1], logarithm(image, 1 / 255), 'logarithm')
    _show(panels[2], filtered, f'filtered: {len(detector(filtered))} of 6 identified')
    return figure


def search() -> Figure:
    """Return what `traditional` identifies by the two gains of the paper, and a search."""
    image = render(SCENE).image
    detector, prepared = create_detector('traditional'), HomomorphicFilter(image)
    high, low = np.linspace(1, 4, 16), np.linspace(0, 1, 21)
    counts = [[len(detector(prepared.filtered(h, v))) for h in high] for v in low]
    identifier = create_identifier(
        detector='traditional', expected_targets=6, search='published', threads=1
    )
    identifier.identify(image)
    assert identifier.last_search
    figure = Figure(figsize=(6.4, 3.2), layout='constrained')
    panel = figure.subplots()
    shown = panel.pcolormesh(high, low, counts, cmap='viridis', vmin=0, vmax=6)
    tried = np.array(identifier.last_search.tried)
    panel.plot(*tried.T, 'wx', markersize=5)
    panel.plot(*identifier.last_search.values, 'ro', markersize=9, fillstyle='none')
    panel.set(xlabel='gamma_high', ylabel='gamma_low')
    figure.colorbar(shown, label='targets identified')
    return figure


def dots() -> Figure:
    """Return the dots that whole outlines give, and those that votes give."""
    image = render(SCENE).image
    minimum, maximum = DetectorSettings(family=SCENE.family).radii
    pyramid = image_pyramid(image, maximum)
    whole = whole_dots(pyramid, minimum, maximum, (1,))
    known = circle_outlines(whole.frames, np.full(len(whole.frames), 1.4))
    voted = voted_dots(pyramid, minimum, maximum, (1,), explained=known)
    figure, panels = _panels(1, 2, 5.2, 3.4)
    for panel, some, title in zip(
        panels, (whole, voted), ('whole outlines', 'votes'), strict=True
    ):
        _show(panel, image, f'{title}: {len(some.frames)}')
        for outline in circle_outlines(some.frames, np.ones(len(some.frames))):
            panel.plot(*np.vstack((outline, outline[:1])).T, color='tab:orange', linewidth=1.5)
    return figure


def reading() -> Figure:
    """Return a target that is covered in part, its polar image, the evidence, and its word."""
    image = _covered(render(SCENE).image, *_certain(render(SCENE).image, 320).frames[0, :2, 2])
    best = _certain(image, 320)
    evidence, words = _evidence(image.astype(np.float32), best)
    figure = Figure(figsize=(9, 3.9), layout='constrained')
    grid = figure.subplot_mosaic('ab;ac;ad', width_ratios=(1, 2), height_ratios=(3, 2, 1))
    for panel in grid.values():
        panel.set_xticks(())
        panel.set_yticks(())
    _show(grid['a'], image, f'target {canonical(best.words, TABLE)[1][0]}')
    for radius in (1.0, *TABLE.band):
        (outline,) = circle_outlines(best.frames, np.array([radius]))
        grid['a'].plot(*np.vstack((outline, outline[:1])).T, color='tab:orange', linewidth=1)
    x, y = best.frames[0, :2, 2]
    grid['a'].set(xlim=(x - 62, x + 62), ylim=(y + 62, y - 62))
    radii = np.linspace(4.0, 0.5, 70)
    (strip,) = sample_circles(image.astype(np.float32), best.frames, angles_of(480), radii)
    grid['b'].imshow(strip.T, cmap='gray', aspect='auto', extent=(0, 360, 0.5, 4.0))
    for radius in TABLE.band:
        grid['b'].axhline(radius, color='tab:orange', linewidth=1)
    grid['b'].set(ylabel='radius', title='polar image, counter-clockwise')
    at = np.linspace(0, 360, evidence.paper.shape[2])
    grid['c'].axhline(0, color='silver', linewidth=1)
    grid['c'].plot(at, evidence.paper[0].sum(axis=0), color='tab:blue', label='paper')
    grid['c'].plot(at, evidence.ink[0].sum(axis=0), color='black', label='ink')
    grid['c'].set(xlim=(0, 360), ylabel='evidence')
    grid['c'].legend(loc='lower left', fontsize=8)
    _word(grid['d'], words)
    return figure


def light() -> Figure:
    """Return a target, the light that its ground predicts, and what is left without it."""
    image = render(replace(SCENE, light='lattice', light_scale=0.5)).image.astype(np.float32)
    frames = _certain(image, 320).frames
    reach = TABLE.band_outer + 0.6
    along = np.linspace(-reach, reach, 300)
    x, y = np.meshgrid(along, along)
    (seen,) = sample(image, project(frames, np.stack((x, y), axis=-1)))
    angles, radii = np.linspace(-np.pi, np.pi, 720), np.linspace(0.01, reach, 200)
    (polar,), (spread,) = predicted_light(image, frames, np.zeros(1), angles, radii, TABLE.band)
    polar = np.where(np.isfinite(spread), polar, np.nan)
    row = (np.arctan2(y, x) + np.pi) / (2 * np.pi) * (len(angles) - 1)
    column = np.hypot(x, y) / reach * (len(radii) - 1)
    places = column.astype(np.float32), row.astype(np.float32)
    known = cv2.remap(polar.T, *places, cv2.INTER_LINEAR)
    outside = np.hypot(x, y) > reach
    figure, panels = _panels(1, 3, 3.0, 3.2)
    for panel, values, brightest, title in (
        (panels[0], seen, 255, 'target under a lattice'),
        (panels[1], known, 255, 'light predicted by its ground'),
        (panels[2], seen / np.maximum(known, 1), 1.3, 'their ratio: the ink'),
    ):
        shown = np.where(outside, np.nan, values)
        panel.imshow(shown, cmap='gray', vmin=0, vmax=brightest)
        panel.set_title(title, fontsize=10)
    return figure


def _certain(image: np.ndarray, x: float) -> Hypotheses:
    """Return what the target was read as that is nearest to a column of the image."""
    found = find_hypotheses(image, DetectorSettings(family=SCENE.family))
    found = found.select(found.certain)
    return found.select(np.argmin(np.abs(found.frames[:, 0, 2] - x), keepdims=True))


def _covered(image: np.ndarray, x: float, y: float) -> np.ndarray:
    """Return an image with a gray strip across the band of the target at a place."""
    covered = image.copy()
    left, middle = round(x), round(y)
    covered[middle - 8 : middle + 12, left - 70 : left - 34] = 140
    return covered


def _evidence(gray: np.ndarray, best: Hypotheses) -> tuple[Evidence, Words]:
    """Return the evidence for paper and ink of a band, and its word."""
    angles = angles_of(TABLE.bits * 10)
    dot = fit_dots(gray, best.frames, best.polarity, rays=24, reach=REACH, rounds=1)
    dot = replace(dot, frames=best.frames)
    polar = polar_images(gray, dot, TABLE.band, len(angles))
    growth = best.polarity * best.edge_shift / dot.size
    edges = edge_evidence(polar, np.ones(1), growth, TABLE.band)
    radii = np.array([0.3, 0.6, 1.5, 1.8, 2.5, 2.75, 3.0, 3.25, 3.8, 4.1])
    levels, _ = on_circles(gray, best.frames, angles, radii, polar.lift)
    known = predicted_light(gray, best.frames, polar.lift, angles, radii, TABLE.band)
    evidence = edges.plus(level_evidence(polar, levels, *known, radii, growth, TABLE.band))
    return evidence, decode(evidence, 0 * growth, TABLE)


def _word(panel: Axes, words: Words) -> None:
    """Draw the sectors of a word, and what covers the band."""
    width = 360 / TABLE.bits
    for bit in range(TABLE.bits):
        colour = 'black' if int(words.words[0]) >> bit & 1 else 'white'
        at = (np.degrees(words.starts[0]) + bit * width) % 360
        panel.barh(0, width, left=(at, at - 360), color=colour, edgecolor='gray')
    hidden = words.hidden[0]
    at = (np.flatnonzero(hidden) + 0.5) * 360 / len(hidden)
    panel.barh(0, 360 / len(hidden), left=at, color='tab:orange', height=0.5)
    panel.set(xlim=(0, 360), ylabel='word')


def stack() -> Figure:
    """Return the images of a stack, and their combination."""
    scene = replace(SCENE, ambient=0.02, phases=4)
    images = tuple(render(scene, phase).image for phase in range(4))
    figure, panels = _panels(1, 3, 3.6, 2.6)
    _show(panels[0], images[0], 'first of four images')
    _show(panels[1], images[1], 'second')
    _show(panels[2], ImageStack(images).combined(COMBINATIONS[0]), COMBINATIONS[0])
    return figure


def _panels(rows: int, columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels of a size in inches."""
    figure = Figure(figsize=(columns * width, rows * height), layout='constrained')
    panels = list(np.ravel(figure.subplots(rows, columns)))
    for panel in panels:
        panel.axis('off')
    return figure, panels


def _show(panel: Axes, image: np.ndarray, title: str) -> None:
    panel.imshow(image, cmap='gray', interpolation='nearest')
    panel.set_title(title, fontsize=10)


PICTURES: dict[str, Callable[[], Figure | None]] = {
    'targets': targets,
    'lights': lights,
    'homomorphic': homomorphic,
    'search': search,
    'dots': dots,
    'reading': reading,
    'light': light,
    'stack': stack,
}
"""What makes each picture; `targets` writes its own files."""


def main(names: list[str]) -> int:
    """Write all pictures, or those that are named."""
    cv2.setNumThreads(1)
    FOLDER.mkdir(exist_ok=True)
    for name in names or PICTURES:
        figure = PICTURES[name]()
        if figure:
            figure.savefig(FOLDER / f'{name}.jpg', dpi=DPI, pil_kwargs={'quality': 88})
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
