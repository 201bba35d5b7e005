"""With `--emulated COMMAND`, every call of a kernel is made on another machine as well."""

import shlex
from collections import Counter
from collections.abc import Iterator

import pytest

from support import emulated

CALLS: Counter[str] = Counter()


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
