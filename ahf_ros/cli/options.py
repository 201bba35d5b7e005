"""Command line options: from settings, and those that several commands have."""

import argparse
import os
import sys
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from typing import Any, TypeVar

from ahf_ros.base.inputs import register_input
from ahf_ros.base.settings.nested import assemble, flat_parameters
from ahf_ros.base.settings.parameter import Parameter, parameters
from ahf_ros.clouds.cloud_settings import CloudSettings
from ahf_ros.clouds.registration_settings import RegistrationSettings
from ahf_ros.families.contract import DetectorSettings
from ahf_ros.identification.filtering.settings import AdaptiveSettings
from ahf_ros.identification.session_settings import IdentificationSettings
from ahf_ros.prints.families import files_by_name

Settings = TypeVar('Settings')
Value = TypeVar('Value')

_METAVARS = {int: 'N', float: 'X', str: 'TEXT'}
_FORMER = {'expected_targets': '--expected'}
"""Options that had another name in the release before."""

Group = argparse._ArgumentGroup | argparse.ArgumentParser
"""What takes options: a parser, or a group of its options."""


def add_target_options(parser: argparse.ArgumentParser) -> None:
    """Give a parser the options that say which targets are identified, and by which detector."""
    group = parser.add_argument_group('targets')
    for item in parameters(IdentificationSettings):
        add_option(group, item)
    add_options(group, DetectorSettings)


def add_search_options(parser: argparse.ArgumentParser) -> None:
    """Give a parser the options of the search for a filter."""
    group = parser.add_argument_group('search', 'How AHF searches for a filter if N is given.')
    add_options(group, AdaptiveSettings)


def add_image_options(parser: Group) -> None:
    """Give a parser the options that say how and where image files are read."""
    text = (
        'Turn images as their orientation says. Coordinates then count in the upright '
        'image, otherwise in the pixels as they are stored.'
    )
    add_flag(parser, '--upright', text)
    text = (
        'Number of images or stacks that are identified at the same time, each in a process of '
        'its own; 0: one per processor core, and none for fewer than 4 images, which are faster '
        'without. The result is the same.'
    )
    add_engine_options(parser, Parameter('jobs', 0, text, minimum=0, maximum=256))


def add_engine_options(parser: Group, jobs: Parameter) -> None:
    """Give a parser the options that say how many processes there are, and on which machines."""
    add_option(parser, jobs)
    parser.add_argument(
        '--scheduler',
        default='',
        metavar='ADDRESS',
        help='Process on the workers of this scheduler of dask.distributed, such as '
        'tcp://host:8786; files are read and written there.',
    )


def add_output_options(parser: Group) -> None:
    """Give a parser the options that say what is printed and drawn."""
    add_flag(parser, '--json', 'Print one JSON object per image on standard output.')
    text = 'Write each image with its targets marked to this folder, as NAME_overlay.png.'
    add_output(parser, '--overlay', 'DIR', text)
    add_quiet(parser)


def add_registration_options(parser: Group, without: Collection[str] = ()) -> None:
    """Give a parser the options of a registration, but for some of those of clouds."""
    add_options(parser, RegistrationSettings)
    text = 'Adjust all scans and targets jointly, which closes a chain of scans.'
    add_flag(parser, '--adjust', text)
    for item in parameters(CloudSettings):
        if item.name in (*without, 'cloud'):
            parser.set_defaults(**{item.name: item.default})
        else:
            add_option(parser, item)


def add_quiet(parser: Group) -> None:
    """Give a parser the option that leaves problems only."""
    add_flag(parser, '--quiet', 'Print nothing on standard error but problems.')


def add_flag(parser: Group, name: str, text: str) -> None:
    """Give a parser an option without a value, whose help is a text."""
    parser.add_argument(name, action='store_true', help=text)


def add_input(parser: Group, name: str, metavar: str, text: str, **more: Any) -> None:
    """Give a parser an argument that names a file or folder to read, which no output replaces."""
    parser.add_argument(name, metavar=metavar, help=text, **({'type': input_name} | more))


