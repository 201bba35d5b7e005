"""Sets of words that are hard to confuse, against their definition and what was measured."""

import re
from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pytest

from ahf_ros.prints import selection
from ahf_ros.prints.dots import dot_family
from ahf_ros.prints.families import print_in
from ahf_ros.prints.ring import family
from ahf_ros.prints.selection import independent_set, select_ids
from support.square_markers import needs_square_markers


def smallest_distance(name: str, ids: Sequence[int]) -> int:
    """Return the smallest Hamming distance between two words, over all rotations."""
    distances = selection._distances(print_in(name).design.orbits(np.asarray(ids)))
    return int(distances[np.triu_indices(len(ids), 1)].min())


def rotations(word: int, bits: int) -> list[str]:
    text = f'{word:0{bits}b}'
    return [text[turn:] + text[:turn] for turn in range(bits)]


def distance(first: str, others: list[str]) -> int:
    return min(sum(a != b for a, b in zip(first, other, strict=True)) for other in others)


def turned_by_a_cover(word: int, bits: int) -> set[str]:
    """Return all texts that one stretch of zeros or of ones over a word makes of it."""
    covered = set()
    for text in rotations(word, bits):
        covered |= {colour * n + text[n:] for n in range(1, bits) for colour in '01'}
    return covered


@pytest.mark.parametrize(('name', 'pairs'), [('metashape12', 1652), ('metashape14', 9414)])
def test_as_many_pairs_are_confused_as_was_measured(name: str, pairs: int) -> None:
    design = print_in(name).design
    confused = selection._confused(design, np.asarray(design.all_ids))
    assert np.triu(confused, 1).sum() == pairs


@pytest.mark.parametrize(
    ('name', 'count', 'least'),
    [('metashape12', 20, 2), ('metashape12', 79, 2), ('metashape14', 20, 4), ('dots', 12, 2)],
)
def test_selected_words_are_far_apart_and_never_confused(
    name: str, count: int, least: int
) -> None:
    code = dot_family() if name == 'dots' else family(name)
    ids = select_ids(code, code.all_ids, count)
    assert len(set(ids)) == count and ids == sorted(ids)
    words = [code.word(number) for number in ids]
    for first, second in combinations(words, 2):
        others = rotations(second, code.bits)
        if name == 'dots':
            others += [text[::-1] for text in others]
        assert distance(f'{first:0{code.bits}b}', others) >= least
        assert not turned_by_a_cover(first, code.bits) & set(others)
        assert not turned_by_a_cover(second, code.bits) & set(rotations(first, code.bits))


def test_a_selection_is_the_same_every_time_and_keeps_to_the_ids_given() -> None:
    given = range(30, 130, 2)
    rings = family('metashape12')
    first = select_ids(rings, given, 10)
    assert first == select_ids(rings, given, 10)
    assert set(first) <= set(given)
    assert select_ids(rings, [7], 1) == [7]


def test_point_targets_differ_in_their_dots() -> None:
    ids = select_ids(print_in('gsi').design, print_in('gsi').design.all_ids, 20)
    assert smallest_distance('gsi', ids) == 4


@needs_square_markers
def test_square_markers_differ_in_any_rotation() -> None:
    ids = select_ids(print_in('aruco_4x4_250').design, range(250), 8)
    assert smallest_distance('aruco_4x4_250', ids) > smallest_distance('aruco_4x4_250', range(8))


def test_a_set_that_is_too_large_is_refused_with_the_largest_one() -> None:
    with pytest.raises(ValueError, match='best is 150, accepted is an integer from 1 to ') as info:
        select_ids(print_in('metashape12').design, range(1, 162), 150)
    (largest,) = re.findall(r'from 1 to (\d+)', str(info.value))
    assert int(largest) >= 79


def test_sets_without_conflicts() -> None:
    generator = np.random.default_rng(3)
    edges = np.triu(generator.random((30, 30)) < 0.2, 1)
    graph = edges | edges.T
    found = independent_set(graph, 30, generator)
    assert not graph[np.ix_(found, found)].any()
    exact = max(
        bin(members).count('1')
        for members in range(1 << 12)
        if not graph[np.ix_(*(np.flatnonzero(members >> np.arange(12) & 1),) * 2)].any()
    )
    assert independent_set(graph[:12, :12], 12, generator).size == exact
