"""Images, truth and results in files."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path, PurePath
from typing import Any

import cv2
import numpy as np

from ahf_ros.interchange.target_json import checked_integer, checked_number, targets_of
from ahf_ros.target import Target, TrueTarget, Truth

SUFFIXES = ('.bmp', '.jpeg', '.jpg', '.png', '.tif', '.tiff')
"""Endings of the image files that are tested; others are tried."""


def read_image(path: str | Path) -> np.ndarray:
    """Return the image in a file as gray values.

    Colour turns to gray, transparency is left out. An orientation that a camera noted in the file
    is not applied: the pixels are those of the sensor.

    Parameters
    ----------
    path : str or Path
        An 8- or 16-bit PNG, JPEG, TIFF or BMP file, or another that OpenCV reads.

    Returns
    -------
    ndarray of uint8, uint16, float32 or float64, shape (height, width)

    Raises
    ------
    ValueError
        If the file is missing, a folder, empty, not readable or not an image; the message names
        it.
    """
    encoded = np.frombuffer(_read(Path(path)), np.uint8)
    if not encoded.size:
        raise ValueError(f'{path} is an empty file, accepted is an image')
    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image = cv2.imdecode(encoded, flags)
    except cv2.error as error:
        raise ValueError(f'{path} cannot be decoded: {error.err}') from error
    if image is None:
        raise ValueError(f'{path} is not an image, or damaged; accepted is {", ".join(SUFFIXES)}')
    return image


def write_image(path: str | Path, image: np.ndarray) -> None:
    """Write an image; the ending of the name chooses the format.

    Parameters
    ----------
    path : str or Path
        The file, replaced where it exists. Its folder is made where it does not exist.
    image : ndarray of uint8 or uint16, shape (height, width) or (height, width, 3)
        Gray values, or colours in the order blue, green, red.

    Raises
    ------
    ValueError
        If the format is unknown or the file cannot be written; the message names it.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f'{path} has an unknown format, accepted is {", ".join(SUFFIXES)}')
    _, encoded = cv2.imencode(path.suffix, image)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(encoded.tobytes())
    except OSError as error:
        raise ValueError(f'{path} cannot be written: {error.strerror}') from error


def read_truth(path: str | Path) -> dict[str, tuple[TrueTarget, ...]]:
    """Return what images show, from a table.

    Parameters
    ----------
    path : str or Path
        CSV file in UTF-8 with a header and the columns image, id, x, y and, if some targets are
        not, confirmed (1 or 0), in any order; others are ignored. Folders before the name of an
        image are left out.

    Returns
    -------
    dict of str to tuple of TrueTarget
        The targets of each image.

    Raises
    ------
    ValueError
        If the file cannot be read or a line is not as described; the message names both.
    """
    rows = csv.DictReader(_text(path).splitlines())
    missing = {'image', 'id', 'x', 'y'} - set(rows.fieldnames or ())
    if missing:
        raise ValueError(f'{path} has no column {", ".join(sorted(missing))}')
    truth: dict[str, list[TrueTarget]] = {}
    images: dict[str, str] = {}
    for row in rows:
        where = f'{path}, line {rows.line_num}'
        target = TrueTarget(
            checked_integer(row['id'], f'{where}: id'),
            checked_number(row['x'], f'{where}: x'),
            checked_number(row['y'], f'{where}: y'),
            checked_integer(row.get('confirmed', 1), f'{where}: confirmed') != 0,
        )
        name = _base_name(row['image'], where)
        if images.setdefault(name, row['image']) != row['image']:
            raise ValueError(f'{where}: {name} is in two folders, accepted is one image a name')
        truth.setdefault(name, []).append(target)
    return {name: tuple(targets) for name, targets in truth.items()}


def write_truth(path: str | Path, truth: Truth) -> None:
    """Write what images show as a table that `read_truth` reads.

    Parameters
    ----------
    path : str or Path
        The file, replaced where it exists.
    truth : mapping of str to sequence of TrueTarget
        The targets of each image; coordinates are written to 0.0001 px.

    Raises
    ------
    ValueError
        If the file cannot be written.
    """
    rows = [['image', 'id', 'x', 'y', 'confirmed']]
    for name, targets in truth.items():
        for item in targets:
            place = [f'{item.x:.4f}', f'{item.y:.4f}']
            rows.append([name, str(item.id), *place, str(int(item.confirmed))])
    try:
        with Path(path).open('w', encoding='utf-8', newline='') as file:
            csv.writer(file, lineterminator='\n').writerows(rows)
    except OSError as error:
        raise ValueError(f'{path} cannot be written: {error.strerror}') from error


def read_results(path: str | Path) -> dict[str, tuple[Target, ...]]:
    """Return what was identified, from what `ahf identify --json` printed.

    Parameters
    ----------
    path : str or Path
        JSON objects, one a line, each with an image and its targets, of which id, x and y are
        needed; empty lines are left out. Standard input where it is '-'.

    Returns
    -------
    dict of str to tuple of Target
        By the name of the image, without folders.

    Raises
    ------
    ValueError
        If the file cannot be read, a line is not as described, or two are about images of the
        same name; the message names both.
    """
    results: dict[str, tuple[Target, ...]] = {}
    text = sys.stdin.read() if path == '-' else _text(path)
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            continue
        where = f'{path}, line {number}'
        try:
            record = json.loads(line)
        except json.JSONDecodeError as error:
            raise ValueError(f'{where} is not JSON: {error.msg}') from error
        targets = tuple(targets_of(record, where))
        name = _base_name(record.get('image'), where)
        if name in results:
            raise ValueError(f'{where}: {name} has appeared before, accepted is one line an image')
        results[name] = targets
    return results


def _text(path: str | Path) -> str:
    try:
        return _read(Path(path)).decode('utf-8-sig')
    except UnicodeDecodeError as error:
        raise ValueError(f'{path} is not in UTF-8, accepted is a text') from error


def _base_name(image: Any, where: str) -> str:
    if not isinstance(image, str) or not PurePath(image).name:
        raise ValueError(f'{where}: image is {image!r}, accepted is the name of a file')
    return PurePath(image).name


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ValueError(f'{path} cannot be read: {error.strerror}') from error
