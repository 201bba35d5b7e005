"""`ahf evaluate`: identified targets compared with the truth."""

import argparse
import json
import sys
from typing import Any

from ahf_ros.base.settings.parameter import Parameter
from ahf_ros.base.text import printable
from ahf_ros.cli import tell
from ahf_ros.cli.options import add_flag, add_input, add_option
from ahf_ros.files.target_json import read_results
from ahf_ros.files.truth_files import read_truth
from ahf_ros.scenes.evaluation import TOLERANCE, Score, evaluate, table, total


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Give a parser the arguments of the command."""
    add_input(parser, 'truth', 'TRUTH.csv', 'Columns image, id, x, y[, confirmed].')
    text = 'One JSON object per image; - is standard input.'
    add_input(parser, 'results', 'RESULTS.jsonl', text)
    text = 'Print one JSON object per image on standard output, and a last one for all images.'
    add_flag(parser, '--json', text)
    text = 'Maximum distance between a target and the truth, px.'
    add_option(parser, Parameter('tolerance', TOLERANCE, text, minimum=1e-3))


def run(options: argparse.Namespace) -> int:
    """Print the figures of each image and of all images."""
    try:
        truth = read_truth(options.truth)
        results = read_results(options.results)
        scores = evaluate(truth, results, options.tolerance)
    except ValueError as error:
        tell('evaluate', error)
        return 1
    for name in results:
        if name not in truth:
            text = f'{printable(name)} is not in {options.truth}; its targets count as false'
            tell('evaluate', text)
    if options.json:
        for name, item in scores.items():
            print(json.dumps(_record(name, item)))
        print(json.dumps(_record(None, total(scores.values()))))
    else:
        print(table(scores), file=sys.stderr)
    return 0


def _record(image: str | None, item: Score) -> dict[str, Any]:
    """Return the figures of an image as a JSON object; `image` is None for all images."""
    x, y, both = item.rmse or (None, None, None)
    counts = 'expected', 'reported', 'found', 'right'
    names = *counts, 'correctness', 'recall', 'decoding', 'wrong', 'false_positives'
    figures = {name: getattr(item, name) for name in names}
    return {'image': image, **figures, 'rmse_x': x, 'rmse_y': y, 'rmse_xy': both}
