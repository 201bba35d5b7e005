"""Function calls, a cost that depends neither on the machine nor on versions of what is installed.

    python -m support.calls [NAME ...] [--update]

identifies a small image with each detector, and prints the calls beside the recorded ones;
`--update` records them. `test/test_calls.py` holds the package to the record.
"""

import argparse
import json
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import cv2
import numpy as np

import ahf_ros
from ahf_ros import create_identifier
from ahf_ros.scenes.scene import SceneSettings, render
from support import ROOT

RECORD = ROOT / 'test' / 'calls.json'
TOLERANCE = 0.05
"""Share of the recorded calls, by which they may differ: last bits decide on single candidates."""

_PACKAGE = str(Path(ahf_ros.__file__).parent)
_INLINED = {'<listcomp>', '<setcomp>', '<dictcomp>', '<genexpr>'}


def calls_of(work: Callable[[], object]) -> int:
    """Return how many functions the package's own lines call in this thread.

    These are the functions and methods of the package, those of C that its lines call, and public
    functions of Python elsewhere that its lines call. What those call in turn is not counted, as
    it differs between versions of numpy, and neither are private functions, by which numpy passes
    calls on, nor comprehensions and generator expressions, which Python 3.12 has inlined, nor
    classes, of which some are written in C. Universal functions of numpy and operators are no
    calls in any version.
    """
    count = 0
    kinds: dict[CodeType, int] = {}

    def kind_of(code: CodeType) -> int:
        """Return 1 for a function of the package, -1 for a public one elsewhere, else 0."""
        kind = kinds.get(code)
        if kind is None:
            own = code.co_filename.startswith(_PACKAGE)
            kind = 1 if own else -1 if code.co_name[:1] not in '_<' else 0
            kinds[code] = kind
        return kind

    def counted(frame: FrameType, event: str, _argument: Any) -> None:
        nonlocal count
        if event == 'c_call':
            count += kind_of(frame.f_code) == 1
        elif event == 'call' and frame.f_code.co_name not in _INLINED:
            kind, before = kind_of(frame.f_code), frame.f_back
            count += kind == 1 or bool(
                kind == -1 and before is not None and kind_of(before.f_code) == 1
            )

    before = sys.getprofile()
    sys.setprofile(counted)
    try:
        work()
    finally:
        sys.setprofile(before)
    return count


def scene(family: str, dot_radius: float, **settings: Any) -> np.ndarray:
    """Return an image of four targets, and of some marks that are none."""
    usual = dict(width=480, height=360, targets=4, distractors=4, seed=3)
    return render(
        SceneSettings(family=family, dot_radius=dot_radius, **{**usual, **settings})
    ).image


def page() -> np.ndarray:
    """Return a page of letters, which no version of OpenCV draws in another way."""
    letters = np.unpackbits(np.array(_LETTERS, np.uint8)[:, None], axis=1)[:, 1:-1]
    letters = letters.reshape(-1, 7, 6)
    order = np.random.RandomState(1).randint(0, len(letters), (2, 6))  # the same for ever
    lines = letters[order].transpose(0, 2, 1, 3).reshape(2, 7, -1)
    ink = np.pad(lines, ((0, 0), (1, 2), (0, 0))).reshape(-1, lines.shape[2])
    return _photograph(np.kron(225.0 - 180.0 * ink, np.ones((3, 3))))


def texture() -> np.ndarray:
    """Return a texture of grains of two sizes."""
    drawn = np.random.RandomState(2).randint(0, 256, (2, 64, 80)).astype(np.float64)
    fine, coarse = cv2.GaussianBlur(drawn[0], (0, 0), 1.2), cv2.GaussianBlur(drawn[1], (0, 0), 4.0)
    return np.clip(2 * fine + 6 * coarse - 900, 0, 255).astype(np.uint8)


def room() -> np.ndarray:
    """Return what a photograph of an empty room shows: surfaces in a gradient of light."""
    y, x = np.mgrid[:360, :480] / 360.0
    walls = np.where(x + 0.2 * y < 0.6, 90.0, np.where(y > 0.7 + 0.1 * x, 50.0, 150.0))
    walls[60:180, 300:400] = 215.0  # a window
    walls[220:330, 120:170] = 30.0  # a cupboard
    return _photograph(walls * (0.6 + 0.4 * x))


