"""`ahf bag` on files that hold anything at any place: each is read, or its fault is named."""

from __future__ import annotations

import os
import sqlite3
from collections import Counter
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from ruamel.yaml import YAML

from ahf_ros.bag.assembly import finished
from ahf_ros.bag.definitions import IMAGE, LONGEST_DEFINITION, typestore
from ahf_ros.bag.mcap import Mcap
from ahf_ros.bag.other_messages import NAME
from ahf_ros.bag.records import Schema
from ahf_ros.bag.source import Source
from ahf_ros.bag.writing import BagWriter
from ahf_ros.cli import main
from support import bags, mcap

PIXELS = np.tile(np.arange(50, dtype=np.uint8), (40, 1))


def status(source: Path) -> int:
    """Return the exit status of `ahf bag` in this process."""
    return main(['bag', str(source), str(source.parent / 'out'), '--detector', 'traditional'])


def recorded(folder: Path, storage: str = 'sqlite3') -> Path:
    return bags.write_ros2(folder / 'in', bags.recorded(typestore(), [PIXELS] * 3), storage)


def image_records() -> list[bytes]:
    store = typestore()
    definition, _ = store.generate_msgdef(IMAGE, ros_version=2)
    data = bytes(store.serialize_cdr(bags.image(store, PIXELS, 10**8), IMAGE))
    schema = mcap.schema(1, IMAGE, 'ros2msg', definition)
    return [schema, mcap.channel(1, 1, '/image'), mcap.message(1, 10**8, data)]


@pytest.mark.parametrize(
    ('statement', 'reason', 'copied'),
    [
        ('UPDATE messages SET timestamp = -5 WHERE id < 3', '-5 ns is not a time', 4),
        ('UPDATE messages SET data = 5000000000 WHERE id = 1', '10 bytes of type integer', 5),
        ("UPDATE messages SET data = 'text' WHERE id = 1", '4 bytes of type text', 5),
        ("UPDATE topics SET name = x'ff00' WHERE name = '/notes'", "topic 1 is b'\\xff\\x00'", 3),
        ('UPDATE messages SET id = -7 WHERE id = 1', '', 6),
        ("UPDATE message_definitions SET encoded_message_definition = x'ff'", '', 6),
    ],
)
def test_rows_of_any_content_are_read_or_named(
    tmp_path: Path,
    statement: str,
    reason: str,
    copied: int,
    capfd: pytest.CaptureFixture[str],
) -> None:
    source = recorded(tmp_path)
    with closing(sqlite3.connect(source / 'in.db3')) as database, database:
        database.execute(statement)
    assert status(source) == bool(reason)
    assert reason in capfd.readouterr().err
    topics = [topic for topic, _, _ in bags.read(tmp_path / 'out')]
    assert sum(topic in ('/image', '/notes') for topic in topics) == copied


def test_a_view_that_never_ends_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    source = recorded(tmp_path)
    with closing(sqlite3.connect(source / 'in.db3')) as database, database:
        database.execute('DROP TABLE messages')
        database.execute(
            'CREATE VIEW messages AS WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x FROM n) '
            "SELECT x AS id, 1 AS topic_id, x AS timestamp, x'00' AS data FROM n"
        )
    assert status(source) == 1
    assert 'messages is not a table' in capfd.readouterr().err


def test_a_file_that_is_none_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'in').mkdir()
    os.mkfifo(tmp_path / 'in' / 'a.mcap')
    assert status(tmp_path / 'in') == 1
    assert 'a.mcap cannot be read: it is not a regular file' in capfd.readouterr().err


@pytest.mark.parametrize(
    ('metadata', 'reason'),
    [
        ('[' * 5000, 'RecursionError'),
        ('rosbag2_bagfile_information: {topics_with_message_count: [{topic_metadata: '
         '{name: /image}, message_count: .inf}]}', 'OverflowError'),
    ],
)  # fmt: skip
def test_metadata_of_any_content_are_named(
    tmp_path: Path, metadata: str, reason: str, capfd: pytest.CaptureFixture[str]
) -> None:
    source = recorded(tmp_path, 'mcap')
    (source / 'metadata.yaml').write_text(metadata)
    assert status(source) == 1
    assert f'metadata.yaml: {reason}' in capfd.readouterr().err
    assert len(bags.answers(tmp_path / 'out')) == 3


