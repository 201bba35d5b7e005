"""What is usual of lenses: weak observations of their parameters beside the photographs.

All parameters of a camera are estimated together, however much they correlate: a parameter that
is left out takes what it explains to others, and no covariance knows of it. What photographs do
not determine is held by what is usual of lenses, whose variance enters the covariance of all
results [1]_, [2]_.

References
----------
.. [1] Förstner & Wrobel, Photogrammetric Computer Vision, Springer 2016, 4.2.7 and 15.4.
.. [2] Luhmann et al., Close-Range Photogrammetry and 3D Imaging, 3rd ed. 2019, 4.4 and 7.3.
"""

import numpy as np

from ahf_ros.network.camera import PARAMETERS, known_calibration, parameters_of
from ahf_ros.network.image_points import Layout
from ahf_ros.network.network import CameraView, FloatArray, IntArray, Network
from ahf_ros.network.solution import NetworkState

USUAL = {
    'k1': 0.2,
    'k2': 0.2,
    'k3': 0.2,
    'p1': 0.003,
    'p2': 0.003,
    'affinity': 0.001,
    'shear': 0.001,
}
"""Standard deviations of what lenses have, about zero or what is given."""

FOCAL_LENGTH = 0.05
"""Relative standard deviation of a focal length that is given: makers round it."""

UNKNOWN_FOCAL_LENGTH = 0.5
"""The same of a focal length that is only an approximate value."""

OFF_CENTRE = 0.02
"""Standard deviation of a principal point about the centre, in widths of the image."""

UNDETERMINED = 0.03
"""Standard deviation over the focal length that says nothing of it."""

_FAR = 5.0  # standard deviations of what is unlike what was given, or usual
_SQUARE = 2e-4  # affinity and shear that pixels do not have
_ROLLED = np.deg2rad(60)  # between photographs that separate the principal point from poses
_FACING = 0.5  # cosine between the axes of photographs whose roll is compared
_COMPARED = 100  # photographs of a camera whose roll is compared, spread evenly


def usual_deviations(view: CameraView, focal_length: float) -> dict[str, float]:
    """Return the standard deviations of what is usual of a camera, in the order of its parameters.

    Its focal length in px counts where none is given.
    """
    given, off = known_calibration(view)[0], OFF_CENTRE * max(view.width, view.height)
    f = FOCAL_LENGTH * given if np.isfinite(given) else UNKNOWN_FOCAL_LENGTH * focal_length
    usual = {**USUAL, 'k4': USUAL['k3'], '': 0.0}
    known = {'f': float(f), 'cx': off, 'cy': off}
    return {name: known.get(name) or usual[name] for name in parameters_of(view)}


def usual(
    network: Network, layout: Layout, approximate: FloatArray | None = None
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return columns (c,), usual values and standard deviations of free parameters of lenses.

    What is given of a camera is usual of it. A focal length that is not given is near its
    approximate value in `approximate` (cameras, parameters), or left open without one.
    """
    focal = np.full(len(network.cameras), np.nan) if approximate is None else approximate[:, 0]
    middles = np.array([known_calibration(view) for view in network.cameras])
    middles[:, 0] = np.where(np.isfinite(middles[:, 0]), middles[:, 0], focal)
    sigmas = np.array(
        [list(usual_deviations(*it).values()) for it in zip(network.cameras, focal, strict=True)]
    )
    columns = layout.columns
    known = (columns >= 0) & np.isfinite(middles)
    return columns[known], middles[known], sigmas[known]


def undetermined(
    network: Network, layout: Layout, state: NetworkState, rest: FloatArray
) -> tuple[str, ...]:
    """Return warnings of cameras whose focal length is as uncertain as it was before."""
    column = layout.columns[:, 0]
    sigma = np.sqrt(np.pad(np.diag(rest), (0, 1))[column])
    return tuple(
        f'camera {network.cameras[place].name}: these photographs do not determine the focal '
        'length; take some tilted by 30 to 45 degrees against each other, or give a calibration'
        for place in np.flatnonzero(sigma > UNDETERMINED * np.abs(state.calibrations[:, 0]))
    )


def unlike_given(network: Network, calibrations: FloatArray) -> tuple[str, ...]:
    """Return warnings of cameras whose focal length is far from the one that was given."""
    return tuple(
        f'camera {view.name}: its focal length is {found:.0f} px, and {view.focal_length:.0f} px '
        'was given. Check Exif data, --focal-length and the size of the images'
        for view, found in zip(network.cameras, calibrations[:, 0], strict=True)
        if view.focal_length and abs(found / view.focal_length - 1) > _FAR * FOCAL_LENGTH
    )


def unlike_pixels(
    network: Network, layout: Layout, state: NetworkState, rest: FloatArray
) -> tuple[str, ...]:
    """Return warnings of cameras whose affinity or shear is larger than that of any sensor.

    The camera of DBAT's `camcal` is one: with its portraits as a camera of their own, sigma0 falls
    from 1.28 to 0.74, and the principal points are 32 px apart.
    """
    places = [PARAMETERS.index(name) for name in ('affinity', 'shear')]
    found = np.where(layout.free[:, places], state.calibrations[:, places], 0.0)
    sigma = np.sqrt(np.pad(np.diag(rest), (0, 1))[layout.columns[:, places]])
    large = (np.abs(found) > _SQUARE) & (np.abs(found) > _FAR * sigma)
    return tuple(
        f'camera {network.cameras[camera].name}: affinity {found[camera, 0]:.5f} and shear '
        f'{found[camera, 1]:.5f} are more than those of any sensor. They fit the photographs, but '
        'may stand for a lens that moves between them. If it was rolled, give photographs in '
        'landscape and in portrait as two cameras, and compare sigma0'
        for camera in np.flatnonzero(large.any(axis=1))
    )


def rolled(rotations: FloatArray) -> bool:
    """Return whether photographs (n, 3, 3) that look alike are rolled by 60 degrees or more."""
    finite = rotations[np.isfinite(rotations).all(axis=(1, 2))]
    if len(finite) < 2:
        return False
    some = finite[np.unique(np.linspace(0, len(finite) - 1, _COMPARED).astype(int))]
    relative = np.einsum('aij,bkj->abik', some, some)
    roll = np.arctan2(
        relative[..., 1, 0] - relative[..., 0, 1], relative[..., 0, 0] + relative[..., 1, 1]
    )
    return bool(((relative[..., 2, 2] > _FACING) & (np.abs(roll) > _ROLLED)).any())
