"""Reports of benchmarks: options that all of them have, tables, and files."""

import argparse
import json
import os
import platform
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
from rich.console import Console
from rich.progress import track

FIRST_TEST_SEED = 101
"""Seeds below this one are for development: nothing was chosen by looking at the others."""

Report = dict[str, Any]


class Unacceptable(ValueError):
    """Something is wrong with options or with what they name; it is said as usage."""


Item = TypeVar('Item')


def print_chosen(
    tables: Mapping[str, Callable[[int, int | None], list[str]]], about: str | None
) -> None:
    """Print the table that the command line names, of a seed and perhaps a number of runs."""
    made = argparse.ArgumentParser(description=(about or '').split('\n\n', maxsplit=1)[0])
    made.add_argument('--table', choices=sorted(tables), required=True)
    made.add_argument('--seed', type=int, default=301)
    made.add_argument('--runs', type=int, help='runs of each row, where a table has runs')
    options = made.parse_args()
    print('\n'.join(tables[options.table](options.seed, options.runs)))


def parser(description: str | None, *, seeds: bool = True) -> argparse.ArgumentParser:
    """Return a parser with the options that say where a report goes.

    Parameters
    ----------
    description : str
        The first paragraph is that of the help.
    seeds : bool
        Whether the benchmark renders scenes with any number of seeds.
    """
    made = argparse.ArgumentParser(
        description=(description or '').split('\n\n')[0],
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    if seeds:
        made.add_argument('--seeds', nargs='+', type=int, default=[FIRST_TEST_SEED])
    made.add_argument('--json', type=Path, metavar='FILE', help='also write a JSON object')
    made.add_argument(
        '--output', type=Path, metavar='FILE', help='also write FILE.json and FILE.md'
    )
    return made


def parsed(
    made: argparse.ArgumentParser, arguments: Sequence[str] | None = None
) -> argparse.Namespace:
    """Return the options; the program ends where seeds for tests and for development mix."""
    options = made.parse_args(arguments)
    try:
        are_tests(getattr(options, 'seeds', ()))
    except ValueError as error:
        made.error(str(error))
    return options


def run(
    made: argparse.ArgumentParser,
    measure: Callable[[argparse.Namespace], Report],
    page: Callable[[Report], str],
    arguments: Sequence[str] | None = None,
) -> int:
    """Measure what the command line asks for, and print and write it: a whole benchmark.

    Parameters
    ----------
    made : argparse.ArgumentParser
        Made by `parser`.
    measure : callable
        Returns figures for the options; the machine and the seeds are added.
    page : callable
        Returns the figures in Markdown.
    arguments : sequence of str, optional
        By default those of the process.
    """
    options = parsed(made, arguments)
    always = about(options.seeds) if 'seeds' in options else {'machine': machine()}
    try:
        figures = {**always, **measure(options)}
    except Unacceptable as error:
        made.error(str(error))
    publish(figures, page(figures), options)
    return 0


def are_tests(seeds: Sequence[int]) -> bool:
    """Return whether seeds are for tests, not for development; ValueError where they mix."""
    tests = {seed >= FIRST_TEST_SEED for seed in seeds}
    if len(tests) > 1:
        raise ValueError(f'seeds are {seeds}, accepted are all below {FIRST_TEST_SEED} or none')
    return tests == {True}


def about(seeds: Sequence[int], **facts: Any) -> Report:
    """Return a report without figures: facts, seeds and the machine."""
    return {**facts, 'seeds': list(seeds), 'test': are_tests(seeds), 'machine': machine()}


def machine() -> dict[str, Any]:
    """Return what figures depend on."""
    information = Path('/proc/cpuinfo')
    lines = information.read_text().splitlines() if information.exists() else []
    models = [line.split(':', 1)[1].strip() for line in lines if line.startswith('model name')]
    return {
        'processor': models[0] if models else platform.processor(),
        'cores': os.cpu_count(),
        'python': platform.python_version(),
        'numpy': np.__version__,
        'opencv': cv2.__version__,
    }


def machine_text(facts: dict[str, Any]) -> str:
    """Return what figures depend on, as a sentence."""
    return (
        f'{facts["processor"]}, {facts["cores"]} cores, Python {facts["python"]}, '
        f'numpy {facts["numpy"]}, OpenCV {facts["opencv"]}.'
    )


def about_text(report: Report) -> str:
    """Return seeds and machine of a report, as sentences."""
    kind = 'Test' if report['test'] else 'Development'
    seeds = ', '.join(map(str, report['seeds']))
    return f'{kind} seeds: {seeds}. {machine_text(report["machine"])}'


def table(head: Sequence[object], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return the lines of a table in Markdown."""
    first, *others = (f'| {" | ".join(map(str, row))} |' for row in (head, *rows))
    return [first, '|---' * len(head) + '|', *others]


Column = str | tuple[str, int] | Callable[[Report], object]
"""A cell of a record: the value of a name, with some digits, or what a function makes of it."""


def record_table(records: Iterable[Report], columns: Mapping[str, Column]) -> list[str]:
    """Return the lines of a table of records in Markdown, whose head says what is in a column."""

    def cell(record: Report, column: Column) -> object:
        if callable(column):
            return column(record)
        return record[column] if isinstance(column, str) else number(record[column[0]], column[1])

    rows = [[cell(record, column) for column in columns.values()] for record in records]
    return table(list(columns), rows)


def summary(records: Sequence[Report]) -> str:
    """Return the sums of right, wrong and false reports of all records as a sentence."""
    right, expected, wrong, false = (
        sum(of[key] for of in records) for key in ('right', 'expected', 'wrong', 'false_positives')
    )
    return f'{right} of {expected} right, {wrong} wrong, {false} false.'


def number(value: float | None, digits: int, none: str = '-') -> str:
    """Return a number with some digits after the point."""
    return none if value is None else f'{value:.{digits}f}'


def progress(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """Yield items, as many as `total` says, and show on standard error how far it has come."""
    if isinstance(items, Sized):
        total = len(items)
    yield from track(items, what, total, console=Console(stderr=True))


def write(report: Report, options: argparse.Namespace) -> None:
    """Write a report as JSON where the options ask for it."""
    files = (options.json, options.output and Path(f'{options.output}.json'))
    for file in filter(None, files):
        file.write_text(json.dumps(report, indent=1))


def publish(report: Report, page: str, options: argparse.Namespace) -> None:
    """Print the page of a report, and write both where the options ask for it."""
    write(report, options)
    if options.output:
        Path(f'{options.output}.md').write_text(page + '\n')
    print(page)
