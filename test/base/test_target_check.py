"""The gate for results of detectors: what passes fits into messages; the rest is named."""

import json
import math
import struct
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rosbags', reason='rosbags is not installed')

from ahf_ros.bag.definitions import CODED_TARGETS, message_types, typestore
from ahf_ros.base.edge_shift import median_edge_shift
from ahf_ros.base.target import Identification, Target
from ahf_ros.base.target_check import checked_target, checked_targets
from ahf_ros.base.text import printable, reason_of, shown
from ahf_ros.families.external.guarded import guarded
from ahf_ros.files.target_json import to_json
from ahf_ros.files.target_messages import coded_target_array
from ahf_ros.identification.session import create_identifier
from ahf_ros.views.drawing.overlay import draw
from support import bags

NAMES = [item.name for item in fields(Target)]
GOOD = Target(7, 9, 10.5, 20.25, 4.0, 3.0, 0.1, 0.9, (0.1, 0.01, 0.01, 0.2), 'aicon12')
IMAGE = np.tile(np.arange(40, dtype=np.uint8), (30, 1))


class Hostile:
    """Raises whatever is asked of it."""

    def _refuse(self) -> str:
        raise RuntimeError('no')

    __repr__ = __str__ = __float__ = _refuse  # type: ignore[assignment]


@pytest.mark.parametrize(
    ('field', 'value', 'accepted'),
    [
        ('id', 2**40, 'an integer from -1 to 2147483647'),
        ('id', 2**31, 'an integer'),
        ('id', -2, 'an integer'),
        ('id', None, 'an integer'),
        ('id', 'text', 'an integer'),
        ('id', 5.5, 'an integer'),
        ('id', True, 'an integer'),
        ('code', 2**70, 'an integer from 0 to 4294967295'),
        ('code', -1, 'an integer from 0 to 4294967295'),
        ('x', math.nan, 'a number from -65536 to 65536'),
        ('y', math.inf, 'a number'),
        ('y', 10**400, 'a number'),
        ('x', '1', 'a number'),
        ('x', Hostile(), 'a number'),
        ('semi_major', -1.0, 'a number from 0 to 65536'),
        ('semi_minor', 1e30, 'a number from 0'),
        ('angle', 90.0, 'a number from -6.28319 to 6.28319'),
        ('confidence', 1.01, 'a number from 0 to 1'),
        ('covariance', None, 'four finite numbers'),
        ('covariance', (1, 0, 0), 'four finite numbers'),
        ('covariance', (1, 0, 0, -1), 'positive semidefinite'),
        ('covariance', (1, 2, 2, 1), 'positive semidefinite'),
        ('covariance', (1, 0.5, -0.5, 1), 'symmetric'),
        ('covariance', (1, 0, 0, math.nan), 'four finite numbers'),
        ('edge_shift', math.nan, 'a number from -65536 to 65536'),
        ('edge_shift', 'wide', 'a number'),
        ('family', None, 'a printable text of at most 200 characters'),
        ('family', 7, 'a printable text'),
        ('family', 'a' * 201, 'a printable text'),
        ('family', 'two\nlines', 'a printable text'),
        ('family', '\ud800', 'a printable text'),
    ],
)
def test_what_is_not_accepted_is_named(field: str, value: Any, accepted: str) -> None:
    with pytest.raises(ValueError) as caught:
        checked_targets([GOOD, replace(GOOD, **{field: value})], "detector 'mine'")
    message = str(caught.value)
    assert message.startswith(f"detector 'mine': target 1: {field} is ")
    assert accepted in message


@pytest.mark.parametrize('found', [None, 3, GOOD, [GOOD, 'x'], {GOOD: 1}, Hostile(), [Hostile()]])
def test_what_is_no_list_of_targets_is_named(found: Any) -> None:
    with pytest.raises(ValueError, match=r"^detector 'mine'.* accepted is a (list of t|T)arget"):
        checked_targets(found, "detector 'mine'")


def test_numbers_of_numpy_are_converted() -> None:
    target = Target(
        np.int64(7),
        np.uint32(9),
        np.float32(10.5),
        20,
        np.float64(4),
        np.int16(3),
        np.float16(0.5),
        1,
        np.array([[1, 0], [0, 2]]),
        np.str_('aicon12'),
        edge_shift=np.float32(-0.5),
        polarity=np.int8(-1),
        followed=np.bool_(True),
    )
    checked = checked_target(target, 'x')
    covariance = (1.0, 0.0, 0.0, 2.0)
    assert checked == Target(
        *(7, 9, 10.5, 20.0, 4.0, 3.0, 0.5, 1.0, covariance, 'aicon12'),
        edge_shift=-0.5,
        polarity=-1,
        followed=True,
    )
    types = [type(getattr(checked, name)) for name in NAMES]
    of_numbers = [int, int, float, float, float, float, float, float]
    assert types == [*of_numbers, tuple, str, float, int, bool]
    assert all(type(it) is float for it in checked.covariance)


def test_what_is_right_stays_as_it_is() -> None:
    assert checked_target(GOOD, 'x') is GOOD


