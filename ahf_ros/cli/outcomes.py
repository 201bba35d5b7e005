"""What commands print of the outcome of images, and where they draw it."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TextIO

from ahf_ros.batch.identification import ImageOutcome, Level


def print_outcome(command: str, outcome: ImageOutcome, output: TextIO | None, quiet: bool) -> None:
    """Print an outcome: messages on standard error, and JSON where there is an output for it.

    Parameters
    ----------
    command : str
        Its name, before problems.
    outcome : ImageOutcome
    output : file or None
    quiet : bool
        Whether only warnings and problems are printed on standard error.
    """
    minimum = Level.WARNING if quiet else Level.NOTE if output else Level.DETAIL
    for record in outcome.records if output else ():
        print(json.dumps(record), file=output, flush=True)
    for message in outcome.messages:
        if message.level >= minimum:
            before = f'ahf {command}: ' if message.level == Level.PROBLEM else ''
            print(f'{before}{message.text}', file=sys.stderr)


def overlay_path(folder: Path, image: str) -> str:
    """Return the file that an image is drawn to.

    Examples
    --------
    >>> overlay_path(Path('seen'), 'photos/a.jpg')
    'seen/a_overlay.png'
    """
    return str(folder / f'{Path(image).stem}_overlay.png')
