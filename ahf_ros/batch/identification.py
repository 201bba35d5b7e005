"""The job of a batch: identification of the images of a task, and messages about it."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.base import ending
from ahf_ros.base.doubt import doubt, repeated_remark
from ahf_ros.base.edge_shift import edge_shift_remark
from ahf_ros.base.opening import is_url, url_fingerprint
from ahf_ros.base.target import UNDECODED, Identification, Target, UndecodedTarget
from ahf_ros.base.text import listed
from ahf_ros.batch.engine import Report, no_report
from ahf_ros.batch.task import ImageOutcome, ImageTask, Level, Message
from ahf_ros.families import Detector, DetectorSettings, create_detector
from ahf_ros.files.image_files import read_noted_image, write_image
from ahf_ros.files.target_json import to_json
from ahf_ros.identification.session import create_identifier
from ahf_ros.identification.session_settings import IdentificationSettings
from ahf_ros.identification.settling import memory_of
from ahf_ros.identification.stream import identify_parts, refusal
from ahf_ros.views.drawing.overlay import draw, summary
from ahf_ros.vision.image import check_image, white_remark


def identify_images(task: ImageTask, report: Report = no_report) -> ImageOutcome:
    """Identify the targets in the images of a task, and draw its overlays.

    What is wrong with an image or a file is a message of the outcome. A detector that cannot be
    created raises a ValueError. `report` is not called; a job of an engine has it.

    Examples
    --------
    >>> identify_images(ImageTask(('missing.png',))).messages[0].text
    'missing.png cannot be read: No such file or directory'
    """
    if task.outcome:
        return task.outcome
    messages: list[Message] = []
    records: list[dict[str, Any]] = []
    files: list[str] = []
    images: dict[str, np.ndarray] = {}
    detector = detector_of(task.settings)
    for path in task.paths:
        with _reported(path, messages):
            file = path
            if task.folder and not is_url(path):
                file = str(Path(task.folder, path))
            files.append(file_fingerprint(file))
            try:
                noted = read_noted_image(file, upright=task.upright)
            except ValueError as error:  # which names the file
                messages.append(Message(refusal(error).text, Level.PROBLEM))
                continue
            check_image(noted.image)
            images[path] = noted.image
            if noted.note:
                messages.append(Message(noted.note))
            if noted.damage:
                text = f'{path}: the image is damaged: {noted.damage}'
                messages.append(Message(text, Level.PROBLEM))
    if images and len(images) < task.minimum > 1:
        text = f'{task.paths[0]}: {len(images)} of {task.minimum} images of a stack'
        messages.append(Message(text, Level.WARNING))
    if not images:
        return ImageOutcome(messages=tuple(messages), files=tuple(files))
    overlays = dict(zip(task.paths, task.overlays, strict=False))
    with _reported(', '.join(images), messages):
        identifier = create_identifier(
            detector=detector, settings=task.settings, interrupt=ending.check, follow=0
        )
        identifier.memory = memory_of(task.families)
        for part, stack, found in identify_parts(identifier, list(images.values()), task.stacking):
            paths = tuple(images)[part.images.start : part.images.stop]
            search = identifier.last_search
            in_vain = search.in_vain if search and search.reason == 'patience' else 0
            messages += _messages(paths, part.split, stack.images[0], found, in_vain)
            messages += _lines(found, detector.name)
            record = to_json(
                found,
                paths[0],
                stack.shape,
                detector.family,
                detector.name,
                stack=paths if task.stacked else (),
                split=part.split,
                upright=task.upright,
                mapping=asdict(task.settings.adaptive.filter),
            )
            records.append(record)
            if overlays:
                drawn = draw(stack.combined(found.combination), found)
                write_image(Path(task.folder, overlays[paths[0]]), drawn)
    return ImageOutcome(tuple(records), tuple(messages), tuple(files))


def detector_of(settings: IdentificationSettings) -> Detector:
    """Return the detector of settings, the same one for the same families."""
    return _detector(settings.detector, settings.detection)


@lru_cache(maxsize=4)
def _detector(name: str, settings: DetectorSettings) -> Detector:
    return create_detector(name, settings=settings)


def file_fingerprint(path: str) -> str:
    """Return size and time of change of a file; empty where it cannot be looked at.

    Examples
    --------
    >>> file_fingerprint('missing.png')
    ''
    """
    try:
        if is_url(path):
            return url_fingerprint(path)
        status = Path(path).stat()
    except (OSError, ValueError):  # ValueError: of a URL, or a zero byte in the name
        return ''
    return f'{status.st_size} {status.st_mtime_ns}'


@contextmanager
def _reported(name: str, messages: list[Message]) -> Iterator[None]:
    """Leave what is wrong with images in the messages: the next ones may be better."""
    try:
        yield
    except Exception as error:
        messages.append(Message(f'{name}: {refusal(error).text}', Level.PROBLEM))


def _messages(
    paths: tuple[str, ...], split: str, image: np.ndarray, found: Identification, in_vain: int
) -> Iterator[Message]:
    """Yield what there is to say about the result of a part of a stack.

    `split` says why there was a stack before it, and `in_vain` is the number of filters in a row
    that showed no more targets, after which a search ended early.
    """
    name = ', '.join(paths)
    if split:
        yield Message(f'{paths[0]}: the stack is split here: {split}')
    remarks = [f'{summary(found)}, {found.filter.duration:.2f} s']
    if in_vain:
        remarks.append(f'the search ended early, {in_vain} filters in a row show no more targets')
    if found.mirrored:
        remarks.append(
            'the image seems to be mirrored: most IDs are not among the expected ones, and most '
            'would be in a mirror'
        )
    elif found.other_ids:
        others = listed([*map(str, found.other_ids)])
        remarks.append(f'read and left out, as these IDs are not among those given: {others}')
    remarks.append(repeated_remark(found.repeated))
    remarks.append(edge_shift_remark(found.edge_shift))
    if found.count == 0:
        remarks.append(white_remark(image))
    for remark in filter(None, remarks):
        yield Message(f'{name}: {remark}')


def _lines(found: Identification, detector: str) -> Iterator[Message]:
    for target in found.targets:
        yield Message(
            f'{target.id:>8} {target.family:<11} {target.x:10.3f} {target.y:10.3f} px'
            f'  semi-axes {target.semi_major:.2f} {target.semi_minor:.2f} px'
            f'  confidence {target.confidence:.3f}{_remark(target, detector)}',
            Level.DETAIL,
        )


def _remark(target: Target, detector: str) -> str:
    """Return that a target is doubtful, or why it is not decoded; nothing for others."""
    if isinstance(target, UndecodedTarget):
        likely = target.likely_id != UNDECODED
        word = f', likely {target.likely_id} of {target.likely_family}' if likely else ''
        return f', {target.reason}{word}'
    return ', doubtful' if doubt(target, detector) else ''
