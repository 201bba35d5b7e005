"""`ahf bag` on bags that are damaged or hostile: nothing is lost without being named."""

import json
import os
import sqlite3
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from zlib import crc32

import cv2
import numpy as np
import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

import zstandard
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import QosDurability
from ruamel.yaml import YAML

from ahf_ros.bag import source as sources
from ahf_ros.bag.definitions import COMPRESSED_IMAGE, IMAGE, MAXIMUM_DEFINITION, typestore
from ahf_ros.bag.mcap_records import add_checksums
from ahf_ros.bag.output import Journal
from ahf_ros.bag.source import Source
from support import bags, command_line, mcap

COUNT = 3
PIXELS = [np.tile(np.arange(50, dtype=np.uint8) + number, (40, 1)) for number in range(COUNT)]


status = partial(command_line.status, 'bag', '--detector', 'traditional')
Run = Callable[[Path, int], str]


@pytest.fixture
def run(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Run:
    """Return a function that answers a bag, checks the status and returns what is said."""

    def answered(source: Path, expected: int) -> str:
        assert status(source, tmp_path / 'out') == expected
        return capfd.readouterr().err

    return answered


def serialized() -> list[bytes]:
    store = typestore()
    return [
        bytes(store.serialize_cdr(bags.image(store, it, (1 + number) * 10**8), IMAGE))
        for number, it in enumerate(PIXELS)
    ]


def definition(kind: str) -> str:
    return typestore().generate_msgdef(kind, ros_version=2)[0]


def text(words: str) -> bytes:
    store = typestore()
    return bytes(store.serialize_cdr(bags.text(store, words), bags.STRING))


IMAGES = (mcap.schema(1, IMAGE, 'ros2msg', definition(IMAGE)), mcap.channel(1, 1, '/image'))
NOTES = (
    mcap.schema(2, bags.STRING, 'ros2msg', definition(bags.STRING)),
    mcap.channel(2, 2, '/notes'),
)


def recorded(folder: Path, storage: str = 'mcap') -> Path:
    return bags.write_ros2(folder / 'in', bags.recorded(typestore(), PIXELS), storage)


def image_records() -> list[bytes]:
    return [*IMAGES, mcap.message(1, 10, serialized()[0])]


def counts(path: Path) -> Counter[str]:
    return Counter(topic for topic, _, _ in bags.read(path))


def test_a_damage_ends_the_bag_there_and_is_named(tmp_path: Path, run: Run) -> None:
    one, two, three = serialized()
    bad = bytearray(mcap.chunk(mcap.message(2, 3, text('bad')), 3, 3))
    bad[-1] ^= 1
    file = mcap.McapFile([*IMAGES, *NOTES])
    file.records += [mcap.chunk(mcap.message(1, 1, one), 1, 1), bytes(bad)]
    file.records += [mcap.chunk(mcap.message(1, 5, two) + mcap.message(1, 7, three), 5, 7)]
    source = file.write(tmp_path / 'in.mcap')
    errors = run(source, 1)
    assert '1 images answered' in errors
    assert 'missing: in.mcap: nothing after 0.000000001 s can be read: CRCValid' in errors
    assert counts(tmp_path / 'out') == {'/image': 1, '/image/coded_targets': 1}


def test_a_damaged_file_does_not_end_the_next_one(tmp_path: Path, run: Run) -> None:
    one, two, _ = serialized()
    source = tmp_path / 'in'
    source.mkdir()
    cut = mcap.McapFile([*IMAGES, mcap.message(1, 1, one)]).write(source / 'in_0.mcap')
    cut.write_bytes(cut.read_bytes()[:-50])
    mcap.McapFile([*IMAGES, mcap.message(1, 5, two)]).write(source / 'in_1.mcap')
    assert 'missing: in_0.mcap: nothing after 0.000000001 s' in run(source, 1)
    assert counts(tmp_path / 'out') == {'/image': 2, '/image/coded_targets': 2}


def test_messages_without_an_index_may_be_out_of_order(tmp_path: Path) -> None:
    one, two, three = serialized()
    file = mcap.McapFile([*IMAGES, *NOTES])
    file.records += [mcap.message(1, 100, one), mcap.message(2, 95, text('late'))]
    file.records += [mcap.message(1, 200, two), mcap.message(2, 195, text('late'))]
    file.records += [mcap.message(1, 150, three)]
    source = file.write(tmp_path / 'in.mcap')
    assert status(source, tmp_path / 'out') == 0
    assert counts(tmp_path / 'out') == {'/image': 3, '/image/coded_targets': 3, '/notes': 2}


def test_what_nobody_asked_about_is_copied_as_bytes(tmp_path: Path) -> None:
    one, *_ = serialized()
    file = mcap.McapFile([*IMAGES, *NOTES])
    held = 'strange/msg/Held'
    file.records += [
        mcap.schema(3, held, 'ros2msg', 'strange/Held it'),
        mcap.channel(3, 3, '/held'),
        mcap.schema(4, 'strange/msg/No', 'ros2msg', '\N{PILE OF POO} = = ['),
        mcap.channel(4, 4, '/no'),
        mcap.channel(5, 0, '/unknown'),
        *(mcap.message(number, number, bytes([number])) for number in range(2, 6)),
        mcap.message(1, 10, one),
    ]
    assert status(file.write(tmp_path / 'in.mcap'), tmp_path / 'out') == 0
    made = bags.read(tmp_path / 'out')
    assert [(topic, data) for topic, _, data in made][:4] == [
        ('/notes', b'\x02'),
        ('/held', b'\x03'),
        ('/no', b'\x04'),
        ('/unknown', b'\x05'),
    ]


def test_what_a_copy_does_not_have_is_named(tmp_path: Path, run: Run) -> None:
    one, *_ = serialized()
    file = mcap.McapFile([*IMAGES, mcap.message(1, 10, one)])
    file.records += [mcap.attachment('calibration.txt', b'f = 35'), mcap.metadata('rig')]
    errors = run(file.write(tmp_path / 'in.mcap'), 0)
    for name in ("attachment 'calibration.txt'", "metadata 'rig'"):
        assert f'left out: {name}' in errors


def test_custom_data_are_kept(tmp_path: Path) -> None:
    store = typestore()
    name = ('Zoë\t"\\" ' * 30) + '\x85\x7f\ufeff'
    with rosbag2.Writer(tmp_path / 'in', version=9) as writer:
        item = writer.add_connection('/image', IMAGE, typestore=store)
        writer.write(item, 5, serialized()[0])
    metadata = tmp_path / 'in' / 'metadata.yaml'
    content = YAML(typ='safe').load(metadata)
    content['rosbag2_bagfile_information']['custom_data'] = {'operator': name}
    with metadata.open('w', encoding='utf-8') as file:
        json.dump(content, file)
    assert status(tmp_path / 'in', tmp_path / 'out') == 0
    with Source(tmp_path / 'out') as made:
        assert made.metadata.custom['operator'] == name


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_messages_of_a_cut_bag_are_decompressed(tmp_path: Path, storage: str) -> None:
    store = typestore()
    plugin = rosbag2.StoragePlugin[storage.upper()]
    writer = rosbag2.Writer(tmp_path / 'in', version=9, storage_plugin=plugin)
    writer.set_compression(rosbag2.CompressionMode.MESSAGE, rosbag2.CompressionFormat.ZSTD)
    with writer:
        item = writer.add_connection('/image', IMAGE, typestore=store)
        for time, data in enumerate(serialized()):
            writer.write(item, time, data)
    (tmp_path / 'in' / 'metadata.yaml').unlink()
    assert status(tmp_path / 'in', tmp_path / 'out') == 1
    made = [data for topic, _, data in bags.read(tmp_path / 'out') if topic == '/image']
    assert made == serialized()


def test_bombs_are_named_before_they_are_allocated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    monkeypatch.setattr(sources, 'MAXIMUM_SIZE', 2**20)
    compressor = zstandard.ZstdCompressor().compressobj()
    bomb = compressor.compress(bytes(2**20 + 1)) + compressor.flush()
    one, *_ = serialized()
    huge = bytearray(mcap.chunk(bytes(10), 7, 7, compressed=True))
    huge[9 + 16 : 9 + 24] = (2**40).to_bytes(8, 'little')
    file = mcap.McapFile([*IMAGES, mcap.message(1, 4, bomb), mcap.message(1, 5, one), bytes(huge)])
    errors = run(file.write(tmp_path / 'in.mcap'), 1)
    assert 'missing: /image: 1 message cannot be converted: ZstdError: ' in errors
    assert 'missing: in.mcap: nothing after 0.000000005 s can be read: ' in errors
    assert counts(tmp_path / 'out') == {'/image': 1, '/image/coded_targets': 1}


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_names_may_have_any_letters(
    tmp_path: Path, storage: str, capfd: pytest.CaptureFixture[str]
) -> None:
    name = 'what? 100%25 #1'
    source = recorded(tmp_path, storage).rename(tmp_path / name)
    target = tmp_path / f'{name} out'
    assert status(source, target, '--storage', 'sqlite3') == 1
    assert 'accepted with storage sqlite3 is a path without ?, # and %' in capfd.readouterr().err
    assert status(source, target) == 0
    with Source(target) as made:
        assert sum(it.topic == '/image/coded_targets' for it, _, _ in made.messages()) == COUNT


@pytest.mark.parametrize('harm', [Path.unlink, lambda it: it.write_bytes(it.read_bytes()[:200])])
def test_a_finished_bag_without_its_data_is_not_done(
    tmp_path: Path, harm: Callable[[Path], object], run: Run
) -> None:
    source = recorded(tmp_path)
    run(source, 0)
    harm(tmp_path / 'out' / 'out.mcap')
    assert f'{tmp_path / "out"} was finished and is damaged: ' in run(source, 1)


def test_a_bag_that_shrinks_while_it_is_answered_keeps_its_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    source = recorded(tmp_path)
    read = Source.messages

    def short(self: Source, topics: object = None) -> object:
        found = list(read(self, topics))  # type: ignore[arg-type]
        return iter(found if topics else found[:-1])

    with monkeypatch.context() as patch:
        patch.setattr(Source, 'messages', short)
        assert f'{COUNT} images were answered, {COUNT - 1} can be read now' in run(source, 1)
    with closing(Journal(tmp_path / 'out')) as journal:
        assert sum(len(outputs) for _, outputs in journal.outputs()) == COUNT
    assert status(source, tmp_path / 'out') == 0
    assert counts(tmp_path / 'out')['/image/coded_targets'] == COUNT


def test_messages_of_ros1_that_ros2_cannot_hold_are_named(tmp_path: Path, run: Run) -> None:
    store = bags.ros1()
    with rosbag1.Writer(tmp_path / 'in.bag') as writer:
        item = writer.add_connection('/image', IMAGE, typestore=store, latching=1)
        message = bags.image(store, PIXELS[0], 10**9)
        writer.write(item, 10**9, bytes(store.serialize_ros1(message, IMAGE)))
        notes = writer.add_connection('/notes', bags.STRING, typestore=store)
        writer.write(notes, 10**9 + 1, b'\xff\xff\xff\xff?')
        held = writer.add_connection(
            '/held', 'strange/msg/Held', msgdef='strange/Held it', md5sum='0' * 32
        )
        writer.write(held, 10**9 + 2, b'1234')
    errors = run(tmp_path / 'in.bag', 1)
    assert 'missing: /notes: 1 message cannot be converted: ' in errors
    assert 'missing: /held: 1 message cannot be converted: ' in errors
    assert counts(tmp_path / 'out') == {'/image': 1, '/image/coded_targets': 1}
    with Source(tmp_path / 'out') as made:
        (image,) = (it for it in made.connections if it.topic == '/image')
        assert [it.durability for it in image.ext.offered_qos_profiles] == [
            QosDurability.TRANSIENT_LOCAL
        ]


def test_tf_of_old_bags_has_its_name_in_ros2(tmp_path: Path) -> None:
    store = bags.ros1()
    definition = 'std_msgs/Header[] transforms'
    with rosbag1.Writer(tmp_path / 'in.bag') as writer:
        item = writer.add_connection('/image', IMAGE, typestore=store)
        message = bags.image(store, PIXELS[0], 10**9)
        writer.write(item, 10**9, bytes(store.serialize_ros1(message, IMAGE)))
        tf = writer.add_connection('/tf', 'tf/msg/tfMessage', msgdef=definition, md5sum='0' * 32)
        writer.write(tf, 10**9, bytes(4))
    assert status(tmp_path / 'in.bag', tmp_path / 'out') == 0
    with rosbag2.Reader(tmp_path / 'out') as made:
        assert made.topics['/tf'].msgtype == 'tf2_msgs/msg/TFMessage'


@pytest.mark.parametrize(
    ('statement', 'reason', 'copied'),
    [
        ('UPDATE messages SET timestamp = -5 WHERE id < 3', '-5 ns is not a time', 4),
        ('UPDATE messages SET data = 5000000000 WHERE id = 1', 'is of type int, accepted are', 5),
        ("UPDATE messages SET data = 'text' WHERE id = 1", 'is of type str, accepted are', 5),
        ("UPDATE topics SET name = x'ff00' WHERE name = '/notes'", "b'\\xff\\x00': 3 messages", 3),
        ('UPDATE messages SET topic_id = 9 WHERE id = 1', 'in.db3: 5 of 6 messages were read', 5),
        ('UPDATE messages SET id = -7 WHERE id = 1', '', 6),
    ],
)
def test_rows_of_any_content_are_read_or_named(
    tmp_path: Path, statement: str, reason: str, copied: int, run: Run
) -> None:
    source = recorded(tmp_path, 'sqlite3')
    with closing(sqlite3.connect(source / 'in.db3')) as database, database:
        database.execute(statement)
    assert reason in run(source, bool(reason))
    topics = [topic for topic, _, _ in bags.read(tmp_path / 'out')]
    assert sum(topic in ('/image', '/notes') for topic in topics) == copied


def test_a_journal_of_sqlite_that_was_not_merged_is_named(tmp_path: Path, run: Run) -> None:
    source = recorded(tmp_path, 'sqlite3')
    (source / 'in.db3-wal').write_bytes(b'more')
    assert 'missing: in.db3-wal was not merged into in.db3' in run(source, 1)


def test_a_file_that_is_none_is_refused(tmp_path: Path, run: Run) -> None:
    (tmp_path / 'in').mkdir()
    os.mkfifo(tmp_path / 'in' / 'a.mcap')
    assert 'a.mcap cannot be read: it is not a regular file' in run(tmp_path / 'in', 1)


@pytest.mark.parametrize(
    ('metadata', 'reason'),
    [
        ('[' * 1500, ', line 1: it is nested too deep'),
        ('rosbag2_bagfile_information: {topics_with_message_count: [{topic_metadata: '
         '{name: /image}, message_count: .inf}]}', ' is damaged'),
    ],
)  # fmt: skip
def test_metadata_of_any_content_are_named(
    tmp_path: Path, metadata: str, reason: str, run: Run
) -> None:
    source = recorded(tmp_path)
    (source / 'metadata.yaml').write_text(metadata)
    assert f'metadata.yaml{reason}' in run(source, 1)
    assert len(bags.answers(tmp_path / 'out')) == COUNT


def test_channels_of_other_kinds_are_named_as_left_out(tmp_path: Path, run: Run) -> None:
    source = tmp_path / 'in.mcap'
    with source.open('wb') as file:
        writer = Writer(file)
        writer.start('ros2')
        schema = writer.register_schema(IMAGE, 'ros2msg', definition(IMAGE).encode())
        other = writer.register_schema('foxglove.Log', 'protobuf', b'\xff\x00\xfe')
        image = writer.register_channel('/image', 'cdr', schema)
        log = writer.register_channel('/log', 'protobuf', other)
        plain = writer.register_channel('/image', 'json', 0)
        for time, data in enumerate(serialized()):
            writer.add_message(image, log_time=time, data=data, publish_time=time)
            writer.add_message(log, log_time=time, data=b'x', publish_time=time)
        writer.add_message(plain, log_time=9, data=b'{}', publish_time=9)
        writer.finish()
    errors = run(source, 0)
    assert 'left out: /log: 3 messages serialized as protobuf' in errors
    assert 'left out: /image: 1 message serialized as json' in errors
    assert counts(tmp_path / 'out') == {'/image': 3, '/image/coded_targets': 3}


def test_a_file_that_the_metadata_do_not_list_is_named(tmp_path: Path, run: Run) -> None:
    source = recorded(tmp_path)
    mcap.McapFile().write(source / 'more.mcap')
    assert 'left out: more.mcap, which metadata.yaml does not list' in run(source, 0)


def test_messages_of_ros1_in_mcap_are_named(tmp_path: Path, run: Run) -> None:
    records = [mcap.schema(1, IMAGE, 'ros1msg', ''), mcap.channel(1, 1, '/image', 'ros1')]
    errors = run(mcap.McapFile(records, 'ros1').write(tmp_path / 'in.mcap'), 1)
    assert 'in.mcap has no images' in errors
    assert '/image is serialized as ros1' in errors


def test_what_takes_long_to_parse_is_copied_unparsed(tmp_path: Path) -> None:
    definition = '\n'.join(f'uint8 x{number}' for number in range(MAXIMUM_DEFINITION // 9))
    records = [
        *image_records(),
        mcap.schema(2, 'far/msg/Long', 'ros2msg', definition),
        mcap.channel(2, 2, '/long'),
        mcap.message(2, 5, b'12'),
    ]
    assert len(definition) > MAXIMUM_DEFINITION
    assert status(mcap.McapFile(records).write(tmp_path / 'in.mcap'), tmp_path / 'out') == 0
    assert ('/long', 5, b'12') in bags.read(tmp_path / 'out')


def test_more_topics_than_can_be_written_in_time_are_refused(tmp_path: Path, run: Run) -> None:
    channels = [mcap.channel(number, 0, f'/t{number}') for number in range(2, 2002)]
    source = mcap.McapFile([*image_records(), *channels]).write(tmp_path / 'in.mcap')
    assert 'has 2001 topics, accepted are at most 2000' in run(source, 1)


def test_a_damaged_image_is_answered_and_named(tmp_path: Path, run: Run) -> None:
    store = typestore()
    messages = []
    for number, suffix in enumerate(('.png', '.jpg'), start=1):
        message = bags.compressed(store, np.tile(PIXELS[0], (4, 4)), number * 10**8)
        data = cv2.imencode(suffix, np.tile(PIXELS[0], (4, 4)))[1].ravel()
        message.data = data if suffix == '.png' else np.delete(data, slice(-300, -2))
        messages.append(('/image', COMPRESSED_IMAGE, number * 10**8, message))
    source = bags.write_ros2(tmp_path / 'in', messages)
    for _ in range(2):  # what was finished is known, too
        said = run(source, 1)
        assert '2 images answered, 1 of them damaged' in said
    assert counts(tmp_path / 'out') == {'/image': 2, '/image/coded_targets': 2}


@pytest.mark.parametrize('compressed', [False, True])
def test_a_cut_file_says_where_and_gives_what_is_before(
    tmp_path: Path, run: Run, compressed: bool
) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (3, 400, 500), np.uint8)
    store = typestore()
    images = [bytes(store.serialize_cdr(bags.image(store, it, 10**8), IMAGE)) for it in noise]
    messages = [mcap.message(1, it * 10**8, of) for it, of in enumerate(images, start=1)]
    whole = mcap.chunk(b''.join([*IMAGES, *messages]), 10**8, 3 * 10**8, compressed=compressed)
    source = mcap.McapFile([whole]).write(tmp_path / 'in.mcap')
    content = source.read_bytes()
    source.write_bytes(content[:450_000])
    errors = run(source, 1)
    assert '2 images answered' in errors
    assert 'the file is cut in a message of /image at 0.300000000 s' in errors
    assert counts(tmp_path / 'out') == {'/image': 2, '/image/coded_targets': 2}


def test_a_file_that_is_cut_before_its_first_message_says_so(tmp_path: Path, run: Run) -> None:
    chunk = mcap.chunk(b''.join([*IMAGES, mcap.message(1, 5, serialized()[0])]), 5, 5)
    source = mcap.McapFile([chunk]).write(tmp_path / 'in.mcap')
    source.write_bytes(source.read_bytes()[:150])
    errors = run(source, 1)
    cut = 'the file is cut in a chunk with messages from 0.000000005 to 0.000000005 s'
    assert f'has no images that can be read: in.mcap: nothing can be read: {cut}' in errors


def test_a_chunk_that_is_there_again_is_said(tmp_path: Path, run: Run) -> None:
    one, two, _ = serialized()
    first, second = (
        mcap.chunk(mcap.message(1, it, of), it, it) for it, of in ((1, one), (5, two))
    )
    source = mcap.McapFile([*IMAGES, first, second, first]).write(tmp_path / 'in.mcap')
    again = 'left out: in.mcap: a chunk with messages from 0.000000001 to 0.000000001 s'
    assert again in run(source, 0)
    assert counts(tmp_path / 'out') == {'/image': 2, '/image/coded_targets': 2}


def test_a_chunk_that_its_index_names_twice_is_said(tmp_path: Path, run: Run) -> None:
    source = tmp_path / 'in.mcap'
    with source.open('wb') as file:
        writer = Writer(file, chunk_size=1, compression=CompressionType.NONE)
        writer.start(profile='ros2')
        schema = writer.register_schema(IMAGE, 'ros2msg', definition(IMAGE).encode())
        channel = writer.register_channel('/image', 'cdr', schema)
        for _ in range(3):  # the first one is in a chunk with the schema
            writer.add_message(channel, 10, serialized()[0], 10)
        writer.finish()
    assert 'which is there again' in run(source, 0)
    assert counts(tmp_path / 'out') == {'/image': 2, '/image/coded_targets': 2}


def test_chunks_are_written_with_their_checksums(tmp_path: Path) -> None:
    assert status(recorded(tmp_path), tmp_path / 'out') == 0
    (made,) = (tmp_path / 'out').glob('*.mcap')
    with made.open('rb') as file:
        reader = StreamReader(file, emit_chunks=True)
        chunks = [it for it in reader.records if isinstance(it, Chunk)]
    assert chunks
    assert all(it.uncompressed_crc == crc32(it.data) for it in chunks)


@pytest.mark.parametrize('indexed', [True, False])
def test_chunks_without_checksums_are_said_once(
    indexed: bool, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    messages = [(1, it, data) for it, data in enumerate(serialized(), start=1)]
    for name, checked in (('checked', True), ('bare', False)):
        chunks = [mcap.chunk(mcap.message(*it), it[1], it[1], checksum=checked) for it in messages]
        if indexed:
            source = recorded(tmp_path / name)
            if checked:
                add_checksums(next(source.glob('*.mcap')))
        else:
            file = mcap.McapFile([*IMAGES])
            file.records += chunks
            source = file.write(tmp_path / f'{name}.mcap')
        assert status(source, tmp_path / f'{name} out') == 0
        assert capfd.readouterr().err.count('no checksums') == (not checked)


def test_an_output_in_the_recording_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    source = recorded(tmp_path)
    for of in (source, next(source.glob('*.mcap'))):
        assert status(of, source / 'out') == 1
        assert 'which is in the recording' in capfd.readouterr().err
    assert not (source / 'out').exists()
