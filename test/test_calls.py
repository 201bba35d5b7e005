"""No detector calls more functions than is recorded: what takes longer does not come unseen."""

import json

import numpy as np
import pytest

from support.calls import IMAGES, RECORD, TOLERANCE, calls_for, calls_of
from support.square_markers import needs_square_markers

RECORDED = json.loads(RECORD.read_text())
SQUARE = {name for name in IMAGES if name.startswith(('aruco', 'apriltag', 'auto'))}


@pytest.mark.lasting  # with the newest versions only: the oldest ones read light otherwise
@pytest.mark.parametrize(
    'name', [pytest.param(it, marks=needs_square_markers) if it in SQUARE else it for it in IMAGES]
)
def test_an_image_takes_as_many_calls_as_recorded(name: str) -> None:
    calls, targets = calls_for(name)
    before = RECORDED[name]
    assert targets == before['targets']
    assert calls == pytest.approx(before['calls'], rel=TOLERANCE), (
        f'{name}: {calls} calls, {before["calls"]} are recorded; '
        'python -m support.calls --update records these'
    )


def test_every_record_is_of_an_image() -> None:
    assert list(RECORDED) == list(IMAGES)


def test_what_others_call_is_not_counted() -> None:
    assert calls_of(lambda: np.median([np.sqrt(it) for it in range(9)])) == 0
