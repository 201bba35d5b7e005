"""Several families of ring targets in one image."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ahf_ros.base.target import UNDECODED, Target
from ahf_ros.families import DetectorSettings, create_detector, estimator
from ahf_ros.families.ring.choice import choose_families, further_families
from ahf_ros.prints import RING_NAMES
from ahf_ros.prints.ring import family, words_of_prints
from ahf_ros.scenes.covers import Cover, ink_cover
from ahf_ros.scenes.scene import Rendering, SceneSettings
from support.pictures.exposure import Exposure
from support.pictures.sheets import mark_sheet
from support.ring import measured
from support.scenes import identified, rendered

pytestmark = pytest.mark.lasting

TWO = ('metashape12', 'aicon14')
THREE = ('metashape12', 'metashape20', 'aicon14')
LIGHTS = ('normal', 'stripe')
SMALL = SceneSettings(width=480, height=360, targets=4, dot_radius=10, seed=21)
SHARED = {'metashape12': 455, 'metashape16': 3855, 'metashape20': 31775}
"""One print."""


def scene(name: str, light: str = 'normal') -> Rendering:
    return rendered(replace(SMALL, family=name, light=light))


def side_by_side(*renderings: Rendering) -> tuple[np.ndarray, list[tuple[str, int, float, float]]]:
    """Return images in a row, and family, ID and place of their targets."""
    truth = [
        (it.family, it.id, it.x + 480 * place, it.y)
        for place, shown in enumerate(renderings)
        for it in shown.targets
    ]
    return np.hstack([it.image for it in renderings]), truth


def matches(targets: list[Target], truth: list[tuple[str, int, float, float]]) -> bool:
    """Return whether the targets are the true ones, each in its place."""
    if sorted(it.key for it in targets) != sorted((name, number) for name, number, *_ in truth):
        return False
    places = {(name, number): (x, y) for name, number, x, y in truth}
    return all(
        np.hypot(it.x - places[it.key][0], it.y - places[it.key][1]) < 0.2 for it in targets
    )


@pytest.mark.parametrize(
    ('shown', 'light', 'families'),
    [
        (TWO, 'normal', 'aicon14, metashape12'),
        *((TWO, light, families) for light in LIGHTS for families in (','.join(TWO), 'auto')),
        *((THREE, 'normal', families) for families in (','.join(THREE), 'auto')),
    ],
)
def test_every_target_says_its_family(shown: Any, light: str, families: Any) -> None:
    image, truth = side_by_side(*(scene(name, light) for name in shown))
    assert matches(identified(image, family=families), truth)


@pytest.mark.parametrize('name', RING_NAMES)
def test_all_families_together_read_what_the_one_that_is_there_reads(name: str) -> None:
    image = rendered(
        replace(SMALL, width=800, height=600, targets=8, family=name, light='stripe')
    ).image
    alone, together = (identified(image, family=of) for of in (name, ','.join(RING_NAMES)))
    assert len(alone) >= 7
    assert [it.key for it in together] == [it.key for it in alone]


def test_families_that_no_dot_shows_are_not_chosen() -> None:
    shown = scene('metashape14')
    gray = shown.image.astype(np.float32)
    x, y = zip(*((it.x, it.y) for it in shown.targets), strict=True)
    dots = measured(gray, x, y, 10.0, 1, rounds=1)
    others = [family(name) for name in ('cct14', 'aicon14')]
    for choose in (choose_families, further_families):
        assert choose(gray, dots, [*others, family('metashape14')]) == [family('metashape14')]
        assert choose(gray, dots, others) == []


def test_centres_are_refined_by_each_target_s_own_family() -> None:
    image, truth = side_by_side(*map(scene, TWO))
    detector = create_detector('ring', family=','.join(TWO))
    moved = [replace(it, x=it.x + 0.5, y=it.y - 0.5) for it in detector(image)]
    assert not matches(moved, truth)
    assert matches(list(detector.refine(image, moved)), truth)


def ink(name: str, word: int) -> Callable[[float], Cover]:
    return lambda turn: ink_cover(family(name).ink(word, 0.05), turn)


@cache
def sheet(*marks: tuple[str, int]) -> np.ndarray:
    """Return a photograph of a row of code words, each with its family."""
    return mark_sheet([ink(*mark) for mark in marks], 7).photograph(Exposure())


def test_an_id_of_two_families_is_two_targets() -> None:
    image = sheet(*((name, family(name).word(9)) for name in TWO))
    keys = [it.key for it in identified(image, family=','.join(TWO))]
    assert keys == [('aicon14', 9), ('metashape12', 9)]


@pytest.mark.parametrize('name', SHARED)
@pytest.mark.parametrize('families', ['auto', ''])
def test_a_print_of_three_families_is_of_the_family_beside_it(name: str, families: str) -> None:
    """The print is the same in each image; what is beside it is not."""
    others = [(name, int(family(name).words[index])) for index in (20, 40)]
    image = sheet(('metashape12', SHARED['metashape12']), *others)
    targets = identified(image, family=families or name)
    assert sorted(it.code for it in targets) == sorted([SHARED[name], *(it[1] for it in others)])
    assert {it.family for it in targets} == {name}


@pytest.mark.parametrize('name', SHARED)
def test_a_print_of_three_families_alone_is_of_the_one_that_is_named(name: str) -> None:
    image = sheet(('metashape12', SHARED['metashape12']))
    assert [(it.family, it.code) for it in identified(image, family=name)] == [
        (name, SHARED[name])
    ]


@pytest.mark.parametrize('families', ['auto', 'metashape16,metashape12'])
def test_a_print_of_three_families_alone_is_of_none(families: str) -> None:
    image = sheet(('metashape12', SHARED['metashape12']))
    assert identified(image, family=families) == []
    dots = identified(image, family=families, report_undecoded=True)
    centre = [it for it in dots if it.semi_major > 8]
    assert all((it.id, it.family) == (UNDECODED, '') for it in centre)


def test_targets_of_another_family_do_not_settle_a_print() -> None:
    marks = [('aicon14', int(family('aicon14').words[index])) for index in (20, 40, 60, 80)]
    targets = identified(sheet(('metashape12', SHARED['metashape12']), *marks), family='auto')
    assert sorted(it.code for it in targets) == sorted(word for _, word in marks)


def test_bands_of_other_radii_are_not_read() -> None:
    assert identified(scene('aicon14').image, family='metashape14') == []


def test_targets_of_several_families_are_counted() -> None:
    image, truth = side_by_side(*map(scene, TWO))
    assert estimator(DetectorSettings(family='auto'))(image) == len(truth)


def test_both_prints_are_found_among_the_many_dots_of_a_lattice() -> None:
    wide = replace(SMALL, width=900, height=700, targets=8, light='lattice', ambient=0.12)
    image = np.hstack([rendered(replace(wide, family=name)).image for name in TWO])
    names = [target.family for target in identified(image, family='metashape12,aicon14')]
    assert names.count('metashape12') >= 7
    assert names.count('aicon14') >= 7


@pytest.mark.parametrize('families', ['cct10', 'cct12'])
@pytest.mark.parametrize('light', ['normal', 'stripe'])
def test_rings_of_all_words_have_the_numbers_of_their_programs(families: str, light: str) -> None:
    shown = scene(families, light)
    truth = [(it.family, it.id, it.x, it.y) for it in shown.targets]
    assert matches(identified(shown.image, family=families), truth)


def test_targets_of_a_small_family_are_not_those_of_a_larger_one_with_the_same_prints() -> None:
    targets = identified(scene('aicon12').image, family='aicon12,cct12')
    assert [it.family for it in targets] == ['aicon12'] * 4
    shown = scene('cct12')
    truth = [(it.family, it.id, it.x, it.y) for it in shown.targets]
    assert matches(identified(shown.image, family='cct12,aicon12'), truth)


def test_one_word_of_a_larger_family_does_not_take_the_prints_of_a_smaller_one() -> None:
    """Sixteen sectors have all prints of eight, each sector twice."""
    eight, sixteen = family('cct8'), family('cct16')
    words = eight.words[[3, 8, 13, 18, 23]]
    prints = {of[sixteen] for of in words_of_prints(eight, words, [sixteen])}
    odd = next(it for it in sixteen.words[1000:].tolist() if it not in prints)
    marks = [('cct8', int(word)) for word in words]
    found = identified(sheet(*marks, ('cct16', odd)), family='cct8,cct16')
    assert sorted((it.family, it.code) for it in found) == sorted([*marks, ('cct16', odd)])


@pytest.mark.parametrize(('rule', 'free'), [('aicon12', 'cct12'), ('aicon14', 'cct14')])
def test_three_words_that_obey_a_rule_are_of_its_family_unless_another_one_breaks_it(
    rule: str, free: str
) -> None:
    obeying = [int(word) for word in family(rule).words[[20, 50, 80]]]
    breaking = [int(word) for word in family(free).words if word not in family(rule).words][40:42]
    every = ','.join(RING_NAMES)
    for words, of in ((obeying, rule), ([*obeying[:2], *breaking], free)):
        targets = identified(sheet(*((free, word) for word in words)), family=every)
        assert sorted((it.family, it.code) for it in targets) == sorted((of, it) for it in words)
    assert identified(sheet((free, obeying[0])), family=every) == []


@pytest.mark.parametrize(('name', 'radius', 'seed'), [('cct11', 7, 18), ('cct16', 16, 11)])
def test_no_word_stands_that_a_family_found_later_explains_better(
    name: str, radius: int, seed: int
) -> None:
    """In the one, cct13 has words of the clearest bands, and in the other cct8."""
    wide = {'width': 1000 + 40 * radius, 'height': 700 + 30 * radius, 'targets': 12}
    light = {'light': 'stripe', 'ambient': 0.3} if name == 'cct11' else {}
    shown = rendered(SceneSettings(family=name, dot_radius=radius, seed=seed, **wide, **light))
    truth = [(it.family, it.id, it.x, it.y) for it in shown.targets]
    assert matches(identified(shown.image, family=','.join(RING_NAMES)), truth)


@pytest.mark.parametrize(
    ('names', 'light', 'seed'),
    [
        (('metashape16', 'cct14'), 'normal', 21),
        (('cct12', 'cct14'), 'normal', 22),
        (('cct10', 'cct14'), 'stripe', 24),
        (('cct12', 'cct14'), 'stripe', 24),
    ],
)
def test_two_families_are_told_apart_though_a_third_has_some_of_their_prints(
    names: tuple[str, str], light: str, seed: int
) -> None:
    """The prints of cct14 are partly those of aicon14, with fewer words, and of cct12 alike."""
    size = SceneSettings(width=600, height=600, targets=5, dot_radius=9, light=light, ambient=0.3)
    shown = [
        rendered(replace(size, family=name, targets=count, seed=seed + more))
        for name, count, more in zip(names, (5, 3), (0, 100), strict=True)
    ]
    image = np.hstack([it.image for it in shown])
    found = identified(image, family=','.join(RING_NAMES))
    assert {it.key for it in found} == {it.key for of in shown for it in of.targets}


def test_words_tell_the_number_of_sectors_where_light_makes_all_numbers_alike() -> None:
    """Bounds of 12, 14, 16 and 20 sectors differ by a fiftieth there, and 20 have the highest."""
    light = {'light': 'dense_lattice', 'ambient': 0.12}
    shown = rendered(
        SceneSettings(width=800, height=600, targets=12, dot_radius=6, seed=4, **light)
    )
    by_id = {it.id: (it.x, it.y) for it in shown.targets}
    targets = identified(shown.image, family=','.join(RING_NAMES))
    assert len(targets) >= 10
    for it in targets:
        assert it.family == 'metashape12'
        assert (it.x, it.y) == pytest.approx(by_id[it.id], abs=5)


def test_rings_of_a_data_file_are_rendered_and_identified(tmp_path: Path) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text('family: mine\nbits: 10\nband: [1.42, 1.87]\nwords: {changes: 6}\n')
    shown = rendered(
        SceneSettings(
            width=640, height=480, targets=5, dot_radius=14, family='mine', family_file=str(file)
        )
    )
    truth = [(it.family, it.id, it.x, it.y) for it in shown.targets]
    for families in ('mine', 'auto', 'metashape12,mine'):
        detector = create_detector('ring', family=families, family_file=str(file))
        targets = detector(shown.image)
        assert matches(targets, truth)
        assert matches(list(detector.refine(shown.image, targets)), truth)


def test_dots_found_before_their_family_is_shown_are_read_as_well() -> None:
    """Of these twelve targets a lattice leaves some a whole outline, none of which is clear."""
    shown = rendered(
        SceneSettings(
            width=1200,
            height=900,
            targets=12,
            dot_radius=7.0,
            family='aicon12',
            light='dense_lattice',
            seed=43,
        )
    )
    found = create_detector(family=','.join(RING_NAMES))(shown.image)
    assert {it.key for it in found} == {(it.family, it.id) for it in shown.targets}


@pytest.mark.parametrize(('light', 'radius'), [('lattice', 8.0), ('dense_lattice', 12.0)])
def test_a_lone_target_is_read_among_two_families_as_by_its_own(light: str, radius: float) -> None:
    """Its word is certain, but to less than 0.99."""
    size = SceneSettings(width=500, height=400, targets=1, dot_radius=radius, light=light)
    for seed in (20, 21, 22):
        shown = rendered(replace(size, ambient=0.12, seed=seed))
        named, found = (
            create_detector(family=name)(shown.image) for name in (TWO[0], ','.join(TWO))
        )
        assert [it.key for it in found] == [it.key for it in named]
        assert [it.id for it in named] == [it.id for it in shown.targets]


def test_targets_that_are_few_among_the_spots_of_a_lattice_tell_their_family() -> None:
    settings = SceneSettings(width=640, height=480, targets=4, dot_radius=12, seed=22)
    shown = rendered(replace(settings, light='dense_lattice', ambient=0.06))
    keys = [it.key for it in identified(shown.image, family='auto')]
    assert keys == sorted(('metashape12', it.id) for it in shown.targets)