def add_output(parser: Group, name: str, metavar: str, text: str, **more: Any) -> None:
    """Give a parser an argument that names a file or folder to write; -o is --output as well."""
    more |= {'type': output_path, 'metavar': metavar, 'help': text}
    parser.add_argument(*_names(name), **more)


def add_parsed(
    parser: Group, name: str, metavar: str, text: str, parse: Callable[[str], Any], **more: Any
) -> None:
    """Give a parser an argument that a function reads, whose ValueErrors are for users."""
    more |= {'type': parsed_by(parse), 'metavar': metavar, 'help': text}
    parser.add_argument(*_names(name), **more)


def _names(name: str) -> tuple[str, ...]:
    return ('-o', '--output') if name == '-o' else (name,)


def add_options(parser: Group, settings: type) -> None:
    """Give a parser one option for each parameter of settings and of those nested in them."""
    for item in flat_parameters(settings):
        add_option(parser, item)


def add_option(parser: Group, item: Parameter, **changes: Any) -> None:
    """Give a parser the option of one parameter, with other arguments of `add_argument`.

    It is `--max-radius` for the parameter `max_radius`; `--ahf` and `--no-ahf` for one that is
    true or false.
    """
    text = f'{item.description} Default: {item.default}; accepted: {item.accepted}.'
    arguments: dict[str, Any] = {'default': item.default, 'help': text.replace('%', '%%')}
    if isinstance(item.default, bool):
        arguments |= {'action': argparse.BooleanOptionalAction}
    else:
        kind = input_files if item.files else parsed_by(item.value_of)
        arguments |= {'type': kind, 'metavar': _METAVARS[type(item.default)]}
    name = f'--{item.name.replace("_", "-")}'
    parser.add_argument(name, dest=item.name, **(arguments | changes))
    if former := _FORMER.get(item.name):
        hidden = {'default': argparse.SUPPRESS, 'help': argparse.SUPPRESS}
        parser.add_argument(
            former, dest=item.name, action=_Former, const=name, **(arguments | changes | hidden)
        )


class _Former(argparse.Action):
    """Stores the value of an option that is called `const` now, and says so."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option_string: str | None = None,
    ) -> None:
        print(
            f'{parser.prog}: {option_string} is called {self.const} now; the former name goes '
            'with the next release',
            file=sys.stderr,
        )
        setattr(namespace, self.dest, values)


def input_name(text: str) -> str:
    """Return what names a file to read, which no output replaces: the type of all such options."""
    register_input(text)
    return text


def input_path(text: str) -> Path:
    """Return the path of a file or folder to read, as `input_name` does."""
    return Path(input_name(text))


def input_files(text: str) -> str:
    """Return what names files to read, separated by commas, as `input_name` does."""
    for name in text.split(','):
        register_input(name.strip())
    return input_name(text)


def output_path(text: str) -> Path:
    """Return the path of a file or folder to write: the type of all such options."""
    return Path(text)


def parsed_by(function: Callable[[str], Value]) -> Callable[[str], Value]:
    """Return a function for the `type` of an argument; the user reads its ValueErrors."""

    def parse(text: str) -> Value:
        try:
            return function(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return parse


def settings_from(
    options: argparse.Namespace, settings: type[Settings], folders: Iterable[Path] = ()
) -> Settings:
    """Return the settings from the values of the options, which must not contradict each other.

    A family that is not known is described by a data file of its name, in the user's folder of
    families or in one of the folders.
    """
    values = {item.name: getattr(options, item.name) for item in flat_parameters(settings)}
    if 'family_file' in values:
        usual = Path(os.environ.get('XDG_CONFIG_HOME') or Path.home() / '.config')
        places = [*folders, usual / 'ahf_ros' / 'families']
        values['family_file'] = input_files(
            files_by_name(values['family'], values['family_file'], places)
        )
    return assemble(settings, values)
