"""Kernels are called as the header declares them, and nothing else gets through."""

import ctypes
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ahf_ros import kernels
from support import ROOT

FOLDER = kernels.HEADER.parent
HEADER = """
/* void none(count n, double y[n]); */
void sums(count n, count m, const double rows[n][m], const float *unused);
"""


def test_every_function_of_the_header_is_in_a_file_and_in_the_library() -> None:
    declared = kernels.declared(kernels.HEADER.read_text())
    sources = ''.join(it.read_text() for it in FOLDER.glob('*.c'))
    defined = re.findall(r'^void (\w+)\(', sources, re.M)
    assert sorted(declared) == sorted(defined)
    library = ctypes.CDLL(str(kernels.LIBRARY))
    assert all(hasattr(library, name) for name in declared)


def test_comments_declare_nothing_and_pointers_are_refused() -> None:
    with pytest.raises(ValueError, match=r'const float \*unused.*accepted is'):
        kernels.declared(HEADER)


@pytest.mark.parametrize(
    ('values', 'counts', 'error', 'message'),
    [
        ((), {}, TypeError, 'has 0 arguments, accepted are x'),
        (([0.0], 1), {}, TypeError, 'has 2 arguments'),
        ((['a'],), {}, TypeError, r'x of the kernel exponentials has the type <U1, accepted is f'),
        (([1j],), {}, TypeError, 'has the type complex128'),
        (([[0.0]],), {}, ValueError, r'has the shape \(1, 1\), accepted is \[n\]'),
        (([0.0],), {'n': 2}, ValueError, r'has the shape \(1,\), accepted is \[n\] with n = 2'),
    ],
)
def test_what_does_not_fit_the_declaration_is_refused(
    values: tuple[object, ...], counts: dict[str, int], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        kernels.exponentials(*values, **counts)


@pytest.mark.parametrize('kind', [np.float32, np.int16, np.uint8, bool])
def test_other_types_and_orders_are_cast(kind: type) -> None:
    values = np.arange(12).reshape(3, 4).astype(kind)
    expected = np.exp(values[::2, 1].astype(float))
    assert kernels.exponentials(values[::2, 1]) == pytest.approx(expected)
    backwards = values[0, ::-1]
    assert kernels.exponentials(backwards) == pytest.approx(np.exp(backwards.astype(float)))


def test_arguments_that_may_not_be_written_are_read() -> None:
    values = np.zeros(3)
    values.flags.writeable = False
    assert kernels.exponentials(values).tolist() == [1, 1, 1]


def test_nothing_is_called_for_empty_arrays() -> None:
    bits, highest, _ = kernels.likeliest_bits(np.zeros((0, 5)), np.zeros((0, 5)))
    assert bits.shape == (0, 5)
    assert highest.shape == (0,)
    bits, highest, _ = kernels.likeliest_bits(np.zeros((2, 0)), np.zeros((2, 0)))
    assert highest.tolist() == [0, 0]


def imported(library: Path) -> subprocess.CompletedProcess[str]:
    code = 'from ahf_ros import kernels; kernels.exponentials([0.0])'
    environment = {**os.environ, kernels.VARIABLE: str(library)}
    return subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, env=environment, cwd=ROOT
    )


def test_a_library_that_is_missing_or_of_another_machine_is_named(tmp_path: Path) -> None:
    missing = imported(tmp_path / 'none.so').stderr.splitlines()[-1]
    assert 'none.so does not exist: the kernels of ahf_ros are not compiled; pip' in missing
    other, library = tmp_path / 'other.so', kernels.LIBRARY.read_bytes()
    other.write_bytes(bytes(20) + library[20:])
    assert 'was compiled for another machine or is damaged' in imported(other).stderr
    machine = b'\x3e\0' if library[18:20] == b'\xb7\0' else b'\xb7\0'  # x86-64 or aarch64
    other.write_bytes(library[:18] + machine + library[20:])
    assert 'was compiled for another machine or is damaged' in imported(other).stderr


def test_kernels_are_attributes_and_nothing_else_is() -> None:
    assert 'likeliest_bits' in dir(kernels)
    with pytest.raises(AttributeError, match="has no attribute 'likeliest_bit'"):
        kernels.likeliest_bit  # noqa: B018


FORKED = """
import os
import time
import numpy as np
from ahf_ros import kernels

kernels.WORTH = -1.0
frames, points, ones = np.tile(np.eye(3), (8, 1, 1)), np.ones((4, 2)), np.ones(4)
with kernels.shared(2):
    kernels.edge_points(frames, points, points, ones, ones, 1e-9)
    time.sleep(0.1)  # until its threads wait for work
    child = os.fork()
    kernels.edge_points(frames, points, points, ones, ones, 1e-9)
    if child:
        raise SystemExit(os.waitpid(child, 0)[1])
"""


@pytest.mark.skipif(not hasattr(os, 'fork'), reason='processes are not forked here')
def test_threads_share_rows_in_a_process_that_was_forked_too() -> None:
    done = subprocess.run([sys.executable, '-W', 'ignore', '-c', FORKED], timeout=60)
    assert done.returncode == 0


ENDING = """
import threading
import numpy as np
from ahf_ros import kernels

def go_on():
    threading.main_thread().join()
    kernels.WORTH = -1.0
    frames, points, ones = np.tile(np.eye(3), (2, 1, 1)), np.ones((4, 2)), np.ones(4)
    with kernels.shared(2):
        print(kernels.edge_points(frames, points, points, ones, ones, 1e-9)[0].sum())

threading.Thread(target=go_on).start()
"""


def test_a_thread_that_outlives_the_main_one_goes_on_alone() -> None:
    command = [sys.executable, '-c', ENDING]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.stderr, done.returncode) == ('16.0\n', '', 0)
