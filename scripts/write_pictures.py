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

import ahf_ros.blas  # noqa: F401  before numpy
from ahf_ros import ImageStack, SceneSettings, create_detector, create_identifier, render
from ahf_ros.codes.designs import printed_design, proportions
from ahf_ros.codes.families import numbers_of
from ahf_ros.codes.ring import canonical, family
from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.ring.band_evidence import band_evidence
from ahf_ros.detectors.ring.band_samples import sample_bands
from ahf_ros.detectors.ring.decoding import sector_angles
from ahf_ros.detectors.ring.detector import find_hypotheses
from ahf_ros.detectors.ring.hypotheses import Hypotheses
from ahf_ros.detectors.ring.reading import mark_appearance
from ahf_ros.detectors.ring.target_circles import REACH
from ahf_ros.features.circle_fit import fit_dots
from ahf_ros.features.dot_search import voted_dots, whole_dots
from ahf_ros.features.frame import circle_outlines
from ahf_ros.features.pyramid import image_pyramid
from ahf_ros.features.sampling import sample_circles
from ahf_ros.filtering.homomorphic import HomomorphicFilter
from ahf_ros.imaging.logarithm import logarithm
from ahf_ros.imaging.stack import COMBINATIONS
from ahf_ros.printing.drawing import Drawing, Ink
from ahf_ros.printing.svg import svg_bytes
from ahf_ros.synthetic.patterns import LIGHT_NAMES

FOLDER = Path(__file__).resolve().parent.parent / 'docs' / 'pictures'
DPI = 110
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
    'gsi': 18,
    'dots': 23,
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
        design = printed_design(name, number, 0.0)
        assert number in numbers_of(name)
        radius = SIDE / 2 / proportions(name).quiet_zone
        ink = Ink(f'{name} {number}', SIDE / 2, SIDE / 2, radius, design.contours)
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
    minimum, maximum = DetectorSettings().radii
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
    """Return a target, its band unrolled, the evidence at each angle, and its word."""
    rendering = render(SCENE)
    gray, table = rendering.image.astype(np.float32), family('metashape12')
    target = min(rendering.targets, key=lambda it: abs(it.x - 320))
    found = find_hypotheses(gray, DetectorSettings())
    away = np.hypot(*(found.frames[:, :2, 2] - (target.x, target.y)).T)
    best = found.select(np.argmin(np.where(found.certain, away, np.inf), keepdims=True))
    assert canonical(best.words, table)[1] == target.id
    figure = Figure(figsize=(9, 3.6), layout='constrained')
    grid = figure.subplot_mosaic('ab;ac;ad', width_ratios=(1, 2), height_ratios=(3, 2, 1))
    for panel in grid.values():
        panel.set_xticks(())
        panel.set_yticks(())
    _show(grid['a'], rendering.image, f'target {target.id}')
    for radius in (1.0, *table.band):
        (outline,) = circle_outlines(best.frames, np.array([radius]))
        grid['a'].plot(*np.vstack((outline, outline[:1])).T, color='tab:orange', linewidth=1)
    grid['a'].set(xlim=(target.x - 62, target.x + 62), ylim=(target.y + 62, target.y - 62))
    angles = sector_angles(table, 40)
    (strip,) = sample_circles(gray, best.frames, angles, np.linspace(4.0, 0.5, 70))
    grid['b'].imshow(strip.T, cmap='gray', aspect='auto', extent=(0, 360, 0.5, 4.0))
    for radius in table.band:
        grid['b'].axhline(radius, color='tab:orange', linewidth=1)
    grid['b'].set(ylabel='radius', title='unrolled, counter-clockwise')
    _evidence(grid['c'], gray, best, angles)
    width = 360 / table.bits
    for bit in range(table.bits):
        colour = 'black' if int(best.words[0]) >> bit & 1 else 'white'
        at = (np.degrees(best.starts[0]) + bit * width) % 360
        grid['d'].barh(0, width, left=(at, at - 360), color=colour, edgecolor='gray')
    grid['d'].set(xlim=(0, 360), ylabel='word')
    return figure


def _evidence(panel: Axes, gray: np.ndarray, best: Hypotheses, angles: np.ndarray) -> None:
    """Draw the evidence for a mark at each angle."""
    table = family('metashape12')
    marks = mark_appearance(gray, fit_dots(gray, best.frames, best.polarity, rays=24, reach=REACH))
    samples = sample_bands(gray, best.frames, marks.blur, angles, table)
    evidence = band_evidence(samples, marks, best.frames, table).marked[0]
    at = np.linspace(0, 360, len(evidence))
    panel.fill_between(at, evidence, where=evidence > 0, color='black', step='mid')
    panel.fill_between(at, evidence, where=evidence < 0, color='tab:blue', step='mid')
    panel.set(xlim=(0, 360), ylabel='evidence')


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
