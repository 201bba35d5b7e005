"""What users import from `ahf_ros`."""

import ast
import doctest
import inspect
import re
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ahf_ros
from ahf_ros import (
    DetectorSettings,
    Identification,
    IdentificationSettings,
    SceneSettings,
    Target,
    create_detector,
    create_identifier,
    identify,
    read_image,
    render,
    score,
    write_image,
)
from support import ROOT
from support.command_line import python

pytestmark = pytest.mark.lasting

OBJECTS = [name for name in ahf_ros.__all__ if not name.isupper()]


def test_every_public_name_is_there_and_nothing_else_is_told() -> None:
    assert dir(ahf_ros) == sorted([*ahf_ros.__all__, '__version__'])
    assert re.match(r'\d+\.\d+|not installed$', ahf_ros.__version__)
    assert len(set(ahf_ros.__all__)) == len(ahf_ros.__all__)
    for name in ahf_ros.__all__:
        assert getattr(ahf_ros, name) is not None
    with pytest.raises(AttributeError, match="module 'ahf_ros' has no attribute 'identity'"):
        ahf_ros.identity  # noqa: B018


def test_type_checkers_are_told_the_same_names() -> None:
    tree = ast.parse(Path(ahf_ros.__file__).read_text())
    (checked,) = (node for node in tree.body if isinstance(node, ast.If))
    imported = {
        alias.asname: item.module
        for item in checked.body
        if isinstance(item, ast.ImportFrom)
        for alias in item.names
    }
    modules = {name: f'ahf_ros.{module}' for name, module in ahf_ros._MODULES.items()}
    assert imported == modules
    assert Path(ahf_ros.__file__).with_name('py.typed').exists()


def test_nothing_is_imported_before_it_is_used() -> None:
    """Type checkers and commands that compute nothing import `ahf_ros` in no time."""
    program = "import sys, ahf_ros; assert not {'numpy', 'cv2'} & set(sys.modules)"
    assert python('-c', program).returncode == 0


@pytest.mark.parametrize('name', OBJECTS)
def test_the_example_of(name: str) -> None:
    item = getattr(ahf_ros, name)
    module = sys.modules[item.__module__]
    found = doctest.DocTestFinder(recurse=False).find(item, name, module)
    results = [doctest.DocTestRunner().run(test) for test in found]
    assert sum(result.attempted for result in results) >= 1, 'there is no example'
    assert sum(result.failed for result in results) == 0


IMAGE = np.arange(400, dtype=np.uint8).reshape(20, 20)


def test_every_function_is_called_in_an_example_of_the_library_page() -> None:
    examples = doctest.DocTestParser().get_examples((ROOT / 'docs' / 'library.md').read_text())
    calls = [
        node.func.id
        for example in examples
        for node in ast.walk(ast.parse(example.source))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    ]
    functions = {name for name in OBJECTS if inspect.isfunction(getattr(ahf_ros, name))}
    assert len(functions) > 5
    assert functions <= set(calls)


def no_targets(image: np.ndarray) -> list[Target]:
    return []


@pytest.mark.parametrize(
    ('call', 'message'),
    [
        (
            lambda: create_identifier('ring'),
            "settings is 'ring', accepted is an IdentificationSettings; a detector is given",
        ),
        (
            lambda: identify(IMAGE, DetectorSettings()),
            r'detector is DetectorSettings\(.*, accepted is the name of a detector or a function',
        ),
        (
            lambda: identify(IMAGE, settings=DetectorSettings()),
            r'settings is DetectorSettings\(.* DetectorSettings as settings=Identification',
        ),
        (
            lambda: create_detector('ring', settings=IdentificationSettings()),
            r'settings is IdentificationSettings\(.*, accepted is a DetectorSettings',
        ),
    ],
)
@pytest.mark.filterwarnings('ignore:.* by keyword')
def test_arguments_of_another_kind_are_named(call: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize(
    ('call', 'message'),
    [
        (lambda: identify(IMAGE, no_targets), 'identify takes detector by keyword'),
        (lambda: create_identifier(IdentificationSettings()), 'create_identifier takes settings'),
        (lambda: create_detector('ring', DetectorSettings()), 'create_detector takes settings'),
        (
            lambda: create_identifier(detector=no_targets).identify(IMAGE, 0),
            'Identifier.identify takes expected_targets by keyword',
        ),
        (lambda: score([], [], 3.0), 'score takes tolerance by keyword'),
        (lambda: render(SMALL).truth, 'Rendering.truth is Rendering.targets now'),
    ],
)
def test_former_arguments_work_and_warn(call: Any, message: str) -> None:
    with pytest.warns(DeprecationWarning, match=message) as caught:
        call()
    assert [warning.filename for warning in caught] == [__file__]


def test_too_many_arguments_are_refused() -> None:
    with pytest.raises(TypeError, match='positional argument'):
        identify(IMAGE, no_targets, IdentificationSettings(), 3)
    with pytest.raises(TypeError, match='identify got detector twice'):
        identify(IMAGE, no_targets, detector='ring')


def test_images_are_turned_upright_by_the_word_that_the_command_line_has(tmp_path: Path) -> None:
    path = tmp_path / 'image.png'
    write_image(path, IMAGE)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        assert (read_image(path, upright=True) == IMAGE).all()
    with pytest.warns(DeprecationWarning, match='read_image calls turned upright now'):
        assert (read_image(path, turned=True) == IMAGE).all()


SMALL = SceneSettings(width=320, height=240, targets=3, dot_radius=8)


def test_a_scene_its_targets_and_their_truth_are_scored_alike() -> None:
    scene = render(SMALL)
    found = identify(scene.image)
    assert score(scene, found) == score(scene.targets, found.targets)
    assert score(scene, found).right == 3


def test_an_identification_is_a_sequence_of_targets() -> None:
    targets = (
        Target(-1, 0, 1.0, 2.0, 3.0, 3.0),
        Target(4, 9, 5.0, 6.0, 3.0, 3.0, covariance=(0.1, 0.2, 0.2, 0.3), family='mine'),
    )
    found = Identification(targets, expected=1)
    assert (len(found), found.count) == (2, 1)
    assert tuple(found) == targets
    assert (found[-1], found[:1], targets[0] in found) == (targets[1], targets[:1], True)
    assert found.ids.tolist() == [-1, 4]
    assert found.centres.tolist() == [[1.0, 2.0], [5.0, 6.0]]
    assert found.covariances[1].tolist() == [[0.1, 0.2], [0.2, 0.3]]
    none = Identification(())
    assert (none.ids.shape, none.centres.shape) == ((0,), (0, 2))
    assert none.covariances.shape == (0, 2, 2)


def test_an_identification_is_a_table() -> None:
    pytest.importorskip('pandas', reason='pandas is not installed')
    target = Target(4, 9, 5.0, 6.0, 3.0, 3.0, covariance=(0.1, 0.2, 0.2, 0.3), family='mine')
    table = Identification((target,)).to_dataframe()
    (row,) = table.to_dict('records')
    assert (row['id'], row['x'], row['family']) == (4, 5.0, 'mine')
    assert [row[f'covariance_{name}'] for name in ('xx', 'xy', 'yy')] == [0.1, 0.2, 0.3]
    assert list(Identification(()).to_dataframe().columns) == list(table.columns)


def test_without_pandas_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'pandas', None)
    with pytest.raises(ModuleNotFoundError, match='pandas not installed, needed for to_dataframe'):
        Identification(()).to_dataframe()
