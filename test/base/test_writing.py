"""Files and sets of files that are old or new, and nothing between, wherever writing fails."""

import ast
import json
import os
import signal
import stat
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from pathlib import Path
from shutil import copytree, rmtree
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from ahf_ros.base.inputs import inputs_kept, register_input
from ahf_ros.base.writing import complete, locked, write_files, write_set, write_whole
from ahf_ros.clouds.registration.field import Field, added
from ahf_ros.clouds.registration_files import ScanRecord, write_registration
from ahf_ros.network.export.formats import write_network_export
from ahf_ros.network.files.network_results import read_network, write_network
from ahf_ros.network.transform import Transform
from support import ROOT
from support.disk import room_for
from support.faults import with_fault
from support.networks import known, solution
from support.scans import measured

Write = Callable[[Path], object]

WRITERS = {
    *('write_text', 'write_bytes', 'imwrite', 'savetxt', 'tofile', 'touch', 'rename'),
    *('copyfile', 'copytree', 'symlink_to', 'hardlink_to'),
}
"""Names of functions that write files, of modules and of paths."""

MAY_WRITE = {
    'base/writing.py': 'the way out',
    'bag/source.py': 'copies of damaged bags in a folder of its own',
    'bag/mcap_records.py': 'checksums in a bag that has not its place yet',
    'batch/results.py': 'lines behind those that are there, see test_results.py',
    'cli/__init__.py': 'the device null',
    'families/external/command.py': 'the image for a program, in a folder of its own',
}


def networks() -> tuple[Write, Write]:
    """Return what writes a network and another one, which lacks files of the first."""
    first = solution()
    second = replace(first, network=known(first.network), sigma0=1.5)
    mounting = {'mounting.json': b'{}', 'report.html': b'<p>'}
    return (
        lambda folder: write_network(folder, first, mounting),
        lambda folder: write_network(folder, second),
    )


def registrations() -> tuple[Write, Write]:
    """Return what writes a scan with its cloud, and another scan."""

    def write(name: str, seed: int) -> Write:
        random = np.random.default_rng(seed)
        scan = measured('abcd', random.normal(size=(4, 3)), Transform(np.eye(3)), 1e-3, random)
        cloud = random.normal(size=(4, 5, 3)).astype('f4').view([(it, 'f4') for it in 'xyz'])
        cloud, field = cloud[..., 0], added(Field(), scan)
        return lambda folder: write_registration(folder, 'a', field, [ScanRecord(name)], [cloud])

    return write('scan_1', 1), write('scan_9', 2)


def exports() -> tuple[Write, Write]:
    """Return what writes an export with files in several folders, and another one."""
    first, second = solution(), solution(targets=13)
    return (
        lambda folder: write_network_export('colmap', folder, first),
        lambda folder: write_network_export('colmap', folder, second),
    )


def files() -> tuple[Write, Write]:
    """Return what writes a single file, and another one in the place of it."""
    return (
        lambda folder: write_whole(folder / 'a.html', b'first'),
        lambda folder: write_whole(folder / 'a.html', b'second'),
    )


