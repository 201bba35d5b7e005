"""Gaps in the numbers of messages are losses only where one publisher made them."""

from collections.abc import Iterable

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from ahf_ros.nodes.inputs import Losses


def told(number: int | None, sender: object = None) -> dict[str, object]:
    return {
        'publication_sequence_number': number,
        'publisher_gid': sender,
        'source_timestamp': 5 * (number or 0),
    }


def counted(numbers: Iterable[int], *publishers: str) -> Losses:
    losses = Losses(lambda: frozenset(publishers))
    assert all(losses.add(told(number)) for number in numbers)
    return losses


def test_gaps_of_one_publisher_are_losses() -> None:
    losses = counted([4, 5, 8, 9, 13], 'camera')
    assert (losses.lost, losses.unknown) == (2 + 3, '')


def test_gaps_between_several_publishers_are_not_counted() -> None:
    losses = counted([1, 40, 2, 41, 3], 'camera', 'replay')
    assert (losses.lost, losses.unknown) == (0, 'messages come from 2 publishers')


def test_losses_are_counted_again_when_one_publisher_is_left() -> None:
    present = ['camera', 'replay']
    losses = Losses(lambda: frozenset(present))
    for number in (1, 40, 2, 41, 3):
        losses.add(told(number))
    assert losses.unknown
    del present[1]
    losses.add(told(4))
    assert (losses.lost, losses.unknown) == (0, '')
    losses.add(told(6))
    assert losses.lost == 1


def test_another_publisher_begins_anew() -> None:
    present = ['first']
    losses = Losses(lambda: frozenset(present))
    for number in (1, 2):
        losses.add(told(number))
    present[:] = ['second']
    for number in (8, 9, 11):
        losses.add(told(number))
    assert losses.lost == 1
    losses.add(told(1))  # a third one, known or not
    losses.add(told(3))
    assert losses.lost == 2


def test_publishers_that_are_told_apart_are_counted_one_by_one() -> None:
    losses = Losses(lambda: frozenset(('camera', 'replay')))
    for number, sender in ((1, 'a'), (40, 'b'), (3, 'a'), (41, 'b'), (45, 'b')):
        losses.add(told(number, sender))
    assert (losses.lost, losses.unknown) == (1 + 3, '')


def test_without_numbers_nothing_is_counted() -> None:
    for nothing in (0, None):
        losses = Losses(lambda: frozenset(('camera',)))
        assert losses.add(told(nothing))
        assert losses.add(told(nothing))
        assert (losses.lost, losses.unknown) == (0, 'the middleware does not number messages')


def test_the_same_message_again_is_no_new_one() -> None:
    losses = Losses(lambda: frozenset(('camera',)))
    assert losses.add(told(7))
    assert not losses.add(told(7))
    assert losses.add({**told(7), 'source_timestamp': 36})
