"""The method in one command: the same image under projected light, identified in three ways."""

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from ahf_ros.base.opening import file_errors
from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.base.target import Identification, Target, TrueTarget
from ahf_ros.cli.options import add_option, add_output
from ahf_ros.files.image_files import write_image
from ahf_ros.identification.filtering.homomorphic import filtered
from ahf_ros.identification.session import create_identifier
from ahf_ros.scenes.evaluation import FALSE, RIGHT, WRONG, judge, line, method
from ahf_ros.scenes.patterns import LIGHT_NAMES
from ahf_ros.scenes.scene import SceneSettings, render
from ahf_ros.views.drawing.overlay import (
    DECODED_COLOUR,
    MISSED_COLOUR,
    TEXT_COLOUR,
    WRONG_COLOUR,
    overlay,
)
from ahf_ros.views.drawing.tiles import Tile, side_by_side

WAYS: dict[str, dict[str, Any]] = {
    'traditional': {'detector': 'traditional', 'ahf': False},
    'traditional with AHF': {'detector': 'traditional', 'ahf': True},
    'ring': {'detector': 'ring', 'ahf': False},
}
"""Options of each way to identify, by its title."""

SCENE: dict[str, Any] = {'width': 1600, 'height': 1066, 'targets': 12}
"""What is rendered: few enough targets to see each of them in a picture of the whole."""

WIDTH = 800
"""Width of one of the images side by side, px."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    scene = SceneSettings()
    parser.add_argument(
        '--light', choices=LIGHT_NAMES, default='stripe', help='Projected light. Default: stripe.'
    )
    text = 'Ambient light as a share of the projected light.'
    add_option(parser, Parameter('ambient', scene.ambient, text))
    add_option(parser, Parameter('seed', scene.seed, 'Seed of the image.'))
    add_output(parser, '--output', 'DIR', 'Folder for the picture. Default: demo.', default='demo')


def run(options: argparse.Namespace) -> int:
    """Identify the same image in three ways.

    The three ways are the detector `traditional` alone, the same with a filter that AHF finds,
    and the detector `ring`, which needs no filter. One line for each says what was right and
    wrong, and one picture shows it.
    """
    picture = options.output / 'image_1.jpg'
    scene = SceneSettings(**SCENE, light=options.light, ambient=options.ambient, seed=options.seed)
    with file_errors(picture.parent, 'made'):
        picture.parent.mkdir(parents=True, exist_ok=True)
    show(scene, picture)
    return 0


def show(scene: SceneSettings, picture: Path) -> None:
    """Print a line for each way, and write a picture of two columns."""
    print(f'{scene.targets} targets under {scene.light}, being rendered ...', flush=True)
    rendering = render(scene)
    image, truth = rendering.image, rendering.targets
    title = f'{scene.light}, ambient light {scene.ambient:g}'
    tiles = [Tile(image, title, [(f'{len(truth)} targets', TEXT_COLOUR)])]
    for way, options in WAYS.items():
        found = create_identifier(
            family=scene.family, expected_targets=len(truth), **options
        ).identify(image)
        print(f'  {way:{max(map(len, WAYS))}}  {line(found, truth)}', flush=True)
        seen = filtered(image, found.filter)
        tiles.append(tile(f'{way}: {method(found)}', seen, found, truth))
    write_image(picture, side_by_side([tiles[:2], tiles[2:]], WIDTH))
    print(f'  {picture}', flush=True)


def tile(title: str, image: np.ndarray, found: Identification, truth: tuple[Target, ...]) -> Tile:
    """Return the overlay of what was found; right, wrong and missed targets differ in colour.

    The image, shape (height, width), is the one in which the targets were identified, filtered or
    not.
    """
    verdicts = judge(truth, found)
    wrong = [
        target
        for verdict, target in zip(verdicts, found.targets, strict=True)
        if verdict.kind in (WRONG, FALSE)
    ]
    met = {verdict.target for verdict in verdicts}
    missed = [target for target in truth if TrueTarget.of(target) not in met]
    remarks = [
        (f'{sum(verdict.kind == RIGHT for verdict in verdicts)} right', DECODED_COLOUR),
        (f'{len(wrong)} wrong', WRONG_COLOUR),
        (f'{len(missed)} missed', MISSED_COLOUR),
    ]
    unit = max(1, image.shape[1] // WIDTH)
    drawn = overlay(image, found.targets, wrong, missed, unit, prints=found.prints)
    return Tile(drawn, title, remarks)
