"""How far stated confidences can be trusted, and the weights that they rest on.

Scenes under every condition are rendered (`support.pictures.conditions`, for `gsi` and `dots`
`support.pictures.dot_conditions`), and every plausible reading is compared with the truth. The
table shows the reliability of the weights in force by condition. With --fit, logistic regressions
are fitted to the readings instead, and written to the file of fitted weights. With --diagram,
detectors read pictures of three makers where readings begin to fail
(`support.pictures.conditions.pictures`), and the table shows how often what they state is right:
what is reported, and undecoded targets whose likely ID is uncertain, from a confidence of 0.5 on.
`off` is by how much that is more than 3 % and two standard deviations of so many draws away.
With --calibrate, what they state is fitted to such pictures (`ahf_ros.families.dots.calibration`).
Seeds from 101 on are for tests, those below for development.

    python -m benchmarks.confidence [--family ring] [--seeds 101 102]
    python -m benchmarks.confidence --family gsi --fit 1 2 3 4
    python -m benchmarks.confidence --diagram dots gsi [--seeds 101]
    python -m benchmarks.confidence --calibrate 1 2 3
"""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from ahf_ros.base.target import UNDECODED, Target, UndecodedTarget
from ahf_ros.families import DetectorSettings, create_detector
from ahf_ros.families.dots import calibration
from ahf_ros.families.dots import rings as dots
from ahf_ros.families.dots.calibration import KNOTS
from ahf_ros.families.dots.detector import find_rings
from ahf_ros.families.gsi import hypotheses as gsi
from ahf_ros.families.gsi.detector import find_hypotheses as find_gsi_hypotheses
from ahf_ros.families.ring import confidence as ring
from ahf_ros.families.ring.contests import overlapping
from ahf_ros.families.ring.detector import find_hypotheses
from ahf_ros.families.ring.hypotheses import Hypotheses
from ahf_ros.prints.dots import dot_family
from ahf_ros.prints.gsi import point_family
from ahf_ros.prints.ring import RingPrint, canonical
from ahf_ros.scenes.scene import Rendering, render
from ahf_ros.vision.image import as_gray
from ahf_ros.vision.logistic import log_odds, probability
from ahf_ros.vision.pyramid import image_pyramid
from benchmarks import report
from support.pictures.conditions import COMMON, FIRST, FOREIGN, MAKERS, Scene, pictures, scenes
from support.pictures.dot_conditions import dots_scenes, gsi_scenes, with_covered_dots
from support.pictures.textures import lookalikes, rough_image, text_page, weave

NEAR = 5.0
"""Largest distance of a target from its truth, px."""

CLASSES = (0.0, 0.5, 0.9, 0.95, 0.98, 0.99, 0.999, 1.0)
"""Bounds of the classes of confidence in the table."""

COVERED = ('cover', 'cover like paper', 'another target')
"""Conditions under which something lies on targets."""

COVERED_DOTS = 2
"""Targets of GSI in a scene that lack a decoding dot."""

TEXTURES = 6
"""Textured images of a seed, pages of text, and woven fibre, which show no target of GSI."""

NO_TARGETS = 'no targets'
"""Condition of pictures that show none of GSI."""

SIGNS = np.array([-1, 1, -1, -1, 1, -1, -1])
"""Of GSI's weights: margin and edges in place speak for a target, all else against one."""

STATED, ALLOWED = (0.5, 0.7, 0.9, 0.97, 1.0), 0.03
"""Classes of confidence in the diagram, and by how much their shares may be away."""

LOOKALIKES = 40
"""Images of rings of dots that are no targets, for each seed."""

MARGIN, CODED = 0, 1
"""Places of some features."""

RARE = 0.3
"""Weight of a reading of a target under a condition that is not common, in the fit."""

_PRIOR = 1.0  # inverse variance of scaled weights
_ITERATIONS = 3000
_NO_SPREAD = 1e-9
_OF_STEPS, _LEAST_STEP = 2.0, 0.05  # prior deviation and least of steps of odds between knots
_MINIMUM_MARGIN = np.log1p(2.0)  # of readings that count: others are not certain in any case
_HIDDEN, _TRACE = 0.03, -1.4  # share of the band, and feature of arcs, without a trace of covers

Parts = Iterator[tuple[np.ndarray, ...]]
"""Conditions, features and what is right of the readings of one image after the other."""


