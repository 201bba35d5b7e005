"""The image files that a command line names: files, folders, patterns and lists."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from glob import glob, has_magic
from pathlib import Path

from ahf_ros.interchange.files import read_text
from ahf_ros.interchange.image_files import SUFFIXES
from ahf_ros.interchange.urls import is_url, urls_named
from ahf_ros.text import shown


def image_paths(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the image files that arguments name, and what is wrong with the others.

    Parameters
    ----------
    arguments : sequence of str
        As `ahf_ros.cli.identify_options.IMAGES` says. A file of the name comes first, whatever
        characters are in it.

    Returns
    -------
    paths : list of str
        In the order of the arguments, and sorted by name within a folder or a pattern.
    problems : list of str
        One for each argument that names no image.

    Examples
    --------
    >>> image_paths(['left.png', 'right.png'])
    (['left.png', 'right.png'], [])
    """
    paths: list[str] = []
    problems: list[str] = []
    for argument in arguments:
        try:
            found = list(_named(argument))
        except ValueError as error:
            problems.append(str(error))
            continue
        if not found:
            problems.append(f'{shown(argument)} names no image, accepted are files and folders')
        paths += found
    return paths, problems


def _named(argument: str) -> Iterator[str]:
    path = Path(argument)
    if is_url(argument):
        yield from urls_named(argument, SUFFIXES)
    elif path.is_dir():
        yield from sorted(str(file) for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
    elif path.exists():
        yield argument
    elif argument.startswith('@'):
        for line in read_text(argument[1:]).splitlines():
            if line.strip():
                yield from _named(line.strip())
    elif has_magic(argument):
        found = glob(argument, recursive=True)  # noqa: PTH207  Path has none for absolute patterns
        yield from sorted(found)
    else:
        yield argument  # whoever reads it says what is wrong
