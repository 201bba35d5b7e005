"""Scenes under every condition that the confidences of `gsi` and of `dots` have to bear."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.base.target import DottedTarget
from ahf_ros.families import create_detector
from ahf_ros.prints.gsi import GSI_LIBRARY, point_family
from ahf_ros.scenes.scene import Rendering, SceneSettings
from support.pictures.lights import EVERY_LIGHT, PATTERNS

GSI = SceneSettings(
    family='gsi', width=1600, height=1200, targets=6, dot_radius=5.0, focal_length=6.0
)
"""A scene; the others differ from it."""

RADII = (1.0, 1.5, 2.0, 2.5, 3.0, 3.6)
"""Of dots, in the unit of the printed design."""

PER_RADIUS = 6.4
"""Width of a target in radii of its disc."""

WIDTHS = (22, 24, 26, 29, 36, 48, 60, 90)
"""Of targets in clean light, px."""

AMBIENT = (0.3, 0.12, 0.04, 0.02)
"""Ambient light, as a share of the projector's."""


def design(folder: Path, radius: float) -> str:
    """Return a data file that describes GSI's targets with dots of another radius."""
    path = folder / f'gsi_{radius:g}.json'
    path.write_text(
        GSI_LIBRARY.read_text(encoding='utf-8').replace(
            f'"dot_radius": {point_family().dot_radius:g}', f'"dot_radius": {radius:g}'
        ),
        encoding='utf-8',
    )
    return str(path)


def gsi_scenes(seed: int, folder: Path) -> Iterator[tuple[str, SceneSettings]]:
    """Yield the condition and the settings of every scene of a seed."""
    generator = np.random.default_rng(seed)

    def printed(scene: SceneSettings) -> SceneSettings:
        """Return a scene whose dots have another radius, in targets of the same size."""
        radius = float(generator.choice(RADII))
        pixels = scene.dot_radius * radius / point_family().dot_radius
        return replace(scene, family_file=design(folder, radius), dot_radius=pixels, seed=seed)

    for light, ambient in product(PATTERNS, (0.3, 0.12, 0.04)):
        radius = float(generator.choice([5.0, 6.0, 8.0, 10.0]))
        polarity = str(generator.choice(['dark', 'bright']))
        changes: dict[str, Any] = {'dot_radius': radius, 'polarity': polarity}
        yield light, printed(replace(GSI, light=light, ambient=ambient, **changes))
    for tilt, radius in product((0.0, 45.0, 70.0, 80.0), (2.5, 4.0, 5.0)):
        polarity = str(generator.choice(['dark', 'bright']))
        scene = replace(GSI, tilt=tilt, dot_radius=radius, polarity=polarity, targets=12)
        yield 'even light', printed(scene)
    for light in ('normal', 'stripe', 'lattice'):
        clutter = replace(GSI, targets=0, distractors=30, dot_radius=8.0, light=light)
        yield 'no targets', replace(clutter, seed=seed)


def with_covered_dots(scene: Rendering, count: int) -> tuple[np.ndarray, set[int]]:
    """Return an image in which some targets lack a decoding dot, and their IDs.

    Parameters
    ----------
    scene : Rendering
    count : int
        Number of these targets, of those that are identified.
    """
    image = scene.image.copy()
    covered: set[int] = set()
    shown = {target.id for target in scene.targets}
    for target in create_detector(family='gsi')(image):
        if target.id in shown and len(covered) < count and isinstance(target, DottedTarget):
            covered.add(target.id)
            x, y, radius, *_ = target.dots[-len(covered)]
            half = round(1.6 * radius + 2)
            rows, columns = (slice(max(round(at) - half, 0), round(at) + half) for at in (y, x))
            patch = image[rows, columns]
            patch[...] = np.median(
                np.concatenate([patch[0], patch[-1], patch[:, 0], patch[:, -1]])
            )
    return image, covered


def dots_scenes(seed: int) -> Iterator[tuple[str, SceneSettings]]:
    """Yield conditions and scenes."""
    base = SceneSettings(family='dots', width=1500, height=1000, targets=20, seed=seed)
    for width in WIDTHS:
        yield 'size', replace(base, targets=40, dot_radius=width / PER_RADIUS)
    generator = np.random.default_rng(seed)
    for light, ambient in product(PATTERNS, AMBIENT):
        radius = float(generator.choice([8, 11, 14, 18]))
        colour = str(generator.choice(['dark', 'bright']))
        count = round(3000 / radius**2)
        scene = replace(base, targets=count, dot_radius=radius, polarity=colour)
        yield f'ambient {ambient}', replace(scene, light=light, ambient=ambient)
    for tilt, radius in product((30.0, 45.0, 60.0, 70.0), (8.0, 14.0)):
        scene = replace(base, targets=12, tilt=tilt, focal_length=3.0, dot_radius=radius)
        yield 'oblique', scene
    for blur, radius in product((1.3, 1.8, 2.3), (7.0, 12.0)):
        yield 'blur', replace(base, blur=blur, dot_radius=radius)
    for electrons, radius in product((1000.0, 300.0, 100.0), (4.5, 9.0)):
        yield 'noise', replace(base, full_well=electrons, dot_radius=radius)
    for light in EVERY_LIGHT:
        marks = replace(base, targets=0, distractors=40, dot_radius=10.0, light=light)
        yield 'no targets', marks
    for family, light in product(('metashape12', 'aicon14'), ('normal', 'stripe', 'lattice')):
        yield 'no targets', replace(base, family=family, light=light, dot_radius=12.0)
