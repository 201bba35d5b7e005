"""The soak of `benchmarks/soak.py`, for seconds instead of an hour."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from benchmarks import soak


def test_every_image_is_answered_and_nothing_is_left_behind(graph: Any) -> None:
    run = soak.Soak(graph, count=130, interval=10)  # everything happens once
    run.run()
    figures = soak.figures_of(run, 1.0)
    assert figures['answered'] == figures['images'] >= 130
    assert figures['unexpected IDs'] == 0
    assert figures['rejected'] == figures['messages that are not images'] == 13 + 1
    assert (figures['parameters set'], figures['participants that joined and left']) == (10, 1)
    # Threads of pools start when they are first needed: 3 of the executor, 3 of the worker.
    assert figures['threads at the end'] <= run.looks[0].threads + 6
    assert figures['open files at the end'] == figures['open files when warm']
    assert run.node.end()[0] == 0
