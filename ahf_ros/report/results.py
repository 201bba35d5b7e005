"""Results of images, from what `ahf identify --json` prints for them, in files and folders."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ahf_ros.interchange.files import file_errors, read_text
from ahf_ros.interchange.target_json import RESULTS_FILE, parsed_json, targets_from_json
from ahf_ros.target import UNDECODED, FilterState, SearchTrace, Target
from ahf_ros.target_check import MAXIMUM_ID, checked_integer, checked_number
from ahf_ros.text import shown

_MAPPING = ('log_offset', 'black_percentile', 'white_percentile')
_MAXIMUM_SIDE = 65536  # px
_MAXIMUM_FILTERS = 100_000  # of a search

ENDINGS = ('.json', '.jsonl')
"""Endings of the files of a folder that are read."""


@dataclass(frozen=True, slots=True)
class ImageResult:
    """What was identified in one image, or in one stack of images.

    Attributes
    ----------
    image : str
        Path of the image as the record has it; the first one of a stack.
    source : Path
        File that the record is in.
    width, height : int
        Size of the image, px; 0 if the record does not say.
    upright : bool
        Whether the image was turned as its orientation says.
    family, detector : str
    expected : int
        N; 0 if unknown.
    expected_ids : tuple of int
        Empty if unknown.
    estimated, mirrored : bool
    edge_shift : float, optional
        Of the image, px; None if it is unknown.
    targets : tuple of Target
    filter : FilterState
    mapping : dict of str to float
        The settings of the filter that the record has beside its gains.
    search : SearchTrace or None
    images : tuple of str
        Paths of all images of a stack; empty for one image.
    combination : str
        Combination of the stack; empty for one image.
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

    @property
    def identified(self) -> frozenset[int]:
        """The IDs that were identified."""
        return frozenset(target.id for target in self.targets if target.id != UNDECODED)


def result_from_json(content: Any, source: Path, where: str) -> ImageResult:
    """Return the result that a JSON object is.

    Parameters
    ----------
    content : dict
        As `ahf_ros.interchange.target_json.to_json` makes it; only 'image' and 'targets' are
        required.
    source : Path
        The file that it is in.
    where : str
        What errors call the object.

    Raises
    ------
    ValueError
        If the object is not like that; the message names the field.

    Examples
    --------
    >>> result_from_json({'image': 'a.png', 'targets': []}, Path('a.jsonl'), 'line 1').image
    'a.png'
    """
    targets = tuple(targets_from_json(content, where))
    record = _Record(content, where)
    used = record.object('filter')
    extra = {key: used.number(key) for key in used.content if key in _MAPPING}
    search = record.object('search')
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
        mapping=extra,
        search=_search(search) if search.content else None,
        images=record.texts('images'),
        combination=record.text('combination'),
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
        return checked_number(value, name, -math.inf, math.inf)

    def numbers(self, name: str) -> tuple[float, ...]:
        values = self.content.get(name) or []
        if not isinstance(values, list) or len(values) > _MAXIMUM_FILTERS:
            raise ValueError(f'{self.where}: {name} is {shown(values)}, accepted is a list')
        called = f'{self.where}: {name}'
        return tuple(checked_number(it, called, -math.inf, math.inf) for it in values)


def result_files(paths: Sequence[str | Path]) -> tuple[list[Path], list[str]]:
    """Return the files with results, also in folders, and what is wrong with others.

    Parameters
    ----------
    paths : sequence of str or Path
        Files, and folders: for the results of a batch if they hold them, for their files with an
        ending of `ENDINGS` if not.
    """
    files: list[Path] = []
    problems: list[str] = []
    for path in map(Path, paths):
        if not path.is_dir():
            files.append(path)
            continue
        try:
            with file_errors(path, 'read'):
                inside = sorted(it for it in path.iterdir() if it.suffix.lower() in ENDINGS)
                if (path / RESULTS_FILE).is_file():
                    inside = [path / RESULTS_FILE]
        except ValueError as error:
            problems.append(str(error))
            continue
        if not inside:
            problems.append(f'{path} has no results, accepted are files {" and ".join(ENDINGS)}')
        files += inside
    return files, problems


def read_results(paths: Sequence[str | Path]) -> tuple[list[ImageResult], list[str]]:
    """Return the results in files, and what is wrong with those that cannot be used.

    Of several results for one image, the last one counts.

    Parameters
    ----------
    paths : sequence of str or Path
        As for `result_files`. A file holds one JSON object a line, or one object, or a list of
        objects. Objects without 'image' are no results and are ignored.

    Returns
    -------
    results : list of ImageResult
        In the order of the files and of their lines.
    problems : list of str
        Each names the file and the line.
    """
    files, problems = result_files(paths)
    results: dict[tuple[str, ...], ImageResult] = {}
    for file in files:
        for where, content in _contents(file, problems):
            if isinstance(content, dict) and 'image' not in content:
                continue
            try:
                result = result_from_json(content, file, where)
            except ValueError as error:
                problems.append(str(error))
                continue
            key = (str(result.image), *result.images)
            results.pop(key, None)
            results[key] = result
    return list(results.values()), problems


def _contents(file: Path, problems: list[str]) -> Iterator[tuple[str, Any]]:
    """Yield the values in a file and what errors call them; append what is wrong with others."""
    if file.suffix.lower() == '.json':
        try:
            whole = parsed_json(read_text(file), str(file))
        except ValueError:
            whole = None  # perhaps one object a line
        if isinstance(whole, list):
            yield from ((f'{file}, item {number}', it) for number, it in enumerate(whole, start=1))
            return
        if whole is not None:
            yield str(file), whole
            return
    try:
        with file_errors(file, 'read'), file.open('rb') as lines:
            for number, line in enumerate(lines, start=1):
                if line.strip():
                    where = f'{file}, line {number}'
                    try:
                        yield where, parsed_json(line.decode('utf-8-sig'), where)
                    except UnicodeDecodeError:
                        problems.append(f'{where} is not in UTF-8, accepted is JSON')
                    except ValueError as error:
                        problems.append(str(error))
    except ValueError as error:
        problems.append(str(error))
