"""Every reader on damaged files: it reads them, or says what is wrong with which file.

`--hypothesis-profile attack` tries many more. Bags have a test of their own, test_bag_hostile.py.
"""

import ast
import importlib
import pkgutil
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

pytest.importorskip('PIL', reason='Pillow is not installed')

import ahf_ros
from ahf_ros.base.opening import READERS
from support.hostile import generators, mutated, mutated_text
from support.readers import Sample, samples

with TemporaryDirectory() as _network:
    SAMPLES = list(samples(Path(_network)))

PACKAGE = Path(ahf_ros.__file__).parent
LONGEST = 10.0  # s of the processor, where a file takes milliseconds
OPENERS = {'open', 'read_text', 'read_bytes', 'imread', 'loadtxt', 'genfromtxt', 'fromfile'}
"""Names of functions that open files."""

MAY_OPEN = {
    **dict.fromkeys(('base/opening.py', 'base/writing.py'), 'ways in and out'),
    'kernels/__init__.py': 'the header of the package',
    'files/whole.py': 'standard error',
    'files/arrays.py': 'members of an archive in memory',
    'files/exif.py': 'a file that is open already',
    'network/export/colmap.py': 'a database that was written before',
    'network/export/xml_files.py': 'a script of the package',
    'files/html_pages.py': 'parts of pages',
    **dict.fromkeys(('bag/source.py', 'bag/mcap_records.py', 'bag/output.py'), 'bags'),
    'bag/definitions.py': 'definitions of the package',
    'batch/engine.py': 'what the system says of cores',
    'batch/results.py': 'results that are gone on with, see test_results.py',
    'cli/__init__.py': 'standard streams',
    'families/external/command.py': 'what a program printed',
    'vision/logistic.py': 'weights of the package',
    'nodes/process.py': 'no files',
    'nodes/processes.py': 'what the system says of processes',
}
"""Modules that may open something else than what a user names, and what."""


@pytest.fixture(scope='module')
def folder() -> Iterator[Path]:
    with TemporaryDirectory() as made:
        yield Path(made)


def read(sample: Sample, content: bytes, folder: Path) -> Any:
    """Return what a reader makes of a content, in a folder of its own."""
    with TemporaryDirectory(dir=folder) as place:
        for name, other in sample.beside:
            Path(place, name).write_bytes(other)
        Path(place, sample.name).write_bytes(content)
        return sample.read(Path(place, sample.name))


@pytest.mark.parametrize('sample', SAMPLES, ids=lambda it: it.name)
@settings(max_examples=settings.default.max_examples // 2)
@given(random=generators())
def test_a_damaged_file_is_read_or_refused_by_name(
    sample: Sample, folder: Path, random: np.random.Generator
) -> None:
    harm = mutated_text if sample.text and random.integers(4) else mutated
    content = harm(sample.content, random)
    begun = time.process_time()
    try:
        read(sample, content, folder)
    except ValueError as error:
        assert type(error) is ValueError
        assert str(folder) in str(error)
    assert time.process_time() - begun < LONGEST


def test_every_reader_is_tested_on_damaged_files(folder: Path) -> None:
    for module in pkgutil.walk_packages(ahf_ros.__path__, 'ahf_ros.'):
        if '.nodes' not in module.name and not module.name.endswith('__main__'):
            with suppress(ModuleNotFoundError):  # of an extra
                importlib.import_module(module.name)
    called = set()

    def note(frame: FrameType, event: str, _: Any) -> None:
        called.add(frame.f_code)

    sys.setprofile(note)
    try:
        for sample in SAMPLES:
            with suppress(ValueError):  # a table that has not the columns of all readers
                read(sample, sample.content, folder)
    finally:
        sys.setprofile(None)
    missing = [it.__qualname__ for it in READERS if it.__wrapped__.__code__ not in called]
    assert not missing


@pytest.mark.lasting
def test_nothing_else_opens_files() -> None:
    found = set()
    for path in PACKAGE.rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            called = node.func if isinstance(node, ast.Call) else None
            name = getattr(called, 'attr', getattr(called, 'id', ''))
            imported = isinstance(called, ast.Name) and name != 'open'
            if name in OPENERS and not imported:
                found.add(path.relative_to(PACKAGE).as_posix())
    assert found <= MAY_OPEN.keys()
