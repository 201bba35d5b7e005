from __future__ import annotations

import doctest
import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md'))]


def test_the_tables_are_current():
    script = runpy.run_path(str(ROOT / 'scripts' / 'write_readme.py'))
    text = (ROOT / 'README.md').read_text()
    assert script['with_tables'](text) == text, 'run scripts/write_readme.py'


def test_the_examples_do_what_they_say():
    results = doctest.testfile(str(ROOT / 'README.md'), module_relative=False)
    assert results.attempted >= 6
    assert results.failed == 0


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_links_to_files_lead_somewhere(page):
    links = re.findall(r'\]\(([^)#]+)', page.read_text())
    local = [link for link in links if not link.startswith('http')]
    assert all((page.parent / link).exists() for link in local), local
