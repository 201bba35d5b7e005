"""Fields of records and messages, checked; every error names the field."""

from __future__ import annotations

import math
from pathlib import PurePath
from typing import Any

from ahf_ros.text import shown


def parsed_integer(text: Any, name: str, minimum: int, maximum: int) -> int:
    """Return the integer that a text holds, or raise a ValueError that calls it `name`."""
    try:
        number = int(text)
    except (TypeError, ValueError):
        number = None
    if number is None or not minimum <= number <= maximum:
        raise ValueError(
            f'{name} is {shown(text)}, accepted is an integer from {minimum} to {maximum}'
        )
    return number


def parsed_number(text: Any, name: str, minimum: float, maximum: float) -> float:
    """Return the number that a text holds, or raise a ValueError that calls it `name`."""
    try:
        number = float(text)
    except (TypeError, ValueError):
        number = math.nan
    if not minimum <= number <= maximum:
        raise ValueError(
            f'{name} is {shown(text)}, accepted is a number from {minimum:g} to {maximum:g}'
        )
    return number


def checked_file_name(value: Any, name: str) -> str:
    """Return the file name of a path without folders, or raise a ValueError that names it."""
    if not isinstance(value, str) or not PurePath(value).name:
        raise ValueError(f'{name} is {shown(value)}, accepted is the name of a file')
    return PurePath(value).name


def check_rows(message: Any, step: str, minimum: int, row: str) -> None:
    """Raise a ValueError unless a message has the bytes of all its rows.

    Parameters
    ----------
    message : sensor_msgs/Image or sensor_msgs/PointCloud2
    step : str
        Name of the field that holds the distance of two rows, bytes.
    minimum : int
        Bytes that a row takes without padding.
    row : str
        What is in a row, for the error.
    """
    value = getattr(message, step)
    if value < minimum:
        raise ValueError(f'{step} is {value}, accepted is an integer of at least {minimum}: {row}')
    size = message.height * value
    if len(message.data) < size:
        raise ValueError(
            f'data has {len(message.data)} bytes, accepted are at least {size}: '
            f'{message.height} rows of {value} bytes'
        )
