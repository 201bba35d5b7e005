"""The builder of one identification, which every way in uses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ahf_ros.base.deprecation import deprecated_arguments
from ahf_ros.base.settings.nested import updated
from ahf_ros.base.target import Identification
from ahf_ros.base.text import shown
from ahf_ros.families import (
    AUTO,
    Confirming,
    Contesting,
    Detector,
    Drafter,
    EarlyStopping,
    Expecting,
    Narrowing,
    Refiner,
    check_listed_ids,
    create_detector,
    estimator,
)
from ahf_ros.identification.filtering.identifier import Identifier
from ahf_ros.identification.filtering.trials import DetectorFunction
from ahf_ros.identification.following import Following
from ahf_ros.identification.session_settings import IdentificationSettings
from ahf_ros.identification.settling import SettlingIdentifier
from ahf_ros.vision.stack import ImageStack

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ahf_ros.base.options import IdentificationOptions


@deprecated_arguments(positions=('settings', 'detector'))
def create_identifier(
    *,
    detector: str | DetectorFunction | None = None,
    settings: IdentificationSettings | None = None,
    interrupt: Callable[[], None] | None = None,
    **options: Unpack[IdentificationOptions],
) -> Identifier:
    """Return what identifies one image after the other.

    Parameters
    ----------
    detector : str or callable, optional
        Name of a detector, or a detector of your own: any function from an 8-bit image to a list
        of `Target`. If it is also a `Refiner`, a `Drafter` or `EarlyStopping`, that is used.
        Where None, the detector of the settings.
    settings : IdentificationSettings, optional
        The defaults where None.
    interrupt : callable, optional
        As for `Identifier`.
    **options
        Parameters that differ from `settings`, such as `family`, `expected_targets`, `threads`;
        `ahf_ros.base.options` lists them.

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
    _check_kinds(detector, settings)
    values = dict(options)
    if isinstance(detector, str):
        values['detector'], detector = detector, None
    settings = updated(settings or IdentificationSettings(), values)
    used = detector or create_detector(settings.detector, settings=settings.detection)
    listed = settings.adaptive.listed
    if isinstance(used, Detector) and listed:
        looked_for = settings.detection
        if isinstance(used, Narrowing):
            looked_for = looked_for.narrowed(used.families)
        name = 'expected_ids' if settings.adaptive.wanted else 'network_ids'
        check_listed_ids(name, listed, used.name, looked_for)
    wanted = settings.detection.family
    families = (AUTO, used.family) if isinstance(used, Detector) else (wanted,)
    if settings.estimate_expected and wanted not in families:
        raise ValueError(
            f'family is {wanted!r}, accepted with estimate_expected is that of the detector, '
            f'{families[-1]!r}'
        )
    if isinstance(used, Detector) and isinstance(used, Narrowing) and used.family == AUTO:
        narrowed = partial(_narrowed, used, settings, interrupt)
        return _identifier(
            SettlingIdentifier,
            used,
            settings,
            interrupt,
            kinds={it: settings.detection.prints[it].kind for it in used.families},
            groups=used.groups,
            narrowed=narrowed,
        )
    return _identifier(Identifier, used, settings, interrupt)


def _narrowed(
    detector: Narrowing,
    settings: IdentificationSettings,
    interrupt: Callable[[], None] | None,
    families: tuple[str, ...],
) -> Identifier:
    """Return what identifies the targets of some families; N is estimated where all are rings."""
    used = detector.narrowed(families)
    counted = settings.estimate_expected and used.name == 'ring'
    detection = settings.detection.narrowed(families)
    some = replace(settings, detection=detection, estimate_expected=counted)
    return _identifier(Identifier, used, some, interrupt)


def _identifier(
    kind: type[Identifier],
    used: Detector | DetectorFunction,
    settings: IdentificationSettings,
    interrupt: Callable[[], None] | None,
    **more: Any,
) -> Identifier:
    """Return what identifies with a detector, and with whatever else that can do."""
    listed = settings.adaptive.listed
    if listed and isinstance(used, Detector) and isinstance(used, Expecting):
        used = used.expecting(listed)
    if isinstance(used, Detector) and isinstance(used, Contesting):
        used = used.contesting()
    prints = settings.detection.prints
    return kind(
        used,
        settings.adaptive,
        expected_targets=settings.expected_targets,
        refine=used.refine if isinstance(used, Refiner) else None,
        draft=used.draft if isinstance(used, Drafter) else None,
        estimate=estimator(settings.detection) if settings.estimate_expected else None,
        follow=_following(used, settings) if kind is Identifier else None,
        interrupt=interrupt,
        contested=settings.detection.report_undecoded,
        patience=used.patience if isinstance(used, EarlyStopping) else 0,
        mirrored=lambda it: prints[it.family].mirrored(it.code) if it.family in prints else None,
        name=f'detector {used.name!r}' if isinstance(used, Detector) else 'detector',
        looked_for=used.family if isinstance(used, Detector) else '',
        prints=prints,
        **more,
    )


def _following(used: Any, settings: IdentificationSettings) -> Following | None:
    """Return what follows the targets of a detector, None if every image is searched wholly."""
    every = settings.detection.report_undecoded
    if not settings.follow or every or not isinstance(used, Confirming):
        return None
    prints = settings.detection.prints
    return Following(used, used.confirm, prints, settings.follow)  # type: ignore[arg-type]


@deprecated_arguments(positions=('detector', 'settings'))
def identify(
    image: np.ndarray | ImageStack,
    *,
    detector: str | DetectorFunction | None = None,
    settings: IdentificationSettings | None = None,
    **options: Unpack[IdentificationOptions],
) -> Identification:
    """Identify the coded targets of one image, or of several images of an unmoved scene.

    Parameters
    ----------
    image : ndarray of uint8, uint16, float32 or float64, shape (height, width), or ImageStack
        Gray values, increasing with light.
    detector, settings, **options
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
    >>> scene = render(SceneSettings(width=320, height=240, targets=3, dot_radius=8))
    >>> found = identify(scene.image, expected_targets=3)
    >>> [target.id for target in found] == [target.id for target in scene.targets]
    True
    """
    options.setdefault('follow', 0)  # no image comes next
    return create_identifier(detector=detector, settings=settings, **options).identify(image)


def _check_kinds(detector: object, settings: object) -> None:
    """Refuse what is neither a detector nor settings of an identification."""
    if not (detector is None or isinstance(detector, str) or callable(detector)):
        raise ValueError(
            f'detector is {shown(detector)}, accepted is the name of a detector or a function '
            'from an image to targets; settings are given as '
            'settings=IdentificationSettings(...), or one by one, such as family=...'
        )
    if not (settings is None or isinstance(settings, IdentificationSettings)):
        raise ValueError(
            f'settings is {shown(settings)}, accepted is an IdentificationSettings; a detector is '
            'given as detector=..., and DetectorSettings as '
            'settings=IdentificationSettings(detection=...)'
        )
