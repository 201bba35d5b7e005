"""From the images of a task to its outcome."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros import ending
from ahf_ros.batch.engine import Report, no_report
from ahf_ros.batch.results import file_fingerprint
from ahf_ros.batch.task import ImageOutcome, ImageTask, Level, Message
from ahf_ros.detectors import Detector, DetectorSettings, create_detector
from ahf_ros.drawing.overlay import draw, summary
from ahf_ros.edge_shift import edge_shift_remark
from ahf_ros.imaging.image import check_image, white_remark
from ahf_ros.imaging.stack import ImageStack
from ahf_ros.interchange.files import is_url, read_bytes
from ahf_ros.interchange.image_files import read_noted_image, write_image
from ahf_ros.interchange.target_json import to_json
from ahf_ros.session import create_identifier
from ahf_ros.session_settings import IdentificationSettings
from ahf_ros.stream import identify_parts, refusal
from ahf_ros.target import Identification


def identify_images(task: ImageTask, report: Report = no_report) -> ImageOutcome:
    """Identify the targets in the images of a task, and draw its overlays.

    What is wrong with an image or a file is a message of the outcome.

    Parameters
    ----------
    task : ImageTask
    report : callable, optional
        Not called; a job of an engine has it.

    Raises
    ------
    ValueError
        If the detector cannot be created or does not fit the other settings.

    Examples
    --------
    >>> identify_images(ImageTask(('missing.png',))).messages[0].text
    'missing.png cannot be read: No such file or directory'
    """
    messages: list[Message] = []
    records: list[dict[str, Any]] = []
    detector = detector_of(task.settings)
    files = tuple(file_fingerprint(_located(path, task)) for path in task.paths)
    images = _read(task, messages)
    if task.minimum > 1 and len(images) < task.minimum:
        text = f'{task.paths[0]}: {len(images)} of {task.minimum} images of a stack'
        messages.append(Message(text, Level.WARNING))
    overlays = dict(zip(task.paths, task.overlays, strict=False))
    with _reported(', '.join(images), messages):
        for found in _identified(images, detector, task):
            records.append(_record(found, detector, task))
            messages += _messages(found)
            if overlays:
                shown = found.stack.combined(found.identification.combination)
                drawn = draw(shown, found.identification)
                write_image(_located(overlays[found.paths[0]], task), drawn)
    return ImageOutcome(tuple(records), tuple(messages), files)


def detector_of(settings: IdentificationSettings) -> Detector:
    """Return the detector of settings, the same one as long as its data file does not change."""
    file = settings.detection.family_file
    digest = hashlib.sha256(read_bytes(file)).digest() if file else b''
    return _detector(settings.detector, settings.detection, digest)


@lru_cache(maxsize=4)
def _detector(name: str, settings: DetectorSettings, digest: bytes) -> Detector:
    return create_detector(name, settings=settings)


@dataclass(frozen=True, slots=True)
class _Found:
    """What was identified in images of an unmoved scene, or in one."""

    paths: tuple[str, ...]
    stack: ImageStack
    identification: Identification
    split: str  # why there was a stack before
    in_vain: int  # filters in a row that showed no more, after which a search ended early


def _located(path: str, task: ImageTask) -> str:
    """Return a path from the folder of the task."""
    return str(Path(task.folder, path)) if task.folder and not is_url(path) else path


@contextmanager
def _reported(name: str, messages: list[Message]) -> Iterator[None]:
    """Leave what is wrong with images in the messages: the next ones may be better."""
    try:
        yield
    except Exception as error:
        reason = refusal(error).text
        text = reason if isinstance(error, ValueError) else f'{name}: {reason}'
        messages.append(Message(text, Level.PROBLEM))


def _read(task: ImageTask, messages: list[Message]) -> dict[str, np.ndarray]:
    """Return the images that can be read."""
    images: dict[str, np.ndarray] = {}
    for path in task.paths:
        with _reported(path, messages):
            images[path], note = _read_checked(path, task)
            if note:
                messages.append(Message(note))
    return images


def _read_checked(path: str, task: ImageTask) -> tuple[np.ndarray, str]:
    """Return an image of a task and what there is to say about it.

    Raises
    ------
    ValueError
        If it cannot be read or is not accepted.
    """
    image, note = read_noted_image(_located(path, task), upright=task.upright)
    try:
        check_image(image)
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from error
    return image, note


def _identified(
    images: dict[str, np.ndarray], detector: Detector, task: ImageTask
) -> Iterator[_Found]:
    """Yield what was identified in each part of a stack."""
    paths = tuple(images)
    if not paths:
        return
    try:
        identifier = create_identifier(
            detector=detector, settings=task.settings, interrupt=ending.check
        )
        for part, stack, found in identify_parts(identifier, list(images.values()), task.stacking):
            of = paths[part.images.start : part.images.stop]
            search = identifier.last_search
            in_vain = search.in_vain if search and search.reason == 'patience' else 0
            yield _Found(
                paths=of, stack=stack, identification=found, split=part.split, in_vain=in_vain
            )
    except ValueError as error:
        raise ValueError(f'{", ".join(paths)}: {error}') from error


def _record(found: _Found, detector: Detector, task: ImageTask) -> dict[str, Any]:
    return to_json(
        found.identification,
        found.paths[0],
        found.stack.shape,
        detector.family,
        detector.name,
        found.paths if task.stacked else (),
        found.split,
        task.upright,
        asdict(task.settings.adaptive.filter),
    )


def _messages(of: _Found) -> Iterator[Message]:
    """Yield what there is to say about a result, and a detail for each target."""
    path, found = ', '.join(of.paths), of.identification
    if of.split:
        yield Message(f'{of.paths[0]}: the stack is split here: {of.split}')
    yield Message(f'{path}: {summary(found)}, {found.filter.duration:.2f} s')
    if of.in_vain:
        yield Message(
            f'{path}: the search ended early, {of.in_vain} filters in a row show no more targets'
        )
    if found.mirrored:
        yield Message(
            f'{path}: the image seems to be mirrored: most IDs are not among the expected ones, '
            'and most would be in a mirror'
        )
    remarks = [edge_shift_remark(found.edge_shift)]
    if found.count == 0:
        remarks.append(white_remark(of.stack.images[0]))
    for remark in filter(None, remarks):
        yield Message(f'{path}: {remark}')
    for target in found.targets:
        yield Message(
            f'{target.id:>8} {target.family:<11} {target.x:10.3f} {target.y:10.3f} px'
            f'  semi-axes {target.semi_major:.2f} {target.semi_minor:.2f} px'
            f'  confidence {target.confidence:.3f}',
            Level.DETAIL,
        )
