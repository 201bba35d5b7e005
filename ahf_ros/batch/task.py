"""The images of a task and what becomes of them: records that processes and machines exchange."""

from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

from ahf_ros.identification.session_settings import IdentificationSettings, StackSettings


class Level(IntEnum):
    """How important a message is; `PROBLEM` if something could not be read or written."""

    DETAIL = 0
    NOTE = 1
    WARNING = 2
    PROBLEM = 3


@dataclass(frozen=True, slots=True)
class Message:
    """A line for people."""

    text: str
    level: Level = Level.NOTE


@dataclass(frozen=True, slots=True)
class ImageOutcome:
    """What became of an `ImageTask`."""

    records: tuple[dict[str, Any], ...] = ()  # as JSON, one for each part of the stack
    messages: tuple[Message, ...] = ()  # in the order in which they came up
    files: tuple[str, ...] = ()  # `file_fingerprint` of each before it was read

    @property
    def failed(self) -> bool:
        """Whether something could not be read, identified or written."""
        return any(message.level == Level.PROBLEM for message in self.messages)


@dataclass(frozen=True, slots=True)
class ImageTask:
    """Image files that are identified together, independently of all others."""

    paths: tuple[str, ...]  # as the user named them
    settings: IdentificationSettings = field(default_factory=IdentificationSettings)
    stacking: StackSettings = field(
        default_factory=StackSettings
    )  # whether movement is looked for
    upright: bool = False  # whether images are turned as their orientation says
    stacked: bool = False  # whether results name all images of their stack
    minimum: int = 0  # images below which a message says that some are missing
    overlays: tuple[str, ...] = ()  # files to draw the first image of each result to
    families: tuple[str, ...] = ()  # that other images have settled, where all are looked for
    folder: str = ''  # where paths start that are not absolute; the working folder where empty
    outcome: ImageOutcome | None = None  # if it is known, as images settled families

    @property
    def name(self) -> str:
        """What messages call the task."""
        return ', '.join(self.paths)


def with_machine(outcome: ImageOutcome, machine: str) -> ImageOutcome:
    """Return an outcome whose problems say on which machine they came up.

    Examples
    --------
    >>> lost = ImageOutcome(messages=(Message('a.png cannot be read', Level.PROBLEM),))
    >>> with_machine(lost, 'node7').messages[0].text
    'a.png cannot be read (on node7)'
    """
    messages = (
        replace(message, text=f'{message.text} (on {machine})')
        if message.level == Level.PROBLEM
        else message
        for message in outcome.messages
    )
    return replace(outcome, messages=tuple(messages))
