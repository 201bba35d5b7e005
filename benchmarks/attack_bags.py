"""Hostile bags: damaged bytes, records and rows of any content, and metadata of any content.

`benchmarks.attack` counts what becomes of them.
"""

from __future__ import annotations

import contextlib
import io
import shutil
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np

from ahf_ros.bag.assembly import finished
from ahf_ros.bag.definitions import IMAGE, typestore
from ahf_ros.bag.run import BagTask, answer_bag
from ahf_ros.bag.source import Source
from ahf_ros.detectors import DetectorSettings
from ahf_ros.filtering.settings import AdaptiveSettings
from ahf_ros.session_settings import IdentificationSettings
from support import bags, mcap

COUNT = 3
"""Images of a bag, and as many other messages."""

PAGE = 4096
GRAY = np.tile(np.arange(40, dtype=np.uint8), (30, 1))
SETTINGS = IdentificationSettings(
    detection=DetectorSettings(family='aruco_4x4_50'),
    adaptive=AdaptiveSettings(ahf=False, threads=1),
)
RECORDED = Counter({'/image': COUNT, '/notes': COUNT})
VALUES = (
    *(None, -1, 0, 1, 2, 2**31, 2**63 - 1, -(2**63), 1.5, 1e300, float('inf')),
    *('', 'abc', '/image', '/notes', 'cdr', 'json', IMAGE, bags.STRING, 'a: [', '[' * 3000, '\0'),
    *(b'', b'\0\1\0\0', b'\xff' * 9, b'\x28\xb5\x2f\xfd', bytes(5000)),
)
"""What is put into columns of SQLite."""


def mutated(content: bytes, random: np.random.Generator) -> bytes:
    """Return content with one to three damages of any kind."""
    changed = bytearray(content)
    for _ in range(random.integers(1, 4)):
        place = int(random.integers(len(changed)))
        size = int(random.integers(1, 64))
        kind = random.integers(7)
        if kind == 0:
            changed[place] ^= 1 << int(random.integers(8))
        elif kind == 1:
            page = place // PAGE * PAGE
            changed[page : page + PAGE] = bytes(len(changed[page : page + PAGE]))
        elif kind == 2:
            del changed[max(place, 1) :]
        elif kind == 3:
            del changed[place : place + size]
        elif kind == 4:
            changed[place:place] = random.bytes(size)
        elif kind == 5:
            changed[place : place + 8] = b'\xff' * len(changed[place : place + 8])
        else:
            other = int(random.integers(len(changed)))
            changed[place : place + size] = changed[other : other + size]
        changed = changed or bytearray(b'\0')
    return bytes(changed)


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
            with contextlib.suppress(sqlite3.Error):  # a column that takes no such value
                query = f'UPDATE {table} SET {column} = ? WHERE rowid = ?'
                database.execute(query, (value, row))


def change_records(bag: Path, random: np.random.Generator) -> None:
    """Change one to three records of an MCAP file, whose lengths and checksums are right."""
    records = [*_definitions(), *_messages()]
    for _ in range(random.integers(1, 4)):
        place = int(random.integers(len(records)))
        opcode, content = records[place]
        kind = random.integers(5)
        if kind == 0:
            records[place] = int(random.integers(256)), content
        elif kind == 1:
            records.insert(int(random.integers(len(records) + 1)), records.pop(place))
        elif kind == 2:
            records.insert(place, (int(random.integers(3, 6)), random.bytes(40)))
        else:
            records[place] = opcode, mutated(content, random)
    joined = [mcap.record(*it) for it in records]
    if random.integers(2):
        content = b''.join(joined)
        joined = [mcap.chunk(content, 0, 10**9, compressed=bool(random.integers(2)))]
    mcap.McapFile(joined).write(next(bag.glob('*.mcap')))


def _definitions() -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of the records that define the topics."""
    for number, (topic, kind) in enumerate((('/image', IMAGE), ('/notes', bags.STRING)), 1):
        definition, _ = typestore().generate_msgdef(kind, ros_version=2)
        schema = mcap.schema(number, kind, 'ros2msg', definition)
        for record in (schema, mcap.channel(number, number, topic)):
            yield record[0], record[9:]


def _messages() -> Iterator[tuple[int, bytes]]:
    store = typestore()
    for topic, kind, time, message in bags.recorded(store, _images()):
        data = bytes(store.serialize_cdr(message, kind))
        record = mcap.message(1 if topic == '/image' else 2, time, data)
        yield record[0], record[9:]


def _images() -> list[np.ndarray]:
    return [GRAY + number for number in range(COUNT)]


Harm = Callable[[Path, np.random.Generator], None]
KINDS: tuple[tuple[str, Harm], ...] = (
    ('mcap', damage_file),
    ('sqlite3', damage_file),
    ('ros1', damage_file),
    ('mcap', change_records),
    ('sqlite3', change_rows),
    ('mcap', damage_metadata),
)
"""What is recorded, and what is done to it."""


@contextmanager
def hostile_bags() -> Iterator[Callable[[int], bool]]:
    """Yield a function that attacks with the bag of a number and returns whether it is complete.

    The function raises whatever must not happen.
    """
    random = np.random.default_rng(0)
    with tempfile.TemporaryDirectory(prefix='ahf_attack_') as name:
        folder = Path(name)
        for storage in ('mcap', 'sqlite3'):
            bags.write_ros2(folder / storage, bags.recorded(typestore(), _images()), storage)
        bags.write_ros1(folder / 'ros1', bags.recorded(bags.ros1(), _images()))

        def attack(number: int) -> bool:
            storage, harm = KINDS[number % len(KINDS)]
            with tempfile.TemporaryDirectory(dir=folder) as made:
                source = Path(made) / ('in.bag' if storage == 'ros1' else 'in')
                if storage == 'ros1':
                    shutil.copyfile(folder / storage, source)
                else:
                    shutil.copytree(folder / storage, source)
                harm(source, random)
                return check(source, Path(made) / 'out')

        yield attack


def check(source: Path, target: Path) -> bool:
    """Process a bag and return whether it is complete; losses must be named."""
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            outcome = answer_bag(BagTask(source, target, identification=SETTINGS), lambda *_: None)
    except ValueError as error:
        assert str(error)
        return False
    made: Counter[str] = Counter()
    with Source(target) as bag:
        made.update(item.topic for item, _, _ in bag.messages())
        assert not bag.lost
    assert finished(target) == outcome
    answers = sum(count for topic, count in made.items() if topic.endswith('/coded_targets'))
    assert answers + outcome.refused == outcome.images
    if outcome.lost or outcome.left_out:
        return False
    # Without a loss that is named everything is there; a name may be what was damaged.
    copied = sum(made.values()) - answers
    assert copied >= RECORDED.total(), (dict(made), outcome)
    return True
