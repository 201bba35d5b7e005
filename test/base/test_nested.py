from dataclasses import dataclass, field

import pytest

from ahf_ros.base.settings.nested import assemble, flat_parameters
from ahf_ros.base.settings.parameter import check_parameters, parameter


@dataclass(frozen=True)
class Lens:
    focal_length: float = parameter(50.0, 'Focal length, mm.', minimum=1.0, maximum=1000.0)

    def __post_init__(self) -> None:
        check_parameters(self)


@dataclass(frozen=True)
class Camera:
    name: str = parameter('left', 'Name.', choices=('left', 'right'))
    shots: int = parameter(1, 'Number of shots.', minimum=1)
    lens: Lens = field(default_factory=Lens)

    def __post_init__(self) -> None:
        check_parameters(self)
        if self.name == 'right' and self.lens.focal_length > 100:
            raise ValueError('focal_length is too long for the right camera')


def test_own_parameters_come_before_those_of_parts() -> None:
    assert [item.name for item in flat_parameters(Camera)] == ['name', 'shots', 'focal_length']


def test_one_name_for_two_parameters_is_refused() -> None:
    @dataclass(frozen=True)
    class Twice:
        focal_length: float = parameter(1.0, 'Another one.')
        lens: Lens = field(default_factory=Lens)

    Twice.__annotations__['lens'] = Lens
    with pytest.raises(ValueError, match='focal_length is the name of two'):
        flat_parameters(Twice)


def test_values_find_their_part_and_the_rest_keeps_its_default() -> None:
    assert assemble(Camera, {'focal_length': 35.0}) == Camera(lens=Lens(35.0))
    assert assemble(Camera, {}) == Camera()


def test_an_integer_is_a_number_but_not_the_other_way_round() -> None:
    settings = assemble(Camera, {'focal_length': 35})
    assert isinstance(settings.lens.focal_length, float)
    with pytest.raises(ValueError, match=r'shots is 2\.0, accepted is an integer of at least 1'):
        assemble(Camera, {'shots': 2.0})


def test_values_are_checked_together() -> None:
    long = {'focal_length': 200.0}
    assert assemble(Camera, long).lens.focal_length == 200
    with pytest.raises(ValueError, match='too long for the right camera'):
        assemble(Camera, {**long, 'name': 'right'})


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(ValueError, match='zoom is not a parameter, accepted is one of name, s'):
        assemble(Camera, {'zoom': 3.0})
