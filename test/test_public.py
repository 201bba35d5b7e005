"""What users import from `ahf_ros`."""

from __future__ import annotations

import ast
import doctest
import subprocess
import sys
from pathlib import Path

import pytest

import ahf_ros

OBJECTS = [name for name in ahf_ros.__all__ if not name.isupper()]


def test_every_public_name_is_there_and_nothing_else_is_told() -> None:
    assert set(ahf_ros.__all__) <= set(dir(ahf_ros))
    assert len(set(ahf_ros.__all__)) == len(ahf_ros.__all__)
    for name in ahf_ros.__all__:
        assert getattr(ahf_ros, name) is not None
    with pytest.raises(AttributeError, match="module 'ahf_ros' has no attribute 'identity'"):
        ahf_ros.identity  # noqa: B018


def test_type_checkers_are_told_the_same_names() -> None:
    tree = ast.parse(Path(ahf_ros.__file__).read_text())
    (checked,) = (node for node in tree.body if isinstance(node, ast.If))
    imported = {
        alias.name: item.module
        for item in checked.body
        if isinstance(item, ast.ImportFrom)
        for alias in item.names
    }
    modules = {name: f'ahf_ros.{module}' for name, module in ahf_ros._MODULES.items()}
    assert imported == modules
    assert set(modules) == set(ahf_ros.__all__)
    assert Path(ahf_ros.__file__).with_name('py.typed').exists()


def test_nothing_is_imported_before_it_is_used() -> None:
    """Type checkers and commands that compute nothing import `ahf_ros` in no time."""
    program = "import sys, ahf_ros; assert not {'numpy', 'cv2'} & set(sys.modules)"
    subprocess.run([sys.executable, '-c', program], check=True)


@pytest.mark.parametrize('name', OBJECTS)
def test_the_example_of(name: str) -> None:
    item = getattr(ahf_ros, name)
    module = sys.modules[item.__module__]
    found = doctest.DocTestFinder(recurse=False).find(item, name, module)
    results = [doctest.DocTestRunner().run(test) for test in found]
    assert sum(result.attempted for result in results) >= 1, 'there is no example'
    assert sum(result.failed for result in results) == 0
