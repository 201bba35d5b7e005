"""The dictionaries of square markers."""

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import pytest

from ahf_ros.prints import square
from ahf_ros.prints.square import SQUARE_NAMES, dictionary, marker, words
from support.square_markers import needs_square_markers

pytestmark = needs_square_markers


@pytest.mark.parametrize('name', SQUARE_NAMES)
def test_every_dictionary_is_there_and_as_large_as_its_name_says(name: Any) -> None:
    table = dictionary(name)
    wanted = name.partition('_')[2]
    if wanted[1] == 'x':
        side, _, count = wanted.partition('_')
        assert (table.markerSize, len(table.bytesList)) == (int(side[0]), int(count))
    elif wanted != 'original':
        assert table.markerSize**2 == int(wanted.removeprefix('mip_').partition('h')[0])


def test_a_marker_has_a_black_border_and_its_own_bits() -> None:
    prints = [marker('aruco_4x4_50', number, 5) for number in range(50)]
    assert all(of.shape == (30, 30) for of in prints)
    for of in prints:
        assert not of[:5].any() and not of[-5:].any() and not of[:, :5].any()
    assert len(np.unique([of.ravel() for of in prints], axis=0)) == 50


def test_words_are_the_cells_of_the_prints_inside_their_borders() -> None:
    cells = words('apriltag_25h9')
    assert cells.shape == (35, 5, 5)
    print_ = marker('apriltag_25h9', 7, 4)[2::4, 2::4]
    assert np.array_equal(cells[7], print_[1:-1, 1:-1] > 0)


def test_what_is_not_there_is_named() -> None:
    with pytest.raises(ValueError, match=r"family is 'aruco_9x9', accepted is one of aruco_4"):
        dictionary('aruco_9x9')
    with pytest.raises(ValueError, match='number is 50, accepted is an integer from 0 to 49'):
        marker('aruco_4x4_50', 50, 5)


def test_an_opencv_without_markers_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(cv2.aruco, 'ArucoDetector')
    with pytest.raises(ValueError, match=r'at least 4\.7, which has square markers; this is'):
        dictionary('aruco_4x4_50')


@pytest.fixture
def unknown_members() -> Iterator[None]:
    """Let the names of dictionaries be looked up anew, before and after a test."""
    square._member.cache_clear()
    yield
    square._member.cache_clear()


@pytest.mark.usefixtures('unknown_members')
def test_an_opencv_without_a_dictionary_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for member in ('DICT_ARUCO_MIP_36h12', 'DICT_ARUCO_MIP_36H12'):
        monkeypatch.delattr(cv2.aruco, member, raising=False)
    with pytest.raises(ValueError, match="'aruco_mip_36h12', accepted with a newer OpenCV; this"):
        dictionary('aruco_mip_36h12')
