"""`ahf bag` on damaged bytes, and on records, rows and metadata of any content."""

import shutil
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rosbags', reason='rosbags is not installed')

from ahf_ros.bag.definitions import IMAGE, typestore
from ahf_ros.bag.output import finished
from ahf_ros.bag.run import BagTask, answer_bag
from ahf_ros.bag.source import Source
from ahf_ros.families import DetectorSettings
from ahf_ros.identification.filtering.settings import AdaptiveSettings
from ahf_ros.identification.session_settings import IdentificationSettings
from support import bags, mcap
from support.hostile import generators, mutated

COUNT = 3
IMAGES = [np.tile(np.arange(40, dtype=np.uint8) + number, (30, 1)) for number in range(COUNT)]
SETTINGS = IdentificationSettings(
    detection=DetectorSettings(family='aruco_4x4_50'),
    adaptive=AdaptiveSettings(ahf=False, threads=1),
)
VALUES = (
    *(None, -1, 0, 1, 2, 2**31, 2**63 - 1, -(2**63), 1.5, 1e300, float('inf')),
    *('', 'abc', '/image', '/notes', 'cdr', 'json', IMAGE, bags.STRING, 'a: [', '[' * 3000, '\0'),
    *(b'', b'\0\1\0\0', b'\xff' * 9, b'\x28\xb5\x2f\xfd', bytes(5000)),
)
"""What is put into columns of SQLite."""


def damage_file(bag: Path, random: np.random.Generator) -> None:
    """Damage the bytes of the file with the messages."""
    file = bag if bag.is_file() else next(it for it in bag.iterdir() if it.suffix != '.yaml')
    file.write_bytes(mutated(file.read_bytes(), random))


def damage_metadata(bag: Path, random: np.random.Generator) -> None:
    """Damage the bytes of metadata.yaml."""
    file = bag / 'metadata.yaml'
    file.write_bytes(mutated(file.read_bytes(), random))


def change_rows(bag: Path, random: np.random.Generator) -> None:
    """Put values of any type into one to three places of a SQLite file."""
    with closing(sqlite3.connect(next(bag.glob('*.db3')))) as database, database:
        query = "SELECT name FROM sqlite_master WHERE type = 'table'"
        tables = [name for (name,) in database.execute(query)]
        for _ in range(random.integers(1, 4)):
            table = tables[random.integers(len(tables))]
            columns = [row[1] for row in database.execute(f'PRAGMA table_info({table})')]
            column = columns[random.integers(len(columns))]
            value = VALUES[random.integers(len(VALUES))]
            row = int(random.integers(1, 2 * COUNT + 1))
            with suppress(sqlite3.Error):  # a column that takes no such value
                query = f'UPDATE {table} SET {column} = ? WHERE rowid = ?'
                database.execute(query, (value, row))


def change_records(bag: Path, random: np.random.Generator) -> None:
    """Change one to three records of an MCAP file, whose lengths and checksums are right."""
    content = [(record[0], record[9:]) for record in records()]
    for _ in range(random.integers(1, 4)):
        place = int(random.integers(len(content)))
        opcode, data = content[place]
        kind = random.integers(5)
        if kind == 0:
            content[place] = int(random.integers(256)), data
        elif kind == 1:
            content.insert(int(random.integers(len(content) + 1)), content.pop(place))
        elif kind == 2:
            content.insert(place, (int(random.integers(3, 6)), random.bytes(40)))
        else:
            content[place] = opcode, mutated(data, random)
    changed = [mcap.record(*it) for it in content]
    if random.integers(2):
        compressed = bool(random.integers(2))
        changed = [mcap.chunk(b''.join(changed), 0, 10**9, compressed=compressed)]
    mcap.McapFile(changed).write(next(bag.glob('*.mcap')))


def records() -> Iterator[bytes]:
    """Yield the records of the topics, then those of the messages."""
    store = typestore()
    numbers = {'/image': 1, '/notes': 2}
    for (topic, number), kind in zip(numbers.items(), (IMAGE, bags.STRING), strict=True):
        definition, _ = store.generate_msgdef(kind, ros_version=2)
        yield mcap.schema(number, kind, 'ros2msg', definition)
        yield mcap.channel(number, number, topic)
    for topic, kind, time, message in bags.recorded(store, IMAGES):
        yield mcap.message(numbers[topic], time, bytes(store.serialize_cdr(message, kind)))


KINDS: tuple[tuple[str, Callable[[Path, np.random.Generator], None]], ...] = (
    ('mcap', damage_file),
    ('sqlite3', damage_file),
    ('ros1', damage_file),
    ('mcap', change_records),
    ('sqlite3', change_rows),
    ('mcap', damage_metadata),
)
"""What is recorded, and what is done to it."""


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with one bag of each kind."""
    folder = tmp_path_factory.mktemp('bags')
    for storage in ('mcap', 'sqlite3'):
        bags.write_ros2(folder / storage, bags.recorded(typestore(), IMAGES), storage)
    bags.write_ros1(folder / 'ros1', bags.recorded(bags.ros1(), IMAGES))
    return folder


@given(st.sampled_from(KINDS), generators())
def test_whatever_is_lost_is_named(folder: Path, kind: Any, random: Any) -> None:
    storage, harm = kind
    with TemporaryDirectory(dir=folder) as made:
        source = Path(made) / ('in.bag' if storage == 'ros1' else 'in')
        copy = shutil.copyfile if storage == 'ros1' else shutil.copytree
        copy(folder / storage, source)
        harm(source, random)
        check(source, Path(made) / 'out')


def check(source: Path, target: Path) -> None:
    """Fail if a bag is refused without a reason, or a message is lost and not named."""
    try:
        outcome = answer_bag(BagTask(source, target, identification=SETTINGS), lambda *_: None)
    except ValueError as error:
        assert str(error)
        return
    with Source(target) as bag:
        made = Counter(item.topic for item, _, _ in bag.messages())
        assert not bag.lost
    assert finished(target) == outcome
    answers = sum(count for topic, count in made.items() if topic.endswith('/coded_targets'))
    assert answers + outcome.refused == outcome.images
    if not outcome.lost and not outcome.left_out:
        # Everything is there; a name may be what was damaged.
        assert made.total() - answers >= 2 * COUNT, (dict(made), outcome)
