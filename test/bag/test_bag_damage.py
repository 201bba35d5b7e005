"""`ahf bag` on bags that are damaged or hostile: nothing is lost without being named."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from backports import zstd
from rosbags import rosbag2

from ahf_ros.bag.assembly import finished
from ahf_ros.bag.definitions import IMAGE, typestore
from ahf_ros.bag.source import Source
from ahf_ros.cli import main
from support import bags, mcap

COUNT = 3
PAGE = 4096


def status(*arguments: object) -> int:
    """Return the exit status of `ahf bag` in this process."""
    try:
        return main(['bag', *map(str, arguments), '--detector', 'traditional'])
    except SystemExit as left:
        return int(left.code or 0)


@pytest.fixture(scope='module')
def images() -> list[np.ndarray]:
    return [np.tile(np.arange(50, dtype=np.uint8) + number, (40, 1)) for number in range(COUNT)]


def serialized(images: list[np.ndarray]) -> list[bytes]:
    store = typestore()
    return [
        bytes(store.serialize_cdr(bags.image(store, it, (1 + number) * 10**8), IMAGE))
        for number, it in enumerate(images)
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


def counts(path: Path) -> Counter[str]:
    return Counter(topic for topic, _, _ in bags.read(path))


def check(target: Path, ended: int, recorded: Counter[str]) -> None:
    """Fail if an answer is missing, or messages are and the status says that none is."""
    made = counts(target)
    outcome = finished(target)
    assert outcome and outcome.images == made['/image']
    assert made['/image'] == made['/image/coded_targets'] + outcome.refused
    if ended == 0:
        assert {topic: made[topic] for topic in recorded} == dict(recorded)


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3', 'ros1'])
def test_no_page_that_is_zeroed_loses_anything_in_silence(
    images: list[np.ndarray], tmp_path: Path, storage: str, capfd: pytest.CaptureFixture[str]
) -> None:
    if storage == 'ros1':
        file = bags.write_ros1(tmp_path / 'in.bag', bags.recorded(bags.ros1(), images))
        source = file
    else:
        source = bags.write_ros2(tmp_path / 'in', bags.recorded(typestore(), images), storage)
        file = next(it for it in source.iterdir() if it.suffix != '.yaml')
    whole = file.read_bytes()
    recorded = Counter({'/image': COUNT, '/notes': COUNT})
    ends = Counter()
    for place in range(0, len(whole), PAGE if storage == 'sqlite3' else 512):
        size = PAGE if storage == 'sqlite3' else 512
        file.write_bytes(whole[:place] + bytes(size) + whole[place + size :])
        target = tmp_path / f'out{place}'
        ended = status(source, target)
        ends[ended] += 1
        errors = capfd.readouterr().err
        if not (target / 'metadata.yaml').exists():
            assert 'ahf bag: ' in errors and ended == 1
        else:
            check(target, ended, recorded)
    assert ends[1] > 0


def test_a_damage_in_a_message_that_is_no_image_is_named(
    images: list[np.ndarray], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    one, two, three = serialized(images)
    bad = bytearray(mcap.chunk(mcap.message(2, 3, text('bad')), 3, 3))
    bad[-1] ^= 1
    file = mcap.McapFile([*IMAGES, *NOTES])
    file.records += [mcap.chunk(mcap.message(1, 1, one), 1, 1), bytes(bad)]
    file.records += [mcap.chunk(mcap.message(1, 5, two) + mcap.message(1, 7, three), 5, 7)]
    source = file.write(tmp_path / 'in.mcap')
    assert status(source, tmp_path / 'out') == 1
    errors = capfd.readouterr().err
    assert '3 images answered' in errors
    assert '/image, /notes at 0.000000003 s: the checksum of a chunk is wrong' in errors
    assert counts(tmp_path / 'out') == {'/image': 3, '/image/coded_targets': 3}


def test_messages_without_an_index_may_be_out_of_order(
    images: list[np.ndarray], tmp_path: Path
) -> None:
    one, two, three = serialized(images)
    file = mcap.McapFile([*IMAGES, *NOTES])
    file.records += [mcap.message(1, 100, one), mcap.message(2, 95, text('late'))]
    file.records += [mcap.message(1, 200, two), mcap.message(2, 195, text('late'))]
    file.records += [mcap.message(1, 150, three)]
    source = file.write(tmp_path / 'in.mcap')
    assert status(source, tmp_path / 'out') == 0
    made = [(topic, time) for topic, time, _ in bags.read(tmp_path / 'out')]
    assert [time for _, time in made] == [95, 100, 100, 150, 150, 195, 200, 200]
    assert Counter(topic for topic, _ in made)['/image/coded_targets'] == 3


def test_what_nobody_asked_about_is_copied_as_bytes(
    images: list[np.ndarray], tmp_path: Path
) -> None:
    one, *_ = serialized(images)
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


def test_what_a_copy_does_not_have_is_named(
    images: list[np.ndarray], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    one, *_ = serialized(images)
    file = mcap.McapFile([*IMAGES, mcap.message(1, 10, one, sequence=7, published=9)])
    file.records += [mcap.attachment('calibration.txt', b'f = 35'), mcap.metadata('rig')]
    assert status(file.write(tmp_path / 'in.mcap'), tmp_path / 'out') == 0
    errors = capfd.readouterr().err
    for name in ("attachment 'calibration.txt'", "metadata 'rig'", 'publish times and sequence'):
        assert f'left out: {name}' in errors


def test_custom_data_are_kept(images: list[np.ndarray], tmp_path: Path) -> None:
    store = typestore()
    with rosbag2.Writer(tmp_path / 'in', version=9) as writer:
        writer.set_custom_data('operator', 'me')
        item = writer.add_connection('/image', IMAGE, typestore=store)
        writer.write(item, 5, serialized(images)[0])
    assert status(tmp_path / 'in', tmp_path / 'out') == 0
    with Source(tmp_path / 'out') as made:
        assert made.metadata.custom['operator'] == 'me'


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_messages_of_a_cut_bag_are_decompressed(
    images: list[np.ndarray], tmp_path: Path, storage: str
) -> None:
    store = typestore()
    plugin = rosbag2.StoragePlugin[storage.upper()]
    writer = rosbag2.Writer(tmp_path / 'in', version=9, storage_plugin=plugin)
    writer.set_compression(rosbag2.CompressionMode.MESSAGE, rosbag2.CompressionFormat.ZSTD)
    with writer:
        item = writer.add_connection('/image', IMAGE, typestore=store)
        for time, data in enumerate(serialized(images)):
            writer.write(item, time, data)
    (tmp_path / 'in' / 'metadata.yaml').unlink()
    assert status(tmp_path / 'in', tmp_path / 'out') == 1
    made = [data for topic, _, data in bags.read(tmp_path / 'out') if topic == '/image']
    assert made == serialized(images)


def test_bombs_are_named_before_they_are_allocated(
    images: list[np.ndarray], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    zeros = zstd.ZstdCompressor()
    part = bytes(2**20)
    bomb = b''.join([*(zeros.compress(part) for _ in range(600)), zeros.flush()])
    one, *_ = serialized(images)
    file = mcap.McapFile([*IMAGES, mcap.message(1, 4, bomb), mcap.message(1, 5, one)])
    file.records.append(bytes(mcap.chunk(b'x', 6, 6)))
    huge = bytearray(mcap.chunk(bytes(10), 7, 7, compressed=True))
    huge[9 + 16 : 9 + 24] = (2**40).to_bytes(8, 'little')
    file.records.append(bytes(huge))
    assert status(file.write(tmp_path / 'in.mcap'), tmp_path / 'out') == 1
    errors = capfd.readouterr().err
    assert '/image at 0.000000004 s: zstd data of more than 536870912 bytes' in errors
    assert f'a chunk has {2**40} bytes, accepted are at most 536870912' in errors
    assert counts(tmp_path / 'out') == {'/image': 1, '/image/coded_targets': 1}


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_names_may_have_any_letters(
    images: list[np.ndarray], tmp_path: Path, storage: str
) -> None:
    messages = bags.recorded(typestore(), images)
    source = bags.write_ros2(tmp_path / 'plain', messages, storage)
    name = 'what? 100%25 #1'
    source = source.rename(tmp_path / name)
    target = tmp_path / f'{name} out'
    assert status(source, target, '--storage', storage) == 0
    with Source(target) as made:
        assert sum(it.topic == '/image/coded_targets' for it, _, _ in made.messages()) == COUNT


@pytest.mark.parametrize('harm', [Path.unlink, lambda it: it.write_bytes(it.read_bytes()[:200])])
def test_a_finished_bag_without_its_data_is_not_done(
    images: list[np.ndarray],
    tmp_path: Path,
    harm: Callable[[Path], object],
    capfd: pytest.CaptureFixture[str],
) -> None:
    source = bags.write_ros2(tmp_path / 'in', bags.recorded(typestore(), images))
    target = tmp_path / 'out'
    assert status(source, target) == 0
    harm(target / 'out.mcap')
    assert status(source, target) == 1
    assert f'{target} was finished and is damaged: ' in capfd.readouterr().err


def test_a_topic_that_is_called_like_the_progress_is_refused(
    images: list[np.ndarray], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    source = bags.write_ros2(tmp_path / 'in', bags.recorded(typestore(), images))
    assert status(source, tmp_path / 'out', '--output-topic', '/ahf_bag/progress') == 1
    assert 'ahf bag needs a topic /ahf_bag/progress, accepted is another' in capfd.readouterr().err


def test_a_bag_that_shrinks_while_it_is_answered_keeps_its_answers(
    images: list[np.ndarray],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    source = bags.write_ros2(tmp_path / 'in', bags.recorded(typestore(), images))
    read = Source.messages

    def short(self: Source, topics: object = None) -> object:
        found = list(read(self, topics))  # type: ignore[arg-type]
        return iter(found if topics else found[:-1])

    with monkeypatch.context() as patch:
        patch.setattr(Source, 'messages', short)
        assert status(source, tmp_path / 'out') == 1
    assert f'{COUNT} images were answered, {COUNT - 1} can be read now' in capfd.readouterr().err
    assert len(bags.answers(tmp_path / 'out')) == COUNT
    assert status(source, tmp_path / 'out') == 0
    assert counts(tmp_path / 'out')['/image/coded_targets'] == COUNT


def test_messages_of_ros1_that_ros2_cannot_hold_are_named(
    images: list[np.ndarray], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    from rosbags import rosbag1

    store = bags.ros1()
    with rosbag1.Writer(tmp_path / 'in.bag') as writer:
        item = writer.add_connection('/image', IMAGE, typestore=store)
        message = bags.image(store, images[0], 10**9)
        writer.write(item, 10**9, bytes(store.serialize_ros1(message, IMAGE)))
        notes = writer.add_connection('/notes', bags.STRING, typestore=store)
        writer.write(notes, 10**9 + 1, b'\xff\xff\xff\xff?')
        held = writer.add_connection(
            '/held', 'strange/msg/Held', msgdef='strange/Held it', md5sum='0' * 32
        )
        writer.write(held, 10**9 + 2, b'1234')
    assert status(tmp_path / 'in.bag', tmp_path / 'out') == 1
    errors = capfd.readouterr().err
    assert 'missing: /notes: 1 messages cannot be converted: ' in errors
    assert 'missing: /held: 1 messages cannot be converted: ' in errors
    assert counts(tmp_path / 'out') == {'/image': 1, '/image/coded_targets': 1}
