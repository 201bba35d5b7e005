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
from typing import Any, TypeAlias

Scope: TypeAlias = ast.Module | ast.ClassDef | ast.FunctionDef


def change(place: str, expression: str) -> None:
    """Change a name of a module that is not imported yet; ValueError if it has none.

    Parameters
    ----------
    place : str
        Name of the module, a dot, and that of the constant or function. After a colon instead of
        the dot, the name may lie in functions or classes: `module:function.local`.
    expression : str
        What the name is assigned instead, Python, in which `ORIGINAL` is what it is assigned now.
    """
    module, _, name = place.rpartition(':' if ':' in place else '.')
    compiled = SourceFileLoader.get_code

    def get_code(loader: SourceFileLoader, fullname: str) -> CodeType | None:
        if fullname != module:
            return compiled(loader, fullname)
        tree = ast.parse(loader.get_data(loader.path))
        try:
            replace(tree, name, expression)
        except KeyError:
            raise ValueError(f'{module} has no constant {name}') from None
        return compile(ast.fix_missing_locations(tree), loader.path, 'exec')

    SourceFileLoader.get_code = get_code  # type: ignore[method-assign]


def replace(tree: ast.Module, name: str, expression: str) -> None:
    """Let what a name stands for be an expression instead; KeyError if there is no such name.

    The name is that of `change`. A function becomes the assignment of the expression.
    """
    *scopes, last = name.split('.')
    scope: Scope = tree
    for outer in scopes:
        scope = definitions(scope)[outer]
    value = ast.parse(expression, mode='eval').body
    defined = definitions(scope).get(last)
    if defined is not None:
        assignment = ast.Assign([ast.Name(last, ast.Store())], value)
        scope.body[scope.body.index(defined)] = assignment
    else:
        assigned(scope)[last](value)


def definitions(scope: Scope) -> dict[str, ast.FunctionDef | ast.ClassDef]:
    """Return the functions and classes of a module, a class or a function."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    return {node.name: node for node in scope.body if isinstance(node, kinds)}


def assigned(scope: Scope) -> dict[str, Callable[[ast.expr], None]]:
    """Return the names that a module assigns to, and for each what replaces its value.

    A name may be alone on the left, or one of as many names as there are values on the right.
    """
    found: dict[str, Callable[[ast.expr], None]] = {}
    for node in scope.body:
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


def replace_value(node: ast.Assign | ast.AnnAssign, value: ast.expr) -> None:
    """Let a statement assign another value."""
    assert node.value is not None
    node.value = _Original(node.value).visit(value)


def replace_element(values: ast.Tuple, number: int, value: ast.expr) -> None:
    """Let one of several values be another one."""
    values.elts[number] = _Original(values.elts[number]).visit(value)


class _Original(ast.NodeTransformer):
    """Put what a name is assigned now in the place of `ORIGINAL`."""

    def __init__(self, value: ast.expr) -> None:
        self.value = value

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Return what stands for a name."""
        return self.value if node.id == 'ORIGINAL' else node


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
        change(constant, value)
    found = results(options.folder)
    if options.change and constant.rpartition('.')[0] not in sys.modules:
        raise SystemExit(f'{constant} is not in a module that the detector imports')
    print(json.dumps(found))


if __name__ == '__main__':
    main()
