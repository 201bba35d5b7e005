"""What all tests share: a header, the drawn examples, and the graph of real nodes."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from support import live, vector_units

with suppress(ModuleNotFoundError):
    from hypothesis import HealthCheck, settings

    # Neither the speed of a machine nor chance decides, unless `--hypothesis-profile attack` asks
    # for many other examples.
    free = settings(deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow])
    settings.register_profile('same', free, derandomize=True)
    settings.register_profile('attack', free, max_examples=10_000)
    settings.load_profile('same')


def pytest_report_header() -> str:
    return f'vector units: {vector_units.described()}'


@pytest.hookimpl(tryfirst=True)
def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> pytest.Module:
    """Leave modules to pytest.

    The plugin of launch_testing imports each of them to see whether it describes a launch. One
    that skips at its import then ends the collection, and no test runs.
    """
    return pytest.Module.from_parent(parent, path=module_path)


@pytest.fixture(scope='module')
def graph() -> Iterator[live.Graph]:
    """Return the graph of a module's tests, on this machine only."""
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    with live.opened() as graph:
        yield graph
