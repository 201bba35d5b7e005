"""The page: one HTML file with everything in it, written picture by picture.

What it knows about each image is a row of numbers and texts, ready for JSON.
"""

import math
import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2

from ahf_ros.base.doubt import DOUBTFUL_BELOW, doubt
from ahf_ros.base.edge_shift import edge_shift_remark
from ahf_ros.base.opening import parsing
from ahf_ros.base.settings.parameter import check_parameters, parameter
from ahf_ros.base.target import (
    UNDECODED,
    DottedTarget,
    SquareMarker,
    Target,
    TrueTarget,
    Truth,
    UndecodedTarget,
    count_codes,
)
from ahf_ros.base.text import printable, reason_of
from ahf_ros.base.writing import whole_file
from ahf_ros.families.contract import DetectorSettings
from ahf_ros.files.html_pages import page_script, page_style, page_template, script_json
from ahf_ros.prints.families import AUTO, prints_in
from ahf_ros.scenes.evaluation import FALSE, RIGHT, WRONG, judge
from ahf_ros.views.advice import LOOKED_AT, advice
from ahf_ros.views.report.images import Picture, fitted, shown_image, thumbnail
from ahf_ros.views.report.results import ImageResult

_PAGE = Path(__file__).parent / 'page'  # the template, and the styles and scripts that it holds
_SCRIPTS = ('data', 'table', 'viewer', 'plots', 'details', 'overview', 'main')  # in their order
_MAXIMUM_UNREAD = 300  # dots of an image without any likely code word that are shown
_MAXIMUM_PICTURE = 4_000_000  # bytes
_MINIMUM_PICTURE = 2_000
_FILTERED_WEIGHT = 0.6  # of the bytes of an original
_MARKUP = 600  # bytes around the pictures of an image
_THUMBNAIL = 4_000  # bytes of its text
_GAINS = 'gamma_high', 'gamma_low', 'cutoff', 'attenuation'


@dataclass(frozen=True, slots=True)
class ReportSettings:
    """What a report shows, and how large it may be."""

    title: str = parameter('', 'Title of the page; empty: the names of the results.')
    max_size: float = parameter(
        55.0,
        'Maximum size of the page, MB. Pictures are reduced to fit; results alone may take more.',
        minimum=0.1,
        maximum=2000.0,
    )
    doubtful_below: float = parameter(
        DOUBTFUL_BELOW,
        'Confidence below which an identified target counts as doubtful.',
        minimum=0.0,
        maximum=1.0,
    )
    threads: int = parameter(
        0, 'Number of images that are read at a time; 0: one per core.', minimum=0, maximum=1024
    )

    def __post_init__(self) -> None:
        """Check every parameter."""
        check_parameters(self)


def row(
    result: ImageResult,
    families: Sequence[str],
    doubtful_below: float,
    truth: Sequence[TrueTarget] | None = None,
    advised: Sequence[str] = (),
) -> dict[str, Any]:
    """Return what the page knows about an image; `truth` is what it shows, `advised` what helps.

    Targets have the indices of their families, and are doubtful below a confidence.
    """
    decoded = [target for target in result.targets if target.id != UNDECODED]
    undecoded = [target for target in result.targets if target.id == UNDECODED]
    likely = [target for target in undecoded if _reason(target) != 'unread']
    unread = [target for target in undecoded if _reason(target) == 'unread']
    unread.sort(key=lambda target: -target.semi_major)
    identified = count_codes(decoded)
    known = _known_ids(result, truth)
    judged = None if truth is None else _judged(truth, decoded)
    missed = sorted(known - result.identified) if known is not None else []
    if judged:
        missed = sorted(number for number, _, _ in judged['missed'])
    expected = len(known) if known else result.expected
    return {
        'image': printable(result.image, len(result.image)),
        'images': [printable(it, len(it)) for it in result.images],
        'combination': result.combination,
        'width': result.width,
        'height': result.height,
        'family': result.family,
        'detector': result.detector,
        'expected': expected,
        'estimated': result.estimated,
        'mirrored': result.mirrored,
        'edges': edge_shift_remark(result.edge_shift),
        'advice': list(advised),
        'identified': identified,
        'missed': len(missed) if known is not None else max(0, expected - identified),
        'missedIds': missed,
        'unexpectedIds': sorted(result.identified - known) if known is not None else [],
        'doubtful': len(likely) + sum(it.confidence < doubtful_below for it in decoded),
        'doubts': sorted({doubt(target, result.detector) for target in decoded} - {''}),
        'unread': len(unread),
        'seconds': round(result.filter.duration, 3),
        'filter': _filter(result),
        'search': _search(result),
        'targets': [_target(target, families) for target in decoded],
        'dots': [_dots(target) for target in decoded if isinstance(target, DottedTarget)],
        'squares': [_square(target) for target in decoded if isinstance(target, SquareMarker)],
        'undecoded': [_undecoded(target) for target in [*likely, *unread[:_MAXIMUM_UNREAD]]],
        'truth': judged,
    }


