"""The documentation: its tables are current, its examples work, its links lead somewhere."""

import doctest
import re
import runpy
from pathlib import Path

import pytest

from benchmarks.gates import value_of
from support import ROOT

pytestmark = pytest.mark.lasting

TOP = ('README.md', 'CONTRIBUTING.md', 'QUALITY_DECLARATION.md')
PAGES = [*(ROOT / name for name in TOP), *sorted((ROOT / 'docs').rglob('*.md'))]
ROOTS = (ROOT, ROOT / 'ahf_ros')
WITH_EXAMPLES = [page for page in PAGES if '>>> ' in page.read_text()]
SCRIPT = runpy.run_path(str(ROOT / 'scripts' / 'write_docs.py'))


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize('page', SCRIPT['PAGES'])
def test_the_tables_are_current(page: str) -> None:
    text = (ROOT / page).read_text()
    assert SCRIPT['with_tables'](page, text) == text, 'run scripts/write_docs.py'


def test_there_are_examples() -> None:
    assert {name(page) for page in WITH_EXAMPLES} >= {'README.md', 'docs/library.md'}


@pytest.mark.parametrize('page', WITH_EXAMPLES, ids=name)
def test_the_examples_do_what_they_say(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    results = doctest.testfile(str(page), module_relative=False)
    assert results.attempted >= 4
    assert results.failed == 0


@pytest.mark.parametrize('page', PAGES, ids=name)
def test_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r'\]\(([^)]+)', page.read_text())
    for link in links:
        file, _, heading = link.partition('#')
        if file.startswith('http'):
            continue
        target = page.parent / file if file else page
        assert target.exists(), link
        assert not heading or heading in headings(target), link


def headings(page: Path) -> set[str]:
    """Return what links to the headings of a page are made of."""
    lines = re.findall(r'^#+ (.*)$', page.read_text(), re.M)
    return {re.sub(r'[^\w -]', '', line.lower()).replace(' ', '-') for line in lines}


@pytest.mark.parametrize('page', PAGES, ids=name)
def test_paths_in_the_text_exist(page: Path) -> None:
    """Those of files, from the root of the repository or that of the package."""
    paths = re.findall(r'`((?:\w+/)+\w+\.(?:py|sh|md|json|yaml|xml|msg|srv))`', page.read_text())
    lost = [path for path in paths if not any((root / path).exists() for root in ROOTS)]
    assert not lost


def test_every_page_is_in_the_index() -> None:
    listed = re.findall(r'^   (\w+)$', (ROOT / 'docs' / 'index.rst').read_text(), re.M)
    pages = [page.stem for page in (ROOT / 'docs').iterdir() if page.suffix in ('.md', '.rst')]
    assert sorted([*listed, 'index']) == sorted(pages)


def test_every_picture_is_shown_and_can_be_made_again() -> None:
    shown = ''.join(page.read_text() for page in PAGES)
    pictures = {path.name: path for path in (ROOT / 'docs' / 'pictures').iterdir()}
    assert [name for name in pictures if f'](pictures/{name})' not in shown] == []
    pytest.importorskip('matplotlib')
    script = runpy.run_path(str(ROOT / 'scripts' / 'write_pictures.py'))
    printed = {f'{name}.svg': content for name, content in script['printed']().items()}
    drawn = {f'{name}.jpg' for name in script['PICTURES'] if name != 'targets'}
    assert set(printed) | drawn <= set(pictures)
    assert all(pictures[name].read_bytes() == content for name, content in printed.items())
    assert len(script['reading']().axes) == 4


def test_pages_of_the_site_that_load_from_other_hosts_are_found(tmp_path: Path) -> None:
    loads = {
        'font.css': '@import "https://example.org/font";',
        'picture.css': 'body { background: url(//example.org/a.png) }',
        'script.html': '<script async src="https://example.org/a.js"></script>',
        'style.html': '<link rel="stylesheet" href="//example.org/a.css">',
    }
    others = {
        'link.html': '<a href="https://example.org">there</a> <img src="../a.png">',
        'own.css': "@import 'own.css'; body { background: url('a.png') }",
    }
    for name, text in (loads | others).items():
        (tmp_path / name).write_text(text)
    script = runpy.run_path(str(ROOT / 'scripts' / 'build_site.py'))
    assert {path.name for path in script['loading'](tmp_path)} == set(loads)


def test_the_readme_is_short() -> None:
    assert len((ROOT / 'README.md').read_text().splitlines()) <= 130


@pytest.mark.parametrize(
    ('page', 'pattern', 'place'),
    [
        ('docs/method.md', r'have a prior of e\^-(\d+)', 'families.ring.codewords:_UNEXPECTED'),
        ('docs/method.md', r'which is a margin below (\d+)', 'families.ring.decoding:CLEAR'),
        ('docs/limits.md', r'At most (\d+)\s+complete', 'vision.dot_search:MAXIMUM_OUTLINES'),
        ('docs/limits.md', r'and (\d+) candidates', 'vision.candidates:MAXIMUM_CANDIDATES'),
        ('docs/limits.md', r'more than (\d+) dots of the other', 'families.gsi.grouping:FEW'),
    ],
)
def test_numbers_are_those_of_the_code(page: str, pattern: str, place: str) -> None:
    (found,) = re.findall(pattern, (ROOT / page).read_text())
    assert float(found) == float(value_of(place))
