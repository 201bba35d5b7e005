"""Scenes under every condition that the confidence of targets has to bear.

`scenes` are those of ring targets. The disturbances are other ones than those of
`support.pictures.disturbed`: other gray values, widths and distances. Only the kinds are the same.
`pictures` are the same for all families, by three makers, where readings begin to fail.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, TypeVar

import cv2
import numpy as np

from ahf_ros.base.target import Target, TrueTarget
from ahf_ros.families import DetectorSettings
from ahf_ros.prints import RING_NAMES
from ahf_ros.prints.families import print_in
from ahf_ros.prints.gsi import point_family
from ahf_ros.prints.ring import FAMILY_NAMES, family, ring_family
from ahf_ros.scenes.bent.picture import render_bent
from ahf_ros.scenes.bent.settings import BentSettings
from ahf_ros.scenes.scene import SceneSettings, render
from support.pictures import bent, occluders
from support.pictures.disturbed import blurred, compressed, noisy, overlapping
from support.pictures.dot_conditions import design
from support.pictures.drawn_families import LIGHTS, TARGETS, random_family, sheet
from support.pictures.exposure import Exposure
from support.pictures.lights import EVERY_LIGHT, LIT, PATTERNS
from support.pictures.lookalikes import LOOKALIKES
from support.pictures.phone import phone
from support.pictures.sheets import COLUMNS, ROWS, mark_sheet, random_numbers, target_sheet
from support.pictures.textures import lookalikes, rough_image, textured_image

SHADOWS = (0.3, 0.08, 0.04, 0.02)
"""Ambient light of the smaller scenes, as a share of the projector's."""

GRAYS = (61.0, 75.0, 105.0, 150.0, 190.0, 220.0)
"""Gray values of what covers targets, from ink to paper."""

DRAWN = 12
"""Families that are drawn for each light."""

FEW = 9
"""Largest number of sectors of every other one of these."""

SMALL = (5.0, 20.0)
"""Smallest and largest radius of dots of these, px."""

WIDTH, HEIGHT = 1600, 1066
"""Of scenes of small dots and of photographs, px."""

SHADES = (0.3, 0.12)
"""Ambient light of these."""

RADII_OF_SMALL, RADII_IN_PHOTOGRAPHS = (4.5, 9.0), (4.5, 20.0)
"""Smallest and largest radius of dots of small targets, and in photographs, px."""

RADII_OF_BENT = (5.5, 14.0)
"""Smallest and largest radius of dots on bent sheets, px."""

PHOTOGRAPHS = 15
"""Images of a phone, of each seed."""

CELLS = COLUMNS * ROWS

Made = TypeVar('Made')

NOTHING: Sequence[Target] = ()

COMMON = ('light', 'small', 'phone', 'bent', 'drawn family', 'clean', 'exposure', 'quality')
"""Conditions that most targets are under; the others are rare."""

FOREIGN = ('other family', 'look-alikes', 'clutter')
"""Conditions without a target of the family that is read."""

MAKERS = ('this package', 'bent sheets', 'phone')
"""Makers of `pictures`."""

HARD = (
    *('small', 'small', 'small', 'small', 'dark', 'dark', 'blurred', 'blurred'),
    *('covered', 'covered', 'another kind', 'clutter'),
)
"""Conditions of the pictures of a family and a maker; the last two show no target of it."""

FIRST = ('metashape12', 'cct12', 'gsi', 'dots', 'cctag3', 'aruco_4x4_50', 'apriltag_36h11')
"""A family or two of each kind."""

LIMITS = {
    'ring': (4.0, 9.0),
    'gsi': (2.2, 5.0),
    'dots': (3.5, 8.0),
    'cctag': (7.0, 16.0),
    'aruco': (1.7, 4.5),
    'apriltag': (2.0, 5.0),
}
"""Radii of dots, px, from where hardly any target of a kind is read to where most are."""

SIZE = (960, 640)
"""Width and height of these, px."""

RADII = (1.0, 1.5, 1.5, 2.0, 3.0, 3.6)
"""Of dots of point-distributed targets, in the unit of the printed design, which has 1.5."""