class Kind(NamedTuple):
    """How the confidences of a family are looked at, and how their weights are fitted.

    Attributes
    ----------
    weights : Path
        The file of fitted weights, in which the set is called `NAME_confidence`, or `confidence`.
    readings : callable
        Yields what is read in the scenes of a seed, in columns: the conditions come first, what is
        right last but for rings, whose covers follow.
    stated, fitted : callable
        Return the confidence of readings, and weights that suit them.
    """

    weights: Path
    readings: Callable[[int], Parts]
    stated: Callable[..., np.ndarray]
    fitted: Callable[..., dict[str, np.ndarray]]


def gathered(readings: Callable[[int], Parts], seeds: Sequence[int]) -> tuple[np.ndarray, ...]:
    """Return the readings of the scenes of some seeds, joined; each seed has a process."""
    with ProcessPoolExecutor(min(len(seeds), os.cpu_count() or 1)) as pool:
        parts = [part for of in pool.map(partial(_listed, readings), seeds) for part in of]
    return tuple(np.concatenate(column) for column in zip(*parts, strict=True))


def _listed(readings: Callable[[int], Parts], seed: int) -> list[tuple[np.ndarray, ...]]:
    return list(readings(seed))


def reliability_table(
    condition: Sequence[str] | np.ndarray, stated: np.ndarray, right: np.ndarray
) -> list[str]:
    """Return the lines of the table of confidences and how often they are right.

    Parameters
    ----------
    condition : sequence of k str
        Under which each reading was made; 'all' stands for all of them at the end.
    stated : ndarray of float, shape (k,)
        Their confidence.
    right : ndarray of bool, shape (k,)
    """
    condition = np.asarray(condition)
    rows = []
    for name in (*dict.fromkeys(condition.tolist()), 'all'):
        here = (condition == name) | (name == 'all')
        for label, (said, was) in _by_class(stated[here], right[here], CLASSES):
            rows.append((name, label, len(said), f'{said.mean():.4f}', f'{was.mean():.4f}'))
    return report.table(
        ('condition', 'confidence', 'readings', 'mean confidence', 'share right'), rows
    )


def _by_class(
    stated: np.ndarray, right: np.ndarray, bounds: Sequence[float]
) -> Iterator[tuple[str, tuple[np.ndarray, np.ndarray]]]:
    """Yield each class of confidence with readings: its bounds, and what is stated and right."""
    for low, high in pairwise(bounds):
        within = (stated >= low) & ((stated < high) | (high == bounds[-1]))
        if within.any():
            yield f'{low} to {high}', (stated[within], right[within])


def ring_readings(seed: int) -> Parts:
    """Yield condition, features, rightness and covers of all plausible readings of each scene."""
    return map(readings_of, scenes(seed))


def readings_of(scene: Scene) -> tuple[np.ndarray, ...]:
    """Return condition, features, rightness and covers of the plausible readings of a scene.

    Those of targets that nobody is asked for are left out.
    """
    code = scene.settings.codes(RingPrint)[0]
    read = find_hypotheses(as_gray(scene.image), scene.settings)
    read = read.select(read.words > 0)
    _, ids = canonical(read.words, code)
    true = [(of.x, of.y, of.id, getattr(of, 'confirmed', True)) for of in scene.truth]
    x, y, number, asked = np.array(true).reshape(-1, 4).T
    near = np.hypot(read.frames[:, :1, 2] - x, read.frames[:, 1:2, 2] - y) < NEAR
    right = (near & (ids[:, None] == number)).any(axis=1)
    seen = near.any(axis=1) | (not scene.others)
    seen &= right | ~_below_right_ones(read, right)
    seen &= ~near[:, asked == 0].any(axis=1)
    condition = np.full(seen.sum(), scene.condition)
    return condition, ring.features(read.select(seen)), right[seen], read.hidden[seen]


def _below_right_ones(read: Hypotheses, right: np.ndarray) -> np.ndarray:
    """Return which readings overlap the target of a right one with a larger margin, bool, (k,).

    These are not reported, whatever their confidence is.
    """
    over, margin = overlapping(read)(np.arange(len(right))), read.margin
    return np.asarray((over & right & (margin > margin[:, None])).any(axis=1))


