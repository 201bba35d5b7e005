"""What holds for the package as a whole."""

import ast
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections import Counter
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

import cv2
import pytest

from ahf_ros.nodes.start import NODES
from ahf_ros.scenes.scene import SceneSettings, render
from support import ROOT
from support.command_line import python

pytestmark = pytest.mark.lasting

PACKAGE = ROOT / 'ahf_ros'
MODULES = {
    '.'.join(file.relative_to(ROOT).with_suffix('').parts): file for file in PACKAGE.rglob('*.py')
}
"""The files of the package by the names of their modules."""

NOT_DISTRIBUTED = ('.ci/*', '.gitignore')
ADDED_BY_SETUPTOOLS = ('MANIFEST.in', 'README.md', 'pyproject.toml', 'setup.py')

NOT_INSTALLED = {'Metashape', 'typing_extensions'}
"""What is only in the console of other software, and what only type checkers import."""

OWN = {'ahf_ros', 'benchmarks', 'support'}

needs_rosbags = pytest.mark.skipif(
    not importlib.util.find_spec('rosbags'), reason='rosbags is not installed'
)

WITHOUT_ROS = """
import importlib, sys

for name in ('rclpy', 'sensor_msgs', 'std_msgs', 'rosidl_runtime_py', 'rosidl_parser'):
    sys.modules[name] = None
"""
WITH_ROS = 'import ahf_ros.msg, rclpy, sensor_msgs.msg, sys'
IMPORT = """
for name in sys.argv[1:]:
    importlib.import_module(name)
"""
COMMANDS = """
import json
from ahf_ros.cli import main
sys.exit(max(map(main, json.loads(sys.argv[1]))))
"""


