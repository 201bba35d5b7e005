"""`ahf learn-family`: the data file of a family, from photographs or measured dots of its targets.

What computes is imported where it is used, so that `--help` and mistakes come at once.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ahf_ros.base.opening import parsing
from ahf_ros.base.settings.parameter import parameters
from ahf_ros.base.writing import write_files, write_whole
from ahf_ros.cli import say, tell
from ahf_ros.cli.identify import image_paths
from ahf_ros.cli.options import add_input, add_option, add_output
from ahf_ros.families.contract import DetectorSettings

if TYPE_CHECKING:
    import numpy as np

    from ahf_ros.families.learning.points import Learnt
    from ahf_ros.families.learning.rings import LearntFamily
    from ahf_ros.families.ring.bands import Bands
    from ahf_ros.prints.gsi import PointPrint

_OF_DOTS = 'polarity', 'min_radius', 'max_radius'  # options
_COLUMNS, _TILE = 6, 180  # of the contact sheet, and width of a picture, px
_AROUND = 1.15  # radius of what is shown of a target, in that of its band


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    text = (
        'Photographs, or folders of these, of ring targets that nobody described; or one '
        'point list with rows CODEn, NUGGETn_A and NUGGETn_7, as V-STARS writes them.'
    )
    add_input(parser, 'sources', 'SOURCE', text, nargs='+')
    text = (
        'Data file. For photographs, pictures of the words that were seen are beside it, in '
        'FILE.png; a second family is FILE_2.'
    )
    add_output(parser, '-o', 'FILE', text, required=True)
    parser.add_argument('--name', help='Name of the family. Default: the name of the data file.')
    rings = parser.add_argument_group('photographs of rings')
    for item in parameters(DetectorSettings):
        if item.name in _OF_DOTS:
            add_option(rings, item)
    points = parser.add_argument_group('point lists')
    text = (
        'Data file with the design in rough, for positions and codes that the points do not '
        'show. Default: the family of GSI.'
    )
    add_input(points, '--base', 'FILE', text, default='')
    points.add_argument('--unit', default='mm', help='Unit of the coordinates. Default: mm.')
    points.add_argument(
        '--dot-radius',
        type=float,
        metavar='X',
        help='Radius of the dots in that unit. Default: in proportion to the design.',
    )


def run(options: argparse.Namespace) -> int:
    """Write the data file and say what was learnt."""
    radius = options.dot_radius
    if radius is not None and not 0 < radius < float('inf'):
        raise ValueError(f'dot_radius is {radius!r}, accepted is a length above 0')
    if options.output.suffix.lower() == '.png':
        raise ValueError(f'output is {str(options.output)!r}, accepted is another ending')
    lists = [source for source in options.sources if source.lower().endswith('.csv')]
    if lists and len(options.sources) > 1:
        raise ValueError(
            f'sources are {len(options.sources)} with {lists[0]!r}, accepted are photographs, or '
            'one point list'
        )
    try:
        return _learn_points(options, lists[0]) if lists else _learn_rings(options)
    except ValueError as error:
        tell('learn-family', error)
        return 1


def _learn_rings(options: argparse.Namespace) -> int:
    from ahf_ros.families.learning.rings import learn_families
    from ahf_ros.families.ring.bands import MINIMUM_TARGETS, Bands, find_bands
    from ahf_ros.files.image_files import read_image

    paths, problems, left_out = image_paths(options.sources)
    for problem in (*problems, *left_out):
        tell('learn-family', problem)
    settings = DetectorSettings(**{name: getattr(options, name) for name in _OF_DOTS})
    found: list[Bands] = []
    crops: dict[bytes, np.ndarray] = {}
    for path in paths:
        try:
            with parsing(path, 'a photograph of ring targets'):
                image = read_image(path)
                bands = find_bands([image], settings)
                crops |= _crops(image, bands)
        except ValueError as error:
            problems.append(str(error))
            tell('learn-family', error)
            continue
        found.append(replace(bands, image=bands.image + len(found)))
    if not found:
        raise ValueError('no photograph was read, accepted is one at least')
    bands = Bands.joined(found)
    families = learn_families(bands)
    if not families:
        raise ValueError(
            f'{len(bands.size)} dots with a concentric band of sectors in {len(found)} images; '
            f'{MINIMUM_TARGETS} of one family are needed, and 20 tell it well'
        )
    output = options.output
    for number, learnt in enumerate(families, 1):
        file = output if number == 1 else output.with_stem(f'{output.stem}_{number}')
        name = options.name or output.stem
        _write_rings(file, name if number == 1 else f'{name}_{number}', learnt, len(found), crops)
    return int(bool(problems))


def _write_rings(
    file: Path, name: str, learnt: LearntFamily, images: int, crops: dict[bytes, np.ndarray]
) -> None:
    """Write the data file of a family and its contact sheet, and say what was learnt.

    From the number of images and the pictures of targets, by their frames.
    """
    import cv2

    from ahf_ros.prints.ring import ring_family

    inner, outer = (round(radius, 2) for radius in learnt.band)
    count = len(learnt.words)
    seen = f'{count} targets in {len(set(learnt.bands.image.tolist()))} of {images} images'
    rules, *others = [json.dumps(of) if of else 'all' for of, _ in learnt.likely]
    different = sorted(set(learnt.words.tolist()))
    maybe = [
        f'{len(different)} words may follow words: {of} as well (probability {share:.2f})'
        for of, (_, share) in zip(others, learnt.likely[1:], strict=True)
    ]
    pinhole = round(learnt.pinhole, 2)
    text = (
        f'# Words that were seen: {", ".join(map(str, different))}\n'
        f'{"".join(f"# {of}{chr(10)}" for of in maybe)}'
        f'family: {json.dumps(name)}\nsource: learnt from {seen}\nbits: {learnt.bits}\n'
        f'band: [{inner:g}, {outer:g}]\npolarity: {learnt.polarity}\n'
        f'{f"pinhole: {pinhole:g}{chr(10)}" if pinhole else ""}'
        f'words: {rules}\nnumbers: {{first_bit: lowest}}\n'
    )
    sheet = file.with_suffix('.png')
    _, picture = cv2.imencode(sheet.suffix, _contact_sheet(learnt, crops))
    write_files(file.parent, {file.name: text.encode(), sheet.name: picture.tobytes()}.items())
    ring_family(str(file))
    say(
        f'{file}: {seen}, {learnt.bits} bits (log odds against the next number: '
        f'{learnt.lead:.0f}), band {inner:g} to {outer:g}, {learnt.polarity}, '
        f'{f"pinhole {pinhole:g}, " if pinhole else ""}ink {learnt.growth:+.1f} px'
    )
    say(f'{file}: words: {rules} (probability {learnt.likely[0][1]:.2f})')
    for of in maybe:
        say(f'{file}: {of}')
    for known in learnt.known():
        say(f'{file}: {known} has all of these words and about this band')


def _crops(image: np.ndarray, bands: Bands) -> dict[bytes, np.ndarray]:
    """Return pictures of the targets of an image, by their frames, so that it need not be kept."""
    import cv2
    import numpy as np

    from ahf_ros.vision import frame
    from ahf_ros.vision.image import as_gray

    gray = np.clip(as_gray(image), 0, 255).astype(np.uint8)
    sides = np.rint(2 * _AROUND * frame.ellipse_axes(bands.frames)[0] * bands.outer).astype(int)
    crops = {}
    for at, side in zip(bands.frames, sides.tolist(), strict=True):
        shown = cv2.getRectSubPix(gray, (side, side), tuple(at[:2, 2].tolist()))
        crops[at.tobytes()] = cv2.resize(shown, (_TILE, _TILE), interpolation=cv2.INTER_AREA)
    return crops


def _contact_sheet(learnt: LearntFamily, crops: dict[bytes, np.ndarray]) -> np.ndarray:
    """Return a picture of one target of each word, uint8, shape (height, width, 3)."""
    import numpy as np

    from ahf_ros.views.drawing.tiles import Tile, side_by_side

    words, first = np.unique(learnt.words, return_index=True)
    shown = [crops[learnt.bands.frames[index].tobytes()] for index in first]
    tiles = [Tile(of, str(word)) for of, word in zip(shown, words.tolist(), strict=True)]
    blank = Tile(np.zeros((_TILE, _TILE), np.uint8), '')
    tiles += [blank] * (-len(tiles) % _COLUMNS)
    rows = [tiles[start : start + _COLUMNS] for start in range(0, len(tiles), _COLUMNS)]
    return side_by_side(rows, _TILE)


def _learn_points(options: argparse.Namespace, points: str) -> int:
    from ahf_ros.families.learning.points import learn_family, library_text, with_codes
    from ahf_ros.files.tables import read_points
    from ahf_ros.prints.gsi import point_family

    radius = options.dot_radius
    base = point_family(options.base)
    name = options.name or options.output.stem
    learnt = learn_family(read_points(points), base, name)
    family = replace(learnt.family, unit=options.unit, source=Path(points).name)
    if radius is not None:
        family = replace(
            family,
            dot_radius=radius,
            template_radii=family.template_radii * (radius / family.dot_radius),
            position_radii=family.position_radii * (radius / family.dot_radius),
        )
    family = with_codes(family, learnt.codes)
    write_whole(options.output, library_text(family).encode())
    point_family(str(options.output))
    _report(learnt, base, options)
    return 0


def _report(learnt: Learnt, base: PointPrint, options: argparse.Namespace) -> None:
    """Say on standard error what was learnt and what was not."""
    import numpy as np

    for number, reason in learnt.left_out.items():
        tell('learn-family', f'target {number} is left out: it {reason}')
    sizes = [target.scale for target in learnt.targets]
    numbers = ', '.join(str(target.number) for target in learnt.targets)
    spread = max(np.hypot(*(target.template - base.template).T).max() for target in learnt.targets)
    say(
        f'{options.output}: {len(learnt.targets)} targets ({numbers}), {1 / np.mean(sizes):.4f} '
        f'times the size of {base.name}, template within {spread:.3f} {base.unit} of it'
    )
