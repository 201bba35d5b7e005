"""Results that are kept: a later run goes on, and does again what is out of date."""

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ahf_ros.batch.engine import Report, SerialEngine
from ahf_ros.batch.identification import file_fingerprint
from ahf_ros.batch.results import PREVIOUS, Results, Unwritable, kept_outcomes_in_order
from ahf_ros.batch.task import ImageOutcome, ImageTask, Level, Message
from ahf_ros.cli import main
from ahf_ros.files.files import RESULTS_FILE
from ahf_ros.files.image_files import write_image
from ahf_ros.files.target_json import read_results
from ahf_ros.identification.session_settings import IdentificationSettings
from support.disk import room_for


def tasks_in(folder: Path, count: int) -> list[ImageTask]:
    tasks = []
    for number in range(count):
        path = folder / f'{number}.png'
        path.write_bytes(b'image')
        tasks.append(ImageTask((str(path),)))
    return tasks


class Run:
    """One run of a batch whose engine only counts what it does."""

    def __init__(self, tasks: Sequence[ImageTask], folder: Path, stop: int = 0) -> None:
        self.done: list[str] = []
        self.notes: list[str] = []
        self.images: list[str] = []
        results = Results(folder)
        try:
            engine = SerialEngine(self.job)
            for outcome in kept_outcomes_in_order(engine, tasks, results, self.notes.append):
                self.images += [record['image'] for record in outcome.records]
                if stop and len(self.images) == stop:
                    break
        finally:
            results.close()

    def job(self, task: ImageTask, _: Report) -> ImageOutcome:
        self.done.append(Path(task.paths[0]).stem)
        files = tuple(map(file_fingerprint, task.paths))
        broken = [path for path in task.paths if b'broken' in Path(path).read_bytes()]
        messages = tuple(Message(path, Level.PROBLEM) for path in broken)
        records = tuple({'image': path, 'targets': []} for path in task.paths)
        return ImageOutcome(records, messages, files)


def test_a_run_goes_on_where_another_one_was_killed(tmp_path: Path) -> None:
    tasks, folder = tasks_in(tmp_path, 5), tmp_path / 'results'
    assert Run(tasks, folder, stop=3).done == ['0', '1', '2']
    with (folder / RESULTS_FILE).open('rb+') as file:
        file.truncate(file.seek(0, os.SEEK_END) - 9)
    again = Run(tasks, folder)
    assert again.done == ['2', '3', '4']
    assert again.images == [task.paths[0] for task in tasks]
    assert 'left out, because damaged or unfinished: lines: 1' in again.notes[0]
    assert '2 of 5 results are there already' in again.notes[1]
    assert len(read_results(folder)) == 5
    assert Run(tasks, folder).done == []
    assert Run(tasks[::-1], folder).done == []
    lines = (folder / RESULTS_FILE).read_text().splitlines()
    assert [json.loads(line)['image'] for line in lines] == [it.paths[0] for it in tasks[::-1]]


def test_what_is_out_of_date_is_done_again_and_said(tmp_path: Path) -> None:
    tasks, folder = tasks_in(tmp_path, 4), tmp_path / 'results'
    Path(tasks[1].paths[0]).write_bytes(b'broken')
    assert Run([*tasks, tasks[0]], folder).done == ['0', '1', '2', '3']
    Path(tasks[3].paths[0]).write_bytes(b'another image')
    again = Run(tasks, folder)
    assert again.done == ['1', '3']
    names = f'{tasks[1].paths[0]}; {tasks[3].paths[0]}'
    assert again.notes[1].endswith(f': 2 results are out of date and made again: {names}')
    assert not (folder / PREVIOUS).exists()
    Path(tasks[2].paths[0]).rename(tmp_path / 'away')
    assert Run(tasks, folder).done == ['1']
    (tmp_path / 'away').rename(tasks[2].paths[0])
    settings = IdentificationSettings(expected_targets=3)
    others = [replace(task, settings=settings) for task in tasks[:3]]
    again = Run(others, folder)
    assert again.done == ['0', '1', '2']
    assert '3 results are out of date and made again' in again.notes[0]
    assert 'settings or version are others, earlier results are kept in' in again.notes[1]
    assert len(read_results(folder / PREVIOUS)) == len(read_results(folder)) == 4
    drawn = [replace(task, overlays=(str(tmp_path / 'none.png'),)) for task in others[:1]]
    assert Run(drawn, folder).done == ['0']


def test_a_stack_is_there_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    (first, second), folder = tasks_in(tmp_path, 2), tmp_path / 'results'
    stack = ImageTask((*first.paths, *second.paths))
    assert Run([stack, first], folder).done == ['0', '0']
    path = folder / RESULTS_FILE
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + lines[2])
    again = Run([stack, first], folder)
    assert again.done == ['0'] and 'lines: 1' in again.notes[0]
    path.write_bytes(lines[1] + lines[2])
    assert Run([stack, first], folder).done == ['0']


def test_what_cannot_be_written_is_named(tmp_path: Path) -> None:
    tasks, folder = tasks_in(tmp_path, 2), tmp_path / 'results'
    results = Results(folder)
    with pytest.raises(Unwritable, match='results is being written by another process'):
        Results(folder)
    results.append(tasks[0], ImageOutcome(({'image': '0.png'},), files=('',)))
    size = results.path.stat().st_size
    with room_for(size + 9), pytest.raises(Unwritable, match=r'results\.jsonl cannot be written'):
        results.append(tasks[1], ImageOutcome(({'image': '1.png'},), files=('',)))
    results.close()
    assert results.path.stat().st_size == size
    (folder / RESULTS_FILE).write_text('{"image": "0.png", "targets": []}\n')
    with pytest.raises(Unwritable, match='lines that were not written with --output'):
        Results(folder)
    with pytest.raises(Unwritable, match=r'0\.png cannot be written: (File exists|Not a dir)'):
        Results(Path(tasks[0].paths[0]))


def test_the_command_goes_on_with_the_same_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    images = [tmp_path / name for name in ('a.png', 'b.png')]
    for number, path in enumerate(images):
        write_image(path, np.tile(np.arange(number, number + 40, dtype=np.uint8), (30, 1)))
    command = ['identify', *map(str, images), '--jobs', '1', '--detector', 'traditional']
    command += ['--json', '--output', str(tmp_path / 'results')]
    assert main(command) == 0
    first = capsys.readouterr()
    assert main(command) == 0
    second = capsys.readouterr()
    assert first.out == second.out
    assert len(first.out.splitlines()) == 2
    assert '2 of 2 results are there already' in second.err
    assert main([*command, '--output', str(images[0])]) == 1
    assert 'a.png cannot be written' in capsys.readouterr().err
