"""What is said of an image is said once."""

from unittest.mock import Mock

import pytest

from ahf_ros.base.notices import said_once, tell_left_out


def test_what_is_left_out_is_said_once_of_an_image(monkeypatch: pytest.MonkeyPatch) -> None:
    log = Mock()
    monkeypatch.setattr('ahf_ros.base.notices._LOG', log)

    @said_once()
    def look(times: int) -> None:
        for number in range(times):
            tell_left_out(7000 + number, 'candidates', 6000)
            with said_once():
                tell_left_out(30000, 'spots', 20000)

    look(3)
    said = [call.args[1:] for call in log.warning.call_args_list]
    assert said == [(7000, 'candidates', 6000), (30000, 'spots', 20000)]
    look(2)
    assert log.warning.call_count == 4
