"""What all tests share: the line that says on which code they ran, and the graph of real nodes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from support import live, vector_units


def pytest_report_header() -> str:
    return f'vector units: {vector_units.described()}'


@pytest.fixture(scope='module')
def graph() -> Iterator[live.Graph]:
    """Return the graph of a module's tests, on this machine only."""
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    with live.opened() as graph:
        yield graph