def rising_regression(
    features: np.ndarray, right: np.ndarray, counts: np.ndarray
) -> tuple[float, np.ndarray]:
    """Return intercept and weights of a logistic regression, none of which is negative.

    Accelerated projected gradients (Nesterov 1983; Beck and Teboulle 2009) find those with the
    highest likelihood under a weak prior.

    Parameters
    ----------
    features : ndarray of float, shape (k, n)
    right : ndarray of bool, shape (k,)
    counts : ndarray of float, shape (k,)
        How often each row counts.
    """
    mean, spread = features.mean(axis=0), features.std(axis=0) + _NO_SPREAD
    basis = np.column_stack([np.ones(len(features)), (features - mean) / spread])
    prior = np.append(0.0, np.full(features.shape[1], _PRIOR))
    steepest = np.linalg.eigvalsh((basis.T * counts / 4) @ basis)[-1] + _PRIOR
    weights = ahead = np.zeros(basis.shape[1])
    momentum = 1.0
    for _ in range(_ITERATIONS):
        stated = probability(np.clip(basis @ ahead, -30, 30))
        gradient = basis.T @ (counts * (stated - right)) + prior * ahead
        after = ahead - gradient / steepest
        after[1:] = np.maximum(after[1:], 0)
        faster = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        ahead = after + (momentum - 1) / faster * (after - weights)
        weights, momentum = after, faster
    slopes = weights[1:] / spread
    return weights[0] - slopes @ mean, slopes


