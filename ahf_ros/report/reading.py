"""The files with results: JSON lines of `ahf identify --json`, and folders of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ahf_ros.interchange.files import file_errors, read_text
from ahf_ros.interchange.target_json import RESULTS_FILE, parsed_json
from ahf_ros.report.results import ImageResult, result_from_json

ENDINGS = ('.json', '.jsonl')
"""Endings of the files of a folder that are read."""


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