def test_custom_data_of_any_text_read_back_as_they_were(tmp_path: Path) -> None:
    text = ('\\u00ff "\\\\\' ' * 30) + '\x85\x7f\ufeff\U0001f600'
    with BagWriter(tmp_path / 'out', 'mcap') as made:
        made.set_custom_data('operator', text)
    with Source(tmp_path / 'out') as read:
        assert read.metadata.custom == {'operator': text}
    content = YAML(typ='safe').load(tmp_path / 'out' / 'metadata.yaml')
    assert content['rosbag2_bagfile_information']['custom_data'] == {'operator': text}


def test_what_a_ros2_bag_cannot_hold_is_kept_beside_it(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    records = [
        *image_records(),
        mcap.schema(2, 'foxglove.Log', 'protobuf', b'\xff\x00\xfe'),
        mcap.channel(2, 2, '/log', 'protobuf'),
        mcap.channel(3, 0, '/image', 'json'),
        *(mcap.message(2, time, bytes([time])) for time in (5, 6)),
        mcap.message(3, 7, b'{}'),
    ]
    source = mcap.McapFile(records).write(tmp_path / 'in.mcap')
    assert status(source) == 0
    errors = capfd.readouterr().err
    assert f'left out: /log: 2 messages, serialized as protobuf, are in {NAME}' in errors
    made = tmp_path / 'out'
    assert Counter(topic for topic, _, _ in bags.read(made)) == {
        '/image': 1,
        '/image/coded_targets': 1,
    }
    others = Mcap(made / NAME)
    log, image = others.connections
    assert (log.topic, log.ext.serialization_format, log.msgcount) == ('/log', 'protobuf', 2)
    assert others.schema(log) == Schema('foxglove.Log', 'protobuf', b'\xff\x00\xfe')
    assert others.schema(image) is None
    read = [(it.topic, time, data) for it, time, data in others.messages([log, image])]
    assert read == [('/log', 5, b'\5'), ('/log', 6, b'\6'), ('/image', 7, b'{}')]
    outcome = finished(made)
    assert outcome and outcome.others == 3
    (made / NAME).unlink()
    assert status(source) == 1
    assert 'out was finished and is damaged' in capfd.readouterr().err


def test_a_file_that_the_metadata_do_not_list_is_named(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    source = recorded(tmp_path, 'mcap')
    mcap.McapFile().write(source / 'more.mcap')
    assert status(source) == 0
    named = 'left out: more.mcap, which metadata.yaml does not list'
    assert named in capfd.readouterr().err


def test_messages_of_ros1_in_mcap_are_named(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    records = [mcap.schema(1, IMAGE, 'ros1msg', ''), mcap.channel(1, 1, '/image', 'ros1')]
    assert status(mcap.McapFile(records, 'ros1').write(tmp_path / 'in.mcap')) == 1
    assert 'in.mcap has no images' in (errors := capfd.readouterr().err)
    assert '/image is serialized as ros1' in errors


def test_what_takes_long_to_parse_is_copied_unparsed(tmp_path: Path) -> None:
    definition = '\n'.join(f'uint8 x{number}' for number in range(LONGEST_DEFINITION // 9))
    records = [
        *image_records(),
        mcap.schema(2, 'far/msg/Long', 'ros2msg', definition),
        mcap.channel(2, 2, '/long'),
        mcap.message(2, 5, b'12'),
    ]
    assert len(definition) > LONGEST_DEFINITION
    assert status(mcap.McapFile(records).write(tmp_path / 'in.mcap')) == 0
    assert ('/long', 5, b'12') in bags.read(tmp_path / 'out')


def test_more_topics_than_can_be_written_in_time_are_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    channels = [mcap.channel(number, 0, f'/t{number}') for number in range(2, 2002)]
    source = mcap.McapFile([*image_records(), *channels]).write(tmp_path / 'in.mcap')
    assert status(source) == 1
    assert 'has 2001 topics, accepted are at most 2000' in capfd.readouterr().err
