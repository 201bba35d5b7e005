"""Every benchmark starts, and every one that is named exists."""

import re

from support import ROOT
from support.command_line import python

PROGRAM = """
import contextlib, io, runpy, sys

for name in sys.argv[1:]:
    sys.argv = [name, '--help']
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed):
            runpy.run_module(f'benchmarks.{name}', run_name='__main__')
    except SystemExit as end:
        if end.code == 0 and printed.getvalue().startswith('usage: '):
            continue
    sys.exit(f'python -m benchmarks.{name} --help does not tell how it is used')
"""


def test_every_benchmark_tells_how_it_is_used() -> None:
    files = sorted((ROOT / 'benchmarks').glob('*.py'))
    names = [file.stem for file in files if "__name__ == '__main__'" in file.read_text()]
    assert len(names) >= 10
    done = python('-c', PROGRAM, *names)
    assert done.returncode == 0, done.stderr


def test_documents_and_docstrings_name_benchmarks_that_exist() -> None:
    folders = ('docs', 'ahf_ros', 'benchmarks', 'scripts', 'test')
    files = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', ROOT / 'CHANGELOG.rst']
    for folder in folders:
        files += [it for it in (ROOT / folder).rglob('*') if it.suffix in ('.md', '.py', '.json')]
    text = ''.join(file.read_text() for file in files)
    named = set(re.findall(r'\bbenchmarks[./]([a-z_]+)', text))
    assert len(named) >= 20
    modules = {file.stem for file in (ROOT / 'benchmarks').iterdir()}  # with their records
    assert named - modules == set()
