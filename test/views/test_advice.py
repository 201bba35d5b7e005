"""Advice where nothing is found: only what a second look at the image measures."""

import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from ahf_ros.families import DetectorSettings
from ahf_ros.files.image_files import write_image
from ahf_ros.prints.ring import ring_family
from ahf_ros.scenes.scene import SceneSettings
from ahf_ros.views.advice import IN_A_ROW, Adviser, advice, advice_on_all
from support.calls import calls_of
from support.command_line import status
from support.scenes import rendered

pytestmark = pytest.mark.lasting

SCENE = SceneSettings(width=800, height=600, targets=12, dot_radius=9, seed=3)


def shown(**changes: object) -> np.ndarray:
    return rendered(replace(SCENE, **changes)).image


def test_large_targets_that_are_far_from_each_other_are_told() -> None:
    image = shown(width=3000, height=2200, targets=3, dot_radius=60)
    lines = advice(image, DetectorSettings(family='aicon14'))
    assert lines == ['3 targets of metashape12: --family metashape12']


@pytest.mark.parametrize(
    ('scene', 'looked_for', 'lines'),
    [
        ({'family': 'aicon14'}, {}, ['12 dots with a band of 14 sectors: --family aicon14 or ']),
        ({'family': 'cct10'}, {}, ['12 dots with a band of 10 sectors: --family cct10']),
        ({}, {'family': 'apriltag_36h11'}, ['12 dots with a band of 12 sectors: --family met']),
        ({'targets': 2}, {'family': 'aicon14'}, ['2 targets of metashape12: --family met']),
        (
            {'targets': 1},
            {'family': 'auto'},
            ['1 target may be of metashape12, too few to be sure'],
        ),
        (
            {'family': 'aicon12', 'targets': 3},
            {'family': 'aicon12,cct12'},
            ['3 targets of aicon12 or cct12: --family says which'],
        ),
        ({'dot_radius': 3.4}, {}, [r'1[012] dots of 3\.\d px are too small: 5 px would do']),
        ({'dot_radius': 3}, {'family': 'auto'}, [r'\d+ dots of 2\.\d px are too small: 5 px']),
        (
            {'family': 'gsi', 'dot_radius': 1.5, 'targets': 6},
            {'family': 'gsi'},
            [r'[56] dots of 1\.3 px are too small: 2\.5 px would do'],
        ),
        (
            {},
            {'min_radius': 14.0},
            [r'12 dots have a radius of (8\.9|9\.[01]) px, min_radius is 14'],
        ),
        (
            {},
            {'max_radius': 6.0},
            [r'12 dots have a radius of (8\.9|9\.[01]) px, max_radius is 6'],
        ),
        ({}, {'polarity': 'bright'}, ['12 dots with a band of 12 .* dark, polarity is bright']),
        (
            {'family': 'cct10', 'edge_shift': -1.0},
            {},
            ['12 dots .*: --family cct10', r'edges are (0\.9|1\.[01]) px too bright'],
        ),
    ],
)
def test_a_second_look_says_why_nothing_was_identified(
    scene: dict, looked_for: dict, lines: list[str]
) -> None:
    given = advice(shown(**scene), DetectorSettings(**{'family': 'metashape12', **looked_for}))
    assert len(given) == len(lines)
    for line, expected in zip(given, lines, strict=True):
        assert re.match(expected, line)


@pytest.mark.parametrize('family', ['apriltag_36h11', 'auto'])
def test_square_markers_in_a_mirror_are_told(family: str) -> None:
    image = np.ascontiguousarray(shown(family='apriltag_36h11', dot_radius=12, targets=4)[:, ::-1])
    lines = advice(image, DetectorSettings(family=family))
    assert lines == ['4 targets of apriltag_36h11 mirrored: flip the images, or print anew']


def test_a_family_that_nobody_knows_is_to_be_learnt(tmp_path: Path) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text('family: mine\nbits: 9\nband: [1.6, 2.4]\nwords: all\n')
    image = shown(family='mine', family_file=str(file))
    (line,) = advice(image, DetectorSettings(family='metashape12'))
    assert line.startswith('12 dots with a band of 9 sectors that no known family has: `ahf le')
    (line,) = advice(image, DetectorSettings(family='metashape12', family_file=str(file)))
    assert line == '12 dots with a band of 9 sectors: --family mine'
    assert ring_family(str(file)).bits == 9


@pytest.mark.parametrize('family', ['metashape12', 'auto'])
def test_ids_that_are_there_twice_are_named(family: str) -> None:
    rendering = rendered(replace(SCENE, targets=4))
    (line,) = advice(np.hstack([rendering.image] * 2), DetectorSettings(family=family))
    named = ', '.join(f'{it.id} of metashape12 (2)' for it in rendering.targets)
    assert line == f'8 targets share IDs and are not reported, {named}: print each ID once'


def test_nothing_is_said_of_what_shows_nothing() -> None:
    noise = np.random.default_rng(0).integers(0, 256, (150, 200)).astype(np.uint8)
    soft = cv2.normalize(cv2.GaussianBlur(noise, (0, 0), 3), None, 0, 255, cv2.NORM_MINMAX)
    for image in (noise, soft, np.tile(np.arange(80, dtype=np.uint8), (60, 1))):
        assert advice(image, DetectorSettings(family='metashape12')) == []
    with pytest.raises(ValueError, match='image is constant'):
        advice(np.zeros((60, 80), np.uint8), DetectorSettings(family='metashape12'))