@cache
def imported(file: Path) -> set[str]:
    """Return the names of all modules that a file imports, and of what it takes out of them."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f'{node.module}.{alias.name}' for alias in node.names)}
    return names


@needs_rosbags
def test_everything_but_the_nodes_works_without_ros() -> None:
    without = [name for name in MODULES if not name.startswith('ahf_ros.nodes')]
    names = [name for name in without if not name.endswith(('.__init__', '.__main__'))]
    assert len(names) > 50
    names += [f'ahf_ros.nodes.{name}' for name in ('settings', 'drivers', 'interfaces')]
    done = python('-c', WITHOUT_ROS + IMPORT, *names)
    assert done.returncode == 0, done.stderr


def test_nothing_is_written_where_it_is_installed(tmp_path: Path) -> None:
    package, image = tmp_path / 'installed' / 'ahf_ros', tmp_path / 'image.png'
    shutil.copytree(ROOT / 'ahf_ros', package, ignore=shutil.ignore_patterns('__pycache__'))
    folders = [package, *(it for it in package.rglob('*') if it.is_dir())]
    before = {it: it.stat().st_mtime_ns for it in package.rglob('*')}
    for folder in folders:
        folder.chmod(0o555)  # root may write even so
    scene = SceneSettings(width=320, height=240, targets=3, dot_radius=8.0)
    cv2.imwrite(str(image), render(scene).image)
    path = os.pathsep.join([str(package.parent), os.environ.get('PYTHONPATH', '')])
    done = subprocess.run(
        [sys.executable, '-B', '-m', 'ahf_ros.cli', 'identify', str(image), '--json'],
        env={**os.environ, 'PYTHONPATH': path},
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    for folder in folders:
        folder.chmod(0o755)
    assert (done.returncode, len(json.loads(done.stdout)['targets'])) == (0, 3), done.stderr
    assert before == {it: it.stat().st_mtime_ns for it in package.rglob('*')}


@needs_rosbags
def test_results_are_the_same_by_byte_with_and_without_ros(tmp_path: Path) -> None:
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    from support import bags

    images = bags.scenes(2)
    cv2.imwrite(str(tmp_path / 'image.png'), images[0])
    bags.write_ros2(tmp_path / 'bag', bags.recorded(bags.typestore(), images))
    search = '--detector', 'traditional', '--expected-targets', '4', '--population', '6'
    given = []
    for before in (WITH_ROS, WITHOUT_ROS):
        out = tmp_path / str(len(given)) / 'out'
        lines = [
            ['identify', str(tmp_path / 'image.png'), '--json', *search],
            ['bag', str(tmp_path / 'bag'), str(out), *search],
        ]
        done = python('-c', before + COMMANDS, json.dumps(lines))
        assert done.returncode == 0, done.stderr
        files = [it for it in sorted(out.rglob('*')) if it.is_file()]
        line = re.sub(r'(?<="elapsed_s": )[\d.]+', '0', done.stdout.splitlines()[0])
        given.append([line, *((it.relative_to(out), it.read_bytes()) for it in files)])
    assert json.loads(given[0][0])['targets']
    assert len(given[0]) > 2
    assert given[0] == given[1]


def test_every_module_is_used() -> None:
    entries = (ROOT / 'pyproject.toml').read_text()
    users = [*MODULES.values(), *(ROOT / 'scripts').iterdir(), *(ROOT / 'launch').iterdir()]
    used = Counter(name for file in users if file.is_file() for name in imported(file))
    # Registries name what they import when it is asked for.
    words = {
        word for file in MODULES.values() for word in re.findall(r"'([\w.]+)", file.read_text())
    }
    unused = {
        name
        for name in MODULES
        if not name.endswith(('.__init__', '.__main__'))
        and not used[name]
        and f'"{name}:' not in entries
        and name not in words
        and name.removeprefix('ahf_ros.') not in words
    }
    assert not unused


def test_tests_of_bags_skip_without_rosbags() -> None:
    for file in (ROOT / 'test').rglob('test_*.py'):
        text = file.read_text()
        if re.search(r'^from (ahf_ros\.bag|rosbags)\b', text, re.M):
            skips = "pytest.importorskip('rosbags'" in text
            assert skips, f'{file} needs rosbags, accepted is pytest.importorskip before'


@pytest.mark.parametrize(
    ('folders', 'tests'),
    [(('ahf_ros', 'launch'), False), (('test', 'support', 'benchmarks'), True)],
)
def test_pyproject_names_what_is_imported(folders: tuple[str, ...], tests: bool) -> None:
    tomllib = pytest.importorskip('tomllib', reason='Python is older than 3.11')
    project = tomllib.loads((ROOT / 'pyproject.toml').read_text())
    tables = project['tool']['ahf_ros']
    extras = project['project']['optional-dependencies']
    ours = {it: extras[it] for it in extras if tests or not it.startswith('test')}
    lists = [project['project']['dependencies'], tables['packaging']['nodes'], *ours.values()]
    packages = {re.split(r'[^\w.-]', it)[0] for each in lists for it in each}
    declared = {tables['names'].get(it, {}).get('import', it.replace('-', '_')) for it in packages}
    declared |= {*tables['ros']['messages'], *tables['ros']['run']}
    declared |= set(tables['ros']['test'] if tests else ())
    files = [file for folder in folders for file in (ROOT / folder).rglob('*.py')]
    names = {name.split('.')[0] for file in files for name in imported(file)}
    names -= OWN | NOT_INSTALLED | sys.stdlib_module_names
    foreign = {it for it in names if not it.startswith('test_')}
    assert len(foreign) > 5
    assert foreign - declared == set()


def test_the_maintainer_is_not_of_a_host_that_may_be_somebodys() -> None:
    root = ElementTree.parse(ROOT / 'package.xml').getroot()
    people = [*root.iter('maintainer'), *root.iter('author')]
    assert [person.get('email') for person in people] == ['maintainers@example.org'] * 2


def test_the_demo_installs_only_what_it_needs(tmp_path: Path) -> None:
    if not shutil.which('make'):
        pytest.skip('make is not installed')
    command = ['make', '--dry-run', '--silent', f'VENV={tmp_path / "new"}']
    told = [
        subprocess.check_output([*command, target], cwd=ROOT, text=True)
        for target in ('demo', 'lint')
    ]
    assert [text.count('pip install') for text in told] == [2, 4]  # the first one is pip itself
    for extra in ('ahf_ros[test', './ros'):
        assert [extra in text for text in told] == [False, True]


def test_ros2_run_finds_every_program() -> None:
    text = (ROOT / 'CMakeLists.txt').read_text()
    (programs,) = re.findall(r'foreach\(_program (.*)\)', text)
    assert set(programs.split()) == {'ahf', 'demo', *NODES}


@pytest.mark.parametrize(
    ('name', 'said'), [('demo', 'ahf demo'), ('pose', 'ros2 run ahf_ros pose')]
)
def test_a_program_is_what_it_is_called(name: str, said: str, tmp_path: Path) -> None:
    program = tmp_path / name
    shutil.copy(ROOT / 'scripts' / 'program', program)
    done = python(program, '--help')
    assert done.returncode == 0, done.stderr
    assert said in done.stdout.splitlines()[0]


class ImportingPlugin:
    """A plugin that imports test modules while they are collected, as that of launch_testing."""

    def pytest_pycollect_makemodule(self) -> None:
        pytest.skip('a package is not installed', allow_module_level=True)


def test_a_module_that_skips_does_not_end_the_collection(request: pytest.FixtureRequest) -> None:
    here = Path(__file__)
    manager = request.config.pluginmanager
    plugin = ImportingPlugin()
    manager.register(plugin)
    try:
        hooks = request.session.gethookproxy(here)
        made = hooks.pytest_pycollect_makemodule(module_path=here, parent=request.session)
    except pytest.skip.Exception:
        made = None
    finally:
        manager.unregister(plugin)
    assert type(made) is pytest.Module


def test_tests_do_not_need_loggers_that_propagate() -> None:
    """launch, and so its plugin of pytest, makes all later loggers keep from the root logger."""
    files = (ROOT / 'test').rglob('*.py')
    users = [file for file in files if re.search(r'\bcaplog[,:.)]', file.read_text())]
    assert users == [], 'caplog sees nothing where launch is installed'


def distributed(file: str) -> bool:
    """Return whether MANIFEST.in takes a file into the source distribution."""
    for line in (ROOT / 'MANIFEST.in').read_text().splitlines():
        command, *patterns = line.split()
        if command == 'include' and file in patterns:
            return True
        if command == 'graft' and file.startswith(tuple(f'{folder}/' for folder in patterns)):
            return True
    return file in ADDED_BY_SETUPTOOLS


def test_the_source_distribution_holds_everything() -> None:
    if not (ROOT / '.git').exists() or not shutil.which('git'):
        pytest.skip('this is a source distribution')
    command = ['git', '-c', 'safe.directory=*', 'ls-files']  # also those of another user
    listed = subprocess.check_output(command, cwd=ROOT, text=True).splitlines()
    tracked = [file for file in listed if (ROOT / file).exists()]
    assert len(tracked) > 100
    missing = [file for file in tracked if not distributed(file)]
    assert [file for file in missing if not any(fnmatch(file, it) for it in NOT_DISTRIBUTED)] == []


@needs_rosbags
def test_only_public_names_of_rosbags_are_used() -> None:
    """rosbags has no upper bound: what is in no `__all__` may go at any time."""
    for file in PACKAGE.rglob('*.py'):
        if 'rosbags' not in (text := file.read_text()):
            continue
        parsed = ast.parse(text)
        typing = {
            inner
            for node in ast.walk(parsed)
            if isinstance(node, ast.If) and ast.unparse(node.test) == 'TYPE_CHECKING'
            for inner in ast.walk(node)
        }
        for node in set(ast.walk(parsed)) - typing:
            if isinstance(node, ast.ImportFrom) and (node.module or '').startswith('rosbags.'):
                module = importlib.import_module(node.module)
                assert hasattr(module, '__path__'), f'{file}: {node.module} is not public'
                public = getattr(module, '__all__', vars(module))
                others = [it.name for it in node.names if it.name not in public]
                assert not others, f'{file}: {node.module} has no public {others}'
