from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from ahf_ros.bag.definitions import CODED_TARGETS
from ahf_ros.bag.journal import MERGED, Entry, Journal, begin, custom_data
from ahf_ros.filtering.identifier import Memory
from support import bags

ENTRIES = [
    Entry('/image', 10**18 + number, Memory((1 + number / 3, 0.13), (number, 54)), '')
    for number in range(2 * MERGED + 3)
]
REFUSED = Entry('/image', 7, Memory(), 'no image')


def test_everything_is_there_after_every_image(tmp_path: Path) -> None:
    folder = tmp_path / 'new' / 'bag'
    begin(folder, {'/targets': CODED_TARGETS}, 'told')
    assert bags.read(folder) == []
    for count, entry in enumerate(ENTRIES, start=1):
        journal = Journal(folder)  # as after a kill
        assert journal.entries == ENTRIES[: count - 1]
        journal.append(entry, [('/targets', bytes([count, 1])), ('/targets', bytes([count, 2]))])
        read = [data for topic, _, data in bags.read(folder) if topic == '/targets']
        assert read == [bytes([number, part]) for number in range(1, count + 1) for part in (1, 2)]
    assert custom_data(folder) == {'ahf_ros': 'told'}
    parts = [path for path in folder.iterdir() if path.suffix == '.db3']
    assert len(parts) == 1 + 2 + 3  # none, ten each, one each


def test_images_come_back_in_the_order_in_which_they_were_answered(tmp_path: Path) -> None:
    folder = tmp_path / 'bag'
    begin(folder, {'/targets': CODED_TARGETS}, '')
    journal = Journal(folder)
    expected = []
    for entry in (ENTRIES[1], REFUSED, ENTRIES[0]):
        answers = [] if entry.reason else [('/targets', b'some')]
        journal.append(entry, answers)
        expected.append((entry, answers))
    assert list(Journal(folder).answers()) == expected


def test_what_was_broken_off_does_not_count(tmp_path: Path) -> None:
    folder = tmp_path / 'bag'
    begin(folder, {'/targets': CODED_TARGETS}, '')
    Journal(folder).append(ENTRIES[0], [('/targets', b'some')])
    before = bags.read(folder)
    for name in ('new.part.db3', '000000001-1.part.db3', 'metadata.new'):
        (folder / name).write_bytes(b'half')
    assert bags.read(folder) == before
    assert Journal(folder).entries == ENTRIES[:1]
    Journal(folder).append(ENTRIES[1], [])
    assert Journal(folder).entries == ENTRIES[:2]