NUMBERS = st.one_of(
    st.integers(-(2**70), 2**70),
    st.floats(),
    st.floats(width=32).map(np.float32),
    st.integers(-(2**31), 2**31 - 1).map(np.int32),
    st.booleans(),
    st.none(),
    st.text(),
    st.complex_numbers(),
    st.decimals(),
    st.fractions(),
    st.just(Hostile()),
)
VARIANCES = st.floats(0, 100)
FIELDS = {
    'id': st.one_of(st.integers(-1, 2**31 - 1), st.integers(0, 99).map(np.int16)),
    'code': st.one_of(st.integers(0, 2**32 - 1), st.integers(0, 99).map(np.uint8)),
    'x': st.floats(-1e6, 65536),
    'y': st.one_of(st.integers(-99, 99), st.floats(0, 1, width=32).map(np.float32)),
    'semi_major': st.floats(0, 65536),
    'semi_minor': st.floats(0, 65536),
    'angle': st.floats(-6, 6),
    'confidence': st.floats(0, 1),
    'covariance': st.tuples(VARIANCES, st.just(0), st.just(0.0), VARIANCES),
    'family': st.sampled_from(('', 'metashape12')),
    'edge_shift': st.one_of(st.none(), st.floats(-9, 9)),
}
ANYTHING = st.one_of(
    NUMBERS,
    st.lists(NUMBERS, max_size=5),
    st.lists(st.floats(), min_size=4, max_size=4).map(np.array),
)


@st.composite
def targets(choose: st.DrawFn) -> Target:
    """Draw a target; none, one or two of its fields may be anything."""
    bad = choose(st.lists(st.sampled_from(list(FIELDS)), max_size=2))
    return Target(**{name: choose(ANYTHING if name in bad else it) for name, it in FIELDS.items()})


RESULTS = st.one_of(
    st.lists(targets(), max_size=3),
    st.lists(targets(), max_size=1),
    st.lists(NUMBERS, max_size=2),
    NUMBERS,
)
"""What detectors may return."""


@given(RESULTS)
def test_whatever_passes_fits_everywhere(found: Any) -> None:
    try:
        passed = checked_targets(found, 'detector')
    except ValueError as error:
        assert str(error).startswith('detector') and str(error).isprintable()
        return
    identification = Identification(tuple(passed), edge_shift=median_edge_shift(passed))
    content = to_json(identification, 'a', IMAGE.shape, 'f', 'd')
    assert len(json.loads(json.dumps(content, allow_nan=False))['targets']) == len(passed)
    draw(IMAGE, identification)
    store = typestore()
    header = bags.header(store, 0)
    message = coded_target_array(identification, 'f', IMAGE.shape, header, message_types(store))
    sent = bytes(store.serialize_cdr(message, CODED_TARGETS))
    received = store.deserialize_cdr(sent, CODED_TARGETS)
    for one, target in zip(received.targets, passed, strict=True):
        assert (one.id, one.code, one.x, one.y) == (target.id, target.code, target.x, target.y)
        assert one.covariance.tolist() == list(target.covariance)
        for name in ('semi_major', 'semi_minor', 'angle', 'confidence'):
            (single,) = struct.unpack('f', struct.pack('f', getattr(target, name)))
            assert getattr(one, name) == single


class Bad:
    """A detector of another package whose results are not accepted."""

    name = 'bad'
    family = 'metashape12'

    def __init__(self, found: object) -> None:
        self.found = found

    def __call__(self, image: np.ndarray) -> list[Target]:
        if isinstance(self.found, Exception):
            raise self.found
        return self.found if isinstance(self.found, list) else [GOOD]

    def refine(self, image: np.ndarray, targets: object) -> object:
        return self.found


def test_plug_ins_pass_the_gate() -> None:
    with pytest.raises(ValueError, match=r"detector 'bad': target 0: id is 5\.5, accepted is an"):
        guarded(Bad([replace(GOOD, id=5.5)]), 5.0)(IMAGE)
    refining = guarded(Bad((replace(GOOD, x=math.nan),)), 5.0)
    with pytest.raises(ValueError, match="detector 'bad': target 0: x is nan, accepted is a num"):
        refining.refine(IMAGE, [GOOD])
    with pytest.raises(ValueError, match=r"detector 'bad' failed: KeyError: .*ud800"):
        guarded(Bad(KeyError('\ud800')), 5.0)(IMAGE)


def test_refinements_pass_the_gate() -> None:
    identifier = create_identifier(detector=Bad((replace(GOOD, code=-1),)))
    with pytest.raises(ValueError, match="refine of detector 'bad': target 0: code is -1"):
        identifier.identify(IMAGE.astype(np.uint16))


def test_texts_of_others_become_printable() -> None:
    for text in ('a\ud800b', 'line\nline', '\x1b[31m', 'x' * 10**6):
        assert printable(text).isprintable() and len(printable(text)) < 3000
    assert reason_of(ValueError(Hostile())).startswith('ValueError')
    assert shown(Hostile()) == 'a Hostile'
