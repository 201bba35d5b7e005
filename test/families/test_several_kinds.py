"""Families of several kinds in one image, named or settled on the first images."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ahf_ros.base.target import Identification, Target
from ahf_ros.batch.engine import SerialEngine
from ahf_ros.batch.identification import identify_images
from ahf_ros.batch.settling import settled_tasks
from ahf_ros.batch.task import ImageTask
from ahf_ros.families import DetectorSettings, Narrowing, check_listed_ids, create_detector
from ahf_ros.files.image_files import write_image
from ahf_ros.identification.filtering.identifier import Memory
from ahf_ros.identification.session import create_identifier
from ahf_ros.identification.session_settings import IdentificationSettings
from ahf_ros.identification.settling import evident, settled_families, still_shown
from ahf_ros.scenes.scene import SceneSettings
from ahf_ros.vision.stack import ImageStack
from support.command_line import status
from support.scenes import rendered
from support.square_markers import needs_square_markers

pytestmark = pytest.mark.lasting

if needs_square_markers.args[0]:
    pytest.skip(needs_square_markers.kwargs['reason'], allow_module_level=True)

SMALL = SceneSettings(width=320, height=240, targets=3, dot_radius=8, seed=3)
TWO = 'metashape12,apriltag_36h11'


@cache
def image_of(*families: str) -> np.ndarray:
    """Return scenes of families side by side."""
    return np.hstack([rendered(replace(SMALL, family=name)).image for name in families])


BOTH = image_of('metashape12', 'apriltag_36h11')
EMPTY = np.random.default_rng(5).normal(128, 3, (240, 640)).astype(np.uint8)


def truth(*families: str) -> list[tuple[str, int, float, float]]:
    return sorted(
        (it.family, it.id, it.x + 320 * place, it.y)
        for place, name in enumerate(families)
        for it in rendered(replace(SMALL, family=name)).targets
    )


def assert_true(targets: list[Target] | tuple[Target, ...], *families: str) -> None:
    found = sorted((it.family, it.id, it.x, it.y) for it in targets)
    expected = truth(*families)
    assert [it[:2] for it in found] == [it[:2] for it in expected]
    assert np.allclose([it[2:] for it in found], [it[2:] for it in expected], atol=0.2)


@pytest.mark.parametrize('light', ['normal', 'stripe'])
def test_kinds_that_share_a_search_of_dots_are_all_found(light: str) -> None:
    families = ('metashape12', 'gsi', 'dots')
    size = replace(SMALL, width=640, height=480, dot_radius=5, light=light)
    shown = [rendered(replace(size, family=name)) for name in families]
    image = np.hstack([it.image for it in shown])
    found = create_detector(family=','.join(families))(image)
    alone = [target for name in families for target in create_detector(family=name)(image)]
    assert len(alone) == 9
    assert sorted((it.family, it.id) for it in found) == sorted((it.family, it.id) for it in alone)
    places = {target.key: (target.x, target.y) for target in alone}
    assert np.allclose([places[it.key] for it in found], [(it.x, it.y) for it in found], atol=0.05)


@pytest.mark.parametrize('name, radius', [('gsi', 5), ('dots', 8), ('cctag3', 8), ('cctag4', 10)])
def test_other_kinds_are_found_beside_rings_that_are_clear(name: str, radius: float) -> None:
    size = replace(SMALL, width=480, height=480)
    rings = rendered(replace(size, targets=4))
    others = rendered(replace(size, family=name, targets=2, dot_radius=radius))
    found = create_detector(family='auto')(np.hstack([rings.image, others.image]))
    assert {it.key for it in found} == {it.key for it in (*rings.targets, *others.targets)}


def test_rings_of_all_words_are_found_beside_markers_under_stripes() -> None:
    """Cells look more like bands there than the rings that the first family left."""
    size = replace(SMALL, width=700, height=700, light='stripe', ambient=0.4)
    rings = rendered(replace(size, family='cct12', targets=4, dot_radius=9))
    markers = rendered(replace(size, family='apriltag_36h11', dot_radius=12, seed=4))
    found = create_detector(family='auto')(np.hstack([rings.image, markers.image]))
    assert {it.key for it in found} == {it.key for it in (*rings.targets, *markers.targets)}


def without_time(found: Identification) -> Identification:
    return replace(found, filter=replace(found.filter, duration=0.0))


def test_families_of_two_kinds_are_identified_and_refined_each_by_its_detector() -> None:
    detector = create_detector(family=TWO, min_radius=5.0)
    assert (detector.name, detector.family) == ('several', TWO)
    assert isinstance(detector, Narrowing)
    found = detector(BOTH)
    assert_true(found, *TWO.split(','))
    moved = [replace(it, x=it.x + 0.3) for it in found]
    assert_true(detector.refine(BOTH, moved), *TWO.split(','))
    assert_true(detector.refine(BOTH, detector.draft(BOTH)), *TWO.split(','))
    for name in TWO.split(','):
        alone = create_detector(family=name, min_radius=5.0)
        assert detector.narrowed([name])(BOTH) == alone(BOTH)
        assert [it for it in found if it.family == name] == alone(BOTH)


def test_the_disc_of_a_ring_of_dots_is_no_ring() -> None:
    image = rendered(SceneSettings(width=640, height=480, targets=2, family='dots', dot_radius=8))
    found = create_detector(family='dots,cct8,cct10,gsi')(image.image)
    assert sorted(it.key for it in found) == sorted(it.key for it in image.targets)


def test_each_kind_has_its_smallest_dots() -> None:
    settings = DetectorSettings(family='metashape12,gsi')
    assert settings.radii[0] == 2.0
    assert settings.narrowed(['metashape12']).radii[0] == 4.0


def test_ids_of_any_family_may_be_expected() -> None:
    check_listed_ids('expected_ids', [150, 580], 'several', DetectorSettings(family=TWO))
    with pytest.raises(ValueError, match='expected_ids has 587, accepted are IDs of metashape12'):
        check_listed_ids('expected_ids', [587], 'several', DetectorSettings(family=TWO))
    found = create_identifier(family=TWO, expected_targets=6).identify(BOTH)
    assert (found.count, found.expected, found.filter.applied) == (6, 6, False)


def test_doubtful_targets_of_few_are_no_evidence_for_a_family() -> None:
    def target(family: str, number: int, confidence: float) -> Target:
        return Target(number, 1, 9.0, 9.0, 5.0, 5.0, confidence=confidence, family=family)

    doubtful = [target('cct8', 1, 0.95), target('cct8', 2, 0.9), target('cct9', 2, 0.98)]
    doubtful += [target('cctag3', 5, 0.89), target('cctag3', 21, 0.99), target('cctag3', 28, 0.76)]
    doubtful += [target('gsi', it, 0.98) for it in (1, 2)]  # two do not show a family
    doubtful += [target('aruco_original', 1023, 0.99)] * 4  # as letters are
    sure = [target('aicon12', 5, 0.9995), *(target('cct12', it, 0.95) for it in range(3))]
    undecoded = target('', -1, 0.5)
    assert evident([*doubtful, *sure, undecoded]) == [*sure, undecoded]


@pytest.mark.parametrize('name', ['metashape12', 'apriltag_36h11'])
def test_a_lone_target_is_identified_among_all_families(name: str) -> None:
    shown = rendered(replace(SMALL, family=name, targets=1))
    found = create_identifier(family='auto').identify(shown.image)
    assert [it.key for it in found.targets] == [(name, shown.targets[0].id)]


@pytest.mark.parametrize(
    ('confidences', 'shown'),
    [((), False), ((0.94,), False), ((0.8, 0.89), False), ((0.995,), True), ((0.94, 0.95), True)],
)
def test_doubtful_targets_alone_do_not_show_a_family(
    confidences: tuple[float, ...], shown: bool
) -> None:
    targets = [
        Target(number, 0, 9.0, 9.0, 5.0, 5.0, 0.0, confidence, family='aicon14')
        for number, confidence in enumerate(confidences, start=1)
    ]
    assert still_shown(targets) == shown


def test_families_are_settled_on_the_first_images_and_where_none_is_shown() -> None:
    families = tuple(TWO.split(','))
    third = image_of('metashape12', 'aruco_mip_36h12')
    identifier = create_identifier(family='auto')
    images = [
        EMPTY,
        image_of('metashape12'),
        image_of('apriltag_36h11'),
        EMPTY,
        BOTH,
        image_of('aruco_mip_36h12'),
        third,
        third,
    ]
    settled = [
        ((), 0),
        (families[:1], 3),
        (families, 3),
        (families, 3),
        (families, 3),
        (('metashape12', 'aruco_mip_36h12', 'apriltag_36h11'), 3),
        (('metashape12', 'aruco_mip_36h12', 'apriltag_36h11'), 3),
        (('metashape12', 'aruco_mip_36h12', 'apriltag_36h11'), 3),
    ]
    shown = [0, 3, 3, 0, 6, 3, 6, 6]
    memories = [identifier.memory]
    results = []
    for image, expected, count in zip(images, settled, shown, strict=True):
        results.append(identifier.identify(image))
        memories.append(identifier.memory)
        assert (identifier.memory.families, identifier.memory.shown) == expected
        assert results[-1].count == count
    named = create_identifier(family=TWO).identify(ImageStack((BOTH,)))
    assert [it.looked_for for it in results[3:6]] == ['auto', TWO, 'auto']
    assert without_time(results[4]) == without_time(named)
    # From the memory of any image, another identifier goes on in the same way.
    for number in (3, 6):
        other = create_identifier(family='auto')
        other.memory = memories[number]
        assert without_time(other.identify(images[number])) == without_time(results[number])
        assert other.memory == memories[number + 1]
    assert settled_families(memories[2], ()) == 'families: metashape12'
    assert settled_families(memories[2], memories[2].families) == ''
    identifier.reset()
    assert identifier.memory == Memory()


def test_a_filter_is_searched_for_with_the_families_that_are_there() -> None:
    hard = rendered(replace(SMALL, light='stripe', ambient=0.3)).image
    found = create_identifier(family='auto', expected_targets=4, max_evaluations=4).identify(hard)
    named = create_identifier(
        family='metashape12', expected_targets=4, max_evaluations=4
    ).identify(hard)
    assert found.search
    assert without_time(found) == replace(without_time(named), looked_for='auto')


def test_rings_are_counted_where_they_are_settled() -> None:
    settings = IdentificationSettings(
        estimate_expected=True, detection=DetectorSettings(family='auto')
    )
    identifier = create_identifier(settings=settings)
    found = identifier.identify(image_of('metashape12'))
    assert (found.count, found.expected, found.estimated) == (3, 3, True)
    found = create_identifier(settings=settings).identify(BOTH)
    assert (found.count, found.expected, found.estimated) == (6, 0, False)


def test_a_batch_is_the_same_with_any_number_of_processes(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    images = tmp_path / 'images'
    images.mkdir()
    for number, image in enumerate((image_of('metashape12'), BOTH, EMPTY, BOTH)):
        write_image(images / f'{number}.png', image)
    lines = []
    for jobs in (1, 2):
        output = tmp_path / f'output{jobs}'
        arguments = ('identify', images, '--json', '--jobs', jobs, '--output', output)
        assert status(*arguments) == 0
        told = capsys.readouterr()
        assert f'\nfamilies: {", ".join(sorted(TWO.split(",")))}\n' in told.err
        records = [json.loads(line) for line in told.out.splitlines()]
        for record in records:
            record.pop('elapsed_s')
        lines.append(records)
    assert lines[0] == lines[1]
    assert [len(record['targets']) for record in lines[0]] == [3, 6, 0, 6]
    assert status(*arguments) == 0
    assert '4 of 4 results are there already' in capsys.readouterr().err


def test_what_settles_the_families_of_a_batch_is_not_identified_again(tmp_path: Path) -> None:
    settings = IdentificationSettings(detection=DetectorSettings(family='auto'))
    tasks = []
    for number, image in enumerate((image_of('metashape12'), BOTH)):
        path = str(tmp_path / f'{number}.png')
        write_image(Path(path), image)
        tasks.append(ImageTask((path,), settings))
    settled = settled_tasks(SerialEngine(identify_images), tasks)
    assert [task.families for task in settled] == [tuple(TWO.split(','))] * 2
    assert [task.outcome is None for task in settled] == [True, False]
    again = identify_images(replace(settled[1], outcome=None)).records
    kept = identify_images(settled[1]).records
    assert (kept[0].pop('looked_for'), again[0].pop('looked_for')) == ('auto', TWO)
    assert without_times(kept) == without_times(again)
    assert len(kept[0]['targets']) == 6
    drawn = replace(tasks[0], overlays=(str(tmp_path / 'overlay.png'),))
    counted = replace(tasks[0], settings=replace(settings, expected_targets=3))
    settled = settled_tasks(SerialEngine(identify_images), [drawn, counted])
    assert [task.outcome for task in settled] == [None] * 2


def without_times(records: tuple[dict[str, Any], ...]) -> list[dict[str, Any]]:
    return [{key: record[key] for key in record.keys() - {'elapsed_s'}} for record in records]
