"""Identifications as messages of this package, whatever made the classes of these."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any, Protocol

import numpy as np

from ahf_ros.target import Identification, Target


class MessageTypes(Protocol):
    """The classes of the messages: of the module `ahf_ros.msg`, or from a reader of bags."""

    CodedTarget: Any
    CodedTargetArray: Any
    FilterState: Any


def coded_target_array(
    identification: Identification,
    family: str,
    shape: tuple[int, int],
    header: Any,
    types: MessageTypes,
) -> Any:
    """Return the message of an identification.

    Parameters
    ----------
    identification : Identification
        What was identified.
    family : str
        Name of the family of codes that was looked for.
    shape : tuple of int
        Height and width of the image, px.
    header : std_msgs/Header
        Of the image.
    types : MessageTypes
        What the message is made of.

    Returns
    -------
    CodedTargetArray
        Of `types`.
    """
    height, width = shape
    return types.CodedTargetArray(
        header=header,
        width=width,
        height=height,
        family=family,
        expected=identification.expected,
        estimated=identification.estimated,
        targets=[_coded_target(target, types) for target in identification.targets],
        filter=types.FilterState(**asdict(identification.filter)),
    )


def _coded_target(target: Target, types: MessageTypes) -> Any:
    """Return the message of a target, which may be of a class with more fields than `Target`."""
    values = {item.name: getattr(target, item.name) for item in fields(Target)}
    return types.CodedTarget(**values | {'covariance': np.array(target.covariance)})
