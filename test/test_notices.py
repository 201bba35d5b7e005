"""What is said of an image is said once."""

from __future__ import annotations

import logging

import pytest

from ahf_ros.notices import said_once, tell_left_out


def test_what_is_left_out_is_said_once_of_an_image(caplog: pytest.LogCaptureFixture) -> None:
    @said_once()
    def look(times: int) -> None:
        for number in range(times):
            tell_left_out(7000 + number, 'candidates', 6000)
            with said_once():
                tell_left_out(30000, 'spots', 20000)

    said = ['7000 candidates; the 6000 best are looked at', '30000 spots; the 20000 best are']
    with caplog.at_level(logging.WARNING):
        look(3)
        assert [it[: len(of)] for it, of in zip(caplog.messages, said, strict=True)] == said
        look(2)
        assert len(caplog.messages) == 4
