"""Pictures of bent sheets, ray by ray.

Each pixel has `_SAMPLES` x `_SAMPLES` rays. Each meets a sheet or what is behind, where light and
print are evaluated; where it meets the edge of ink, the ink is that of as many finer rays. Lens,
defocus and motion blur these samples, their mean is a pixel, and then the sensor adds noise. Light
is added before the curve of sRGB.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from ahf_ros.base.blas import one_blas_thread
from ahf_ros.base.target import Target, sorted_targets
from ahf_ros.scenes.bent import exposure
from ahf_ros.scenes.bent.grain import Grain
from ahf_ros.scenes.bent.ink import inked
from ahf_ros.scenes.bent.lens import Lens
from ahf_ros.scenes.bent.light import Light, drawn_light, surface_light
from ahf_ros.scenes.bent.scene import (
    Printed,
    PrintedSheet,
    around,
    bounds,
    drawn_lens,
    drawn_sheets,
)
from ahf_ros.scenes.bent.settings import BentSettings

_SAMPLES = 4  # rays per pixel along each axis, and finer ones per ray at edges of ink
_STRIP = 64  # rows of pixels at a time, to bound the memory
_BEHIND = 1.15  # distance of what is behind, in distances of the sheets
_COARSE = 6.0  # size of the unevenness of paper over that of toner
_NOWHERE = 1e6  # place of rays that miss the sheet, mm: no ink is there


@dataclass(frozen=True, slots=True, eq=False)
class BentRendering:
    """A picture of bent sheets, and its truth.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width)
        The photograph.
    targets : tuple of Target
        Sorted by `id`: the projected physical centres. Ellipses are those of the dots in the
        plane that touches the sheet.
    lens : Lens
        The lens of the camera.
    settings : BentSettings
        The settings of the picture.
    """

    image: np.ndarray
    targets: tuple[Target, ...]
    lens: Lens
    settings: BentSettings


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """All that a ray may meet."""

    settings: BentSettings
    lens: Lens
    light: Light
    sheets: list[PrintedSheet]
    grain: Grain


@one_blas_thread()
def render_bent(settings: BentSettings) -> BentRendering:
    """Return the photograph of bent sheets; equal settings give equal images.

    Examples
    --------
    >>> some = BentSettings(width=400, height=300, targets=2, sheets=1, dot_radius=10)
    >>> rendering = render_bent(some)
    >>> rendering.image.shape, len(rendering.targets)
    ((300, 400), 2)
    """
    streams = np.random.SeedSequence(settings.seed).spawn(5)
    setup, lamp, paper, shake, noise = map(np.random.default_rng, streams)
    lens = drawn_lens(settings, setup)
    sheets, targets = drawn_sheets(settings, lens, setup)
    scene = _Scene(
        settings, lens, drawn_light(settings, lamp), sheets, Grain(settings.grain_size, paper)
    )
    direction = shake.uniform(0, math.pi)
    shape, gaussian = exposure.spread(
        settings.blur, settings.confusion, settings.motion, direction, _SAMPLES
    )
    margin = math.ceil((len(shape) + len(gaussian)) / 2 / _SAMPLES) + 1
    white = exposure.light_of_grey(settings.exposure) / (1 + settings.ambient)
    image = np.empty((settings.height, settings.width), np.uint8)
    for top in range(0, settings.height, _STRIP):
        bottom = min(top + _STRIP, settings.height)
        seen = _samples(scene, top - margin, bottom + margin, margin)
        seen = cv2.filter2D(seen, -1, shape)
        seen = cv2.sepFilter2D(seen, -1, gaussian, gaussian)
        inner = slice(margin * _SAMPLES, -margin * _SAMPLES)
        size = settings.width, bottom - top
        light = cv2.resize(seen[inner, inner], size, interpolation=cv2.INTER_AREA)
        light *= exposure.vignette(
            settings.width, settings.height, np.arange(top, bottom), settings.vignetting
        )
        image[top:bottom] = exposure.exposed(
            light * np.float32(white), settings.full_well, settings.read_noise, noise
        )
    return BentRendering(image, tuple(sorted_targets(targets)), lens, settings)


def _samples(scene: _Scene, top: int, bottom: int, margin: int) -> np.ndarray:
    """Return the light of the rays of rows of pixels and of a margin to the left and right.

    It has the shape (rows * `_SAMPLES`, columns * `_SAMPLES`), float32.
    """
    left, right = -margin, scene.settings.width + margin
    columns, rows = np.meshgrid(
        np.arange(left - 1, right + 1, dtype=float), np.arange(top - 1, bottom + 1, dtype=float)
    )
    x, y = scene.lens.rays(columns, rows)
    seen = _finer(_behind(scene, x, y))
    for printed in scene.sheets:
        first, last = printed.window[0], printed.window[2]
        above, below = max(printed.window[1], top), min(printed.window[3], bottom)
        if first >= last or above >= below:
            continue
        inside = (slice(above - top, below - top + 2), slice(first - left, last - left + 2))
        _add_sheet(
            seen[
                (above - top) * _SAMPLES : (below - top) * _SAMPLES,
                (first - left) * _SAMPLES : (last - left) * _SAMPLES,
            ],
            scene,
            printed,
            (first, above, last, below),
            _finer(x[inside]),
            _finer(y[inside]),
        )
    return seen


def _finer(values: np.ndarray) -> np.ndarray:
    """Interpolate pixels at their samples, without the pixels of the border."""
    size = values.shape[1] * _SAMPLES, values.shape[0] * _SAMPLES
    fine = cv2.resize(values, size, interpolation=cv2.INTER_LINEAR)
    return fine[_SAMPLES:-_SAMPLES, _SAMPLES:-_SAMPLES]


def _behind(scene: _Scene, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the light of the plane behind the sheets in each pixel, float32."""
    settings = scene.settings
    distance = _BEHIND * settings.distance
    points = _points(x, y, np.full_like(x, distance))
    normals = np.zeros_like(points)
    normals[2] = -1
    scattered, _ = surface_light(scene.light, points, normals, 0.0, 1.0)
    uneven = scene.grain.at(points[0], points[1], part=3, coarser=_COARSE)
    reflected: np.ndarray = scattered * (1 + np.float32(settings.texture) * uneven)
    return reflected * np.float32(settings.background)


