"""The page of a network, and its table on the terminal."""

import io
import json
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from ahf_ros.cli.orient import print_network
from ahf_ros.network.network import Rejection
from ahf_ros.network.report.figures import image_figure, sensor_map, views
from ahf_ros.network.report.page import network_page
from ahf_ros.network.report.scene import scene
from ahf_ros.network.solution import Solution
from support.browser import opened
from support.networks import SIZE, known, solution

pytest.importorskip('jinja2')

WRONG = Rejection('view_1.jpg', '9', (812.0, 600.0), 'another target <b>', 7.25)


def network() -> Solution:
    """Return a network with everything that a page can show."""
    whole = solution()
    used = whole.state.used.copy()
    used[12 + 8] = False
    return replace(
        whole,
        network=known(whole.network),
        state=replace(whole.state, used=used),
        rejected=(WRONG,),
        warnings=('a warning & more',),
        expected_rejections=0.2,
    )


def figures(text: str) -> list[ElementTree.Element]:
    return [ElementTree.fromstring(it) for it in re.findall(r'<svg.*?</svg>', text, re.S)]


def test_the_page_shows_what_was_found(tmp_path: Path) -> None:
    (tmp_path / 'report.html').write_bytes(network_page(network(), 'Hall <3>'))
    text = (tmp_path / 'report.html').read_text()
    assert '<h1>Hall &lt;3&gt;</h1>' in text and 'a warning &amp; more' in text
    assert 'another target &lt;b&gt;' in text and '7.2' in text
    shown = text[: text.index('<script')]
    assert 'nan' not in shown.lower().replace('nance', '')
    assert '<p class="line">Usable, with weaknesses: relative precision 1 : ' in text
    assert '1 of 1 check passed' not in text and '2 of 2 checks passed' in text
    assert '1 of 72 image points failed the test; chance alone rejects about 0.2' in text
    assert 'Camera camera: affinity, shear kept as given' in text
    sections = 'verdict next network known targets left-out cameras photographs'
    for section in sections.split():
        assert f'<section id="{section}"' in text
    assert '1 to 2</td><td class="text">control</td>' in text and '-0.020</td><td>0.012' in text
    drawn = figures(text)
    assert [it.attrib['class'] for it in drawn] == ['view'] * 3 + ['image'] * 7


def test_a_page_of_little_is_a_page(tmp_path: Path) -> None:
    """One photograph has no pose, a target no place, nothing gives a scale."""
    whole = solution(unit='')
    positions, points = whole.state.positions.copy(), whole.state.points.copy()
    positions[1] = points[2] = np.nan
    used = (whole.network.observations.photograph != 1) & (whole.network.observations.point != 2)
    residuals = np.where(used[:, None], whole.residuals, np.nan)
    start = replace(whole.state, positions=positions, points=points, used=used)
    part = replace(whole, state=start, residuals=residuals)
    (tmp_path / 'report.html').write_bytes(network_page(part, 'little'))
    text = (tmp_path / 'report.html').read_text()
    assert 'no pose' in text and 'has no scale' in text
    assert 'nan' not in text[: text.index('<script')]
    assert 'weak: 1 target without coordinates, 1 photograph without a pose' in text
    assert '5 of 6' in text and '11 of 12' in text


def test_a_view_shows_places_in_proportion() -> None:
    """Without control points, the longest axis of the targets is to the right."""
    whole = solution()
    caption, text = views(whole)[0]
    assert caption.startswith('From above: length to the right, width up; grid of 200 mm.')
    (figure,) = figures(text)
    centres = {
        group.findtext('title'): np.array(
            [float(group.find('circle').attrib[it]) for it in ('cx', 'cy')]
        )  # type: ignore[union-attr]
        for group in figure.findall("g[@class='target']")
    }
    points = whole.state.points
    axes = np.linalg.svd(points - points.mean(axis=0))[2][:2]
    flat = points @ axes.T
    drawn = np.array([centres[name] for name in whole.network.targets])
    scale = np.ptp(drawn[:, 0]) / np.ptp(flat[:, 0])
    distances = np.linalg.norm(drawn - drawn[0], axis=1)
    np.testing.assert_allclose(distances, scale * np.linalg.norm(flat - flat[0], axis=1), atol=0.2)
    assert len(figure.findall("path[@class='camera']")) == 6


def test_a_view_shows_bars_and_control_points() -> None:
    """Along the axes of the coordinates, where control points give these a meaning."""
    caption, text = views(network())[1]
    assert 'x to the right, z up' in caption
    (figure,) = figures(text)
    kinds = [it.attrib['class'] for it in figure.findall('path') if 'known' in it.attrib['class']]
    assert kinds == ['known', 'known check'] * 2


def test_scale_bars_of_views_are_as_long_as_they_say() -> None:
    whole = solution()
    caption, text = views(whole)[0]
    (figure,) = figures(text)
    written = [(it.text or '') for it in figure.findall('text')]
    lengths = [float(it.removeprefix('ellipses: ').split()[0]) for it in written]
    assert [it.startswith('ellipses') for it in written] == [False, True]
    drawn = []
    for bar in figure.findall("path[@class='bar']"):
        begin, end = re.findall(r'[MH]([0-9.]+)', bar.attrib['d'])
        drawn.append(float(end) - float(begin))
    known = whole.state.points @ np.linalg.svd(np.cov(whole.state.points.T))[0][:, 0]
    circles = [float(it.attrib['cx']) for it in figure.findall('g/circle')]
    scale = np.ptp(circles) / np.ptp(known)
    assert drawn[0] == pytest.approx(scale * lengths[0], abs=0.3)
    enlarged = float(re.findall(r'enlarged ([0-9,]+) times', caption)[0].replace(',', ''))
    assert drawn[1] == pytest.approx(scale * enlarged * lengths[1], rel=0.01)