FILLED, MOST = 0.3, 24
"""Share of them that targets take at the most, and how many there are."""

SHEETS = 2
"""Bent sheets that they are on."""


class Scene(NamedTuple):
    """An image, what it shows, and the family that it is read as.

    Attributes
    ----------
    condition : str
    image : ndarray of uint8, shape (height, width)
    truth : sequence of TrueTarget
    family : str
    others : bool
        Whether the image shows other targets of the family as well.
    file : Path or None
        Data file of the family.
    """

    condition: str
    image: np.ndarray
    truth: Sequence[TrueTarget | Target]
    family: str
    others: bool = False
    file: Path | None = None

    @property
    def settings(self) -> DetectorSettings:
        """Settings with the family that it is read as."""
        return DetectorSettings(family=self.family, family_file=str(self.file or ''))


def scenes(seed: int) -> Iterator[Scene]:
    """Yield scenes under every condition."""
    for settings in lit(seed):
        rendering = render(settings)
        yield Scene('light', rendering.image, rendering.targets, settings.family)
    yield from small(seed)
    yield from photographed(seed)
    yield from sheets_bent(seed)
    yield from drawn(seed)
    yield from disturbed(seed)
    yield from strange(seed)
    yield from strange_in_light(seed)


def lit(seed: int) -> Iterator[SceneSettings]:
    """Yield scenes under all lights as in the figures, and smaller ones in deeper shadow."""
    for light, ambient in LIT:
        yield SceneSettings(light=light, ambient=ambient, seed=seed)
    generator = np.random.default_rng(seed)
    for light, ambient in product(PATTERNS, SHADOWS):
        radius = float(generator.choice([9, 14, 20, 24]))
        yield SceneSettings(
            width=2000,
            height=1334,
            targets=round(6400 / radius**2),
            dot_radius=radius,
            family=str(generator.choice(FAMILY_NAMES)),
            polarity=str(generator.choice(['dark', 'bright'])),
            tilt=float(generator.choice([0, 30, 50])),
            light=light,
            ambient=ambient,
            seed=seed,
        )


def small(seed: int) -> Iterator[Scene]:
    """Yield scenes of small dots under all lights."""
    for settings in _small_dots(seed, 36, np.random.default_rng([seed, 8]), varied=True):
        rendering = render(settings)
        yield Scene('small', rendering.image, rendering.targets, settings.family)


def photographed(seed: int) -> Iterator[Scene]:
    """Yield scenes that a phone has processed; every third one is read as another family."""
    generator = np.random.default_rng([seed, 9])
    for index in range(PHOTOGRAPHS):
        settings = SceneSettings(
            width=WIDTH,
            height=HEIGHT,
            targets=24,
            dot_radius=float(np.exp(generator.uniform(*np.log(RADII_IN_PHOTOGRAPHS)))),
            family=_any_family(generator),
            light=str(generator.choice(['normal', 'normal', 'shadow', 'spots', 'stripe'])),
            ambient=0.3,
            seed=seed * PHOTOGRAPHS + index,
        )
        rendering = render(settings)
        image = phone(rendering.image, generator)
        if index % 3:
            yield Scene('phone', image, rendering.targets, settings.family)
        else:
            yield Scene('other family', image, (), _other_print(settings.family, generator))


def sheets_bent(seed: int) -> Iterator[Scene]:
    """Yield bent sheets by the second maker; every fourth one is read as another family."""
    generator = np.random.default_rng([seed, 11])
    for index, (light, polarity) in enumerate(product(bent.LIGHTS, ['dark', 'dark', 'bright'])):
        name = _any_family(generator)
        radius = float(np.exp(generator.uniform(*np.log(RADII_OF_BENT))))
        drawn_by = int(generator.integers(2**31))
        rendering = render_bent(bent.settings(name, polarity, light, radius, drawn_by, 24))
        if index % 4:
            yield Scene('bent', rendering.image, rendering.targets, name)
        else:
            yield Scene('other family', rendering.image, (), _other_print(name, generator))