def families_of(results: Sequence[ImageResult]) -> list[str]:
    """Return the names of the families of all targets, the most frequent first."""
    counts = Counter(target.family for result in results for target in result.targets)
    return [name for name, _ in counts.most_common() if name]


def _reach(name: str, results: Sequence[ImageResult]) -> float:
    """Return the radius of the targets of a family, in semi-axes of their ellipses."""
    usual = prints_in(AUTO).get(name)  # other programs do not say it
    told = (result.reach[name] for result in results if name in result.reach)
    return next(told, round(usual.reach, 4) if usual else 1.0)


def _known_ids(result: ImageResult, truth: Sequence[TrueTarget] | None) -> frozenset[int] | None:
    """Return the IDs that the image is known to show, None if only their number is known."""
    if truth is not None:
        return frozenset(target.id for target in truth if target.confirmed)
    return frozenset(result.expected_ids) if result.expected_ids else None


def _reason(target: Target) -> str:
    return target.reason if isinstance(target, UndecodedTarget) else 'unread'


def _place(target: Target) -> list[float]:
    angle = round(math.degrees(target.angle), 2)
    axes = round(target.semi_major, 2), round(target.semi_minor, 2)
    return [round(target.x, 3), round(target.y, 3), *axes, angle]


def _target(target: Target, families: Sequence[str]) -> list[float]:
    """Return ID, place, confidence, standard deviations and family of a target."""
    deviations = [_significant(math.sqrt(max(0.0, target.covariance[i]))) for i in (0, 3)]
    family = families.index(target.family) if target.family else -1
    return [target.id, *_place(target), round(target.confidence, 6), *deviations, family]


def _undecoded(target: Target) -> list[Any]:
    """Return place, confidence, reason and the likely ID of an undecoded target."""
    likely = target.likely_id if isinstance(target, UndecodedTarget) else UNDECODED
    return [*_place(target), round(target.confidence, 4), _reason(target), likely]


def _dots(target: DottedTarget) -> dict[str, Any]:
    ellipses = [
        [*(round(length, 2) for length in dot[:4]), round(math.degrees(dot[4]), 1)]
        for dot in target.dots
    ]
    return {'id': target.id, 'template': target.template_dots, 'ellipses': ellipses}


def _square(target: SquareMarker) -> dict[str, Any]:
    corners = [[round(x, 2), round(y, 2)] for x, y in target.corners]
    return {'id': target.id, 'corners': corners}


def _filter(result: ImageResult) -> dict[str, Any] | None:
    used = result.filter
    state: dict[str, Any] = {'applied': used.applied, 'evaluations': used.evaluations}
    if used.applied:
        state |= {name: _significant(getattr(used, name)) for name in _GAINS}
    return state


def _search(result: ImageResult) -> dict[str, Any] | None:
    if result.search is None:
        return None
    columns = asdict(result.search)
    for name in _GAINS:
        columns[name] = [_significant(value) for value in columns[name]]
    return columns


def _judged(truth: Sequence[TrueTarget], decoded: Sequence[Target]) -> dict[str, Any]:
    """Return which targets are right and wrong, errors of the right ones, and what is missed."""
    verdicts = judge(truth, decoded)
    right = {verdict.target for verdict in verdicts if verdict.kind == RIGHT}
    errors = [
        [index, round(decoded[index].x - it.target.x, 4), round(decoded[index].y - it.target.y, 4)]
        for index, it in enumerate(verdicts)
        if it.kind == RIGHT and it.target is not None
    ]
    missed = [it for it in truth if it.confirmed and it not in right]
    return {
        'wrong': [index for index, it in enumerate(verdicts) if it.kind in (WRONG, FALSE)],
        'errors': errors,
        'missed': [[it.id, round(it.x, 2), round(it.y, 2)] for it in missed],
    }


