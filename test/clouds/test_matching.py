from ahf_ros.clouds.cloud_settings import CloudSettings
from ahf_ros.clouds.matching import Matcher

CLOUD, ANSWER = 0, 1


def test_messages_match_whichever_comes_first() -> None:
    matcher = Matcher(0, (10, 10), unmatched := [0, 0])
    assert matcher.put(CLOUD, 5, 'cloud') is None
    assert matcher.put(ANSWER, 5, 'answer') == 'cloud'
    assert matcher.put(ANSWER, 6, 'answer') is None
    assert matcher.put(CLOUD, 6, 'cloud') == 'answer'
    assert unmatched == [0, 0]
    assert matcher.put(CLOUD, 6, 'again') is None  # each matches once


def test_the_nearest_within_the_tolerance_matches() -> None:
    matcher = Matcher(3, (10, 10), unmatched := [0, 0])
    for stamp in (10, 14, 20):
        matcher.put(CLOUD, stamp, stamp)
    assert matcher.put(ANSWER, 24, 'too late') is None
    assert matcher.put(ANSWER, 13, 'answer') == 14
    assert unmatched == [1, 1]  # what came before


def test_stamps_that_went_through_pcl_match_by_default() -> None:
    matcher = Matcher(round(CloudSettings().cloud_tolerance * 1e9), (10, 10), [0, 0])
    stamp = 1_700_000_000_123_456_999
    matcher.put(ANSWER, stamp, 'answer')
    assert matcher.put(CLOUD, stamp // 1000 * 1000, 'cloud') == 'answer'


def test_what_came_before_a_match_is_given_up() -> None:
    matcher = Matcher(0, (10, 10), unmatched := [0, 0])
    for stamp in (1, 2, 3):
        matcher.put(CLOUD, stamp, stamp)
    assert matcher.put(ANSWER, 2, 'answer') == 2
    assert unmatched == [1, 0]
    assert matcher.put(ANSWER, 1, 'late') is None
    assert matcher.put(ANSWER, 3, 'answer') == 3
    assert unmatched == [1, 1]


def test_what_waits_is_limited_by_its_size() -> None:
    matcher = Matcher(0, (10, 2), unmatched := [0, 0])
    for stamp, size in ((1, 4), (2, 5), (3, 6), (4, 100)):
        assert matcher.put(CLOUD, stamp, stamp, size) is None
    assert unmatched == [3, 0]
    assert matcher.put(ANSWER, 4, 'answer') == 4
    for stamp in (5, 6, 7):
        matcher.put(ANSWER, stamp, stamp)
    assert unmatched == [3, 1]


def test_stamps_that_start_again_match() -> None:
    matcher = Matcher(0, (10, 10), [0, 0])
    matcher.put(CLOUD, 1000, 'old')
    assert matcher.put(CLOUD, 0, 'new') is None
    assert matcher.put(ANSWER, 0, 'answer') == 'new'
