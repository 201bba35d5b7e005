"""The documentation: its tables are current, its examples work, its links lead somewhere."""

from __future__ import annotations

import doctest
import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').rglob('*.md'))]
ROOTS = (ROOT, ROOT / 'ahf_ros')
WITH_EXAMPLES = [page for page in PAGES if '>>> ' in page.read_text()]
SCRIPT = runpy.run_path(str(ROOT / 'scripts' / 'write_docs.py'))


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize('page', SCRIPT['PAGES'])
def test_the_tables_are_current(page: str):
    text = (ROOT / page).read_text()
    assert SCRIPT['with_tables'](page, text) == text, 'run scripts/write_docs.py'


def test_there_are_examples():
    assert {name(page) for page in WITH_EXAMPLES} >= {'README.md', 'docs/library.md'}


@pytest.mark.parametrize('page', WITH_EXAMPLES, ids=name)
def test_the_examples_do_what_they_say(page: Path):
    results = doctest.testfile(str(page), module_relative=False)
    assert results.attempted >= 4
    assert results.failed == 0


@pytest.mark.parametrize('page', PAGES, ids=name)
def test_links_lead_somewhere(page: Path):
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
def test_paths_in_the_text_exist(page: Path):
    """Those of files, from the root of the repository or that of the package."""
    paths = re.findall(r'`((?:\w+/)+\w+\.(?:py|sh|md|json|yaml|xml|msg|srv))`', page.read_text())
    lost = [path for path in paths if not any((root / path).exists() for root in ROOTS)]
    assert not lost


def test_the_readme_is_short():
    assert len((ROOT / 'README.md').read_text().splitlines()) <= 150
