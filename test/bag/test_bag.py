"""`ahf bag` on real bags: what is in them, what is missing, what was broken off."""

import signal
import subprocess
import sys
import time
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='rosbags is not installed')

from rosbags import rosbag2

from ahf_ros.bag import output, run
from ahf_ros.bag.definitions import COMPRESSED_IMAGE, IMAGE, typestore
from ahf_ros.scenes.scene import Rendering, SceneSettings, render
from support import bags, command_line, mcap

ROOT = Path(__file__).resolve().parents[2]
PATIENCE = 300.0
SEARCH = ('--detector', 'traditional', '--expected', '4', '--population', '6')
"""A detector that needs a filter for what `bags.scenes` shows."""

FAMILY = ('--family', 'metashape12')
"""Where it does not matter what is found: `auto` takes several times as long."""

UNFINISHED = """
import sys, time
from ahf_ros.bag import run
from ahf_ros.cli import main
run.write_bag = lambda *_: time.sleep(600)
sys.exit(main())
"""
"""The command `ahf`, which answers all images of a bag and then waits to be killed."""


status = partial(command_line.status, 'bag')


@pytest.fixture(scope='module')
def scenes() -> list[Rendering]:
    return [render(SceneSettings(**bags.SCENE, seed=seed)) for seed in range(6)]


@pytest.fixture(scope='module')
def images(scenes: list[Rendering]) -> list[np.ndarray]:
    return [scene.image for scene in scenes]


@pytest.fixture(scope='module')
def messages(images: list[np.ndarray]) -> list[bags.Recorded]:
    return bags.recorded(typestore(), images)


