"""One task of a batch, and its outcome: records that processes and machines exchange."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

from ahf_ros.session_settings import IdentificationSettings, StackSettings


class Level(IntEnum):
    """How important a message is."""

    DETAIL = 0
    NOTE = 1
    WARNING = 2
    PROBLEM = 3


@dataclass(frozen=True, slots=True)
class Message:
    """A line for people.

    Attributes
    ----------
    text : str
    level : Level
        `PROBLEM` if something could not be read, identified or written.
    """

    text: str
    level: Level = Level.NOTE


@dataclass(frozen=True, slots=True)
class ImageTask:
    """Image files that are identified together, independently of all others.

    Attributes
    ----------
    paths : tuple of str
        The files, as the user named them.
    settings : IdentificationSettings
    stacking : StackSettings
        Whether movement within the stack is looked for.
    upright : bool
        Whether images are turned as their orientation says.
    stacked : bool
        Whether results name all images of their stack.
    minimum : int
        Number of images below which a message says that some are missing; 0 for none.
    overlays : tuple of str
        For each image, the file to draw it to if it is the first of its result; empty if none
        are drawn.
    folder : str
        Where paths start that are not absolute; the working folder where empty.

    Examples
    --------
    >>> ImageTask(('photos/a.jpg',)).name
    'photos/a.jpg'
    """

    paths: tuple[str, ...]
    settings: IdentificationSettings = field(default_factory=IdentificationSettings)
    stacking: StackSettings = field(default_factory=StackSettings)
    upright: bool = False
    stacked: bool = False
    minimum: int = 0
    overlays: tuple[str, ...] = ()
    folder: str = ''

    @property
    def name(self) -> str:
        """What messages call the task."""
        return ', '.join(self.paths)


@dataclass(frozen=True, slots=True)
class ImageOutcome:
    """What became of an `ImageTask`.

    Attributes
    ----------
    records : tuple of dict
        What `ahf identify --json` prints, one for each part of the stack.
    messages : tuple of Message
        In the order in which they came up.
    files : tuple of str
        Fingerprint of each file of the task before it was read, see
        `ahf_ros.batch.results.file_fingerprint`.
    """

    records: tuple[dict[str, Any], ...] = ()
    messages: tuple[Message, ...] = ()
    files: tuple[str, ...] = ()

    @property
    def failed(self) -> bool:
        """Whether something could not be read, identified or written."""
        return any(message.level == Level.PROBLEM for message in self.messages)


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
