"""`ahf render`: synthetic images and their truth."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from ahf_ros.base import ending
from ahf_ros.base.inputs import release_input
from ahf_ros.base.settings.nested import flat_parameters
from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.base.target import TrueTarget
from ahf_ros.cli import say, tell
from ahf_ros.cli.options import add_option, add_output, settings_from
from ahf_ros.files.image_files import write_image
from ahf_ros.files.truth_files import read_truth, write_truth
from ahf_ros.scenes.bent.picture import BentRendering, render_bent
from ahf_ros.scenes.bent.settings import BentSettings
from ahf_ros.scenes.scene import Rendering, SceneSettings, render

_MAKERS: dict[str, type[SceneSettings | BentSettings]] = {
    'wall': SceneSettings,
    'bent': BentSettings,
}
"""Settings by the name of what makes pictures of them."""


class _Picture(NamedTuple):
    """A picture to make; only a wall has phases."""

    scene: SceneSettings | BentSettings
    phase: int = 0

    @property
    def name(self) -> str:
        """Its file."""
        name = f'{self.scene.light}_{self.scene.ambient:g}_{self.scene.seed}'
        several = isinstance(self.scene, SceneSettings) and self.scene.phases > 1
        return name + (f'_{self.phase}.png' if several else '.png')

    def made(self) -> Rendering | BentRendering:
        """Return the picture and its truth."""
        if isinstance(self.scene, SceneSettings):
            return render(self.scene, self.phase)
        return render_bent(self.scene)


def add_arguments(parser: ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    text = (
        'Folder for LIGHT_AMBIENT_SEED.png, or LIGHT_AMBIENT_SEED_PHASE.png with several '
        'phases, and truth.csv; created if it does not exist.'
    )
    add_output(parser, 'folder', 'DIR', text)
    text = 'Number of images for each light, with consecutive seeds.'
    add_option(parser, Parameter('count', 1, text, minimum=1))
    choice = Parameter(
        'maker',
        'wall',
        'What makes the pictures: wall, of a flat wall; bent, of bent sheets, ray by ray, with '
        'motion, gloss, grain and a real lens.',
        choices=tuple(_MAKERS),
    )
    add_option(parser, choice)
    groups = {
        maker: parser.add_argument_group(maker, f'Only with --maker {maker}.') for maker in _MAKERS
    }
    for item in dict.fromkeys(item for of in _MAKERS.values() for item in flat_parameters(of)):
        makers = _makers_with(item)
        group = parser if len(makers) > 1 else groups[makers[0]]
        if item.name == 'light':
            add_option(group, item, nargs='+', default=[item.default])
        else:
            add_option(group, item)


def _makers_with(item: Parameter) -> list[str]:
    """Return the makers that have a parameter."""
    return [maker for maker, of in _MAKERS.items() if item in flat_parameters(of)]


def run(options: Namespace) -> int:
    """Render the images and add their truth to the truth of the folder."""
    pictures = _pictures(options)
    truth_path = options.folder / 'truth.csv'
    try:
        truth = dict(read_truth(truth_path)) if truth_path.exists() else {}
        release_input(truth_path)  # which goes on
        for picture in pictures:
            ending.check()
            rendering = picture.made()
            write_image(options.folder / picture.name, rendering.image)
            truth[picture.name] = tuple(map(TrueTarget.of, rendering.targets))
            write_truth(truth_path, truth)
            count = len(rendering.targets)
            say(f'{options.folder / picture.name}: {count} targets')
    except ValueError as error:  # of a file, or an impossible scene
        tell('render', error)
        return 1
    return 0


def _pictures(options: Namespace) -> Iterator[_Picture]:
    """Return pictures one by one, having refused options that do not fit each other."""
    settings: type[SceneSettings | BentSettings] = _MAKERS[options.maker]
    _refuse_others(options)
    first = [
        settings_from(Namespace(**vars(options) | {'light': light}), settings)
        for light in options.light
    ]
    for scene in first:
        replace(scene, seed=scene.seed + options.count - 1)  # refuses a seed that is too large
    return (
        _Picture(replace(scene, seed=scene.seed + number), phase)
        for scene in first
        for number in range(options.count)
        for phase in range(scene.phases if isinstance(scene, SceneSettings) else 1)
    )


def _refuse_others(options: Namespace) -> None:
    """Raise a ValueError if an option was given that the maker does not have."""
    for item in (item for of in _MAKERS.values() for item in flat_parameters(of)):
        value, makers = getattr(options, item.name), _makers_with(item)
        if options.maker not in makers and value != item.default:
            raise ValueError(
                f'{item.name} is {value!r} and maker is {options.maker!r}; accepted with '
                f'{item.name} is the maker {makers[0]!r}'
            )
