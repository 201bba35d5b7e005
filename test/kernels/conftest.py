"""What is done with every call of a kernel in these tests.

All whose rows threads may share are made again by three threads, with the same results. Some are
made again with any values: they end, and under `make test-sanitized` no index leaves an
array. With `--emulated COMMAND`, all are made on another machine as well.
"""

import shlex
from collections import Counter
from collections.abc import Iterator
from typing import Any
from unittest import mock

import numpy as np
import pytest

from ahf_ros import kernels
from ahf_ros.kernels import Kernel
from support import emulated

CALLED = Kernel.__call__
CALLS: Counter[str] = Counter()
HOSTILE = 12
"""Calls of a kernel in a module that are made again with any values."""
_FLOATS = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, -1.0, 0.5, 255.0, 1e-30, 1e9, -1e19, 3e38])
_BITS = np.array([-62, -31, -8, -1, 0, 1, 8, 31, 62])


def hostile(array: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return an array with any values, in few places or in all of them."""
    if array.dtype.kind == 'f':
        values = generator.choice(_FLOATS, array.shape).astype(array.dtype)
    else:
        bits = generator.choice(_BITS, array.shape)
        values = (np.sign(bits) << np.abs(bits)).astype(array.dtype)
    return np.where(
        generator.random(array.shape) < generator.choice([0.02, 0.3, 1]), values, array
    )


def check_by_threads(kernel: Kernel, *values: Any, **counts: int) -> None:
    """Check that a kernel has the same results where three threads share its rows."""
    # What no kernel writes is the same, too.
    with mock.patch.object(np, 'empty', np.zeros), mock.patch.object(kernels, 'WORTH', -1.0):
        alone = CALLED(kernel, *values, **counts)
        with kernels.shared(3):
            by_threads = CALLED(kernel, *values, **counts)
    both = (of if isinstance(of, tuple) else (of,) for of in (alone, by_threads))
    for each, one, other in zip(kernel._plan[1], *both, strict=True):
        if kernel._rows in each.sides:  # and no scratch
            np.testing.assert_array_equal(one, other, f'{each.name} of {kernel.name}')


@pytest.fixture(scope='module', autouse=True)
def any_values(pytestconfig: pytest.Config) -> Iterator[None]:
    emulating = pytestconfig.getoption('--emulated', None)
    calls, generator = Counter[str](), np.random.default_rng(0)

    def call(kernel: Kernel, *values: Any, **counts: int) -> Any:
        results = CALLED(kernel, *values, **counts)
        calls[kernel.name] += 1
        if kernel._rows and not emulating:
            check_by_threads(kernel, *values, **counts)
        for share in (0.2, 0.5, 1) if calls[kernel.name] <= HOSTILE else ():
            changed = [
                hostile(np.asarray(value, each.dtype), generator)
                if each.sides and generator.random() < share
                else value
                for each, value in zip(kernel._plan[0], values, strict=True)
            ]
            CALLED(kernel, *changed, **counts)
        return results

    with mock.patch.object(Kernel, '__call__', call):
        yield


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        '--emulated', metavar='COMMAND', help='what runs calls of support/emulated.py'
    )


@pytest.fixture(scope='session', autouse=True)
def another_machine(pytestconfig: pytest.Config) -> Iterator[None]:
    if command := pytestconfig.getoption('--emulated', None):
        with emulated.repeated(shlex.split(command), CALLS):
            yield
    else:
        yield


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if CALLS:
        without = ', '.join(it for it in emulated.KERNELS if it not in CALLS) or 'none'
        terminalreporter.write_line(f'{CALLS.total()} calls have the same bits there')
        terminalreporter.write_line(f'kernels without a call: {without}')