def strange_in_light(seed: int) -> Iterator[Scene]:
    """Yield targets of other families under all lights, and clutter without any target."""
    generator = np.random.default_rng([seed, 10])
    for settings in _small_dots(seed, 24, generator):
        name = _other_print(settings.family, generator)
        yield Scene('other family', render(settings).image, (), name)
    for light in EVERY_LIGHT:
        scale = float(generator.choice([0.3, 0.5, 0.8]))
        settings = SceneSettings(
            width=WIDTH,
            height=HEIGHT,
            targets=0,
            distractors=30,
            light=light,
            light_scale=scale,
            ambient=0.2,
            seed=seed,
        )
        yield Scene('clutter', render(settings).image, (), _any_family(generator))


def _small_dots(
    seed: int, targets: int, generator: np.random.Generator, *, varied: bool = False
) -> Iterator[SceneSettings]:
    """Yield scenes of small dots under all lights, also of other colours and blurs if `varied`."""
    for light, ambient in product(EVERY_LIGHT, SHADES):
        settings = SceneSettings(
            width=WIDTH,
            height=HEIGHT,
            targets=targets,
            dot_radius=float(generator.uniform(*RADII_OF_SMALL)),
            family=_any_family(generator),
            light=light,
            ambient=ambient,
            seed=seed,
        )
        if varied:
            polarity = str(generator.choice(['dark', 'dark', 'dark', 'bright']))
            blur = float(generator.uniform(0.6, 1.2))
            settings = replace(settings, polarity=polarity, blur=blur)
        yield replace(settings, light_scale=float(generator.choice([0.5, 0.8, 1.0])))


def _any_family(generator: np.random.Generator) -> str:
    return str(generator.choice(RING_NAMES))


def _other_print(name: str, generator: np.random.Generator) -> str:
    """Return a family whose targets do not look like those of another one."""
    shown = family(name)
    others = [code for code in map(family, RING_NAMES) if code.bits != shown.bits]
    return str(generator.choice([code.name for code in others]))


def drawn(seed: int) -> Iterator[Scene]:
    """Yield scenes of families drawn at random, of few words; every other one has few sectors.

    Few sectors have words of a single mark, which a spot of light shows as well.
    """
    generator = np.random.default_rng([seed, 7])
    with TemporaryDirectory() as folder:
        for index, light in enumerate(LIGHTS * DRAWN):
            file = Path(folder, f'{index}.json')
            random_family(file, generator)
            while index % 2 and ring_family(str(file)).bits > FEW:
                random_family(file, generator)
            values = {
                'dot_radius': float(np.exp(generator.uniform(*np.log(SMALL)))),
                'edge_shift': float(generator.uniform(-0.5, 0.5)),
                'polarity': str(generator.choice(['dark', 'bright'])),
            }
            shown = sheet(file, TARGETS, light, seed, values)
            yield Scene('drawn family', shown.image, shown.targets, 'mine', file=file)


def exposures() -> Iterator[tuple[str, Exposure]]:
    """Yield disturbances of whole sheets, with their conditions."""
    yield 'clean', Exposure()
    for gray in GRAYS:
        over = 'cover like paper' if gray == GRAYS[-1] else 'cover'
        for occluder in (
            occluders.over_sectors(1.5, gray),
            occluders.over_sectors(2.5, gray),
            occluders.paper(1.7, gray),
            occluders.paper(2.4, gray),
            occluders.finger(1.6, gray),
            occluders.disc(0.8, gray),
        ):
            yield over, Exposure(occluder=occluder)
    for radius, levels in ((0.7, 150.0), (0.8, 300.0), (1.2, 250.0), (1.7, 120.0)):
        yield 'glare', Exposure(glare=occluders.highlight(radius, levels))
    for white, contrast, noise in ((150.0, 30.0, 2.0), (90.0, 12.0, 0.8), (200.0, 7.0, 0.6)):
        yield 'faint', Exposure(levels=(white, white - contrast, noise))
    for light in (2.0, 3.5, 0.02):
        yield 'exposure', Exposure(light=light)
    for white, ink in ((100.0, 50.0), (150.0, 88.0), (230.0, 110.0), (120.0, 25.0)):
        yield 'quality', Exposure(levels=(white, ink, 1.2))
    for develop in (
        partial(blurred, 1.2),
        partial(blurred, 1.8),
        partial(blurred, 2.5),
        partial(noisy, 6.0),
        partial(noisy, 20.0),
        partial(compressed, 40),
        partial(compressed, 10),
    ):
        yield 'quality', Exposure(develop=develop)
    for dirt in (
        occluders.scratches(4, (0.06, 0.2)),
        occluders.scratches(8, (0.06, 0.2)),
        occluders.specks(25, (0.08, 0.3)),
    ):
        yield 'dirt', Exposure(occluder=dirt)


