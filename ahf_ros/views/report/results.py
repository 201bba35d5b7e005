"""Results of images, from what `ahf identify --json` prints for them, in files and folders."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ahf_ros.base.opening import LARGEST, Most, file_errors, parsed_json, parsing, read_text
from ahf_ros.base.target import UNDECODED, FilterState, SearchTrace, Target
from ahf_ros.base.target_check import MAXIMUM_ID, checked_integer, checked_number
from ahf_ros.base.text import shown
from ahf_ros.files.files import RESULTS_FILE
from ahf_ros.files.target_json import targets_from_json

_MAPPING = ('log_offset', 'black_percentile', 'white_percentile')
_MAXIMUM_SIDE = 65536  # px
_MAXIMUM_FILTERS = 100_000  # of a search

ENDINGS = ('.json', '.jsonl')
"""Endings of the files of a folder that are read."""


@dataclass(frozen=True, slots=True)
class ImageResult:
    """What was identified in one image, or in one stack of images.

    Fields are those of the record, which is in the file `source`, and empty where it does not say;
    `edge_shift` and `search` are then None. Lengths are in px. `image` is the path of the first
    image of a stack; only stacks have `images`, the paths of all, and `combination`. `mapping` has
    the settings of the filter that the record has beside its gains.
    """

    image: str
    source: Path
    targets: tuple[Target, ...]
    width: int = 0
    height: int = 0
    upright: bool = False
    family: str = ''
    detector: str = ''
    expected: int = 0
    expected_ids: tuple[int, ...] = ()
    estimated: bool = False
    mirrored: bool = False
    edge_shift: float | None = None
    filter: FilterState = field(default_factory=FilterState)
    mapping: dict[str, float] = field(default_factory=dict)
    search: SearchTrace | None = None
    images: tuple[str, ...] = ()
    combination: str = ''
    reach: dict[str, float] = field(default_factory=dict)

    @property
    def identified(self) -> frozenset[int]:
        """The IDs that were identified."""
        return frozenset(target.id for target in self.targets if target.id != UNDECODED)


def result_from_json(content: Any, source: Path, where: str) -> ImageResult:
    """Return the result that a JSON object of a file is; errors call the object `where`.

    `ahf_ros.files.target_json.to_json` makes such objects; only 'image' and 'targets' are
    required. A ValueError names a field that is not accepted.

    Examples
    --------
    >>> result_from_json({'image': 'a.png', 'targets': []}, Path('a.jsonl'), 'line 1').image
    'a.png'
    """
    targets = tuple(targets_from_json(content, where))
    record = _Record(content, where)
    used = record.object('filter')
    search, reach = record.object('search'), record.object('reach')
    return ImageResult(
        image=record.text('image', required=True),
        source=source,
        targets=targets,
        width=record.integer('width', _MAXIMUM_SIDE),
        height=record.integer('height', _MAXIMUM_SIDE),
        upright=record.flag('upright'),
        family=record.text('family'),
        detector=record.text('detector'),
        expected=record.integer('expected'),
        expected_ids=tuple(int(it) for it in record.numbers('expected_ids')),
        estimated=record.flag('estimated'),
        mirrored=record.flag('mirrored'),
        edge_shift=None if content.get('edge_shift') is None else record.number('edge_shift'),
        filter=FilterState(
            applied=used.flag('applied'),
            gamma_high=used.number('gamma_high'),
            gamma_low=used.number('gamma_low'),
            cutoff=used.number('cutoff'),
            attenuation=used.number('attenuation'),
            evaluations=used.integer('evaluations'),
            generations=used.integer('generations'),
            duration=record.number('elapsed_s'),
        ),
        mapping={key: used.number(key) for key in used.content if key in _MAPPING},
        search=_search(search) if search.content else None,
        images=record.texts('images'),
        combination=record.text('combination'),
        reach={name: reach.number(name) for name in reach.content},
    )


def _search(record: _Record) -> SearchTrace:
    discrepancies = record.numbers('discrepancies')
    columns = {
        name: record.numbers(name) for name in ('gamma_high', 'gamma_low', 'cutoff', 'attenuation')
    }
    for name, column in columns.items():
        if len(column) != len(discrepancies):
            raise ValueError(
                f'{record.where}: {name} has {len(column)} numbers, accepted are as many as '
                f'discrepancies, {len(discrepancies)}'
            )
    return SearchTrace(
        reason=record.text('reason'),
        discrepancies=tuple(int(it) for it in discrepancies),
        **columns,
        generations=tuple(int(it) for it in record.numbers('generations')),
        combinations=record.texts('combinations'),
    )


@dataclass(frozen=True, slots=True)
class _Record:
    """An object of JSON, whose fields are checked where they are read; absent ones are empty."""

    content: dict[str, Any]
    where: str

    def object(self, name: str) -> _Record:
        value = self.content.get(name) or {}
        if not isinstance(value, dict):
            raise ValueError(f'{self.where}: {name} is {shown(value)}, accepted is an object')
        return _Record(value, f'{self.where}: {name}')

    def text(self, name: str, required: bool = False) -> str:
        value = self.content.get(name, '')
        if not isinstance(value, str) or (required and not value):
            raise ValueError(f'{self.where}: {name} is {shown(value)}, accepted is a text')
        return value

    def texts(self, name: str) -> tuple[str, ...]:
        values = self.content.get(name) or []
        if not isinstance(values, list) or not all(isinstance(it, str) for it in values):
            raise ValueError(f'{self.where}: {name} is {shown(values)}, accepted is a list')
        return tuple(values)

    def flag(self, name: str) -> bool:
        return self.content.get(name, False) is True

    def integer(self, name: str, maximum: int = MAXIMUM_ID) -> int:
        return checked_integer(self.content.get(name, 0), f'{self.where}: {name}', 0, maximum)

    def number(self, name: str) -> float:
        name, value = f'{self.where}: {name}', self.content.get(name, 0)
        return checked_number(value, name, -LARGEST, LARGEST)

    def numbers(self, name: str) -> tuple[float, ...]:
        values = self.content.get(name) or []
        if not isinstance(values, list) or len(values) > _MAXIMUM_FILTERS:
            raise ValueError(f'{self.where}: {name} is {shown(values)}, accepted is a list')
        called = f'{self.where}: {name}'
        return tuple(checked_number(it, called, -LARGEST, LARGEST) for it in values)


def read_results(paths: Sequence[str | Path]) -> tuple[list[ImageResult], list[str]]:
    """Return the results in files, and what is wrong with those that cannot be used.

    Results are in the order of the files and of their lines; of several for one image, the last
    one counts. A folder stands for the results of a batch if it holds them, for its files with an
    ending of `ENDINGS` if not. A file holds one JSON object a line, or one object, or a list of
    objects. Objects without 'image' are no results and are ignored.
    """
    results: dict[tuple[str, ...], ImageResult] = {}
    files: list[Path] = []
    problems: list[str] = []
    for path in map(Path, paths):
        with _noted(problems):
            files += _files(path)
    for file in files:
        for where, content in _contents(file, problems):
            if isinstance(content, dict) and 'image' not in content:
                continue
            with _noted(problems), parsing(where, 'a result of ahf identify --json'):
                result = result_from_json(content, file, where)
                key = result.image, *result.images
                results.pop(key, None)
                results[key] = result
    return list(results.values()), problems


@contextmanager
def _noted(problems: list[str]) -> Iterator[None]:
    """Append what a ValueError says to the problems, and go on."""
    try:
        yield
    except ValueError as error:
        problems.append(str(error))


def _files(path: Path) -> list[Path]:
    """Return the files with results that a path stands for."""
    if not path.is_dir():
        return [path]
    if (path / RESULTS_FILE).is_file():
        return [path / RESULTS_FILE]
    with file_errors(path, 'read'):
        inside = sorted(it for it in path.iterdir() if it.suffix.lower() in ENDINGS)
    if not inside:
        raise ValueError(f'{path} has no results, accepted are files {" and ".join(ENDINGS)}')
    return inside


def _contents(file: Path, problems: list[str]) -> Iterator[tuple[str, Any]]:
    """Yield the values in a file and what errors call them; append what is wrong with others."""
    text = ''
    with _noted(problems):
        text = read_text(file, Most.JSON)
    if file.suffix.lower() == '.json':
        with suppress(ValueError):  # perhaps one object a line
            whole = parsed_json(text, str(file))
            if isinstance(whole, list):
                yield from ((f'{file}, item {number}', it) for number, it in enumerate(whole, 1))
            else:
                yield str(file), whole
            return
    for number, line in enumerate(text.splitlines(), start=1):
        where = f'{file}, line {number}'
        if line.strip():
            with _noted(problems):
                yield where, parsed_json(line, where)
