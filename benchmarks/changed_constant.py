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
from collections.abc import Callable, Sequence
from functools import partial
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any


class Changed(SourceFileLoader):
    """Loads a module with one of its constants changed."""

    name_of_constant = ''
    value: float = 0.0

    def get_code(self, fullname: str) -> CodeType:
        """Return the code of the module, compiled from its source."""
        tree = ast.parse(self.get_data(self.path))
        replace = assigned(tree).get(self.name_of_constant)
        if replace is None:
            raise ValueError(f'{fullname} has no constant {self.name_of_constant}')
        replace(self.value)
        return compile(ast.fix_missing_locations(tree), self.path, 'exec')


class Finder(MetaPathFinder):
    """Finds one module and has it loaded with a constant changed."""

    def __init__(self, constant: str, value: float) -> None:
        self._module, _, self._name = constant.rpartition('.')
        self._value = value
        self.used = False

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the specification of the module, and nothing for any other."""
        if fullname != self._module:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is None or spec.origin is None:
            return None
        loader = Changed(fullname, spec.origin)
        loader.name_of_constant, loader.value = self._name, self._value
        spec.loader = loader
        self.used = True
        return spec


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
        finder = Finder(constant, float(value))
        sys.meta_path.insert(0, finder)
    found = results(options.folder)
    if options.change and not finder.used:
        raise SystemExit(f'{constant} is not in a module that the detector imports')
    print(json.dumps(found))


if __name__ == '__main__':
    main()
