"""A detector that is another program: it gets an image file and prints what it found as JSON."""

from __future__ import annotations

import json
import shlex
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from ahf_ros.detectors.contract import DetectorSettings
from ahf_ros.detectors.external.program import check_running, output_of
from ahf_ros.imaging.image import as_gray, check_image
from ahf_ros.interchange.target_json import targets_from_json
from ahf_ros.target import Target, sorted_targets
from ahf_ros.text import printable, reason_of


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
        Unavailable
            If the command cannot be started.
        ValueError
            If the image is not accepted; if this process ends; if the command takes longer than
            its time limit, ends with another status than 0, or prints what is not accepted.
        """
        check_image(image)
        check_running(self._named)
        with tempfile.TemporaryDirectory(prefix='ahf_') as folder:
            path = Path(folder, 'image.png')
            cv2.imwrite(str(path), as_gray(image).astype(np.uint8, copy=False))
            words = self._words(str(path))
            timeout = self.settings.detector_timeout
            printed = output_of(words, Path(folder), timeout, self._named)
        try:
            record = json.loads(printed)
        except (ValueError, RecursionError) as error:
            told = printable(printed.strip())
            raise ValueError(
                f'{self._named} printed {told!r}, accepted is JSON: {reason_of(error)}'
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