def test_the_scene_has_what_is_known_in_its_place() -> None:
    whole = network()
    shown = json.loads(json.dumps(scene(whole)))
    points = whole.state.points  # along the axes of the coordinates, as there are control points
    places = np.array(shown['places'])
    np.testing.assert_allclose(places - places[0], points - points[0], atol=1e-3)
    assert (shown['targets'], shown['axes']) == (list(whole.network.targets), ['x', 'y', 'z'])
    assert (shown['bars'], shown['control']) == ([[0, 1, 0], [2, 3, 1]], [[4, 0], [5, 1]])
    spread = np.zeros((3, 3))
    spread[np.triu_indices(3)] = shown['spreads'][7]
    factor = 5.991 * shown['enlarged'] ** 2
    expected = factor * whole.point_covariances[7]
    np.testing.assert_allclose(np.triu(spread), np.triu(expected), rtol=1e-3, atol=1e-3)
    cameras = np.array(shown['cameras'])
    positions = whole.state.positions - (points.min(axis=0) + points.max(axis=0)) / 2
    np.testing.assert_allclose(cameras[:, :3], positions, atol=1e-3)
    np.testing.assert_allclose(cameras[:, 3:6], whole.state.rotations[:, 2], atol=1e-3)


_PICTURE = "return document.getElementById('turning').toDataURL()"
_PLACES = (
    "return [...document.querySelectorAll('.views > *')].map((it) => {"
    'const box = it.getBoundingClientRect(); return [box.left, box.right, box.top]; })'
)


def test_a_browser_turns_the_network_and_leaves_no_half_of_the_page_empty(tmp_path: Path) -> None:
    (tmp_path / 'report.html').write_bytes(network_page(network(), 'Hall'))
    with opened() as browser:
        actions = pytest.importorskip('selenium.webdriver').ActionChains
        browser.set_window_size(1300, 1000)
        browser.get((tmp_path / 'report.html').as_uri())
        assert browser.get_log('browser') == []
        first = browser.execute_script(_PICTURE)
        canvas = browser.find_element('id', 'turning')
        actions(browser).drag_and_drop_by_offset(canvas, 120, 40).perform()
        turned = browser.execute_script(_PICTURE)
        canvas.send_keys('+')
        larger = browser.execute_script(_PICTURE)
        actions(browser).double_click(canvas).perform()
        assert len({first, turned, larger}) == 3
        browser.find_element('id', 'with-photographs').click()
        assert browser.execute_script(_PICTURE) not in (first, turned, larger)
        places = browser.execute_script(_PLACES)
        width, shown = browser.execute_script(
            'return [document.body.scrollWidth, document.documentElement.clientWidth]'
        )
        assert browser.get_log('browser') == []
    assert width <= shown
    left, right = ([it[side] for it in places] for side in (0, 1))
    assert min(left) < 40 and max(right) > shown - 40
    for number in range(0, len(places) - 1, 2):  # two beside each other
        assert places[number + 1][0] > places[number][1] - 1
        assert places[number][2] == pytest.approx(places[number + 1][2], abs=1)


def test_residuals_are_drawn_where_they_are() -> None:
    whole = network()
    (figure,) = figures(image_figure(whole, 1, 1000.0))
    arrows = figure.findall('g')
    assert [it.attrib['class'] for it in arrows].count('arrow lost') == 1
    scale = float(figure.attrib['width']) / SIZE[0]
    circle = arrows[0].find('circle')
    assert circle is not None
    place = [float(circle.attrib[it]) for it in ('cx', 'cy')]
    expected = scale * (whole.network.observations.xy[12] + 0.5)
    np.testing.assert_allclose(place, expected, atol=0.06)
    path = arrows[0].find('path')
    assert path is not None
    moved = [float(it) for it in path.attrib['d'].split('l')[1].split()]
    np.testing.assert_allclose(moved, scale * 1000 * whole.residuals[12], atol=0.06)


def test_a_map_counts_what_was_used() -> None:
    (figure,) = figures(sensor_map(network(), 0, 1000.0))
    titles = [it.text or '' for it in figure.iter('title')]
    assert sum(int(it.split()[0]) for it in titles) == 71
    assert len(figure.findall('rect')) == 12 * 9


def test_the_terminal_shows_what_was_found() -> None:
    console = Console(file=io.StringIO(), width=100)
    print_network(network(), 'out/network', console)
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    for part in (
        'out/network',
        'image points used          │                   71 of 72 │',
        'Usable, with weaknesses: relative precision 1 : ',
        'sigma0',
        'another target <b>',
        '7.2',
        '1 to 2',
        'check',
        '! a warning & more',
        '> Camera camera: targets reach only 31 %',
    ):
        assert re.sub(r'\s+', ' ', part) in re.sub(r'\s+', ' ', text)
