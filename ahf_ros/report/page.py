"""The page: one HTML file with everything in it, written picture by picture.

What it knows about each image is a row of numbers and texts, ready for JSON.
"""

from __future__ import annotations

import json
import math
import os
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

import cv2

from ahf_ros.codes.designs import relative_reach
from ahf_ros.edge_shift import edge_shift_remark
from ahf_ros.evaluation import FALSE, RIGHT, WRONG, judge
from ahf_ros.interchange.files import whole_file
from ahf_ros.report.images import Picture, fitted, shown_image, thumbnail
from ahf_ros.report.results import ImageResult
from ahf_ros.report.settings import ReportSettings
from ahf_ros.target import (
    UNDECODED,
    DottedTarget,
    SquareMarker,
    Target,
    TrueTarget,
    Truth,
    UndecodedTarget,
    count_codes,
)
from ahf_ros.text import reason_of

MAXIMUM_UNREAD = 300
"""Number of dots of an image without any likely code word that are shown."""

PAGE = Path(__file__).parent / 'page'
"""Folder of the template, and of the styles and scripts that it holds."""

SCRIPTS = ('data', 'table', 'viewer', 'plots', 'details', 'overview', 'main')
"""Scripts of the page, in their order."""

_MAXIMUM_PICTURE = 4_000_000  # bytes
_MINIMUM_PICTURE = 2_000
_FILTERED_WEIGHT = 0.6  # of the bytes of an original
_MARKUP = 600  # bytes around the pictures of an image
_THUMBNAIL = 4_000  # bytes of its text

Item = TypeVar('Item')
Value = TypeVar('Value')


