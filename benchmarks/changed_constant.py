"""`ring` with one constant changed, on the scenes in a folder; see `benchmarks.sensitivity`.

    python -m benchmarks.changed_constant FOLDER [MODULE.NAME VALUE]

The constant is changed in the source of its module as that is imported. So values that are
computed from it, default arguments and names imported into other modules change as well.
"""

from __future__ import annotations

import argparse
import ast
import json
import sys
from collections.abc import Callable
from functools import partial
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType
from typing import Any


def change(constant: str, value: float) -> None:
    """Change a constant of a module that is not imported yet; ValueError if it has none.

    Parameters
    ----------
    constant : str
        Name of the module, a dot, and that of the constant.
    value : float
    """
    module, _, name = constant.rpartition('.')
    compiled = SourceFileLoader.get_code

    def get_code(loader: SourceFileLoader, fullname: str) -> CodeType | None:
        if fullname != module:
            return compiled(loader, fullname)
        tree = ast.parse(loader.get_data(loader.path))
        replace = assigned(tree).get(name)
        if replace is None:
            raise ValueError(f'{module} has no constant {name}')
        replace(value)
        return compile(ast.fix_missing_locations(tree), loader.path, 'exec')

    SourceFileLoader.get_code = get_code  # type: ignore[method-assign]


def assigned(tree: ast.Module) -> dict[str, Callable[[float], None]]:
    """Return the names that a module assigns to, and for each what replaces its value.

    A name may be alone on the left, or one of as many names as there are values on the right.
    """
    found: dict[str, Callable[[float], None]] = {}
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            targets, value = [node.target], node.value
        elif isinstance(node, ast.Assign):
            targets, value = node.targets, node.value
        else:
            continue
        if len(targets) != 1:
            continue
        target = targets[0]
        if isinstance(target, ast.Name):
            found[target.id] = partial(replace_value, node)
        elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            for number, name in enumerate(target.elts):
                if isinstance(name, ast.Name) and len(target.elts) == len(value.elts):
                    found[name.id] = partial(replace_element, value, number)
    return found


def replace_value(node: ast.Assign | ast.AnnAssign, value: float) -> None:
    """Let a statement assign a number."""
    node.value = ast.Constant(value)


def replace_element(values: ast.Tuple, number: int, value: float) -> None:
    """Let a number be one of several values."""
    values.elts[number] = ast.Constant(value)


def results(folder: Path) -> dict[str, Any]:
    """Return what `ring` identifies in all scenes of a folder together."""
    # Imported only now, so that the constant is changed already.
    import numpy as np

    from ahf_ros.detectors.contract import DetectorSettings
    from ahf_ros.detectors.ring.detector import RingDetector
    from ahf_ros.evaluation import score, total
    from ahf_ros.target import TrueTarget

    scores = []
    for path in sorted(folder.glob('*.npz')):
        with np.load(path) as scene:
            detector = RingDetector(DetectorSettings(family=str(scene['family'])))
            truth = [TrueTarget(int(number), x, y) for number, x, y in scene['truth'].tolist()]
            scores.append(score(truth, detector(scene['image'])))
    figures = total(scores)
    return {
        'right': figures.right,
        'wrong': figures.wrong,
        'false': figures.false_positives,
        'rmse': figures.rmse[2] if figures.rmse else None,
    }


def main() -> None:
    """Print the results as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('change', nargs='*', metavar='MODULE.NAME VALUE')
    options = parser.parse_args()
    if options.change:
        constant, value = options.change
        change(constant, float(value))
    found = results(options.folder)
    if options.change and constant.rpartition('.')[0] not in sys.modules:
        raise SystemExit(f'{constant} is not in a module that the detector imports')
    print(json.dumps(found))


if __name__ == '__main__':
    main()
