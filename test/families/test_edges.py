"""Square markers placed by the edges of their print."""

import cv2
import numpy as np
import pytest

from ahf_ros.families.square.edges import fit_markers
from ahf_ros.families.square.frames import SQUARE, Places, centres
from ahf_ros.vision.image import GAMMA

CORNERS = np.array([[60.3, 50.7], [160.9, 58.2], [152.4, 161.6], [55.1, 149.3]])
NEAR = np.array([[1.2, -0.7], [-1.1, 0.9], [0.6, 1.3], [-0.8, -1.0]])
"""What corners are off by before they are fitted, px."""

INK = np.pad([[0, 0, 1, 1], [1, 0, 1, 1], [0, 0, 0, 0], [1, 1, 0, 1]], 1, constant_values=1) > 0
"""The print of ID 7 of `aruco_4x4_50`."""

WIDTH, HEIGHT, SCALE = 220, 210, 8


def plane() -> np.ndarray:
    """Return where the samples of an image are on the marker, in sides, (height, width, 2)."""
    columns, rows = ((np.arange(of * SCALE) + 0.5) / SCALE - 0.5 for of in (WIDTH, HEIGHT))
    view = cv2.getPerspectiveTransform(CORNERS.astype(np.float32), SQUARE.astype(np.float32))
    samples = np.stack(np.meshgrid(columns, rows), axis=2)
    return cv2.perspectiveTransform(samples, view)


def photographed(ink: np.ndarray, light: np.ndarray | float = 200.0) -> np.ndarray:
    """Return gray values, as a camera would blur them, where there is ink or not."""
    fine = np.where(ink, np.float32(0.25**GAMMA), np.float32(1))
    shown = cv2.resize(fine, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    gray = cv2.GaussianBlur(shown, (0, 0), 0.7) ** (1 / GAMMA)
    return (gray * light).astype(np.float32)


def drawn(light: np.ndarray | float = 200.0, grown: float = 0.0) -> np.ndarray:
    """Return gray values of a marker whose ink has grown, by a length in px."""
    cells = np.floor((plane() + 0.5) * len(INK)).astype(int) + 1
    column, row = np.clip(cells, 0, len(INK) + 1).transpose(2, 0, 1)
    ink = np.pad(INK, 1)[row, column].astype(np.uint8)
    spread = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, [2 * round(abs(grown) * SCALE) + 1] * 2)
    return photographed((cv2.dilate if grown > 0 else cv2.erode)(ink, spread) > 0, light)


def fitted_to(gray: np.ndarray, corners: np.ndarray = CORNERS + NEAR) -> Places:
    return fit_markers(gray, corners[None], INK[None])


def centre_error(fitted: Places) -> float:
    return np.abs(centres(fitted.corners) - centres(CORNERS[None])).max()


def test_corners_and_centre() -> None:
    fitted = fitted_to(drawn())
    assert np.abs(fitted.corners[0] - CORNERS).max() < 0.03
    assert centre_error(fitted) < 0.01
    assert fitted.edge_shift[0] == pytest.approx(0, abs=0.05)
    assert fitted.share[0] > 0.95
    assert np.linalg.eigvalsh(fitted.covariance[0]).min() > 0
    assert np.trace(fitted.covariance[0]) < 0.01**2


@pytest.mark.parametrize('shift', [-1.0, -0.4, 0.5, 1.0])
def test_edges_that_moved_are_known_and_move_neither_corners_nor_centres(shift: float) -> None:
    fitted = fitted_to(drawn(grown=shift))
    assert fitted.edge_shift[0] == pytest.approx(shift, abs=0.1)
    assert np.abs(fitted.corners[0] - CORNERS).max() < 0.1
    assert centre_error(fitted) < 0.02


@pytest.mark.parametrize('side', range(4))
@pytest.mark.parametrize('cut', [(0.5, 0.9), (0.9, 0.2)], ids=str)
def test_paper_that_covers_a_side_is_not_taken_for_it(side: int, cut: tuple[float, float]) -> None:
    # The edge of the paper runs within the border, so many cells inside the side at its ends.
    first, last = SQUARE[side], SQUARE[(side + 1) % 4]
    inwards = (SQUARE[(side + 2) % 4] - last) / len(INK)
    ends = np.stack([first + cut[0] * inwards, last + cut[1] * inwards])
    place = CORNERS.copy()
    view = cv2.getPerspectiveTransform(SQUARE.astype(np.float32), CORNERS.astype(np.float32))
    place[[side, (side + 1) % 4]] = seen = cv2.perspectiveTransform(ends[None], view)[0]
    along = seen[1] - seen[0]
    rows, columns = np.indices((HEIGHT, WIDTH))
    outside = along[0] * (rows - seen[0, 1]) - along[1] * (columns - seen[0, 0])
    covered = np.clip(0.5 - outside / np.linalg.norm(along), 0, 1)
    gray = drawn() * (1 - covered) + 200 * covered
    assert centre_error(Places.unmeasured(place[None])) > 2
    fitted = fitted_to(gray.astype(np.float32), place)
    assert centre_error(fitted) < 0.05
    assert np.trace(fitted.covariance[0]) < 0.05**2


def test_several_at_once_are_those_one_by_one() -> None:
    starts = np.stack([CORNERS + NEAR, CORNERS - NEAR])
    both = fit_markers(drawn(), starts, np.stack([INK, INK]))
    for start, corners in zip(starts, both.corners, strict=True):
        # BLAS may round batches of another size otherwise.
        assert fitted_to(drawn(), start).corners[0] == pytest.approx(corners, abs=1e-6)
    assert len(fit_markers(drawn(), np.zeros((0, 4, 2)), INK[None][:0]).corners) == 0


@pytest.mark.parametrize('angle', [20, 45, 70, 110])
def test_edges_of_light_that_cross_the_marker_do_not_move_it(angle: int) -> None:
    rows, columns = np.indices((HEIGHT, WIDTH))
    across = columns * np.cos(np.radians(angle)) + rows * np.sin(np.radians(angle))
    light = np.where(across % 37 < 18, 200.0, 70.0)
    assert centre_error(fitted_to(drawn(light=light))) < 0.03


def test_a_slope_of_the_light_does_not_move_the_centre() -> None:
    light = 40.0 + np.indices((HEIGHT, WIDTH))[1] * 0.9
    assert centre_error(fitted_to(drawn(light=light))) < 0.01


def test_where_no_marker_is_places_stay_as_they_are() -> None:
    noise = np.random.default_rng(1).normal(120, 3, (HEIGHT, WIDTH)).astype(np.float32)
    for gray, corners in (
        (noise, CORNERS),
        (255 - drawn(), CORNERS),
        (drawn(), CORNERS + 500),
        (drawn(), CORNERS / 10),
    ):
        fitted = fitted_to(gray, corners)
        assert fitted.share[0] == 0
        assert (fitted.corners[0] == corners).all()