def contents(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder and those in it, but for parts that a killed process left."""
    found = [it for it in folder.rglob('*') if it.is_file() and not it.name.endswith('.part')]
    return {str(it.relative_to(folder)): it.read_bytes() for it in found}


@pytest.fixture
def quick_path() -> Iterator[Path]:
    """Yield a folder in memory, where there is one: `fsync` takes its time on a disk."""
    with TemporaryDirectory(dir='/dev/shm' if os.access('/dev/shm', os.W_OK) else None) as folder:
        yield Path(folder)


@pytest.mark.lasting
@pytest.mark.parametrize('kill', [False, True])
@pytest.mark.parametrize('kind', [networks, registrations, exports, files])
def test_all_is_old_or_all_is_new_wherever_writing_fails(
    quick_path: Path, kind: Callable[[], tuple[Write, Write]], kill: bool
) -> None:
    writes = kind()
    for name, write in zip(('old', 'new'), writes, strict=True):
        write(quick_path / name)
    old, new = contents(quick_path / 'old'), contents(quick_path / 'new')
    assert old != new
    folder, came = quick_path / 'folder', []
    for step in count(1):
        rmtree(folder, ignore_errors=True)
        copytree(quick_path / 'old', folder)
        ended = with_fault(step, kill, lambda: writes[1](folder))
        if ended == 0:
            break
        assert ended in ((-signal.SIGKILL,) if kill else (1, 2))
        if kind is networks:  # a reader completes what was left, or finds all of the old network
            assert read_network(folder).points.sigma0 in (0.98, 1.5)
        complete(folder)
        assert contents(folder) in (old, new), step
        came.append(contents(folder) == new)
        if not kill:
            assert not list(folder.rglob('*.part'))
        elif step % 5 == 0:  # whatever was left there is no obstacle
            writes[1](folder)
            assert contents(folder) == new, step
    assert {*came} == {False, True} and len(came) > 5
    assert contents(folder) == new


def test_a_disk_that_fills_up_leaves_the_old_set(tmp_path: Path) -> None:
    """At every size at which one of the files, and only those that are as large, does not fit."""
    first, second = networks()
    second(tmp_path / 'new')
    new = contents(tmp_path / 'new')
    first(tmp_path / 'net')
    old = contents(tmp_path / 'net')
    for size in sorted(map(len, new.values())):
        with room_for(size - 1), pytest.raises(ValueError, match='cannot be written: File too l'):
            second(tmp_path / 'net')
        assert contents(tmp_path / 'net') == old
        assert not list((tmp_path / 'net').glob('.*'))


@pytest.mark.parametrize('name', ['points.csv', 'covariance_of_points.npz', 'poses.csv'])
def test_a_mixture_of_two_networks_is_refused(tmp_path: Path, name: str) -> None:
    for write, folder in zip(networks(), ('first', 'second'), strict=True):
        write(tmp_path / folder)
    (tmp_path / 'second' / name).write_bytes((tmp_path / 'first' / name).read_bytes() + b'\n')
    with pytest.raises(ValueError, match=f'{name} is of another run than network.json'):
        read_network(tmp_path / 'second')


@pytest.mark.parametrize('files', [[], 5, {'../a': {}}, {'a/b': {}}, {'': {}}, {'points.csv': 5}])
def test_a_damaged_manifest_is_named(tmp_path: Path, files: object) -> None:
    networks()[0](tmp_path)
    record = json.loads((tmp_path / 'network.json').read_text())
    (tmp_path / 'network.json').write_text(json.dumps(record | {'files': files}))
    with pytest.raises(ValueError, match='accepted'):
        read_network(tmp_path)


def test_files_of_the_former_set_go_and_those_of_others_stay(tmp_path: Path) -> None:
    first, second = networks()
    first(tmp_path)
    (tmp_path / 'notes.txt').write_text('mine')
    (tmp_path / 'report.html').write_text('changed')
    second(tmp_path)
    left = contents(tmp_path)
    assert 'mounting.json' not in left
    assert left['notes.txt'] == b'mine' and left['report.html'] == b'changed'


@pytest.mark.parametrize('name', ['../a', '/etc/a', '', 'b/../../a'])
def test_a_list_of_moves_leads_nowhere_else(tmp_path: Path, name: str) -> None:
    folder = tmp_path / 'folder'
    folder.mkdir()
    (tmp_path / '.a.7.part').write_bytes(b'part')
    for moves in (
        {'process': 7, 'parts': [name], 'removed': []},
        {'process': 7, 'parts': [], 'removed': [name or 'b/c']},
    ):
        (folder / '.unfinished.json').write_text(json.dumps(moves))
        with pytest.raises(ValueError, match=r'unfinished\.json is damaged'):
            complete(folder)
        assert (tmp_path / '.a.7.part').read_bytes() == b'part' and not (tmp_path / 'a').exists()


@pytest.mark.parametrize('content', ['', '[]', '{"process": "x"}', '{"process": 1, "parts": 5}'])
def test_a_damaged_list_of_moves_is_named(tmp_path: Path, content: str) -> None:
    (tmp_path / '.unfinished.json').write_text(content)
    with pytest.raises(ValueError, match=r'unfinished\.json is damaged'):
        complete(tmp_path)


def test_results_that_are_being_kept_in_a_folder_are_no_obstacle(tmp_path: Path) -> None:
    with locked(tmp_path):
        write_files(tmp_path, [('a', b'first'), ('b', b'second')])
    assert contents(tmp_path) == {'a': b'first', 'b': b'second'}


def test_permissions_are_kept(tmp_path: Path) -> None:
    for name, mode in (('a', 0o600), ('b', 0o640), ('c', 0o755)):
        (tmp_path / name).write_bytes(b'old')
        (tmp_path / name).chmod(mode)
        write_whole(tmp_path / name, b'new')
        write_files(tmp_path, [(name, b'newer'), (f'{name}2', b'other')])
        assert stat.S_IMODE((tmp_path / name).stat().st_mode) == mode
        assert (tmp_path / name).read_bytes() == b'newer'


@pytest.mark.skipif(not os.getuid(), reason='the superuser may write anything')
def test_a_protected_file_stays(tmp_path: Path) -> None:
    (tmp_path / 'a').write_bytes(b'old')
    (tmp_path / 'a').chmod(0o400)
    for write in (
        write_whole,
        lambda file, content: write_files(tmp_path, [(file.name, content)]),
    ):
        with pytest.raises(ValueError, match='a cannot be written: Permission denied'):
            write(tmp_path / 'a', b'new')
    assert (tmp_path / 'a').read_bytes() == b'old'


def test_no_output_replaces_an_input(tmp_path: Path) -> None:
    """Whatever it is called; others, and inputs of a command that has ended, are replaced."""
    file = tmp_path / 'a.csv'
    file.write_bytes(b'input')
    (tmp_path / 'link').symlink_to(file)
    (tmp_path / 'hard').hardlink_to(file)
    with inputs_kept():
        register_input(file)
        for name in ('a.csv', 'link', 'hard', '../' + tmp_path.name + '/a.csv'):
            for write in (
                lambda name: write_whole(tmp_path / name, b'x'),
                lambda name: write_files(tmp_path, [('other', b'x'), (name, b'x')]),
                lambda name: write_set(tmp_path, name, {}, [('other', b'x')]),
            ):
                with pytest.raises(ValueError, match=r'it is an input, .*a\.csv; accepted'):
                    write(name)
        assert contents(tmp_path) == dict.fromkeys(('a.csv', 'link', 'hard'), b'input')
        write_whole(tmp_path / 'b.csv', b'output')
    write_whole(file, b'output')
    assert file.read_bytes() == b'output'


def test_what_was_an_input_and_is_gone_keeps_no_place(tmp_path: Path) -> None:
    """A file system gives the number of a removed file to another one."""
    file, other = tmp_path / 'a', tmp_path / 'b'
    file.write_bytes(b'')
    with inputs_kept():
        register_input(file)
        file.rename(other)
        write_whole(other, b'output')
    assert other.read_bytes() == b'output'


@pytest.mark.lasting
def test_nothing_else_writes_files() -> None:
    package = ROOT / 'ahf_ros'
    found = set()
    for path in package.rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call):
                continue
            name = getattr(node.func, 'attr', getattr(node.func, 'id', ''))
            texts = {it.value for it in node.args if isinstance(it, ast.Constant)}
            opens = name == 'open' and texts & {'w', 'wb', 'xb', 'ab', 'a+b', 'r+b', 'rb+'}
            of_path = isinstance(node.func, ast.Attribute) and len(node.args) == 1
            if opens or name in WRITERS or (name == 'replace' and of_path):
                found.add(path.relative_to(package).as_posix())
    assert found == MAY_WRITE.keys()
