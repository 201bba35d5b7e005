"""`ahf register`: scans in files, clouds with their images, in one frame.

What computes is imported where it is used, so that `--help` and mistakes come at once.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from ahf_ros.base.opening import parsing
from ahf_ros.cli import say, tell
from ahf_ros.cli.options import (
    add_input,
    add_output,
    add_quiet,
    add_registration_options,
    add_search_options,
    add_target_options,
    input_path,
    settings_from,
)
from ahf_ros.clouds.cloud_settings import CloudSettings
from ahf_ros.clouds.registration_settings import RegistrationSettings
from ahf_ros.identification.session_settings import IdentificationSettings

if TYPE_CHECKING:
    import numpy as np

    from ahf_ros.identification.filtering.identifier import Identifier

_CLOUDS = ('.ply', '.pcd')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    text = (
        'Folder of organised clouds, PLY or PCD in metres, one point per pixel of an image '
        'of the same name.'
    )
    add_input(parser, 'folder', 'FOLDER', text, type=input_path)
    text = (
        'Write clouds in the frame, transforms and targets to this folder, as the service '
        '~/save of the node registration does.'
    )
    add_output(parser, '-o', 'DIR', text, required=True)
    add_registration_options(parser, without=('cloud_tolerance',))
    add_quiet(parser)
    add_target_options(parser)
    add_search_options(parser)


def run(options: argparse.Namespace) -> int:
    """Register the scans in the order of their names, and write them."""
    settings = settings_from(options, IdentificationSettings, [options.folder / 'families'])
    registration = settings_from(options, RegistrationSettings)
    if options.output.resolve() == options.folder.resolve():
        raise ValueError('output is the folder of the scans, accepted is another one')
    pairs = list(_pairs(options.folder))

    from ahf_ros.clouds.registration_files import write_registration
    from ahf_ros.clouds.scans import Scans, known_targets
    from ahf_ros.files.cloud_files import read_cloud
    from ahf_ros.identification.session import create_identifier

    identifier = create_identifier(settings=settings)
    clouds = settings_from(options, CloudSettings)
    failed = False
    try:
        scans = Scans(known_targets(registration))
        files: list[Path] = []
        for cloud_file, image_file in pairs:
            try:
                with parsing(cloud_file, 'an organised cloud and its image'):
                    points = _target_points(cloud_file, image_file, identifier, clouds)
                    scans.register(points, registration.minimum_confidence)
            except ValueError as error:
                tell('register', error)
                failed = True
                continue
            files.append(cloud_file)
            if not options.quiet:
                say(f'{cloud_file}: {scans.last()}')
        if options.adjust:
            text = scans.adjust().words()
            if not options.quiet:
                say(text)
        content = map(read_cloud, files)
        write_registration(options.output, registration.frame, scans.field, scans.records, content)
    except ValueError as error:
        tell('register', error)
        return 1
    return int(failed)


def _pairs(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Yield the clouds of a folder, sorted by name, with the image of each."""
    from ahf_ros.files.image_files import image_suffixes

    if not folder.is_dir():
        raise ValueError(f'{folder} is no folder, accepted is one with PLY or PCD files')
    files, suffixes = sorted(folder.iterdir()), image_suffixes()
    clouds = [it for it in files if it.suffix.lower() in _CLOUDS]
    if not clouds:
        raise ValueError(f'{folder} has no PLY or PCD file, accepted is a folder of them')
    stems = [it.stem for it in clouds]
    for cloud in clouds:
        images = [it for it in files if it.stem == cloud.stem and it.suffix.lower() in suffixes]
        if len(images) != 1 or stems.count(cloud.stem) > 1:
            raise ValueError(
                f'{cloud} has {stems.count(cloud.stem)} clouds and {len(images)} images of its '
                'name, accepted are one and one'
            )
        yield cloud, images[0]


def _target_points(
    cloud_file: Path, image_file: Path, identifier: Identifier, settings: CloudSettings
) -> np.ndarray:
    """Return the targets of a scan with their positions, as the node detector publishes them."""
    from ahf_ros.clouds.localisation import labelled
    from ahf_ros.clouds.scans import located
    from ahf_ros.files.cloud_files import read_cloud
    from ahf_ros.files.image_files import read_image

    cloud, image = read_cloud(cloud_file), read_image(image_file)
    targets = identifier.identify(image).targets
    return labelled(targets, located(cloud, targets, image.shape[:2], settings))