def _photograph(gray: np.ndarray) -> np.ndarray:
    """Return gray values as a camera sees them, blurred and with noise."""
    noise = np.random.RandomState(3).standard_normal(gray.shape)
    return np.clip(cv2.GaussianBlur(gray, (0, 0), 0.7) + noise, 0, 255).astype(np.uint8)


_LETTERS = [
    *(0x38, 0x44, 0x44, 0x7C, 0x44, 0x44, 0x44),  # A
    *(0x44, 0x44, 0x44, 0x7C, 0x44, 0x44, 0x44),  # H
    *(0x7C, 0x40, 0x40, 0x78, 0x40, 0x40, 0x40),  # F
    *(0x78, 0x44, 0x44, 0x78, 0x50, 0x48, 0x44),  # R
    *(0x38, 0x44, 0x44, 0x44, 0x44, 0x44, 0x38),  # O
    *(0x38, 0x44, 0x40, 0x38, 0x04, 0x44, 0x38),  # S
    *(0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00),
]
"""Rows of letters of five by seven pixels, and of a space."""

Image = Callable[[], np.ndarray]
_RING = {'light': 'stripe', 'ambient': 0.3}

IMAGES: dict[str, tuple[dict[str, Any], Image]] = {
    'ring': ({'family': 'metashape12'}, partial(scene, 'metashape12', 12.0)),
    'ring, stripes': ({'family': 'metashape12'}, partial(scene, 'metashape12', 12.0, **_RING)),
    'ring, followed': (
        {'family': 'metashape12', 'follow': 30},
        partial(scene, 'metashape12', 12.0),
    ),
    'traditional': (
        {'family': 'metashape12', 'detector': 'traditional'},
        partial(scene, 'metashape12', 12.0),
    ),
    'aruco': ({'family': 'aruco_4x4_50'}, partial(scene, 'aruco_4x4_50', 12.0)),
    'apriltag': ({'family': 'apriltag_36h11'}, partial(scene, 'apriltag_36h11', 14.0)),
    'gsi': ({'family': 'gsi'}, partial(scene, 'gsi', 4.0)),
    'gsi_published': ({'family': 'gsi', 'detector': 'gsi_published'}, partial(scene, 'gsi', 4.0)),
    'dots': ({'family': 'dots'}, partial(scene, 'dots', 12.0)),
    'dots_published': (
        {'family': 'dots', 'detector': 'dots_published'},
        partial(scene, 'dots', 12.0),
    ),
    'cctag': ({'family': 'cctag3'}, partial(scene, 'cctag3', 20.0)),
    'auto': ({'family': 'auto'}, partial(scene, 'metashape12', 12.0)),
    'auto, page': ({'family': 'auto'}, page),
    'auto, texture': ({'family': 'auto'}, texture),
    'auto, room': ({'family': 'auto'}, room),
}
"""Options of the identifier and its image, by name."""


def calls_for(name: str) -> tuple[int, int]:
    """Return the calls that the identification of an image takes, and its targets."""
    options, image = IMAGES[name]
    shown = image()
    identifier = create_identifier(**{'follow': 0, 'threads': 1, **options})
    identifier.identify(shown ^ 1)  # modules are imported, tables made; the noise is another one
    found: list[Any] = []
    calls = calls_of(lambda: found.append(identifier.identify(shown)))
    return calls, len(found[0].targets)


def main() -> None:
    """Print the calls of images, and record them where that is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n\n')[0])
    parser.add_argument('names', nargs='*', metavar='NAME', help='default: all')
    parser.add_argument('--update', action='store_true', help='record the calls')
    options = parser.parse_args()
    record = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    for name in options.names or IMAGES:
        calls, targets = calls_for(name)
        before = record.get(name, {}).get('calls')
        change = f'{100 * (calls / before - 1):+.1f} %' if before else ''
        print(f'{name:16s} {targets:3d} targets {calls:9,d} calls {change}')
        record[name] = {'calls': calls, 'targets': targets}
    if options.update:
        some = {name: record[name] for name in IMAGES if name in record}
        RECORD.write_text(json.dumps(some, indent=1) + '\n')


if __name__ == '__main__':
    main()