def _significant(value: float) -> float:
    return float(f'{value:.5g}')


def write_page(
    path: Path,
    results: Sequence[ImageResult],
    settings: ReportSettings,
    title: str,
    truth: Truth | None = None,
    folders: Sequence[Path] = (),
    track: Callable[[Iterable[Any]], Iterable[Any]] = iter,
) -> list[str]:
    """Write the page of results to a file that is never there in part.

    The settings may have another title. The truth is by the names of images without folders, which
    may be in other `folders` now, see `find_image`. `track` follows the images as they are done.
    The texts that are returned say what is wrong with images. A ValueError says so if the file
    cannot be written, or jinja2 is not installed.
    """
    template = page_template(_PAGE, 'page.html')
    families = families_of(results)
    rows = []
    empty = [result for result in results if not result.identified][:LOOKED_AT]
    for result in results:
        shown = None if truth is None else truth.get(Path(result.image).name)
        advised = _advice(result, folders) if result in empty else []
        rows.append(script_json(row(result, families, settings.doubtful_below, shown, advised)))
    about = {
        'families': families,
        'reach': [_reach(name, results) for name in families],
        'doubtfulBelow': settings.doubtful_below,
        'maxSize': settings.max_size,
    }
    style = page_style(_PAGE, 'style.css')
    script = page_script(_PAGE, _SCRIPTS)
    taken = sum(map(len, rows)) + len(style) + len(script)
    limits = _limits(round(1e6 * settings.max_size) - taken, results)
    problems: dict[int, str] = {}

    def pictures_of(index: int) -> dict[str, Picture]:
        try:
            return _pictures(results[index], limits[index], folders)
        except ValueError as error:
            problems[index] = str(error)
        except (MemoryError, cv2.error) as error:  # the other images may be smaller
            problems[index] = f'{results[index].image}: {reason_of(error)}'
        return {}

    executor = ThreadPoolExecutor(settings.threads or os.cpu_count())
    try:
        with whole_file(path) as file:
            for text in template.generate(
                title=settings.title or title,
                style=style,
                script=script,
                rows=rows,
                about=script_json(about),
                pictures=enumerate(track(executor.map(pictures_of, range(len(results))))),
                # known when all are done
                problems=lambda: script_json(dict(sorted(problems.items()))),
            ):
                file.write(text.encode('utf-8', 'backslashreplace'))
    finally:
        executor.shutdown(cancel_futures=True)
    return [problems[index] for index in sorted(problems)]


def _advice(result: ImageResult, folders: Sequence[Path]) -> list[str]:
    """Return what may help with an image in which nothing was identified."""
    # An image that is not there, or cannot be shown, is named with its picture.
    with suppress(ValueError), parsing(result.image, 'an image that can be shown'):
        wanted = DetectorSettings(family=result.family)
        return advice(shown_image(result, folders)[0], wanted, result.expected)
    return []


def _limits(available: int, results: Sequence[ImageResult]) -> list[int]:
    """Return the bytes for the pictures of each image."""
    weights = [1 + _FILTERED_WEIGHT * result.filter.applied for result in results]
    texts = available - len(weights) * (_MARKUP + _THUMBNAIL)
    share = texts * 3 / 4 / sum(weights)  # base64 makes four bytes of three
    share = min(max(share, _MINIMUM_PICTURE), _MAXIMUM_PICTURE)
    return [int(share * weight) for weight in weights]


def _pictures(result: ImageResult, limit: int, folders: Sequence[Path]) -> dict[str, Picture]:
    """Return the pictures of an image by what they are; the large ones fit into the limit."""
    with parsing(result.image, 'an image that can be shown'):
        original, filtered = shown_image(result, folders)
        pictures = {'thumbnail': thumbnail(original)}
        if filtered is None:
            pictures['original'] = fitted(original, limit)
        else:
            part = int(limit / (1 + _FILTERED_WEIGHT))
            pictures['original'] = fitted(original, part)
            pictures['filtered'] = fitted(filtered, limit - part)
        return pictures
