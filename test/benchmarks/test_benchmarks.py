"""Every benchmark starts."""

from __future__ import annotations

import subprocess
import sys

from support import ROOT

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
    done = subprocess.run(
        [sys.executable, '-c', PROGRAM, *names],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