def disturbed(seed: int) -> Iterator[Scene]:
    """Yield sheets of targets that are covered, glossy, faint or badly exposed."""
    generator = np.random.default_rng([seed, 5])
    for index, (condition, exposure) in enumerate(exposures()):
        name = str(generator.choice(FAMILY_NAMES))
        sheet = target_sheet(
            name,
            random_numbers(name, CELLS, seed + 1000 * index)[0],
            seed + 1000 * index,
            radius=float(generator.choice([6, 9, 13, 18])),
            bright=bool(generator.random() < 0.3),
        )
        yield Scene(condition, sheet.photograph(exposure), sheet.truth, name)
    for name in FAMILY_NAMES:
        numbers = random_numbers(name, CELLS, seed)[0]
        radius = float(generator.choice([8, 14]))
        for distance in (5.0, 6.0):
            scene = overlapping(name, numbers, seed, distance, radius)
            yield Scene('another target', *scene, name, True)


def strange(seed: int) -> Iterator[Scene]:
    """Yield targets read as those of another family, marks that are no targets, and clutter."""
    generator = np.random.default_rng([seed, 6])
    for shown in FAMILY_NAMES:
        radius = float(generator.choice([6, 9, 13, 18]))
        numbers = random_numbers(shown, CELLS, seed)[0]
        image = target_sheet(shown, numbers, seed, radius=radius).photograph(Exposure())
        for name in FAMILY_NAMES:
            if name != shown:
                yield Scene('other family', image, (), name)
    for kind, draw in LOOKALIKES.items():
        for name in FAMILY_NAMES:
            inks = list(map(partial(draw, family(name)), [generator] * CELLS))
            radius = float(generator.choice([9, 13, 18]))
            image = mark_sheet(inks, seed, radius=radius).photograph(Exposure())
            yield Scene('clutter' if kind == 'clutter' else 'look-alikes', image, (), name)


def pictures(name: str, maker: str, seed: int) -> Iterator[Scene]:
    """Yield pictures of a family by a maker, under the conditions `HARD`."""
    with TemporaryDirectory() as folder:
        yield from _pictures(name, maker, seed, Path(folder))


def _pictures(name: str, maker: str, seed: int, folder: Path) -> Iterator[Scene]:
    kinds = {print_in(it).kind: it for it in FIRST}
    foreign = [it for kind, it in kinds.items() if kind != print_in(name).kind]
    generator = np.random.default_rng([seed, MAKERS.index(maker), *name.encode()])
    for condition in HARD:
        own = condition not in HARD[-2:]
        shown = name if own else str(generator.choice(foreign))
        drawn = int(generator.integers(2**31))
        if condition == HARD[-1] and maker != MAKERS[0]:
            draw = (textured_image, lookalikes, rough_image)[drawn % 3]
            image, truth = draw(drawn), NOTHING
        else:
            image, truth = _picture(shown, condition, maker, drawn, folder)
        if condition == 'covered':
            image = covered(image, truth, print_in(name).reach, generator)
        if maker == MAKERS[2]:
            image = phone(image, generator)
        yield Scene(condition, image, truth if own else (), name)


