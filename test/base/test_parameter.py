from dataclasses import FrozenInstanceError, dataclass
from typing import Any

import numpy as np
import pytest

from ahf_ros.base.settings.parameter import (
    Parameter,
    check_parameters,
    numbers_in,
    parameter,
    parameters,
)


@dataclass(frozen=True, slots=True)
class Camera:
    active: bool = parameter(True, 'Whether it takes pictures.')
    binning: int = parameter(1, 'Pixels in one.', minimum=1, maximum=8)
    exposure: float = parameter(0.01, 'Time, s.', minimum=0.0)
    gain: float = parameter(0.0, 'Gain, dB.', maximum=40.0)
    offset: float = parameter(0.0, 'Added to every pixel.')
    mode: str = parameter('mono', 'Kind of image.', choices=('mono', 'colour'))
    label: str = parameter('', 'Any text.')
    serial: int = 7

    def __post_init__(self) -> None:
        check_parameters(self)


WORDS = {
    'active': 'true or false',
    'binning': 'an integer from 1 to 8',
    'exposure': 'a number of at least 0',
    'gain': 'a number of at most 40',
    'offset': 'a number',
    'mode': 'one of mono, colour',
    'label': 'a text',
}
ACCEPTED = {
    'active': [False],
    'binning': [1, 8, np.int64(3)],
    'exposure': [0.0, 3, np.float32(0.5)],
    'gain': [-1e9, 40.0],
    'mode': ['colour'],
    'label': ['left'],
}
REFUSED = {
    'active': [1, 'true', None],
    'binning': [0, 9, 2.0, True, '2'],
    'exposure': [-0.1, True, float('nan'), float('inf'), '0.1'],
    'gain': [40.1],
    'offset': [float('-inf'), None],
    'mode': ['Mono', 3],
    'label': [3],
}


def one_by_one(values: dict[str, list[object]]) -> list[tuple[str, object]]:
    return [(name, value) for name, several in values.items() for value in several]


def test_parameters_are_told_in_order_with_what_is_accepted() -> None:
    told = parameters(Camera)
    assert {item.name: item.accepted for item in told} == WORDS
    assert [item.name for item in told] == list(WORDS)
    assert told[1] == Parameter('binning', 1, 'Pixels in one.', 1, 8, ())
    assert told == parameters(Camera())


def test_the_defaults_are_the_values_of_the_fields() -> None:
    camera = Camera()
    assert all(getattr(camera, item.name) == item.default for item in parameters(Camera))


@pytest.mark.parametrize(('name', 'value'), one_by_one(ACCEPTED))
def test_a_value_in_range_is_accepted(name: Any, value: Any) -> None:
    assert getattr(Camera(**{name: value}), name) == value


@pytest.mark.parametrize(('name', 'value'), one_by_one(REFUSED))
def test_every_other_value_is_refused_by_name(name: Any, value: Any) -> None:
    with pytest.raises(ValueError) as error:
        Camera(**{name: value})
    assert str(error.value) == f'{name} is {value!r}, accepted is {WORDS[name]}'


def test_the_first_value_that_is_not_accepted_is_named() -> None:
    with pytest.raises(ValueError, match=r'^binning is 0'):
        Camera(binning=0, exposure=-1.0)


def test_a_parameter_is_a_field_like_any_other() -> None:
    with pytest.raises(FrozenInstanceError):
        Camera().gain = 3.0
    assert Camera(True, 2) == Camera(binning=2)


def test_numbers_that_a_text_lists() -> None:
    assert numbers_in('ids', '') == frozenset()
    assert numbers_in('ids', '7') == {7}
    assert numbers_in('ids', ' 1-3, 7,5-5 9 ') == {1, 2, 3, 5, 7, 9}


@pytest.mark.parametrize('text', ['a', '3-1', '-1', '1-', '1.5', '1--2', '1;2'])
def test_what_is_no_list_of_numbers_is_named(text: str) -> None:
    with pytest.raises(ValueError, match=r'^ids has .*, accepted are integers and ranges'):
        numbers_in('ids', f'4, {text}')


def test_lists_are_bounded() -> None:
    with pytest.raises(ValueError, match=r'^ids is .*, accepted are at most 100000 numbers'):
        numbers_in('ids', '1-999999999')
