"""`ahf identify`: the coded targets in image files."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import TextIO

import cv2
import numpy as np
from rich.console import Console
from rich.progress import Progress

from ahf_ros.cli.options import add_options, settings_from
from ahf_ros.detectors import Detector, create_detector
from ahf_ros.drawing import draw, summary
from ahf_ros.interchange.image_files import orientation_note, read_image, write_image
from ahf_ros.interchange.target_json import to_json
from ahf_ros.session import IdentificationSettings, create_identifier, identify
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
    add_options(parser, IdentificationSettings)


def run(options: argparse.Namespace) -> int:
    """Identify, print and draw each image, independently of the images before it.

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
    overlays = _overlay_paths(options.images, options.overlay)
    detector = create_detector(settings.detector, settings.detection)
    create_identifier(settings, detector)  # refuses what does not fit together, before any image
    failed = False
    for path in _with_progress(options.images):
        try:
            image = read_image(path)
            if note := orientation_note(path):
                print(note, file=sys.stderr)
            found = _identified(path, image, detector, settings)
            if options.json:
                names = detector.family, detector.name
                content = to_json(found, path, image.shape, *names)
                print(json.dumps(content), file=output, flush=True)
            _report(path, found, with_targets=not options.json)
            if overlays:
                write_image(overlays[path], draw(image, found))
        except ValueError as error:
            print(f'ahf identify: {error}', file=sys.stderr)
            failed = True
        except (MemoryError, cv2.error) as error:  # the other images may be smaller
            print(f'ahf identify: {path}: {reason_of(error)}', file=sys.stderr)
            failed = True
    return int(failed)


def _identified(
    path: str, image: np.ndarray, detector: Detector, settings: IdentificationSettings
) -> Identification:
    try:
        return identify(image, detector, settings)
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from error


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


def _with_progress(images: list[str]) -> Iterator[str]:
    """Yield the images, with a progress bar for several of them on a terminal."""
    shown = len(images) > 1 and sys.stderr.isatty()
    # If standard output were redirected, JSON would go to the console of the progress bar.
    with Progress(
        console=Console(stderr=True, quiet=not shown),
        transient=True,
        redirect_stdout=False,
        disable=not shown,
    ) as progress:
        yield from progress.track(images, description='identify')


def _report(path: str, found: Identification, with_targets: bool) -> None:
    """Report the identified targets on standard error."""
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
