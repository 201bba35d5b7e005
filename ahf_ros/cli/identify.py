"""`ahf identify`: the coded targets in image files."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import cv2
import numpy as np
from rich.console import Console
from rich.progress import Progress

from ahf_ros.cli.options import add_options, settings_from
from ahf_ros.cli.stacks import add_stack_arguments, stacked
from ahf_ros.detectors import Detector, create_detector
from ahf_ros.drawing import draw, summary
from ahf_ros.imaging.image import check_image
from ahf_ros.interchange.image_files import orientation_note, read_image, write_image
from ahf_ros.interchange.target_json import to_json
from ahf_ros.sequence import StackSettings, identify_parts
from ahf_ros.session import IdentificationSettings, create_identifier
from ahf_ros.target import Identification
from ahf_ros.text import reason_of

DESCRIPTION = 'Identify the coded targets in images.'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    parser.add_argument('images', nargs='+', metavar='IMAGE', help='Image files.')
    parser.add_argument(
        '--json', action='store_true', help='Print one JSON object per image on standard output.'
    )
    parser.add_argument(
        '--overlay',
        type=Path,
        metavar='DIR',
        help='Write each image with its targets marked to this folder, as NAME_overlay.png.',
    )
    add_stack_arguments(parser)
    add_options(parser, IdentificationSettings)


def run(options: argparse.Namespace) -> int:
    """Identify, print and draw each image or stack, independently of those before it.

    Returns
    -------
    int
        0, or 1 if a file could not be read or written.

    Raises
    ------
    ValueError
        If options contradict each other.
    """
    output = sys.stdout
    with redirect_stdout(sys.stderr):  # what detectors of others print is not JSON
        return _run(options, output)


def _run(options: argparse.Namespace, output: TextIO) -> int:
    settings = settings_from(options, IdentificationSettings)
    stacking = StackSettings(stack=options.stack, stack_movement=options.stack_movement)
    groups = stacked(options.images, options.stack_by, options.stack)
    overlays = _overlay_paths(options.images, options.overlay)
    detector = create_detector(settings.detector, settings.detection)
    create_identifier(settings, detector)  # refuses what does not fit together, before any image
    together = bool(options.stack_by) or options.stack > 1
    names = detector.family, detector.name
    failed = False
    for paths in _with_progress(groups):
        images, unread = _read(paths)
        if not options.stack_by and len(images) < options.stack:
            text = f'{len(images)} of {options.stack} images of a stack'
            print(f'{paths[0]}: {text}', file=sys.stderr)
        with _reported(', '.join(images)) as problems:
            for found in _identified(images, detector, settings, stacking):
                if options.json:
                    content = _json(found, names, together)
                    print(json.dumps(content), file=output, flush=True)
                _report(found, with_targets=not options.json)
                if overlays:
                    drawn = draw(found.image, found.identification)
                    write_image(overlays[found.paths[0]], drawn)
        failed |= bool(unread or problems)
    return int(failed)


@dataclass(frozen=True, slots=True)
class _Found:
    """What was identified in images of an unmoved scene, or in one."""

    paths: tuple[str, ...]
    image: np.ndarray
    identification: Identification
    split: str  # why there was a stack before


@contextmanager
def _reported(name: str) -> Iterator[list[str]]:
    """Report what is wrong with images, and leave it in the list."""
    problems: list[str] = []
    try:
        yield problems
    except ValueError as error:
        problems.append(str(error))
    except (MemoryError, cv2.error) as error:  # the other images may be smaller
        problems.append(f'{name}: {reason_of(error)}')
    for problem in problems:
        print(f'ahf identify: {problem}', file=sys.stderr)


def _read(paths: Sequence[str]) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return the images of a stack that can be read, and what is wrong with the others."""
    images: dict[str, np.ndarray] = {}
    wrong: list[str] = []
    for path in paths:
        with _reported(path) as problems:
            image = read_image(path)
            if note := orientation_note(path):
                print(note, file=sys.stderr)
            try:
                check_image(image)
            except ValueError as error:
                raise ValueError(f'{path}: {error}') from error
            images[path] = image
        wrong += problems
    return images, wrong


def _identified(
    images: dict[str, np.ndarray],
    detector: Detector,
    settings: IdentificationSettings,
    stacking: StackSettings,
) -> Iterator[_Found]:
    """Yield what was identified in each part of a stack."""
    paths = tuple(images)
    if not paths:
        return
    try:
        identifier = create_identifier(settings, detector)
        for part, stack, found in identify_parts(identifier, list(images.values()), stacking):
            of = paths[part.images.start : part.images.stop]
            yield _Found(of, stack.combined(found.combination), found, part.split)
    except ValueError as error:
        raise ValueError(f'{", ".join(paths)}: {error}') from error


def _json(found: _Found, names: tuple[str, str], together: bool) -> dict[str, Any]:
    several = found.paths if together else ()
    shape = found.image.shape
    return to_json(found.identification, found.paths[0], shape, *names, several, found.split)


def _overlay_paths(images: list[str], folder: Path | None) -> dict[str, Path]:
    """Return the path of the overlay of each image; none if there is no folder for them."""
    if folder is None:
        return {}
    paths = {path: folder / f'{Path(path).stem}_overlay.png' for path in images}
    if len(set(paths.values())) < len(paths):
        raise ValueError(
            'overlay would hold several images of the same name, accepted are different names'
        )
    return paths


def _with_progress(groups: list[list[str]]) -> Iterator[list[str]]:
    """Yield the images of each stack, with a progress bar for several stacks on a terminal."""
    shown = len(groups) > 1 and sys.stderr.isatty()
    # If standard output were redirected, JSON would go to the console of the progress bar.
    with Progress(
        console=Console(stderr=True, quiet=not shown),
        transient=True,
        redirect_stdout=False,
        disable=not shown,
    ) as progress:
        yield from progress.track(groups, description='identify')


def _report(of: _Found, with_targets: bool) -> None:
    """Report the identified targets on standard error."""
    path, found = ', '.join(of.paths), of.identification
    if of.split:
        print(f'{of.paths[0]}: the stack is split here: {of.split}', file=sys.stderr)
    seconds = found.filter.duration
    print(f'{path}: {summary(found)}, {seconds:.2f} s', file=sys.stderr)
    if found.mirrored:
        print(
            f'{path}: the image seems to be mirrored: most IDs are not among the expected ones, '
            'and most would be in a mirror',
            file=sys.stderr,
        )
    if not with_targets:
        return
    for target in found.targets:
        print(
            f'{target.id:>8} {target.family:<11} {target.x:10.3f} {target.y:10.3f} px'
            f'  semi-axes {target.semi_major:.2f} {target.semi_minor:.2f} px'
            f'  confidence {target.confidence:.3f}',
            file=sys.stderr,
        )