def _picture(
    name: str, condition: str, maker: str, seed: int, folder: Path
) -> tuple[np.ndarray, Sequence[Target]]:
    """Return an image and its truth; it is not covered, and no phone has processed it yet."""
    generator, of = np.random.default_rng(seed), print_in(name)
    radius = float(np.exp(generator.uniform(*np.log(LIMITS[of.kind]))))
    radius *= 1.0 if condition == 'small' else 1.5
    zone = of.design.proportions.quiet_zone * radius
    room = int(FILLED * SIZE[0] * SIZE[1] / (4 * zone**2))
    file, larger = '', 1.0
    if (
        of.kind == 'gsi' and maker != MAKERS[1]
    ):  # whose data file need not say how large the dots are
        printed = float(generator.choice(RADII))
        file, larger = design(folder, printed), printed / point_family().dot_radius
    colours = ['dark', 'dark', 'bright'] if of.design.polarity == 'both' else ['auto']
    colour = str(generator.choice(colours))
    ambient = 0.05 if condition == 'dark' else float(generator.choice([0.12, 0.3]))
    blur = float(generator.uniform(1.2, 2.2) if condition == 'blurred' else 0.7)
    targets = 0 if condition == HARD[-1] else min(MOST, room)
    if maker == MAKERS[1]:
        light = f'{generator.choice(EVERY_LIGHT)} {ambient}'
        share = bent.DOT_SHARES.get(name, 1.0)
        changes: dict[str, Any] = {
            'width': SIZE[0],
            'height': SIZE[1],
            'sheets': SHEETS,
            'family_file': file,
            'dot_radius': larger * radius,
            'printed_radius': larger * share * BentSettings().printed_radius,
            'blur': blur,
        }
        plain = partial(bent.settings, name, colour, light, 10.0, seed)
        sheets = render_bent(_with_room(lambda count: replace(plain(count), **changes), targets))
        return sheets.image, sheets.targets
    settings = SceneSettings(
        width=SIZE[0],
        height=SIZE[1],
        targets=0,
        distractors=0 if targets else MOST,
        family=name,
        family_file=file,
        polarity=colour,
        dot_radius=larger * radius,
        tilt=float(generator.choice([0, 30, 50])),
        light=str(generator.choice(EVERY_LIGHT)),
        light_scale=float(generator.choice([0.5, 1.0])),
        ambient=ambient,
        blur=blur,
        seed=seed,
    )
    scene = _with_room(lambda count: render(replace(settings, targets=count)), targets)
    return scene.image, scene.targets


def _with_room(make: Callable[[int], Made], targets: int) -> Made:
    """Return what can be made of as many targets, or of fewer if there is no room for these."""
    try:
        return make(targets)
    except ValueError:
        if targets <= 1:
            raise
        return _with_room(make, targets // 2)


def covered(
    image: np.ndarray, targets: Sequence[Target], reach: float, generator: np.random.Generator
) -> np.ndarray:
    """Return an image, uint8, in which a bar lies over every other target, whose reach is given.

    The bar is as gray as ink, as paper, or as anything between.
    """
    seen = image.astype(np.float32)
    for target in targets[::2]:
        radius, turn = reach * target.semi_minor, generator.uniform(0, np.pi)
        across = np.array([np.cos(turn), np.sin(turn)])
        along = np.array([-across[1], across[0]]) * 1.5 * radius
        middle = (target.x, target.y) + generator.uniform(-1, 1) * radius * across
        half = generator.uniform(0.1, 0.5) * radius * across
        corners = [middle + half + along, middle - half + along]
        corners += [middle - half - along, middle + half - along]
        x, y, beyond = round(target.x), round(target.y), round(radius) + 1
        around = seen[max(y - beyond, 0) : y + beyond, max(x - beyond, 0) : x + beyond]
        mask = np.zeros(seen.shape, np.float32)
        cv2.fillConvexPoly(mask, np.rint(np.array(corners) * 16).astype(int), 1.0, cv2.LINE_8, 4)
        blurred_mask = cv2.GaussianBlur(mask, (0, 0), 0.7)
        gray = generator.uniform(around.min(), around.max())
        seen += blurred_mask * (np.float32(gray) - seen)
    return np.rint(seen).astype(np.uint8)
