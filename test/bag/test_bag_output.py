import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from ahf_ros.bag.output import JOURNAL, Entry, Journal, begin, begun_with, remove_unfinished
from ahf_ros.identification.filtering.identifier import Memory

ENTRIES = [
    Entry(
        '/image', 10**18 + number, Memory((1 + number / 3, 0.13), (number, 54), ('gsi', 'dots'), 2)
    )
    for number in range(12)
]
REFUSED = Entry('/image', 7, Memory(), 'no image', 'a note')


def test_everything_is_there_after_every_image_in_the_order_of_the_answers(tmp_path: Path) -> None:
    assert begun_with(tmp_path) == ''
    begin(tmp_path, 'told')
    answered = []
    for number, entry in enumerate((*ENTRIES[::-1], REFUSED)):
        outputs = [] if entry.reason else [('/b', bytes([number])), ('/a', b'')]
        with closing(Journal(tmp_path)) as journal:  # as after a kill
            assert list(journal.outputs()) == answered
            journal.append(entry, outputs)
            answered.append((entry, outputs))
            assert journal.entries == [entry for entry, _ in answered]
    assert begun_with(tmp_path) == 'told'
    remove_unfinished(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_image_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    begin(tmp_path, '')
    with closing(Journal(tmp_path)) as journal:
        journal.append(ENTRIES[0], [('/a', b'some')])
        with pytest.raises(TypeError):
            journal.append(ENTRIES[1], [('/a', b'some'), None])  # type: ignore[list-item]
        assert list(journal.outputs()) == [(ENTRIES[0], [('/a', b'some')])]
    with closing(Journal(tmp_path)) as journal:
        assert journal.entries == ENTRIES[:1]


def test_a_journal_that_was_not_begun_is_none(tmp_path: Path) -> None:
    (tmp_path / JOURNAL).touch()
    assert begun_with(tmp_path) == ''
    begin(tmp_path, 'told')
    assert begun_with(tmp_path) == 'told'


@pytest.mark.parametrize(
    'change',
    [
        'DELETE FROM outputs WHERE image = 1 AND number = 1',
        "UPDATE outputs SET data = X'00' WHERE image = 1 AND number = 0",
        "UPDATE images SET entry = replace(entry, '/image', '/other') WHERE number = 1",
        'DELETE FROM images WHERE number = 1',
        'UPDATE images SET entry = NULL WHERE number = 1',
    ],
)
def test_what_was_changed_in_a_journal_is_named(tmp_path: Path, change: str) -> None:
    begin(tmp_path, 'told')
    with closing(Journal(tmp_path)) as journal:
        for entry in ENTRIES[:3]:
            journal.append(entry, [('/a', b'some'), ('/b', b'more')])
    with closing(sqlite3.connect(tmp_path / JOURNAL)) as database, database:
        database.execute(change)
    with pytest.raises(ValueError, match=r'unfinished\.sqlite.* is damaged'):
        Journal(tmp_path)


def test_a_journal_that_is_none_is_named(tmp_path: Path) -> None:
    (tmp_path / JOURNAL).write_bytes(bytes(range(256)) * 40)
    with pytest.raises(ValueError, match=r'unfinished\.sqlite is damaged or of another kind'):
        begun_with(tmp_path)
    (tmp_path / JOURNAL).unlink()
    os.mkfifo(tmp_path / JOURNAL)
    with pytest.raises(ValueError, match=r'unfinished\.sqlite cannot be read: it is a named pipe'):
        begun_with(tmp_path)