def _add_sheet(
    seen: np.ndarray,
    scene: _Scene,
    printed: PrintedSheet,
    window: tuple[int, int, int, int],
    x: np.ndarray,
    y: np.ndarray,
) -> None:
    """Put the light of a sheet into the samples of a window of pixels, where rays meet it."""
    settings, sheet = scene.settings, printed.sheet
    width, height, distance = sheet.places(x, y)
    met = sheet.holds(width, height)
    width, height = np.where(met, width, _NOWHERE), np.where(met, height, _NOWHERE)
    if not met.any():
        return
    share = np.zeros(x.shape, np.float32)
    for target in printed.prints:
        _add_ink(share, scene, printed, target, window, width, height)
    width, height, distance, share = width[met], height[met], distance[met], share[met]
    scattered, mirrored = surface_light(
        scene.light,
        _points(x[met], y[met], distance),
        sheet.normals(width, height),
        settings.gloss,
        settings.roughness,
    )
    toner = 1 + np.float32(settings.grain) * scene.grain.at(width, height)
    paper = scene.grain.at(width, height, part=1, coarser=_COARSE)
    reflectance = 1 - share * toner * np.float32(1 - settings.black)
    reflectance *= 1 + np.float32(settings.texture) * paper
    seen[met] = scattered * np.clip(reflectance, 0, 1.2) + mirrored


def _points(x: np.ndarray, y: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Return the points, float32, shape (3, ...), where rays (x, y, 1) are at a distance."""
    return np.stack((x * distance, y * distance, distance)).astype(np.float32)


def _add_ink(
    share: np.ndarray,
    scene: _Scene,
    printed: PrintedSheet,
    target: Printed,
    window: tuple[int, int, int, int],
    width: np.ndarray,
    height: np.ndarray,
) -> None:
    """Write the share of each sample of a window that a target inks into `share`."""
    size = scene.settings.width, scene.settings.height
    left, top, right, bottom = bounds(printed.sheet, scene.lens, around(target), *size)
    left, right = max(left, window[0]), min(right, window[2])
    top, bottom = max(top, window[1]), min(bottom, window[3])
    if left >= right or top >= bottom:
        return
    inside = (
        slice((top - window[1]) * _SAMPLES, (bottom - window[1]) * _SAMPLES),
        slice((left - window[0]) * _SAMPLES, (right - window[0]) * _SAMPLES),
    )
    ink = _ink(scene, target, width[inside], height[inside]).astype(np.uint8)
    around_each = np.ones((3, 3), np.uint8)
    edge = cv2.dilate(ink, around_each) != cv2.erode(ink, around_each)
    of_target = ink.astype(np.float32)
    rows, columns = np.nonzero(edge)
    if len(rows):
        fine = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
        offsets_y, offsets_x = (it.ravel() for it in np.meshgrid(fine, fine, indexing='ij'))
        x, y = scene.lens.rays(
            left - 0.5 + (columns[:, None] + offsets_x) / _SAMPLES,
            top - 0.5 + (rows[:, None] + offsets_y) / _SAMPLES,
        )
        finer_width, finer_height, _ = printed.sheet.places(x, y)
        of_target[edge] = _ink(scene, target, finer_width, finer_height).mean(axis=1)
    share[inside] += of_target


def _ink(scene: _Scene, target: Printed, width: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Return whether places on a sheet have the ink of a target, whose edges are ragged."""
    if ragged := np.float32(scene.settings.ragged):
        width = width + ragged * scene.grain.at(width, height, part=1)
        height = height + ragged * scene.grain.at(width, height, part=2)
    return inked(target.contours, *target.own(width, height))
