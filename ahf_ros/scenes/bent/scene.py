"""Where sheets and their targets are before the camera; the truth of a picture."""

import math
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np

from ahf_ros.base.target import Target
from ahf_ros.prints.designs import Contour, circle, contours
from ahf_ros.scenes.bent.lens import Lens
from ahf_ros.scenes.bent.settings import BentSettings, sheet_grid
from ahf_ros.scenes.bent.sheet import Sheet
from ahf_ros.scenes.layout import fitting_grid
from ahf_ros.scenes.scene import drawn_numbers

_OFF_MIDDLE = 0.01  # of the principal point, in image widths
_STEP = 1e-3  # of numerical derivatives, mm
_OUTLINE = 32  # points that bound a circle on a sheet


@dataclass(frozen=True, slots=True, eq=False)
class Printed:
    """A target on a sheet: its centre on it, mm, its turn, rad, and its outlines.

    The outlines have the length `scale`, mm, as their unit, and stay within `reach` of these.
    """

    centre: tuple[float, float]
    turn: float
    contours: tuple[Contour, ...]
    scale: float
    reach: float

    def own(self, width: np.ndarray, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y in the design, where y points up, of places on the sheet."""
        right = (width - self.centre[0]) / self.scale
        up = (self.centre[1] - height) / self.scale
        cosine, sine = math.cos(self.turn), math.sin(self.turn)
        return right * cosine + up * sine, up * cosine - right * sine


@dataclass(frozen=True, slots=True, eq=False)
class PrintedSheet:
    """A sheet, what is printed on it, and the pixels that bound it: left, top, right, bottom."""

    sheet: Sheet
    prints: tuple[Printed, ...]
    window: tuple[int, int, int, int]


def drawn_lens(settings: BentSettings, generator: np.random.Generator) -> Lens:
    """Return a lens whose principal point is at random near the middle of the image."""
    x, y = generator.uniform(-_OFF_MIDDLE, _OFF_MIDDLE, 2) * settings.width
    return Lens(
        focal=settings.focal_pixels,
        principal=((settings.width - 1) / 2 + x, (settings.height - 1) / 2 + y),
        k1=settings.distortion,
        p1=settings.tangential_1,
        p2=settings.tangential_2,
    )


def drawn_sheets(
    settings: BentSettings, lens: Lens, generator: np.random.Generator
) -> tuple[list[PrintedSheet], list[Target]]:
    """Return sheets at random places, bent and turned at random, and their targets."""
    numbers = drawn_numbers(settings, generator)
    middles = _middles(settings, generator)
    sheets, targets = [], []
    for index, pixel in enumerate(middles):
        on_sheet = numbers[index :: settings.sheets]
        sheet = _drawn_sheet(settings, lens, pixel, len(on_sheet), generator)
        prints = []
        for number, centre in zip(on_sheet, _centres(settings, len(on_sheet)), strict=True):
            printed, code = _printed(settings, number, centre, generator)
            prints.append(printed)
            targets.append(_target(settings, lens, sheet, printed, number, code))
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * sheet.half_size
        sides = [np.linspace(a, b, _OUTLINE) for a, b in pairwise(corners)]
        window = bounds(sheet, lens, np.concatenate(sides), settings.width, settings.height)
        sheets.append(PrintedSheet(sheet, tuple(prints), window))
    return sheets, targets


def facing_axes(ray: np.ndarray) -> np.ndarray:
    """Return unit vectors in columns: z along a direction, x to the right, y down."""
    z = ray / np.linalg.norm(ray)
    x = np.cross((0.0, 1.0, 0.0), z)
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(z, x), z))


def bounds(
    sheet: Sheet, lens: Lens, places: np.ndarray, width: int, height: int
) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of the pixels that show what places on a sheet bound."""
    pixels = lens.project(sheet.points(*places.T))
    low, high = np.floor(pixels.min(axis=0)) - 2, np.ceil(pixels.max(axis=0)) + 3
    left, top = np.clip(low, 0, (width, height)).astype(int).tolist()
    right, bottom = np.clip(high, 0, (width, height)).astype(int).tolist()
    return left, top, right, bottom


def around(printed: Printed) -> np.ndarray:
    """Return places on the sheet that bound a print, shape (n, 2)."""
    return _circle(printed, printed.reach)


def _circle(printed: Printed, radius: float) -> np.ndarray:
    angles = np.linspace(0, 2 * math.pi, _OUTLINE, endpoint=False)
    circle = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    # the polygon bounds the circle
    return printed.centre + circle * (radius * printed.scale / math.cos(math.pi / _OUTLINE))


def _middles(settings: BentSettings, generator: np.random.Generator) -> np.ndarray:
    """Return the pixels of the middles of all sheets, one in each of the cells of a grid."""
    reach = settings.sheet_reach(settings.on_sheet)
    grid = fitting_grid(settings.width, settings.height, reach, settings.sheets)
    cells = generator.permutation(grid[0] * grid[1])[: settings.sheets]
    corners = np.stack((cells % grid[0], cells // grid[0]), axis=1)
    size = np.array([settings.width, settings.height]) / grid
    inside = reach + generator.uniform(0, 1, (settings.sheets, 2)) * (size - 2 * reach)
    return corners * size + inside - 0.5


def _drawn_sheet(
    settings: BentSettings,
    lens: Lens,
    pixel: np.ndarray,
    count: int,
    generator: np.random.Generator,
) -> Sheet:
    """Return a sheet for so many targets with its middle in a pixel."""
    nearness = 1 + settings.radius_spread * generator.uniform(-1, 1)
    lean = math.radians(settings.lean) * math.sqrt(generator.uniform())
    about, roll, turn = generator.uniform(0, 2 * math.pi, 3)
    ratio = settings.bend_ratio ** generator.uniform()
    side = generator.choice((-1.0, 1.0))
    x, y = (it.item() for it in lens.rays(pixel[:1], pixel[1:]))
    ray = np.array([x, y, 1.0])
    facing = facing_axes(ray)
    across = np.array([math.cos(about), math.sin(about), 0.0]) * lean
    tilted, _ = cv2.Rodrigues(across)
    rolled, _ = cv2.Rodrigues(np.array([0.0, 0.0, roll]))
    columns, rows = sheet_grid(max(count, 1))
    return Sheet(
        middle=ray * settings.distance / nearness,
        axes=(facing @ tilted @ rolled).T,
        curvature=float(side / (settings.bend_radius * ratio)),
        half_size=(columns * settings.cell / 2, rows * settings.cell / 2),
        print_turn=float(turn),
    )


def _centres(settings: BentSettings, count: int) -> list[tuple[float, float]]:
    """Return the centres of targets on a sheet, mm, row by row."""
    columns, rows = sheet_grid(max(count, 1))
    places = [(column, row) for row in range(rows) for column in range(columns)][:count]
    return [
        (settings.cell * (x - (columns - 1) / 2), settings.cell * (y - (rows - 1) / 2))
        for x, y in places
    ]


def _printed(
    settings: BentSettings,
    number: int,
    centre: tuple[float, float],
    generator: np.random.Generator,
) -> tuple[Printed, int]:
    """Return a target that is printed, turned at random, and its code word."""
    design, common = settings.print.design, settings.proportions
    word = design.word(number)
    outlines, reach = contours(design.ink(word, common.pinhole)), common.reach
    if not settings.dark:
        reach = common.quiet_zone
        outlines = (circle(reach), *outlines)
    turn = float(generator.uniform(0, 2 * math.pi))
    return Printed(centre, turn, outlines, settings.printed_radius, reach), word


def _target(
    settings: BentSettings, lens: Lens, sheet: Sheet, printed: Printed, number: int, code: int
) -> Target:
    """Return the truth: the image of the centre, and the ellipse that its derivative gives."""
    steps = np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]]) * _STEP + printed.centre
    pixels = lens.project(sheet.points(*steps.T))
    jacobian = np.stack((pixels[1] - pixels[2], pixels[3] - pixels[4]), axis=1) / (2 * _STEP)
    radius = settings.proportions.radius * printed.scale
    directions, lengths, _ = np.linalg.svd(jacobian * radius)
    angle = math.atan2(directions[1, 0], directions[0, 0])
    if not -math.pi / 2 < angle <= math.pi / 2:
        angle -= math.copysign(math.pi, angle)
    x, y = pixels[0].tolist()
    major, minor = lengths.tolist()
    return Target(number, code, x, y, major, minor, angle, family=settings.family)
