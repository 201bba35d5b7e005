"""What is identified in the pictures in a folder with one constant or function changed.

    python -m benchmarks.changed FOLDER [MODULE:NAME EXPRESSION]

It is for `benchmarks.gates` and `benchmarks.sensitivity`. The name is changed in the source of its
module as that is imported. So values that are computed from it, default arguments and names
imported into other modules change as well. A line of JSON comes for each picture as soon as it is
identified, so that those that were done count where a change takes too long.
"""

import argparse
import ast
import json
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType
from typing import Any, TypeAlias

Scope: TypeAlias = ast.Module | ast.ClassDef | ast.FunctionDef

NEAR = 5.0
"""Largest distance of a target from its true place, px."""

Shown = tuple[str, float | None, float | None]
"""A target of a picture: its ID, or 'code' and its code, and its place, if that is known."""


def change(place: str, expression: str) -> None:
    """Change a name of a module that is not imported yet; ValueError if it has none.

    Parameters
    ----------
    place : str
        `module:NAME`; the name may lie in functions or classes, `module:function.local`.
    expression : str
        What the name is assigned instead, Python, in which `ORIGINAL` is what it is assigned now.
    """
    module, _, name = place.partition(':')
    compiled = SourceFileLoader.get_code

    def get_code(loader: SourceFileLoader, fullname: str) -> CodeType | None:
        if fullname != module:
            return compiled(loader, fullname)
        tree = ast.parse(loader.get_data(loader.path))
        try:
            replace(tree, name, expression)
        except KeyError:
            raise ValueError(f'{module} has no {name}') from None
        return compile(ast.fix_missing_locations(tree), loader.path, 'exec')

    SourceFileLoader.get_code = get_code  # type: ignore[method-assign, assignment]


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
    target: ast.expr
    for node in scope.body:
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            target, value = node.target, node.value
        elif isinstance(node, ast.Assign) and len(node.targets) == 1:
            target, value = node.targets[0], node.value
        else:
            continue
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


def verdicts(targets: Sequence[Any], truth: Sequence[Shown]) -> tuple[dict[int, float], int, int]:
    """Return the errors of the targets of the truth that are right, px, by their indices.

    Then follow the numbers of wrong and of false reports. A report is right if it has the ID of
    the nearest place, wrong with another one or again, and false farther away. Where places are
    not known it is right or false.
    """
    right: dict[int, float] = {}
    wrong = false = 0
    for target in targets:
        if target.id < 0:
            continue
        names = {str(target.id), f'code {target.code}'}
        placed = [
            (((x - target.x) ** 2 + (y - target.y) ** 2) ** 0.5, index)
            for index, (_, x, y) in enumerate(truth)
            if x is not None and y is not None
        ]
        if placed:
            away, nearest = min(placed)
            if away > NEAR:
                false += 1
            elif truth[nearest][0] in names and nearest not in right:
                right[nearest] = away
            else:
                wrong += 1
        else:
            named = [index for index, (name, _, _) in enumerate(truth) if name in names]
            free = [index for index in named if index not in right]
            right |= dict.fromkeys(free[:1], 0.0)
            false += not free
    return right, wrong, false


def main() -> None:
    """Print a line for each picture."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('folder', type=Path)
    parser.add_argument('change', nargs='*', metavar='MODULE:NAME EXPRESSION')
    options = parser.parse_args()
    if options.change:
        change(*options.change)
    # Imported only now, so that the gate is open already.
    import cv2
    import numpy as np

    from ahf_ros import create_identifier
    from support.calls import calls_of

    cv2.setNumThreads(1)
    warm: set[str] = set()
    for path in sorted(options.folder.glob('*.npz')):
        with np.load(path) as picture:
            image, family = picture['image'], str(picture['family'])
            truth = json.loads(str(picture['truth']))
        identifier = create_identifier(family=family, threads=1)
        if family not in warm:  # tables that are made once do not count
            warm.add(family)
            identifier.identify(image[:400, :400])
        found: list[Any] = []
        started = time.process_time()
        calls = calls_of(lambda: found.append(identifier.identify(image)))  # noqa: B023
        seconds = time.process_time() - started
        right, wrong, false = verdicts(found[0].targets, truth)
        seen: dict[str, Any] = {'picture': path.stem, 'right': right, 'wrong': wrong}
        seen |= {'false': false, 'calls': calls, 'seconds': seconds}
        if options.change and options.change[0].partition(':')[0] not in sys.modules:
            raise SystemExit(f'{options.change[0]} is not in a module that is imported')
        print(json.dumps(seen), flush=True)


if __name__ == '__main__':
    main()
