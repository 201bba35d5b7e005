from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ahf_ros.clouds.point_clouds import FLOAT32, FLOAT64, organised_points

INT32 = 5
XYZ = np.arange(36, dtype=float).reshape(3, 4, 3)


def field(name: str, offset: int, datatype: int = FLOAT32) -> SimpleNamespace:
    return SimpleNamespace(name=name, offset=offset, datatype=datatype, count=1)


def cloud(kind: str = '<f4', padding: int = 0, **changes: Any) -> SimpleNamespace:
    """Return the message of `XYZ`, z first, with an intensity between and padded rows."""
    order, float_type = kind[0], kind[1:]
    size = int(float_type[1])
    datatype = FLOAT32 if size == 4 else FLOAT64
    point = np.dtype(
        {
            'names': ['z', 'intensity', 'x', 'y'],
            'formats': [kind, order + 'i4', kind, kind],
            'offsets': [0, size, size + 5, 2 * size + 5],
            'itemsize': 3 * size + 8,
        }
    )
    data = bytearray(3 * (4 * point.itemsize + padding))
    sent = np.ndarray((3, 4), point, data, strides=(4 * point.itemsize + padding, point.itemsize))
    for axis, name in enumerate('xyz'):
        sent[name] = XYZ[:, :, axis]
    fields = [field(name, point.fields[name][1], datatype) for name in 'zxy']
    message = SimpleNamespace(
        height=3,
        width=4,
        fields=[*fields, field('intensity', size, INT32)],
        is_bigendian=order == '>',
        point_step=point.itemsize,
        row_step=4 * point.itemsize + padding,
        data=data,
    )
    return SimpleNamespace(**{**vars(message), **changes})


@pytest.mark.parametrize('padding', [0, 7])
@pytest.mark.parametrize('kind', ['<f4', '>f4', '<f8', '>f8'])
def test_points_are_read_wherever_they_lie(kind: str, padding: int) -> None:
    points = organised_points(cloud(kind, padding))
    assert points.shape == (3, 4)
    for axis, name in enumerate('xyz'):
        assert points[name].tolist() == XYZ[:, :, axis].tolist()


def test_points_are_not_copied() -> None:
    message = cloud()
    points = organised_points(message)
    message.data[:4] = np.float32(-1).tobytes()
    assert points['z'][0, 0] == -1


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'height': 1, 'width': 12}, 'height is 1, accepted is an integer of at least 2'),
        ({'height': 0}, 'height is 0, accepted'),
        ({'width': 1}, 'width is 1, accepted is an integer of at least 2'),
        ({'fields': []}, 'fields are none, accepted are those with x, y and z'),
        ({'fields': [field('x', 0), field('y', 4)]}, "fields are 'x', 'y', accepted"),
        (
            {'fields': [field('x', 0), field('y', 4), field('z', 8, INT32)]},
            'datatype of z is 5, accepted is 7 (FLOAT32) or 8 (FLOAT64)',
        ),
        (
            {'fields': [field('x', 0), field('y', 17), field('z', 8)]},
            'offset of y is 17, accepted is an integer of at most point_step, 20, minus 4 bytes',
        ),
        ({'row_step': 79}, 'row_step is 79, accepted is an integer of at least 80'),
        ({'data': bytes(239)}, 'data has 239 bytes, accepted are at least 240'),
        (
            {'height': 2**32 - 1, 'row_step': 2**32 - 1},
            f'data has 240 bytes, accepted are at least {(2**32 - 1) ** 2}',
        ),
        (
            {'width': 2**32 - 1},
            f'row_step is 80, accepted is an integer of at least {20 * (2**32 - 1)}',
        ),
    ],
)
def test_what_is_no_organised_cloud_is_named(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError) as error:
        organised_points(cloud(**changes))
    assert str(error.value).startswith(words)


def test_it_reads_what_sensor_msgs_py_writes() -> None:
    point_cloud2 = pytest.importorskip('sensor_msgs_py.point_cloud2')
    from std_msgs.msg import Header

    message = point_cloud2.create_cloud_xyz32(Header(), XYZ.reshape(-1, 3))
    message.height, message.width = 3, 4
    message.row_step = 4 * message.point_step
    points = organised_points(message)
    expected = point_cloud2.read_points(message, ['x', 'y', 'z']).reshape(3, 4)
    for name in 'xyz':
        assert (points[name] == expected[name]).all()


def sizes(most: int = 2**32 - 1) -> Any:
    return st.integers(0, 40) | st.integers(0, most)


@settings(max_examples=300)
@given(
    height=sizes(),
    width=sizes(),
    fields=st.lists(
        st.builds(field, st.sampled_from(['x', 'y', 'z', '']), sizes(), st.integers(5, 9)),
        max_size=5,
    ),
    is_bigendian=st.booleans(),
    point_step=sizes(),
    row_step=sizes(),
    data=st.binary(max_size=3000),
)
@example(
    height=2,
    width=2,
    fields=[field(name, 0) for name in 'xyz'],
    is_bigendian=False,
    point_step=2**31,
    row_step=0,
    data=b'',
)
def test_what_is_no_cloud_is_named_and_nothing_is_read_beyond_the_data(**message: Any) -> None:
    try:
        points = organised_points(SimpleNamespace(**message))
    except ValueError as error:
        assert ', accepted ' in str(error)
    else:
        assert points.shape == (message['height'], message['width'])
        assert all(points[name].tobytes() for name in 'xyz')
