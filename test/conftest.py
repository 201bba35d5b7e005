"""What all tests share: a header, the log of the package, and the graph of real nodes."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import pytest

from support import live, vector_units


def pytest_report_header() -> str:
    return f'vector units: {vector_units.described()}'


@pytest.fixture
def caplog(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> pytest.LogCaptureFixture:
    """Capture the log of the package also where launch has made loggers that do not propagate."""
    for name, logger in logging.root.manager.loggerDict.items():
        if name.startswith('ahf_ros') and isinstance(logger, logging.Logger):
            monkeypatch.setattr(logger, 'propagate', True)
    return caplog


@pytest.fixture(scope='module')
def graph() -> Iterator[live.Graph]:
    """Return the graph of a module's tests, on this machine only."""
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    with live.opened() as graph:
        yield graph
