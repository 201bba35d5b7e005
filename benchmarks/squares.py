"""Square markers read by this package, by OpenCV and by AprilTag's own detector.

Centres of the others are the intersections of the diagonals between their corners, OpenCV's after
its sub-pixel refinement. Photographs have no truth: a row says how many markers each finds, and,
where a photograph shows a plane grid of markers whose IDs count along its rows, the RMS distance
of the centres that all such readers find from the grid, under a homography and radial distortion.
The usual grid is the AprilGrid of 6 x 6 markers that Kalibr prints.
pupil-apriltags is left out where it is not installed. Seeds from 101 on are for tests.

    python -m benchmarks.squares [--seeds 301 302] [--photographs FOLDER]
        [--grid COLUMNSxROWS] [--output FILE]
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.optimize import least_squares

from ahf_ros.scenes.evaluation import score
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks import report
from benchmarks.report import number
from support.square_readers import FAMILY, readers

SCENES: dict[str, dict[str, Any]] = {
    'even light': {},
    'tilt 45 deg': {'tilt': 45.0},
    'edges +0.5 px': {'edge_shift': 0.5},
    'edges -0.5 px': {'edge_shift': -0.5},
    'blur 1.5 px': {'blur': 1.5},
    'dim, noisy': {'exposure': 40.0},
    'side 24 px': {'dot_radius': 5.0},
    'stripe 0.3': {'light': 'stripe'},
    'stripe 0.12': {'light': 'stripe', 'ambient': 0.12},
    'lattice 0.3': {'light': 'lattice'},
}


def in_scenes(seeds: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Render scenes and yield what each reader finds in them."""
    found = readers()
    for name, changes in report.progress(SCENES.items(), 'scenes', len(SCENES)):
        usual: dict[str, Any] = {'width': 1600, 'height': 1200, 'targets': 20, 'dot_radius': 12.0}
        usual |= {'family': FAMILY} | changes
        scenes = [render(SceneSettings(**usual | {'seed': seed})) for seed in seeds]
        for reader, read in found.items():
            start = time.perf_counter()
            results = [read(shown.image) for shown in scenes]
            duration = time.perf_counter() - start
            figures = [score(*pair) for pair in zip(scenes, results, strict=True)]
            errors = np.array([error for of in figures for error in of.errors]).reshape(-1, 2)
            yield {
                'scene': name,
                'reader': reader,
                'expected': sum(of.expected for of in figures),
                'right': sum(of.right for of in figures),
                'wrong': sum(of.wrong + of.false_positives for of in figures),
                'rms': float(np.sqrt((errors**2).sum(axis=1).mean())) if len(errors) else None,
                'seconds': duration / len(scenes),
            }


def photographed(folder: Path, columns: int, rows: int) -> Iterator[dict[str, Any]]:
    """Yield how many markers each reader finds in the photographs of a folder, and its RMS, px."""
    of_grid = frozenset(range(columns * rows))
    found = readers()
    for path in sorted(path for path in folder.iterdir() if path.suffix in ('.jpg', '.png')):
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        assert image is not None, path
        read = {name: {it.id: (it.x, it.y) for it in of(image)} for name, of in found.items()}
        grids = {name: of for name, of in read.items() if of_grid.issuperset(of) and len(of) > 12}
        common = sorted(set.intersection(*map(set, grids.values()))) if grids else []
        row: dict[str, Any] = {'scene': path.name}
        for name, places in read.items():
            seen = np.array([places[number] for number in common]) if name in grids else None
            shape = image.shape[0], image.shape[1]
            rms = None if seen is None else grid_rms(np.array(common), columns, seen, shape)
            row |= {name: len(places), f'{name}, RMS, px': number(rms, 3)}
        yield row


def grid_rms(ids: np.ndarray, columns: int, places: np.ndarray, shape: tuple[int, int]) -> float:
    """Return the RMS distance per coordinate, px, of centres (n, 2) from a grid of markers."""
    row, column = np.divmod(ids, columns)
    grid = np.stack([column, row], axis=1) - (columns - 1) / 2
    middle, size = (np.array(shape[::-1]) - 1) / 2, shape[1] / 2
    aim = (places - middle) / size
    first, _ = cv2.findHomography(grid, aim)

    def errors(unknowns: np.ndarray) -> np.ndarray:
        plane = np.append(unknowns[:8], 1).reshape(3, 3)
        seen = np.column_stack([grid, np.ones(len(grid))]) @ plane.T
        seen = seen[:, :2] / seen[:, 2:] - unknowns[10:]
        squares = (seen**2).sum(axis=1, keepdims=True)
        seen *= 1 + squares * (unknowns[8] + squares * unknowns[9])
        return ((seen + unknowns[10:] - aim) * size).ravel()

    fitted = least_squares(errors, np.r_[(first / first[2, 2]).ravel()[:8], 0, 0, 0, 0])
    return float(np.sqrt((fitted.fun**2).mean()))


def markdown(figures: report.Report) -> str:
    """Return the report as tables."""
    columns: dict[str, report.Column] = {
        'scene': 'scene',
        'reader': 'reader',
        'right': lambda row: f'{row["right"]} of {row["expected"]}',
        'wrong, false': 'wrong',
        'RMS, px': ('rms', 4),
        'ms': lambda row: number(1000 * row['seconds'], 0),
    }
    lines = [report.about_text(figures), '', *report.record_table(figures['rows'], columns)]
    if photographs := figures.get('photographs'):
        lines += ['', *report.record_table(photographs, {name: name for name in photographs[0]})]
    return '\n'.join(lines)


def measure(options: argparse.Namespace) -> report.Report:
    """Return what readers find in scenes, and in photographs where a folder is given."""
    figures: report.Report = {'rows': list(in_scenes(options.seeds))}
    if options.photographs:
        columns, rows = map(int, options.grid.split('x'))
        figures['photographs'] = list(photographed(options.photographs, columns, rows))
    return figures


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and print."""
    made = report.parser(__doc__)
    made.add_argument('--photographs', type=Path, help='a folder of photographs of tag36h11')
    made.add_argument('--grid', default='6x6', help='its columns and rows; default: %(default)s')
    return report.run(made, measure, markdown, arguments)


if __name__ == '__main__':
    sys.exit(main())
