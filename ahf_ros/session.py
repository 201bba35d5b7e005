"""The builder of one identification, which every way in uses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ahf_ros.codes.families import mirrored_number
from ahf_ros.detectors import (
    Detector,
    DetectorSettings,
    Discerning,
    Drafter,
    Expecting,
    Refiner,
    check_expected_ids,
    create_detector,
    estimator,
)
from ahf_ros.filtering.identifier import Identifier
from ahf_ros.filtering.trials import DetectorFunction
from ahf_ros.imaging.stack import ImageStack
from ahf_ros.session_settings import IdentificationSettings
from ahf_ros.settings.nested import updated
from ahf_ros.target import Identification, Target


def create_identifier(
    settings: IdentificationSettings | None = None,
    detector: str | DetectorFunction | None = None,
    *,
    interrupt: Callable[[], None] | None = None,
    **values: Any,
) -> Identifier:
    """Return what identifies one image after the other.

    Parameters
    ----------
    settings : IdentificationSettings, optional
        The defaults where None.
    detector : str or callable, optional
        Name of a detector, or a detector of your own: any function from an 8-bit image to a list
        of `Target`. If it is also a `Refiner`, a `Drafter` or `Discerning`, that is used.
    interrupt : callable, optional
        As for `Identifier`.
    **values
        Parameters that differ from `settings`, such as `family`, `expected_targets`, `threads`.

    Raises
    ------
    ValueError
        If a value is not accepted or does not fit the others.

    Examples
    --------
    >>> from ahf_ros import SceneSettings, create_identifier, render
    >>> scene = SceneSettings(width=320, height=240, targets=3, dot_radius=8, family='aicon12')
    >>> identifier = create_identifier(family='aicon12', expected_targets=3)
    >>> identifier.identify(render(scene).image).count
    3
    """
    if isinstance(detector, str):
        values, detector = values | {'detector': detector}, None
    settings = updated(settings or IdentificationSettings(), values)
    used = detector or create_detector(settings.detector, settings.detection)
    listed = settings.adaptive.listed
    if isinstance(used, Detector) and listed:
        check_expected_ids(listed, used.name, settings.detection)
        used = used.expecting(listed) if isinstance(used, Expecting) else used
    estimate = None
    if settings.estimate_expected:
        _check_family(used, settings.detection)
        estimate = estimator(settings.detection)
    return Identifier(
        used,
        settings.adaptive,
        expected_targets=settings.expected_targets,
        refine=used.refine if isinstance(used, Refiner) else None,
        draft=used.draft if isinstance(used, Drafter) else None,
        estimate=estimate,
        interrupt=interrupt,
        patience=used.patience if isinstance(used, Discerning) else 0,
        mirrored=_mirrored_id,
        name=f'detector {used.name!r}' if isinstance(used, Detector) else 'detector',
    )


def identify(
    image: np.ndarray | ImageStack,
    detector: str | DetectorFunction | None = None,
    settings: IdentificationSettings | None = None,
    **values: Any,
) -> Identification:
    """Identify the coded targets of one image, or of several images of an unmoved scene.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width), or ImageStack
        Gray values, increasing with light.
    detector, settings, **values
        As for `create_identifier`.

    Returns
    -------
    Identification

    Raises
    ------
    ValueError
        If the image or a value is not accepted.

    Examples
    --------
    >>> from ahf_ros import SceneSettings, identify, render
    >>> rendering = render(SceneSettings(width=320, height=240, targets=3, dot_radius=8))
    >>> found = identify(rendering.image, expected_targets=3)
    >>> [it.id for it in found.targets] == [it.id for it in rendering.targets]
    True
    """
    return create_identifier(settings, detector, **values).identify(image)


def _mirrored_id(target: Target) -> int | None:
    """Return the ID that a target has in a mirror, None if that is unknown."""
    return mirrored_number(target.family, target.code)


def _check_family(detector: DetectorFunction, settings: DetectorSettings) -> None:
    """Refuse to count targets of another family than that of the detector."""
    if isinstance(detector, Detector) and detector.family != settings.family:
        raise ValueError(
            f'family is {settings.family!r}, accepted with estimate_expected is that of the '
            f'detector, {detector.family!r}'
        )