@pytest.fixture(scope='module')
def recording(messages: list[bags.Recorded], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bags.write_ros2(tmp_path_factory.mktemp('recording') / 'in', messages)


@pytest.fixture(scope='module')
def answered(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return what comes of the recording, by a search that remembers."""
    target = tmp_path_factory.mktemp('answered') / 'out'
    assert status(recording, target, *SEARCH, '--debug-images') == 0
    return target


def contents(folder: Path) -> dict[str, bytes]:
    return {str(it.relative_to(folder)): it.read_bytes() for it in sorted(folder.rglob('*'))}


def test_answers_are_beside_everything_else(recording: Path, answered: Path) -> None:
    before, after = bags.read(recording), bags.read(answered)
    assert [it for it in after if 'coded_targets' not in it[0]] == before
    topics = [topic for topic, _, _ in after][:4]
    assert topics == [
        '/notes',
        '/image',
        '/image/coded_targets',
        '/image/coded_targets/debug_image/compressed',
    ]
    assert len(after) == len(before) + 2 * 6
    found = bags.answers(answered)
    assert [time for time, _ in found] == [(1 + number) * 10**8 for number in range(6)]
    for recorded, message in found:
        stamp = message.header.stamp
        assert stamp.sec * 10**9 + stamp.nanosec == recorded - 10**6
        assert (message.header.frame_id, message.width, message.height) == ('camera', 400, 300)
        assert (message.family, message.expected) == ('metashape12', 4)
    assert any(message.filter.applied for _, message in found)
    assert {message.filter.duration for _, message in found} == {0.0}


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_all_storages_give_the_same(
    messages: list[bags.Recorded], answered: Path, tmp_path: Path, storage: str
) -> None:
    source = bags.write_ros2(tmp_path / 'in', messages, storage)
    options = (*SEARCH, '--debug-images', '--storage', 'sqlite3', '--threads', 1)
    assert status(source, tmp_path / 'out', *options) == 0
    assert bags.read(tmp_path / 'out') == bags.read(answered)


@pytest.mark.parametrize('mode', ['FILE', 'MESSAGE', 'STORAGE'])
def test_compressed_bags_are_read(images: list[np.ndarray], tmp_path: Path, mode: str) -> None:
    store = typestore()
    writer = rosbag2.Writer(tmp_path / 'in', version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
    writer.set_compression(rosbag2.CompressionMode[mode], rosbag2.CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection('/image', IMAGE, typestore=store)
        message = bags.image(store, images[0], 10**9)
        writer.write(connection, 10**9, bytes(store.serialize_cdr(message, IMAGE)))
    assert status(tmp_path / 'in', tmp_path / 'out', *FAMILY) == 0
    assert len(bags.answers(tmp_path / 'out')) == 1


def test_bags_of_ros1_give_the_same(
    images: list[np.ndarray], answered: Path, tmp_path: Path
) -> None:
    source = bags.write_ros1(tmp_path / 'in.bag', bags.recorded(bags.ros1(), images))
    assert status(source, tmp_path / 'out', *SEARCH, '--debug-images') == 0
    assert bags.read(tmp_path / 'out') == bags.read(answered)


def test_topics_are_chosen_and_compressed_images_are_images_too(
    images: list[np.ndarray], tmp_path: Path
) -> None:
    store = typestore()
    messages = bags.recorded(store, images[:2], '/left')
    messages += bags.recorded(store, images[2:4], '/right')
    png = bags.compressed(store, images[0], 10**9)
    messages.append(('/left/compressed', COMPRESSED_IMAGE, 10**9, png))
    source = bags.write_ros2(tmp_path / 'in', sorted(messages, key=lambda it: it[2]))
    assert status(source, tmp_path / 'all', '--output-topic', 'targets', *FAMILY) == 0
    left, right, same = (
        bags.answers(tmp_path / 'all', f'{topic}/targets')
        for topic in ('/left', '/right', '/left/compressed')
    )
    assert (len(left), len(right), len(same)) == (2, 2, 1)
    assert [it.id for it in same[0][1].targets] == [it.id for it in left[0][1].targets]
    one = tmp_path / 'one'
    assert status(source, one, '--topic', '/right', '--output-topic', '/targets', *FAMILY) == 0
    ids = [[it.id for it in message.targets] for _, message in bags.answers(one, '/targets')]
    assert ids == [[it.id for it in message.targets] for _, message in right]


def test_depth_and_video_are_left_out_by_name(
    images: list[np.ndarray], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    messages = bags.recorded(typestore(), images[:2])
    depth = bags.compressed(typestore(), images[0], 10**9)
    messages.append(('/depth/compressedDepth', COMPRESSED_IMAGE, 10**9, depth))
    source = bags.write_ros2(tmp_path / 'in', messages)
    assert status(source, tmp_path / 'out', *FAMILY) == 0
    assert 'left out: answers to /depth/compressedDepth, which has depth' in capfd.readouterr().err
    assert len(bags.answers(tmp_path / 'out')) == 2
    assert status(source, tmp_path / 'none', '--topic', '/depth/compressedDepth') == 1
    assert 'topic /depth/compressedDepth has depth images' in capfd.readouterr().err
    kind = 'foxglove_msgs/msg/CompressedVideo'
    video = [
        mcap.schema(1, kind, 'ros2msg', 'string format'),
        mcap.channel(1, 1, '/video'),
        mcap.message(1, 10**9, bytes(12)),
    ]
    path = mcap.McapFile(video).write(tmp_path / 'video.mcap')
    assert status(path, tmp_path / 'video') == 1
    assert f'/video has video of {kind}: decode it' in capfd.readouterr().err


def test_several_bags_at_once(recording: Path, answered: Path, tmp_path: Path) -> None:
    other = tmp_path / 'other'
    other.symlink_to(recording)
    folder = tmp_path / 'made'
    options = (*SEARCH, '--debug-images', '--jobs', 2)
    command = [sys.executable, '-m', 'ahf_ros.cli', 'bag', recording, other, folder, *options]
    done = subprocess.run(
        [str(it) for it in command], cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE
    )
    assert (done.returncode, done.stdout) == (0, ''), done.stderr
    for name in ('in', 'other'):
        assert f'{folder / name}: 6 images answered' in done.stderr
        assert bags.read(folder / name) == bags.read(answered)


def unfinished(target: Path) -> list[tuple[str, bytes]]:
    """Return what an unfinished run has answered so far."""
    if not output.begun_with(target):
        return []
    with closing(output.Journal(target)) as answered:
        return [it for _, outputs in answered.outputs() for it in outputs]


def test_killed_and_finished_the_same(recording: Path, answered: Path, tmp_path: Path) -> None:
    target = tmp_path / 'out'
    command = [sys.executable, '-c', UNFINISHED, 'bag', str(recording), str(target)]
    answers = [(it[0], it[2]) for it in bags.read(answered) if 'coded_targets' in it[0]]
    for least in (3, 12):
        process = subprocess.Popen([*command, *SEARCH, '--debug-images'], cwd=ROOT)
        limit = time.monotonic() + PATIENCE
        while len(unfinished(target)) < least:
            assert time.monotonic() < limit and process.poll() is None, 'it answers no more'
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        process.wait()
        found = unfinished(target)
        assert found == answers[: len(found)]
    assert status(recording, target, *SEARCH, '--debug-images') == 0
    assert contents(target) == contents(answered)


def test_targets_are_followed_through_interruptions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages = bags.recorded(typestore(), bags.moving(5))
    messages[5][3].encoding = 'unheard of'  # of the third image, which leaves all as it was
    source = bags.write_ros2(tmp_path / 'in', messages)
    whole, often = tmp_path / 'whole' / 'out', tmp_path / 'often' / 'out'
    assert status(source, whole, *FAMILY) == 1
    counts = [sum(it.followed for it in answer.targets) for _, answer in bags.answers(whole)]
    assert counts[0] == counts[2] == 0
    assert min(counts[1], *counts[3:]) >= 3
    append = output.Journal.append

    def interrupted(journal: output.Journal, *entry: Any) -> None:
        append(journal, *entry)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(output.Journal, 'append', interrupted)
        for _ in messages[1::2]:
            assert status(source, often, *FAMILY) == 130
    assert status(source, often, *FAMILY) == 1
    assert contents(often) == contents(whole)


def test_a_damaged_memory_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    source = bags.write_ros2(tmp_path / 'in', bags.recorded(typestore(), bags.moving(2)))
    append = output.Journal.append

    def damaged(journal: output.Journal, *entry: Any) -> None:
        append(journal, *entry)
        with journal._database as database:
            database.execute("UPDATE seen SET known = known || ' '")
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(output.Journal, 'append', damaged)
        assert status(source, tmp_path / 'out', *FAMILY) == 130
    capfd.readouterr()
    assert status(source, tmp_path / 'out', *FAMILY) == 1
    assert 'what was seen last is damaged' in capfd.readouterr().err


@pytest.mark.parametrize(
    ('module', 'name'),
    [(run, 'begin'), (output, '_write'), (Path, 'replace'), (run, 'remove_unfinished')],
    ids=['at the beginning', 'copying', 'moving', 'at the end'],
)
def test_a_kill_besides_the_answers(
    recording: Path,
    answered: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    module: Any,
    name: str,
) -> None:
    def killed(*_: Any) -> None:
        raise KeyboardInterrupt

    target = tmp_path / 'out'
    with monkeypatch.context() as patch:
        patch.setattr(module, name, killed)
        assert status(recording, target, *SEARCH, '--debug-images') == 130
    assert status(recording, target, *SEARCH, '--debug-images') == 0
    assert contents(target) == contents(answered)


def test_what_is_refused_is_named_and_the_others_go_on(
    images: list[np.ndarray], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    store = typestore()
    times = [1_700_000_000_000_000_001 + number for number in range(4)]
    messages = [('/image', IMAGE, it, bags.image(store, images[0], it)) for it in times]
    messages[1][3].encoding = 'unheard of'
    messages[2][3].height = 10**6
    source = bags.write_ros2(tmp_path / 'in', messages)
    for _ in range(2):  # the second run finds it done, and says the same
        assert status(source, tmp_path / 'out', *FAMILY) == 1
        errors = capfd.readouterr().err
        assert '4 images answered, 2 of them not accepted' in errors
        assert 'is not tried again; to do so, remove this bag or name another one' in errors
    assert status(source, tmp_path / 'new', *FAMILY) == 1
    errors = capfd.readouterr().err
    assert "/image at 1700000000.000000002 s: encoding is 'unheard of', accepted is" in errors
    assert '/image at 1700000000.000000003 s: ' in errors
    answers = bags.answers(tmp_path / 'out')
    assert [time for time, _ in answers] == times
    of = [it for _, it in answers]
    assert [(len(it.targets) > 0, it.status, it.reason == '') for it in of] == [
        (True, it.OK, True) if number in (0, 3) else (False, it.REJECTED, False)
        for number, it in enumerate(of)
    ]
    assert of[1].reason.startswith("encoding is 'unheard of', accepted is")
    assert repr(of[1].header) == repr(messages[1][3].header)


def cut(path: Path, share: float) -> None:
    """Leave a share of a file."""
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])


@pytest.mark.parametrize(('storage', 'file'), [('mcap', 'in.mcap'), ('sqlite3', 'in.db3')])
def test_a_bag_that_is_cut_is_answered_up_to_there(
    images: list[np.ndarray],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    storage: str,
    file: str,
) -> None:
    many = images * 10  # several chunks
    source = bags.write_ros2(tmp_path / 'in', bags.recorded(typestore(), many), storage)
    cut(source / file, 0.5)
    for _ in range(2):
        assert status(source, tmp_path / 'out', '--detector', 'traditional') == 1
        errors = capfd.readouterr().err
        assert f'{source}: missing: {file}: nothing after ' in errors
        assert f'{source}: missing: /image: ' in errors
    times = [time for time, _ in bags.answers(tmp_path / 'out')]
    assert 20 <= len(times) <= 30
    assert times == [(1 + number) * 10**8 for number in range(len(times))]


def test_a_bag_of_ros1_that_is_cut_is_refused(
    images: list[np.ndarray], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    source = bags.write_ros1(tmp_path / 'in.bag', bags.recorded(bags.ros1(), images))
    cut(source, 0.5)
    assert status(source, tmp_path / 'out') == 1
    reason = f'{source} is not a bag that can be read: in.bag cannot be read: '
    assert reason in capfd.readouterr().err
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['--topic', '/notes'], 'topic /notes is of std_msgs/msg/String, accepted is one of /im'),
        (['--topic', '/magic'], 'topic /magic does not exist, accepted is one of /image'),
        (['--output-topic', '/notes'], 'has a topic /notes, accepted is another output_topic'),
        (['--output-topic', 'a b?'], "output_topic is 'a b?', accepted are names of letters"),
        (['--output-topic', ''], "output_topic is '', accepted are names of letters"),
    ],
)
def test_bad_topics_are_named(
    recording: Path,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    assert status(recording, tmp_path / 'out', *arguments) == 1
    assert message in capfd.readouterr().err
    assert not (tmp_path / 'out').exists()


def test_bags_that_are_none_are_named_and_the_others_go_on(
    recording: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'text.mcap').write_text('not a bag')
    (tmp_path / 'text.bag').write_text('not a bag')
    (tmp_path / 'empty').mkdir()
    notes = [('/notes', bags.STRING, 5, bags.text(typestore(), 'no image'))]
    bags.write_ros2(tmp_path / 'notes', notes)
    bad = [tmp_path / name for name in ('text.mcap', 'text.bag', 'empty', 'notes', 'missing')]
    bad[1] = bad[1].rename(tmp_path / 'other.bag')
    assert status(*bad, recording, tmp_path / 'made', *FAMILY) == 1
    errors = capfd.readouterr().err
    for path in bad:
        assert f'ahf bag: {path} ' in errors
    assert 'notes has no images, accepted are topics of sensor_msgs/msg/Image' in errors
    assert len(bags.answers(tmp_path / 'made' / 'in')) == 6


def test_what_is_something_else_is_left_alone(
    recording: Path, answered: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    before = contents(answered)
    assert status(recording, answered, *SEARCH, '--debug-images', '--seed', 5) == 1
    assert f'{answered} was begun with seed 0, now it is 5' in capfd.readouterr().err
    assert contents(answered) == before
    other = bags.write_ros2(
        tmp_path / 'other', [('/a', bags.STRING, 5, bags.text(typestore(), ''))]
    )
    before = contents(other)
    assert status(recording, other) == 1
    assert f'{other} exists, accepted is a new name' in capfd.readouterr().err
    assert contents(other) == before


def test_two_at_once_do_not_mix(
    recording: Path, answered: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with run.locked(answered):
        assert status(recording, answered, *SEARCH, '--debug-images') == 1
    assert f'{answered} is being written by another process' in capfd.readouterr().err


def test_a_folder_that_cannot_be_written_is_named(
    recording: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'file').touch()
    assert status(recording, tmp_path / 'file' / 'out') == 1
    assert f'{tmp_path / "file" / "out"} cannot be written: ' in capfd.readouterr().err


def test_bags_of_one_name_are_refused(
    recording: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert status(recording, recording, tmp_path / 'made') == 2
    assert 'several bags of the same name' in capfd.readouterr().err
