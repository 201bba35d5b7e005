"""The records of `ahf_ros.target` from and to the messages of this package."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from std_msgs.msg import Header

from ahf_ros import msg, target
from ahf_ros.interchange import target_messages
from ahf_ros.msg import CodedTarget, CodedTargetArray


def coded_target_array(
    identification: target.Identification, family: str, shape: tuple[int, int], header: Header
) -> CodedTargetArray:
    """Return the message of an identification.

    Parameters
    ----------
    identification : Identification
        What was identified.
    family : str
        Name of the family of codes that was looked for.
    shape : tuple of int
        Height and width of the image, px.
    header : std_msgs.msg.Header
        Of the image.
    """
    return target_messages.coded_target_array(identification, family, shape, header, msg)


def identification(message: CodedTargetArray) -> target.Identification:
    """Return the identification that a message carries."""
    return target.Identification(
        tuple(_target(item) for item in message.targets),
        message.expected,
        target.FilterState(**_values(target.FilterState, message.filter)),
        message.estimated,
    )


def _target(message: CodedTarget) -> target.Target:
    values = _values(target.Target, message)
    values['covariance'] = tuple(values['covariance'].tolist())
    return target.Target(**values)


def _values(record: type, source: Any) -> dict[str, Any]:
    """Return the values that `source` has for the fields of a record."""
    return {item.name: getattr(source, item.name) for item in fields(record)}
