"""`ahf render`: synthetic images and their truth."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from ahf_ros import ending
from ahf_ros.cli import say, tell
from ahf_ros.cli.options import add_option, settings_from
from ahf_ros.interchange.image_files import write_image
from ahf_ros.interchange.truth_files import read_truth, write_truth
from ahf_ros.settings.nested import flat_parameters
from ahf_ros.settings.parameter import Parameter
from ahf_ros.synthetic.scene import SceneSettings, render
from ahf_ros.target import TrueTarget


def add_arguments(parser: ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    parser.add_argument(
        'folder',
        type=Path,
        metavar='DIR',
        help='Folder for LIGHT_AMBIENT_SEED.png, or LIGHT_AMBIENT_SEED_PHASE.png with several '
        'phases, and truth.csv; created if it does not exist.',
    )
    text = 'Number of images for each light, with consecutive seeds.'
    add_option(parser, Parameter('count', 1, text, minimum=1))
    for item in flat_parameters(SceneSettings):
        if item.name == 'light':
            add_option(parser, item, nargs='+', default=[item.default])
        else:
            add_option(parser, item)


def run(options: Namespace) -> int:
    """Render the images and add their truth to the truth of the folder."""
    scenes = _scenes(options)
    truth_path = options.folder / 'truth.csv'
    try:
        truth = dict(read_truth(truth_path)) if truth_path.exists() else {}
        for scene, phase in scenes:
            ending.check()
            rendering = render(scene, phase)
            name = f'{scene.light}_{scene.ambient:g}_{scene.seed}'
            name += f'_{phase}.png' if scene.phases > 1 else '.png'
            write_image(options.folder / name, rendering.image)
            truth[name] = tuple(map(TrueTarget.of, rendering.targets))
            write_truth(truth_path, truth)
            count = len(rendering.targets)
            say(f'{options.folder / name}: {count} targets')
    except ValueError as error:  # of a file, or an impossible scene
        tell('render', error)
        return 1
    return 0


def _scenes(options: Namespace) -> Iterator[tuple[SceneSettings, int]]:
    """Return scenes and phases one by one, having refused options that do not fit each other."""
    first = [
        settings_from(Namespace(**vars(options) | {'light': light}), SceneSettings)
        for light in options.light
    ]
    for scene in first:
        replace(scene, seed=scene.seed + options.count - 1)  # refuses a seed that is too large
    return (
        (replace(scene, seed=scene.seed + number), phase)
        for scene in first
        for number in range(options.count)
        for phase in range(scene.phases)
    )
