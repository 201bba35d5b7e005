"""The page of a network, and its table on the terminal."""

from __future__ import annotations

import io
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from ahf_ros.cli.orient import print_network
from ahf_ros.orientation.network import Rejection
from ahf_ros.orientation.solution import Solution
from ahf_ros.report.network_figures import image_figure, sensor_map, views
from ahf_ros.report.network_page import write_network_page
from support.networks import SIZE, known, solution

pytest.importorskip('jinja2')

WRONG = Rejection('view_1.jpg', '9', (812.0, 600.0), 'another target <b>', 7.25)


def network() -> Solution:
    """Return a network with everything that a page can show."""
    whole = solution()
    used = whole.start.used.copy()
    used[12 + 8] = False
    return replace(
        whole,
        network=known(whole.network),
        start=replace(whole.start, used=used),
        rejected=(WRONG,),
        warnings=('a warning & more',),
    )


def figures(text: str) -> list[ElementTree.Element]:
    return [ElementTree.fromstring(it) for it in re.findall(r'<svg.*?</svg>', text, re.S)]


def test_the_page_shows_what_was_found(tmp_path: Path) -> None:
    write_network_page(tmp_path / 'report.html', network(), 'Hall <3>')
    text = (tmp_path / 'report.html').read_text()
    assert '<h1>Hall &lt;3&gt;</h1>' in text and 'a warning &amp; more' in text
    assert 'another target &lt;b&gt;' in text and '7.2' in text
    assert '<script' not in text and 'nan' not in text.lower().replace('nance', '')
    for section in ('next', 'network', 'known', 'targets', 'left-out', 'cameras', 'photographs'):
        assert f'<section id="{section}"' in text
    assert '1 to 2</td><td class="text">control</td>' in text and '-0.020</td><td>0.012' in text
    drawn = figures(text)
    assert [it.attrib['class'] for it in drawn] == ['view'] * 3 + ['image'] * 7


def test_a_page_of_little_is_a_page(tmp_path: Path) -> None:
    """One photograph has no pose, a target no place, nothing gives a scale."""
    whole = solution(unit='')
    positions, points = whole.start.positions.copy(), whole.start.points.copy()
    positions[1] = points[2] = np.nan
    used = (whole.network.observations.photograph != 1) & (whole.network.observations.point != 2)
    residuals = np.where(used[:, None], whole.residuals, np.nan)
    start = replace(whole.start, positions=positions, points=points, used=used)
    part = replace(whole, start=start, residuals=residuals)
    write_network_page(tmp_path / 'report.html', part, 'little')
    text = (tmp_path / 'report.html').read_text()
    assert 'no pose' in text and 'has no scale' in text and 'nan' not in text
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
    points = whole.start.points
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
        'sigma0',
        'another target <b>',
        '7.2',
        '1 to 2',
        'check',
        '! a warning & more',
        '> Camera camera: targets reach only 31 %',
    ):
        assert re.sub(r'\s+', ' ', part) in re.sub(r'\s+', ' ', text)
