"""The graph of the tests that talk to real nodes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from support import live


@pytest.fixture(scope='module')
def graph() -> Iterator[live.Graph]:
    """Return the graph of a module's tests, on this machine only."""
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    with live.opened() as graph:
        yield graph
