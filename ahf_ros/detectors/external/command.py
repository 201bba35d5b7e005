"""A detector that is another program: it gets an image file and prints what it found as JSON."""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.interchange.target_json import targets_from_json
from ahf_ros.target import Target, sorted_targets

LARGEST_OUTPUT = 64 * 2**20
"""Bytes that a command may print."""

_TOLD = 300  # characters of what a command said that are passed on


@dataclass(frozen=True, slots=True)
class CommandDetector:
    """Identify targets by a program of the user's, one process an image.

    The program gets the path of a PNG file, 8 bit gray, where the command says {image}, or else as
    its last argument. It prints one JSON object, {"targets": [{"id": 7, "x": 1.5, "y": 2.5}]};
    of a target further fields of `Target` are accepted, and others of the object left out. So
    `ahf identify --json` is such a program itself.

    Attributes
    ----------
    settings : DetectorSettings

    Raises
    ------
    ValueError
        If there is no command, or it cannot be split into words.
    """

    settings: DetectorSettings = field(default_factory=DetectorSettings)

    def __post_init__(self) -> None:
        """Refuse a command that is none."""
        self._words('image.png')

    @property
    def name(self) -> str:
        """Name in the registry."""
        return 'command'

    @property
    def family(self) -> str:
        """Family of the targets, by which the results are named."""
        return self.settings.family

    def __call__(self, image: np.ndarray) -> list[Target]:
        """Identify the targets of one image; see `Detector`.

        Raises
        ------
        ValueError
            If the image is not accepted; if the command cannot be started, takes longer than its
            time limit, ends with another status than 0, or prints what is not accepted.
        """
        check_image(image)
        with tempfile.TemporaryDirectory(prefix='ahf_') as folder:
            path = Path(folder, 'image.png')
            cv2.imwrite(str(path), as_gray(image).astype(np.uint8, copy=False))
            printed = self._printed(self._words(str(path)), Path(folder))
        try:
            record = json.loads(printed)
        except ValueError as error:
            told = printed[:_TOLD].strip()
            raise ValueError(
                f'{self._named} printed {told!r}, accepted is JSON: {error}'
            ) from error
        return sorted_targets(targets_from_json(record, self._named))

    @property
    def _named(self) -> str:
        return f'command {self.settings.command!r}'

    def _words(self, image: str) -> list[str]:
        try:
            words = shlex.split(self.settings.command)
        except ValueError as error:
            raise ValueError(f'{self._named} cannot be split into words: {error}') from error
        if not words:
            raise ValueError(f'{self._named} is empty, accepted is a program and its arguments')
        if not any('{image}' in word for word in words):
            words.append('{image}')
        return [word.replace('{image}', image) for word in words]

    def _printed(self, words: list[str], folder: Path) -> str:
        """Return what the command printed on standard output."""
        output, errors = folder / 'output', folder / 'errors'
        limit = self.settings.detector_timeout
        with output.open('wb') as out, errors.open('wb') as err:
            try:
                process = subprocess.Popen(
                    words, stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True
                )
            except OSError as error:
                raise ValueError(f'{self._named} cannot be started: {error.strerror}') from error
            try:
                status = process.wait(limit)
            except subprocess.TimeoutExpired as error:
                raise ValueError(
                    f'{self._named} took longer than detector_timeout, {limit:g} s'
                ) from error
            finally:
                _end(process)
        if status:
            said = errors.read_bytes()[-_TOLD:].decode(errors='replace').strip()
            raise ValueError(f'{self._named} ended {_ending(status)}: {said!r}')
        if output.stat().st_size > LARGEST_OUTPUT:
            raise ValueError(
                f'{self._named} printed {output.stat().st_size} bytes, accepted are at most '
                f'{LARGEST_OUTPUT}'
            )
        return output.read_text(encoding='utf-8', errors='replace')


def _end(process: subprocess.Popen[Any]) -> None:
    """End a process that has not, and all that it started."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        return
    process.wait()


def _ending(status: int) -> str:
    return f'with status {status}' if status > 0 else f'by signal {-status}'
