"""Identifications as messages of this package, whatever made the classes of these."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Protocol

import numpy as np

from ahf_ros.target import Identification


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
    targets = []
    for target in identification.targets:
        values = asdict(target)
        values['covariance'] = np.array(target.covariance)
        targets.append(types.CodedTarget(**values))
    return types.CodedTargetArray(
        header=header,
        width=width,
        height=height,
        family=family,
        expected=identification.expected,
        estimated=identification.estimated,
        targets=targets,
        filter=types.FilterState(**asdict(identification.filter)),
    )
