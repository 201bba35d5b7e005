"""The images that results are about: where they are now, and what a filter makes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath

import numpy as np

from ahf_ros.filtering.homomorphic import FilterSettings, HomomorphicFilter
from ahf_ros.imaging.image import stretched_to_8_bit
from ahf_ros.imaging.stack import ImageStack, unlike
from ahf_ros.interchange.image_files import read_image
from ahf_ros.report.results import ImageResult


@dataclass(frozen=True, slots=True)
class ShownImage:
    """An image as people see it.

    Attributes
    ----------
    original : ndarray of uint8, shape (height, width)
        The image as received, or the combination of a stack.
    filtered : ndarray of uint8, shape (height, width), or None
        The image in which the targets were identified; None if it was not filtered.
    """

    original: np.ndarray
    filtered: np.ndarray | None


def find_image(image: str, source: Path, folders: Sequence[Path] = ()) -> Path:
    """Return the path of an image, which may have moved since it was identified.

    Parameters
    ----------
    image : str
        Its path at that time.
    source : Path
        The file with the result. A relative path may start at its folder, or at the one around it.
    folders : sequence of Path
        Where images may be now, directly or in the folders that `image` names.

    Returns
    -------
    Path
        The first one that exists.

    Raises
    ------
    ValueError
        If there is none.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     Path(folder, 'b').mkdir()
    ...     Path(folder, 'b', 'a.png').touch()
    ...     find_image('/gone/b/a.png', Path('r.jsonl'), [Path(folder)]).parts[-2:]
    ('b', 'a.png')
    """
    path = PurePath(image)
    parts = path.parts[1:] if path.is_absolute() else path.parts
    tails = [PurePath(*parts[start:]) for start in range(len(parts))]
    places = [folder / tail for folder in folders for tail in tails]
    beside = source.absolute().parent
    places += [Path(path), beside / path, beside.parent / path]
    for place in places:
        if place.is_file():
            return place
    where = f' or in {", ".join(map(str, folders))}' if folders else '; --images says where it is'
    raise ValueError(f'{image} is not there{where}')


def shown_image(result: ImageResult, folders: Sequence[Path] = ()) -> ShownImage:
    """Return the image of a result, and the filtered one if a filter was applied.

    Parameters
    ----------
    result : ImageResult
    folders : sequence of Path
        As for `find_image`.

    Raises
    ------
    ValueError
        If an image is not there, cannot be read, or is not of the size of the result; the message
        names it.
    """
    names = result.images if result.combination else (result.image,)
    images = [_read(name, result, folders) for name in names]
    for name, image in zip(names[1:], images[1:], strict=True):
        if difference := unlike(images[0], image):
            raise ValueError(f'{name} {difference}')
    try:
        stack = ImageStack(tuple(images))
        image = stack.combined(result.combination) if result.combination else images[0]
        filtered = _filtered(image, result) if result.filter.applied else None
    except ValueError as error:
        raise ValueError(f'{result.image}: {error}') from error
    return ShownImage(stretched_to_8_bit(image), filtered)


def _read(name: str, result: ImageResult, folders: Sequence[Path]) -> np.ndarray:
    path = find_image(name, result.source, folders)
    image = read_image(path, upright=result.upright)
    size = image.shape[::-1]
    if result.width and size != (result.width, result.height):
        raise ValueError(
            f'{path} has {size[0]} x {size[1]} px, accepted is the size that the results were '
            f'found at, {result.width} x {result.height} px'
        )
    return image


def _filtered(image: np.ndarray, result: ImageResult) -> np.ndarray:
    used = result.filter
    mapping = FilterSettings(**result.mapping)
    return HomomorphicFilter(image, mapping).filtered(
        used.gamma_high, used.gamma_low, used.cutoff or None, used.attenuation
    )