def test_a_filter_is_advised_where_it_may_show_more() -> None:
    image, settings = shown(dot_radius=12), DetectorSettings(family='metashape12')
    (line,) = advice(image, settings)  # as if no band had been read
    assert line.startswith('12 dots with a band of 12 sectors are hard to read: give --expected-')
    assert advice(image, settings, expected_targets=12) == []


def spots(across: int, down: int, radius: float) -> np.ndarray:
    image = np.full((960, 1280), 30, np.uint8)
    for y in (np.arange(down) + 0.5) * 960 / down:
        for x in (np.arange(across) + 0.5) * 1280 / across:
            centre = round(16 * x), round(16 * y)
            cv2.circle(image, centre, round(16 * radius), 200, -1, cv2.LINE_AA, 4)
    return cv2.GaussianBlur(image, (0, 0), 1)


def texture() -> np.ndarray:
    noise = np.random.default_rng(1).normal(size=(1000, 1200))
    soft = cv2.GaussianBlur(noise, (0, 0), 1.5)
    return np.clip(120 + 45 * soft / soft.std(), 0, 255).astype(np.uint8)


@pytest.mark.parametrize('family', ['metashape12', 'auto'])
@pytest.mark.parametrize('image', [spots(30, 22, 11), spots(100, 75, 4), texture()])
def test_a_second_look_costs_little_where_nothing_is_a_target(
    image: np.ndarray, family: str
) -> None:
    settings = DetectorSettings(family=family)
    advice(image[:200, :200], settings)  # modules are imported, tables made
    given: list[str] = []
    assert calls_of(lambda: given.extend(advice(image, settings))) < 45_000
    assert given == []


def test_a_second_look_is_at_the_part_with_the_most_dots() -> None:
    image = np.full((3000, 4000), 220, np.uint8)
    targets = shown(family='cct10')
    image[2300:2900, 3100:3900] = targets
    (line,) = advice(image, DetectorSettings(family='metashape12'))
    assert re.match(r'1[12] dots with a band of 10 sectors: --family cct10', line)


def finish(adviser: Adviser) -> None:
    if adviser._look:
        adviser._look.join()


def test_a_stream_gets_advice_once_and_only_while_nothing_is_identified() -> None:
    image = shown(family='cct10')
    adviser = Adviser(DetectorSettings(family='metashape12'))
    for identified in (0,) * (IN_A_ROW - 1) + (1,) + (0,) * (IN_A_ROW - 1):
        adviser.see(image, identified)
    finish(adviser)
    assert adviser.lines == []
    adviser.see(image, 0)
    finish(adviser)
    assert adviser.lines == ['12 dots with a band of 10 sectors: --family cct10']
    adviser.see(image, 3)
    assert adviser.lines == []
    for _ in range(2 * IN_A_ROW):
        adviser.see(image, 0)
    finish(adviser)
    assert adviser.lines == []


def test_the_command_advises_on_images_without_a_target_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, family in (('a', 'metashape12'), ('b', 'cct10'), ('c', 'cct10')):
        write_image(tmp_path / f'{name}.png', shown(family=family))
    paths = [tmp_path / f'{name}.png' for name in 'abc']
    assert status('identify', *paths, '--family', 'metashape12') == 0
    said = capsys.readouterr().err
    assert f'{paths[1]}: 12 dots with a band of 10 sectors: --family cct10\n' in said
    assert said.count('dots with a band') == 1
    assert 'N is not given' not in said  # no filter would show `ring` more
    assert status('identify', paths[0], '--family', 'metashape12') == 0
    assert 'dots with a band' not in capsys.readouterr().err


def test_the_report_has_the_advice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('jinja2', reason='pages are written with jinja2')
    write_image(tmp_path / 'a.png', shown(family='cct10'))
    assert status('identify', tmp_path / 'a.png', '--family', 'metashape12', '--json') == 0
    (tmp_path / 'results.jsonl').write_text(capsys.readouterr().out)
    page = tmp_path / 'report.html'
    assert status('report', tmp_path / 'results.jsonl', '-o', page) == 0
    assert '"advice":["12 dots with a band of 10 sectors: --family cct10"]' in page.read_text()


def test_a_few_rings_in_each_of_several_images_are_told_together(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text('family: mine\nbits: 9\nband: [1.6, 2.4]\nwords: all\n')
    mine = {'family': 'mine', 'family_file': str(file), 'targets': 4, 'width': 440, 'height': 330}
    images = [shown(**mine, seed=it) for it in range(6)]
    assert [line for image in images for line in advice(image, DetectorSettings())] == []
    line = '24 dots with a band of 9 sectors that no known family has: `ahf learn-family`'
    line += ' describes it'
    named = [(f'{number}.png', image) for number, image in enumerate(images)]
    together = f'6 images together: {line}'
    assert advice_on_all(iter(named), DetectorSettings()) == [together]  # each is read once
    assert advice_on_all(named[:1], DetectorSettings()) == []
    ten = ('ten.png', shown(family='cct10'))
    (first,) = advice_on_all([*named[:2], ten, *named], DetectorSettings(family='metashape12'))
    assert first == 'ten.png: 12 dots with a band of 10 sectors: --family cct10'
    busy = [('a.png', texture()), ('b.png', spots(30, 22, 11))]
    assert advice_on_all(busy, DetectorSettings()) == []
    for number, image in enumerate(images):
        write_image(tmp_path / f'{number}.png', image)
    (tmp_path / '3b.png').write_bytes(b'broken')
    assert status('identify', tmp_path) == 1
    said = capsys.readouterr().err
    assert said.count('dots with a band') == 1
    assert f'\n6 images together: {line}\n' in said
