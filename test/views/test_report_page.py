"""The page of a report, in a real browser, and what becomes of it where something fails."""

import errno
import os
import re
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from ahf_ros.base.target import SquareMarker
from support.browser import opened
from support.command_line import status
from support.results import record, save_image, save_lines, searched, target, undecoded

pytest.importorskip('jinja2', reason='pages are written with jinja2')

HOSTILE = '</script><script>document.title="taken"<!--.png'
MANY = 40


report = partial(status, 'report')


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with images, results and a truth."""
    folder = tmp_path_factory.mktemp('report')
    image = save_image(folder / 'photos' / 'm.png')
    ids = (1, 2, 3, 30)
    targets = [target(number) for number in ids]
    filtered = [*targets[:2], target(3, 0.91), undecoded('uncertain', 30, 0.4)]
    records = [
        record(image, *targets, expected=4, expected_ids=ids),
        record(save_image(folder / 'photos' / 'b.png'), *filtered, expected=4, **searched()),
        record(folder / 'photos' / 'gone.png', *targets, expected=4),
        record(HOSTILE, *targets[:1], expected=4, expected_ids=ids),
    ]
    for number in range(MANY):
        more = folder / 'photos' / f'many_{number:03}.png'
        more.symlink_to(image)
        records.append(record(more, *targets[: 1 + number % 4], expected=4, expected_ids=ids))
    save_lines(folder / 'results.jsonl', *records)
    rows = ['image,id,x,y', 'b.png,1,38.1,20', 'b.png,2,56,20', 'b.png,3,74,20', 'b.png,9,120,100']
    (folder / 'truth.csv').write_text('\n'.join(rows))
    return folder


@pytest.fixture(scope='module')
def page(folder: Path) -> Path:
    page = folder / 'report.html'
    assert report(folder, '-o', page, '--truth', folder / 'truth.csv', '--max-size', 0.7) == 1
    return page


@pytest.fixture(scope='module')
def browser() -> Iterator[Any]:
    with opened() as browser:
        yield browser


class Reader:
    """What a test does with the page."""

    def __init__(self, browser: Any) -> None:
        from selenium.webdriver.common.keys import Keys

        self.browser, self.keys = browser, Keys

    def one(self, selector: str) -> Any:
        return self.browser.find_element('css selector', selector)

    def all(self, selector: str) -> list[Any]:
        return self.browser.find_elements('css selector', selector)

    def text(self, selector: str) -> str:
        return self.one(selector).text

    def names(self) -> list[str]:
        return [it.text for it in self.all('#rows .file')]

    def press(self, *keys: str) -> None:
        self.one('#rows').send_keys(*keys)

    def write(self, selector: str, text: str) -> None:
        field = self.one(selector)
        field.send_keys(self.keys.CONTROL, 'a')
        field.send_keys(self.keys.BACKSPACE, text)

    def box(self) -> list[float]:
        return [float(it) for it in self.one('#viewer svg').get_dom_attribute('viewBox').split()]


def test_people_find_and_look_at_images(browser: Any, page: Path, folder: Path) -> None:
    browser.get(page.as_uri())
    use = Reader(browser)
    assert browser.title == use.text('h1') == folder.name
    assert use.text('#count') == '44 of 44 images'
    totals = use.text('#totals')
    assert re.search(r'\b2 without picture', totals), totals
    assert 10 < len(use.names()) < 44  # only those in sight
    assert use.names()[:3] == ['m.png', 'b.png', 'gone.png']

    # sort
    head = {it.text: it for it in use.all('#head button')}
    head['Missed'].click()
    assert use.all('#head [aria-sort="descending"]')
    missed = browser.execute_script('return table.shown.map((it) => it.missed)')
    assert missed == sorted(missed, reverse=True) != missed[::-1]
    head['Image'].click()
    assert 'b.png' in use.names()[:2]
    head['Image'].click()
    head['Image'].click()

    # filter
    use.write('#name-filter', 'MANY_01 .PNG')
    assert use.text('#count') == '10 of 44 images'
    use.write('#name-filter', '')
    browser.execute_script("document.querySelector('[value=missed]').click()")
    use.write('#id-filter', '30')
    assert use.text('#count') == '31 of 44 images'
    use.write('#id-filter', '')
    browser.execute_script("document.querySelector('[value=doubtful]').click()")
    assert use.names() == ['b.png']

    # look
    use.press('j')
    assert use.text('#image-name') == 'b.png'
    assert '1 missed · 2 doubtful' in use.text('#image-summary')
    kinds = [len(use.all(f'#viewer .is-{it}')) for it in ('found', 'doubtful', 'missed')]
    assert kinds == [2, 2, 1]
    assert use.text('#viewer .is-missed .id') == '9'
    use.press('s')
    assert [it.text.split(',')[0] for it in use.all('.caption')] == ['original', 'filtered']
    use.press('s')
    whole = use.box()
    use.press('+')
    assert use.box()[2] == pytest.approx(whole[2] / 1.4)
    use.press(use.keys.SHIFT, use.keys.ARROW_RIGHT)
    assert use.box()[0] > whole[0]
    use.press('0')
    assert use.box() == whole == [-0.5, -0.5, 160.0, 120.0]
    event = 'new WheelEvent("wheel", {deltaY: -100, clientX: 900, clientY: 300})'
    browser.execute_script(f'arguments[0].dispatchEvent({event})', use.one('#viewer svg'))
    assert use.box()[2] < whole[2]
    use.all('#panel tbody tr')[0].click()
    assert use.box()[0] < 38 < sum(use.box()[::2])  # the target 1 is in sight
    assert use.all('.mark.chosen')

    # why
    use.one('#tab-undecided').click()
    assert 'read, but not certain' in use.text('#panel')
    assert 'missed: no dot was found at its place' in use.text('#panel')
    use.one('#tab-search').click()
    assert '3 filters tried; the search ended because the limit' in use.text('#panel')
    assert len(use.all('#panel svg.plot')) == 2
    assert len(use.all('#panel svg.plot circle.dot')) == 6
    use.one('#tab-plots').click()
    assert len(use.all('#panel svg.plot')) == 4
    use.press('a')
    assert use.text('#all-side h3') == '5 IDs'
    assert use.text('#all-side tbody tr').startswith('1 44')

    # what is not there
    browser.execute_script("document.querySelector('[value=problem]').click()")
    assert use.names() == ['gone.png', HOSTILE.rpartition('/')[2]]
    use.press('j')
    assert 'gone.png is not there; --images says where it is' in use.text('#viewer .lost')
    assert len(use.all('#viewer .is-found')) == 4  # what was found is shown nevertheless
    browser.execute_script("document.querySelector('[value=all]').click()")
    assert use.all('#rows img.thumb')
    assert browser.execute_script('return matchMedia("print").matches') is False
    use.one('#theme').click()
    assert use.one('html').get_attribute('data-theme') in ('light', 'dark')
    use.press('?')
    assert use.one('#help').is_displayed()
    assert [it for it in browser.get_log('browser') if it['level'] in ('SEVERE', 'WARNING')] == []


def test_squares_are_drawn_as_squares(browser: Any, tmp_path: Path) -> None:
    corners = ((10.0, 10.0), (30.0, 10.0), (30.0, 30.0), (10.0, 30.0))
    square = SquareMarker(5, 5, 20.0, 20.0, 10.0, 10.0, family='aruco_4x4_50', corners=corners)
    image = save_image(tmp_path / 'a.png')
    save_lines(tmp_path / 'results.jsonl', record(image, square))
    assert report(tmp_path / 'results.jsonl', '-o', tmp_path / 'a.html') == 0
    browser.get((tmp_path / 'a.html').as_uri())
    drawn = browser.find_elements('css selector', '.mark polygon.line')
    assert [it.get_attribute('points') for it in drawn] == ['10,10 30,10 30,30 10,30']
    assert browser.find_elements('css selector', '.mark ellipse') == []


def test_every_control_has_a_name(page: Path) -> None:
    text = page.read_text()
    for tag in re.findall(r'<(?:button|input)[^>]*>[^<]*', text.split('<script')[0]):
        assert re.search(r'aria-label=|>\s*\w', tag) or 'type="search"' in tag or 'range' in tag
    assert not re.search(r'(?:src|href)="?https?:', text)
    assert "default-src 'none'" in text


def test_a_page_stays_below_its_size_and_names_what_is_lost(
    page: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert page.stat().st_size < 0.7e6
    again = folder / 'again.html'
    arguments = (folder / 'results.jsonl', '-o', again, '--threads', 1, '--max-size', 0.4)
    assert report(*arguments, '--title', 'Bridge') == 1
    said = capsys.readouterr().err
    assert 'gone.png is not there' in said
    assert '44 images' in said
    assert again.stat().st_size < 0.4e6
    assert again.read_text().count('id="original-') == MANY + 2
    assert '<title>Bridge' in again.read_text()
    assert report(folder / 'results.jsonl', '-o', again, '--images', folder / 'photos') == 1


def test_no_page_is_left_in_part(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    results, page = folder / 'results.jsonl', folder / 'kept' / 'report.html'
    page.parent.mkdir()
    page.write_text('whole')

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr('ahf_ros.base.writing.os.fsync', full)
        assert report(results, '-o', page) == 1
    assert 'report.html cannot be written: No space left on device' in capsys.readouterr().err
    assert [it.name for it in page.parent.iterdir()] == ['report.html']
    assert page.read_text() == 'whole'
    monkeypatch.setitem(sys.modules, 'jinja2', None)
    assert report(results, '-o', page) == 2
    assert "pip install 'ahf_ros[report]'" in capsys.readouterr().err
    assert report(folder / 'no.jsonl', '-o', page) == 1
    said = capsys.readouterr().err
    assert 'no.jsonl cannot be read' in said
    assert 'there is no result' in said
    assert report(results, '-o', page, '--truth', folder / 'no.csv') == 1
    assert page.read_text() == 'whole'
