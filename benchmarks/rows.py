"""Rows of benchmarks: a kind of scene, rendered with seeds, identified and scored."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import mean, median
from typing import Any

import cv2
import numpy as np

from ahf_ros.base.target import Target, TrueTarget
from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.identification.session import identify
from ahf_ros.scenes.evaluation import RIGHT, Score, judge, score, total
from ahf_ros.scenes.scene import SceneSettings, render
from benchmarks.report import progress

Truth = Sequence[TrueTarget | Target]

Seen = tuple[Sequence[Target], float]
"""What was identified in an image, and the time that it took, s."""

Identify = Callable[[np.ndarray, str, int], Seen]
"""From an image, the family of its targets and their number."""

Scene = tuple[np.ndarray, Truth]
"""An image, and what it shows."""


@dataclass(frozen=True, slots=True)
class Case:
    """A kind of scene.

    Attributes
    ----------
    group, name : str
        What is varied, and its value.
    make : callable
        Returns image and truth for a seed.
    family : str
        Of the targets.
    """

    group: str
    name: str
    make: Callable[[int], Scene]
    family: str


@dataclass(slots=True)
class Row:
    """What one kind of scene gave.

    Attributes
    ----------
    group, name : str
        What is varied, and its value.
    scores : list of Score
        One an image.
    squares : list of float
        Squared errors of the centres, each in units of its own covariance; 2 on average where
        covariances are right.
    seconds, contours : list of float
        Times of identification, and of the plain search for contours and ellipses, one an image.
    """

    group: str
    name: str
    scores: list[Score] = field(default_factory=list)
    squares: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    contours: list[float] = field(default_factory=list)

    def add(self, image: np.ndarray, truth: Truth, seen: Seen) -> None:
        """Add what was identified in one image."""
        targets, seconds = seen
        self.scores.append(score(truth, targets))
        self.squares += normalised_squares(truth, targets)
        self.seconds.append(seconds)
        self.contours.append(contour_seconds(image))

    def record(self) -> dict[str, Any]:
        """Return the figures as JSON has them."""
        figures = total(self.scores)
        x, y, both = figures.rmse or (None, None, None)
        return {
            'group': self.group,
            'name': self.name,
            'images': len(self.scores),
            'expected': figures.expected,
            'right': figures.right,
            'wrong': figures.wrong,
            'false_positives': figures.false_positives,
            'rmse_x': x,
            'rmse_y': y,
            'rmse_xy': both,
            'nees': mean(self.squares) if self.squares else None,
            'seconds': median(self.seconds),
            'times_contours': median(
                own / plain for own, plain in zip(self.seconds, self.contours, strict=True)
            ),
        }


def rendered(group: str, name: str, settings: SceneSettings) -> Case:
    """Return a case of rendered scenes that differ in their seeds."""

    def make(seed: int) -> Scene:
        rendering = render(replace(settings, seed=seed))
        return rendering.image, rendering.targets

    return Case(group, name, make, settings.family)


def detector(name: str, *, ahf: bool = False) -> Identify:
    """Return identification by a detector of the package, driven by AHF with N given or not."""

    def run(image: np.ndarray, family: str, expected: int) -> Seen:
        made = create_detector(name, settings=DetectorSettings(family=family))
        made(image[:400, :400])  # tables that are made once are not timed
        found = identify(image, detector=made, expected_targets=expected if ahf else 0)
        return found.targets, found.filter.duration

    return run


def measured(
    cases: Sequence[Case], seeds: Sequence[int], methods: Mapping[str, Identify]
) -> Iterator[dict[str, Row]]:
    """Yield the rows of each case, by method: all methods see the same images."""
    for case in progress(cases, 'scenes'):
        rows = {name: Row(case.group, case.name) for name in methods}
        for seed in seeds:
            image, truth = case.make(seed)
            for name, run in methods.items():
                rows[name].add(image, truth, run(image, case.family, len(truth)))
        yield rows


def normalised_squares(truth: Truth, targets: Sequence[Target]) -> list[float]:
    """Return e C^-1 e of the errors e of the right targets that have a covariance C."""
    squares = []
    for verdict, target in zip(judge(truth, targets), targets, strict=True):
        covariance = np.reshape(target.covariance, (2, 2))
        if verdict.kind == RIGHT and verdict.target and np.linalg.det(covariance) > 0:
            error = np.array((target.x - verdict.target.x, target.y - verdict.target.y))
            squares.append(float(error @ np.linalg.solve(covariance, error)))
    return squares


def contour_seconds(image: np.ndarray) -> float:
    """Return the time of the plain search for ellipses: edges, contours, a fit to each."""
    started = time.perf_counter()
    edges = cv2.Canny(image, 50, 150)
    contours, _ = cv2.findContours(edges, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    for contour in contours:
        if len(contour) >= 20:
            cv2.fitEllipse(contour)
    return time.perf_counter() - started