def fitted_to_rings(
    condition: np.ndarray, values: np.ndarray, right: np.ndarray, hidden: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the weights of rings; a cover without a trace cannot be told from the print."""
    no_trace = ~right & np.isin(condition, COVERED) & (hidden < _HIDDEN)
    no_trace &= values[:, CODED] > _TRACE
    used = (values[:, MARGIN] > _MINIMUM_MARGIN) & ~no_trace
    counts = np.where(np.isin(condition, COMMON + FOREIGN), 1.0, RARE)[used]
    intercept, weights = rising_regression(values[used], right[used], counts)
    return {'intercept': np.round([intercept], 3), 'weights': np.round(weights, 3)}


def _gsi_hypotheses(scene: Rendering) -> tuple[np.ndarray, np.ndarray]:
    """Return the features of all hypotheses, and which are right."""
    image, covered = with_covered_dots(scene, COVERED_DOTS)
    found = _found_in(image)
    x, y = (found.homographies[:, :2, 2] / found.homographies[:, 2:, 2]).T
    right = np.zeros(len(found.words), bool)
    for target in scene.targets:
        if target.id not in covered:
            near = np.hypot(x - target.x, y - target.y) < NEAR
            right |= near & (found.words == target.code)
    return found.features, right


def _found_in(image: np.ndarray) -> gsi.Hypotheses:
    """Return the hypotheses of the detector."""
    settings = DetectorSettings(family='gsi')
    pyramid = image_pyramid(image, settings.max_radius)
    return find_gsi_hypotheses(pyramid, settings, point_family())[0]


def gsi_readings(seed: int) -> Parts:
    """Yield condition, features and rightness of the hypotheses of each image."""
    with TemporaryDirectory() as folder:
        for condition, settings in gsi_scenes(seed, Path(folder)):
            features, right = _gsi_hypotheses(render(settings))
            yield np.full(len(right), condition), features, right
    for number, draw in product(range(TEXTURES), (rough_image, text_page, weave)):
        features = _found_in(draw(100 * seed + number)).features
        yield np.full(len(features), NO_TARGETS), features, np.zeros(len(features), bool)


def fitted_to_gsi(
    condition: np.ndarray, features: np.ndarray, right: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the weights of GSI's targets, of which the first one is the intercept.

    Pictures made of what resembles dots are rare.
    """
    counts = np.where(condition == NO_TARGETS, RARE, 1.0)
    intercept, slopes = rising_regression(SIGNS * features, right, counts)
    return {'weights': np.round(np.append(intercept, SIGNS * slopes), 3) + 0.0}


def dots_readings(seed: int) -> Parts:
    """Yield the plausible readings of each image: condition, features, of a target or not, right.

    There are features of a reading as that of a target, and as that of a word.
    """
    for condition, settings in dots_scenes(seed):
        scene = render(settings)
        yield _compared(condition, scene.image, scene.targets if settings.family == 'dots' else ())
    for image in map(lookalikes, range(LOOKALIKES * seed, LOOKALIKES * (seed + 1))):
        yield _compared('lookalikes', image, ())


def _compared(
    condition: str, image: np.ndarray, targets: Sequence[Target]
) -> tuple[np.ndarray, ...]:
    settings, code = DetectorSettings(family='dots'), dot_family()
    pyramid = image_pyramid(as_gray(image), settings.max_radius)
    rings = find_rings(pyramid, settings, code)
    x, y, true = np.array([(it.x, it.y, it.id) for it in targets]).reshape(-1, 3).T
    near = np.hypot(rings.frames[:, :1, 2] - x, rings.frames[:, 1:2, 2] - y) < NEAR
    right = (near & (code.ids(rings.words)[:, None] == true)).any(axis=1)
    features = rings.target_features, rings.word_features
    return np.full(len(right), condition), *features, near.any(axis=1), right


def stated_of_dots(
    _: np.ndarray, of_targets: np.ndarray, of_words: np.ndarray, *__: np.ndarray
) -> np.ndarray:
    """Return the confidence of readings of rings of dots."""
    return dots.target_probability(of_targets) * dots.word_probability(of_words)


def fitted_to_dots(
    _: np.ndarray,
    of_targets: np.ndarray,
    of_words: np.ndarray,
    shown: np.ndarray,
    right: np.ndarray,
) -> dict[str, np.ndarray]:
    """Return the weights of both regressions of rings of dots."""
    return {
        'target': np.round(logistic_regression(of_targets, shown), 2),
        'word': np.round(logistic_regression(of_words[shown], right[shown]), 2),
    }


def logistic_regression(features: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return intercept and weights with the highest likelihood, under a weak prior."""
    mean, spread = features.mean(axis=0), features.std(axis=0)
    basis = np.column_stack([np.ones(len(features)), (features - mean) / spread])
    prior = np.diag([0.0] + [1.0] * features.shape[1])
    weights = np.zeros(basis.shape[1])
    for _ in range(100):
        stated = probability(basis @ weights)
        gradient = basis.T @ (stated - right) + prior @ weights
        curvature = (basis.T * (stated * (1 - stated))) @ basis + prior
        weights -= np.linalg.solve(curvature, gradient)
    slopes = weights[1:] / spread
    return np.concatenate([[weights[0] - slopes @ mean], slopes])


KINDS = {
    'ring': Kind(
        ring.WEIGHTS,
        ring_readings,
        lambda _, values, *__: ring.confidence(values),
        fitted_to_rings,
    ),
    'gsi': Kind(
        gsi.WEIGHTS, gsi_readings, lambda _, values, __: gsi.probability(values), fitted_to_gsi
    ),
    'dots': Kind(dots.WEIGHTS, dots_readings, stated_of_dots, fitted_to_dots),
}
"""The families with fitted confidences."""


def reliability(family: str, seeds: Sequence[int]) -> list[str]:
    """Return the lines of the table of a family, on the scenes of some seeds."""
    kind = KINDS[family]
    columns = gathered(kind.readings, seeds)
    right = columns[2] if family == 'ring' else columns[-1]
    return reliability_table(columns[0], kind.stated(*columns), right)


def write_weights(
    purpose: str,
    arguments: str,
    seeds: Sequence[int],
    weights: Mapping[str, np.ndarray],
    path: Path,
) -> None:
    """Replace one set of a file, and say from which seeds and at which commit it was fitted."""
    sets = json.loads(path.read_text(encoding='utf-8'))
    command = ['git', 'describe', '--always', '--dirty']
    commit = subprocess.run(command, cwd=path.parent, check=True, capture_output=True, text=True)
    sets[purpose].update(
        command=f'python -m benchmarks.confidence {arguments} {" ".join(map(str, seeds))}',
        seeds=list(seeds),
        commit=commit.stdout.strip(),
        **{name: values.tolist() for name, values in weights.items()},
    )
    text = json.dumps(sets, indent=2)
    text = re.sub(r'\[\s+([^]]*?)\s+\]', lambda row: f'[{" ".join(row[1].split())}]', text)
    path.write_text(text + '\n', encoding='utf-8')
    print(f'{path}: {purpose}')


def read(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Return the confidences of the likely IDs of a scene, and which are right, (k,) each."""
    settings = replace(scene.settings, report_undecoded=True)
    found = [
        (it.x, it.y, likely, it.confidence)
        for it in create_detector(settings=settings)(scene.image)
        if (likely := _likely_id(it)) != UNDECODED
    ]
    x, y, ids, stated = np.array(found).reshape(-1, 4).T
    true = np.array([(of.x, of.y, of.id) for of in scene.truth]).reshape(-1, 3)
    near = np.hypot(x[:, None] - true[:, 0], y[:, None] - true[:, 1]) < NEAR
    return stated, (near & (ids[:, None] == true[:, 2])).any(axis=1)


def _likely_id(target: Target) -> int:
    """Return the ID whose probability is the confidence of a target; `UNDECODED` for none."""
    if isinstance(target, UndecodedTarget):
        return target.likely_id if target.reason == 'uncertain' else UNDECODED
    return target.id


def diagram(families: Sequence[str], seeds: Sequence[int]) -> list[str]:
    """Return the lines of the table of families by maker, and of all makers."""
    rows = []
    for family in families:
        makers, stated, right = gathered(partial(of_makers, [family]), seeds)
        for maker in ('all', *MAKERS):
            some = (makers == maker) | (maker == 'all')
            for label, readings in _by_class(stated[some], right[some], STATED):
                rows.append((family, maker, label, *shares(*readings)))
    head = ('family', 'maker', 'confidence', 'readings', 'stated', 'right', 'error', 'off')
    return report.table(head, rows)


def of_makers(families: Sequence[str], seed: int) -> Parts:
    """Yield maker, stated confidences and rightness of the likely IDs in each picture."""
    for family, maker in product(families, MAKERS):
        for scene in pictures(family, maker, seed):
            stated, right = read(scene)
            yield np.full(len(right), maker), stated, right


def calibrated(seeds: Sequence[int]) -> np.ndarray:
    """Return the probabilities of rings of dots at all knots but the last one, shape (3,).

    They have the highest likelihood under a weak prior for those that the detector is sure of, and
    are no higher than these: in photographs by strangers, such are right (`benchmarks.makers`).
    """
    _, stated, right = gathered(partial(of_makers, ['dots']), seeds)
    sure = calibration.sure_of(stated)
    used = (sure > KNOTS[0]) & (sure < KNOTS[-1])
    odds, knots = log_odds(sure[used]), log_odds(KNOTS)

    def values(steps: np.ndarray) -> np.ndarray:
        return np.minimum(knots[-1] - np.append(np.cumsum(steps[::-1])[::-1], 0.0), knots)

    def unlikely(steps: np.ndarray) -> float:
        of = np.interp(odds, knots, values(steps))
        of_prior = ((steps - np.diff(knots)) / _OF_STEPS) ** 2 / 2
        return float((np.logaddexp(0, of) - right[used] * of).sum() + of_prior.sum())

    bounds = [(_LEAST_STEP, None)] * (len(KNOTS) - 1)
    steps = minimize(unlikely, np.diff(knots), bounds=bounds).x
    return np.round(probability(values(steps)[:-1]), 3)


def shares(stated: np.ndarray, right: np.ndarray) -> tuple[int, str, str, str, str]:
    """Return count, mean confidence, share right, its standard deviation, and what is off."""
    mean, share = float(stated.mean()), float(right.mean())
    error = math.sqrt(float((stated * (1 - stated)).sum())) / len(stated)
    off = max(abs(share - mean) - ALLOWED - 2 * error, 0.0)
    shown = f'{math.copysign(off, share - mean):+.3f}' if off else ''
    return len(stated), f'{mean:.3f}', f'{share:.3f}', f'{error:.3f}', shown


def main() -> None:
    """Write weights with --fit, or print their reliability as Markdown."""
    made = report.parser(__doc__)
    made.add_argument('--family', choices=KINDS, default='ring')
    made.add_argument('--fit', type=int, nargs='+', metavar='SEED', help='fit the weights anew')
    made.add_argument('--diagram', nargs='*', choices=FIRST, help='families; all if none is named')
    made.add_argument(
        '--calibrate', type=int, nargs='+', metavar='SEED', help='fit what is stated anew'
    )
    options = report.parsed(made)
    if options.diagram is not None:
        print('\n'.join(diagram(options.diagram or FIRST, options.seeds)))
    elif options.calibrate:
        seeds = options.calibrate
        values = {'values': calibrated(seeds)}
        write_weights('calibration', '--calibrate', seeds, values, calibration.WEIGHTS)
    elif options.fit:
        kind = KINDS[options.family]
        weights = kind.fitted(*gathered(kind.readings, options.fit))
        purpose = 'confidence' if options.family == 'ring' else f'{options.family}_confidence'
        arguments = f'--family {options.family} --fit'
        write_weights(purpose, arguments, options.fit, weights, kind.weights)
    else:
        print('\n'.join(reliability(options.family, options.seeds)))


if __name__ == '__main__':
    main()
