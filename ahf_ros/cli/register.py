"""`ahf register`: scans in files, clouds with their images, in one frame.

What computes is imported where it is used, so that `--help` and mistakes come at once.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from ahf_ros.cli import tell
from ahf_ros.cli.options import (
    add_option,
    add_quiet,
    add_search_options,
    add_target_options,
    settings_from,
)
from ahf_ros.orientation.units import METRES
from ahf_ros.session_settings import IdentificationSettings
from ahf_ros.settings.parameter import Parameter

if TYPE_CHECKING:
    import numpy as np

    from ahf_ros.filtering.identifier import Identifier
    from ahf_ros.registration.scan import Scan

_CLOUDS = ('.ply', '.pcd')
_CONFIDENCE = Parameter(
    'minimum_confidence', 0.9, 'Minimum confidence of targets that are used.', 0.0, 1.0
)
_FRAME = Parameter('frame', 'registered', 'Name of the frame, for transforms.json.')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    parser.add_argument(
        'folder',
        type=Path,
        metavar='FOLDER',
        help='Folder of organised clouds, PLY or PCD in metres, one point per pixel of an image '
        'of the same name.',
    )
    parser.add_argument(
        '-o',
        '--output',
        type=Path,
        required=True,
        metavar='DIR',
        help='Write clouds in the frame, transforms and targets to this folder, as the service '
        '~/save of the node registration does.',
    )
    parser.add_argument(
        '--adjust',
        action='store_true',
        help='Adjust all scans and targets jointly, which closes a chain of scans.',
    )
    parser.add_argument(
        '--coordinates',
        type=Path,
        metavar='FILE',
        help='Known coordinates of targets: a folder of ahf orient, CSV or JSON. Default: the '
        'first scan gives the frame.',
    )
    parser.add_argument(
        '--unit',
        choices=tuple(METRES),
        default='',
        help='Unit of these coordinates where the file does not say it.',
    )
    add_option(parser, _FRAME)
    add_option(parser, _CONFIDENCE)
    add_quiet(parser)
    add_target_options(parser)
    add_search_options(parser)


def run(options: argparse.Namespace) -> int:
    """Register the scans in the order of their names, and write them."""
    settings = settings_from(options, IdentificationSettings, [options.folder / 'families'])
    if options.output.resolve() == options.folder.resolve():
        raise ValueError('output is the folder of the scans, accepted is another one')
    pairs = list(_pairs(options.folder))

    from ahf_ros.interchange.coordinate_files import read_coordinates
    from ahf_ros.interchange.registration_files import ScanRecord, write_registration
    from ahf_ros.registration.session import Registration
    from ahf_ros.session import create_identifier

    identifier = create_identifier(settings=settings)
    failed = False
    try:
        known = (
            read_coordinates(options.coordinates, options.unit) if options.coordinates else None
        )
        registration = Registration(known)
        records: list[ScanRecord] = []
        for cloud_file, image_file in pairs:
            try:
                cloud, scan = _scan(cloud_file, image_file, identifier, options.minimum_confidence)
                found = registration.add(scan)
            except ValueError as error:
                tell('register', f'{cloud_file}: {error}')
                failed = True
                continue
            records.append(ScanRecord(f'scan_{len(records) + 1}', cloud=cloud))
            if not options.quiet:
                common = f'{len(found.common)} of {len(scan.names)} targets in common'
                print(
                    f'{cloud_file}: {records[-1].name}, {common}, residuals '
                    f'{1e3 * found.rms:.3f} mm (RMS)',
                    file=sys.stderr,
                )
        if options.adjust:
            text = registration.adjust().words()
            if not options.quiet:
                print(text, file=sys.stderr)
        write_registration(options.output, options.frame, registration.field, records)
    except ValueError as error:
        tell('register', error)
        return 1
    return int(failed)


def _pairs(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Yield the clouds of a folder, sorted by name, with the image of each."""
    from ahf_ros.interchange.image_files import SUFFIXES

    if not folder.is_dir():
        raise ValueError(f'{folder} is no folder, accepted is one with PLY or PCD files')
    files = sorted(folder.iterdir())
    clouds = [it for it in files if it.suffix.lower() in _CLOUDS]
    if not clouds:
        raise ValueError(f'{folder} has no PLY or PCD file, accepted is a folder of them')
    stems = [it.stem for it in clouds]
    for cloud in clouds:
        images = [it for it in files if it.stem == cloud.stem and it.suffix.lower() in SUFFIXES]
        if len(images) != 1 or stems.count(cloud.stem) > 1:
            raise ValueError(
                f'{cloud} has {stems.count(cloud.stem)} clouds and {len(images)} images of its '
                'name, accepted are one and one'
            )
        yield cloud, images[0]


def _scan(
    cloud_file: Path, image_file: Path, identifier: Identifier, minimum_confidence: float
) -> tuple[np.ndarray, Scan]:
    """Return the cloud of a scan and its targets, as the nodes do."""
    from ahf_ros.interchange.cloud_files import read_cloud
    from ahf_ros.interchange.image_files import read_image
    from ahf_ros.interchange.point_clouds import target_scan
    from ahf_ros.localisation import labelled, positions

    cloud, image = read_cloud(cloud_file), read_image(image_file)
    if cloud.shape != image.shape[:2]:
        sizes = (f'{it[1]} x {it[0]}' for it in (cloud.shape, image.shape))
        raise ValueError(
            'cloud has {} points, accepted is {}, the size of the image'.format(*sizes)
        )
    targets = identifier.identify(image).targets
    return cloud, target_scan(labelled(targets, positions(cloud, targets)), minimum_confidence)