def row(
    result: ImageResult,
    families: Sequence[str],
    doubtful_below: float,
    truth: Sequence[TrueTarget] | None = None,
) -> dict[str, Any]:
    """Return what the page knows about an image.

    Parameters
    ----------
    result : ImageResult
    families : sequence of str
        Names of all families of the page; rows have their indices.
    doubtful_below : float
        Confidence below which an identified target counts as doubtful.
    truth : sequence of TrueTarget, optional
        What the image shows.
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
        'image': result.image,
        'images': list(result.images),
        'combination': result.combination,
        'width': result.width,
        'height': result.height,
        'family': result.family,
        'detector': result.detector,
        'expected': expected,
        'estimated': result.estimated,
        'mirrored': result.mirrored,
        'edges': edge_shift_remark(result.edge_shift),
        'identified': identified,
        'missed': len(missed) if known is not None else max(0, expected - identified),
        'missedIds': missed,
        'unexpectedIds': sorted(result.identified - known) if known is not None else [],
        'doubtful': len(likely) + sum(it.confidence < doubtful_below for it in decoded),
        'unread': len(unread),
        'seconds': round(result.filter.duration, 3),
        'filter': _filter(result),
        'search': _search(result),
        'targets': [_target(target, families) for target in decoded],
        'dots': [_dots(target) for target in decoded if isinstance(target, DottedTarget)],
        'squares': [_square(target) for target in decoded if isinstance(target, SquareMarker)],
        'undecoded': [_undecoded(target) for target in [*likely, *unread[:MAXIMUM_UNREAD]]],
        'truth': judged,
    }


def families_of(results: Sequence[ImageResult]) -> list[str]:
    """Return the names of the families of all targets, the most frequent first."""
    counts = Counter(target.family for result in results for target in result.targets)
    return [name for name, _ in counts.most_common() if name]


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
    names = 'gamma_high', 'gamma_low', 'cutoff', 'attenuation'
    state: dict[str, Any] = {'applied': used.applied, 'evaluations': used.evaluations}
    if used.applied:
        state |= {name: _significant(getattr(used, name)) for name in names}
    return state


def _search(result: ImageResult) -> dict[str, Any] | None:
    if result.search is None:
        return None
    columns = asdict(result.search)
    for name in ('gamma_high', 'gamma_low', 'cutoff', 'attenuation'):
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


@dataclass(frozen=True, slots=True)
class Pictures:
    """The pictures of one image of the page.

    Attributes
    ----------
    index : int
        Row of the image.
    pictures : dict of str to Picture
        By what they are: 'thumbnail', 'original', 'filtered'.
    problem : str
        Why there are none; empty if there are.
    """

    index: int
    pictures: dict[str, Picture]
    problem: str = ''


@dataclass(frozen=True, slots=True)
class Page:
    """Everything on a page but its pictures.

    Attributes
    ----------
    title : str
    rows : tuple of str
        JSON of each image, see `ahf_ros.report.rows.row`.
    about : str
        JSON of what concerns all images.
    limits : tuple of int
        Bytes for the pictures of each image.
    """

    title: str
    rows: tuple[str, ...]
    about: str
    limits: tuple[int, ...]


def make_page(
    results: Sequence[ImageResult],
    settings: ReportSettings,
    title: str,
    truth: Truth | None = None,
) -> Page:
    """Return the page of results, without its pictures.

    Parameters
    ----------
    results : sequence of ImageResult
    settings : ReportSettings
    title : str
        Where the settings have none.
    truth : mapping of str to sequence of TrueTarget, optional
        What images show, by their names without folders.
    """
    families = families_of(results)
    rows = [
        row(
            result,
            families,
            settings.doubtful_below,
            truth.get(Path(result.image).name) if truth is not None else None,
        )
        for result in results
    ]
    about = {
        'families': families,
        'reach': [round(relative_reach(name), 4) for name in families],
        'doubtfulBelow': settings.doubtful_below,
        'maxSize': settings.max_size,
    }
    texts = tuple(_json(it) for it in rows)
    taken = sum(map(len, texts)) + sum(len(text) for text in _parts().values())
    weights = [1 + _FILTERED_WEIGHT * result.filter.applied for result in results]
    limits = _limits(round(1e6 * settings.max_size) - taken, weights)
    return Page(settings.title or title, texts, _json(about), limits)


def page_pictures(
    results: Sequence[ImageResult], page: Page, threads: int, folders: Sequence[Path] = ()
) -> Iterator[Pictures]:
    """Yield the pictures of each image in turn; a few are made at a time.

    Parameters
    ----------
    results : sequence of ImageResult
    page : Page
        Of these results.
    threads : int
        0 for one per core.
    folders : sequence of Path
        Where images may be, see `ahf_ros.report.images.find_image`.
    """

    def make(index: int) -> Pictures:
        return _pictures(index, results[index], page.limits[index], folders)

    yield from _in_order(make, range(len(results)), threads or os.cpu_count() or 1)


def write_page(path: Path, page: Page, pictures: Iterable[Pictures]) -> list[str]:
    """Write a page to a file that is never there in part.

    Parameters
    ----------
    path : Path
    page : Page
    pictures : iterable of Pictures
        Of all its images, in their order.

    Returns
    -------
    list of str
        What is wrong with images.

    Raises
    ------
    ValueError
        If the file cannot be written, or jinja2 is not installed.
    """
    template = _template()
    problems: dict[int, str] = {}

    def passing() -> Iterator[Pictures]:
        for item in pictures:
            if item.problem:
                problems[item.index] = item.problem
            yield item

    with whole_file(path) as file:
        for text in template.generate(
            **_parts(), page=page, pictures=passing(), problems=_Late(problems)
        ):
            file.write(text.encode('utf-8', 'backslashreplace'))
    return [problems[index] for index in sorted(problems)]


class _Late:
    """What is known only when all pictures are written."""

    def __init__(self, problems: Mapping[int, str]) -> None:
        self._problems = problems

    def __html__(self) -> str:
        return _json(self._problems)


def _template() -> Any:
    try:
        from jinja2 import Environment, FileSystemLoader, StrictUndefined
    except ImportError as error:
        raise ValueError(
            "the page needs jinja2, which is not installed: pip install 'ahf_ros[report]'"
        ) from error
    environment = Environment(
        loader=FileSystemLoader(PAGE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template('page.html')


def _parts() -> dict[str, str]:
    """Return the styles and the scripts of the page."""
    scripts = [(PAGE / f'{name}.js').read_text(encoding='utf-8') for name in SCRIPTS]
    style = (PAGE / 'style.css').read_text(encoding='utf-8')
    return {'style': style, 'script': '\n'.join(scripts)}


def _limits(available: int, weights: Sequence[float]) -> tuple[int, ...]:
    """Return the bytes for the pictures of each image, in proportion to the weights."""
    if not weights:
        return ()
    texts = available - len(weights) * (_MARKUP + _THUMBNAIL)
    share = texts * 3 / 4 / sum(weights)  # base64 makes four bytes of three
    share = min(max(share, _MINIMUM_PICTURE), _MAXIMUM_PICTURE)
    return tuple(int(share * weight) for weight in weights)


def _pictures(index: int, result: ImageResult, limit: int, folders: Sequence[Path]) -> Pictures:
    try:
        shown = shown_image(result, folders)
    except ValueError as error:
        return Pictures(index, {}, str(error))
    except (MemoryError, cv2.error) as error:  # the other images may be smaller
        return Pictures(index, {}, f'{result.image}: {reason_of(error)}')
    pictures = {'thumbnail': thumbnail(shown.original)}
    if shown.filtered is None:
        pictures['original'] = fitted(shown.original, limit)
    else:
        part = int(limit / (1 + _FILTERED_WEIGHT))
        pictures['original'] = fitted(shown.original, part)
        pictures['filtered'] = fitted(shown.filtered, limit - part)
    return Pictures(index, pictures)


def _in_order(
    function: Callable[[Item], Value], items: Iterable[Item], threads: int
) -> Iterator[Value]:
    """Yield the values of a function in the order of the items, a few of them ahead."""
    if threads == 1:
        yield from map(function, items)
        return
    waiting: deque[Future[Value]] = deque()
    with ThreadPoolExecutor(threads) as executor:
        try:
            for item in items:
                waiting.append(executor.submit(function, item))
                if len(waiting) > threads:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()


def _json(value: Any) -> str:
    """Return JSON that a script element can hold, whatever texts are in it."""
    text = json.dumps(value, separators=(',', ':'), allow_nan=False)
    return text.replace('<', '\\u003c')
