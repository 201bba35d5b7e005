"""YAML 1.2, and JSON as a part of it, in bounded time and memory, and with the line of each value.

Neither tags nor merges are accepted, so a text can make nothing but mappings, lists, texts,
numbers, truth values and None.
"""

import re
from typing import Any, NoReturn

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    CollectionEndEvent,
    CollectionStartEvent,
    DocumentStartEvent,
    MappingStartEvent,
    ScalarEvent,
)

from ahf_ros.base.text import shown

_DEEPEST = 20  # levels
_WORDS = {'': None, '~': None, 'null': None, 'true': True, 'false': False}
_INTEGER = re.compile(r'[-+]?[0-9]{1,20}|0x[0-9a-fA-F]{1,16}|0o[0-7]{1,21}|0b[01]{1,64}')
_FLOAT = re.compile(r'[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?')
_NOT_FINITE = re.compile(r'[-+]?\.(inf|nan)', re.IGNORECASE)


class Mapping(dict[Any, Any]):
    """A mapping of YAML; `lines` has the lines of its keys, counted from 1."""

    def __init__(self, line: int) -> None:
        super().__init__()
        self.line = line
        self.lines: dict[Any, int] = {}
        self.key: Any = None


class Listing(list[Any]):
    """A list of YAML; `lines` has the lines of its values, counted from 1."""

    def __init__(self, line: int) -> None:
        super().__init__()
        self.line = line
        self.lines: list[int] = []


def parsed_yaml(text: str, name: str, most: int = 50_000, aliases: bool = False) -> Any:
    """Return the value of a YAML text of at most `most` values.

    Only where `aliases` are accepted, a part may stand for another one; it counts as often as it
    is there. A ValueError calls the text `name`, and names the line.
    """
    tree = _Tree(name, most, aliases)
    try:
        for event in YAML(typ='safe', pure=True).parse(text):
            tree.add(event)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = str(error.problem).splitlines()[0]
        tree.refuse(mark.line + 1 if mark else 1, f'{problem}; accepted is JSON or YAML')
    except YAMLError as error:
        raise ValueError(
            f'{name} is neither JSON nor YAML: {str(error).splitlines()[0]}'
        ) from error
    return tree.value


class _Tree:
    """What the events of a parser stand for so far."""

    def __init__(self, name: str, most: int, aliases: bool) -> None:
        self.value: Any = None
        self._name = name
        self._most = most
        self._aliases = aliases
        self._known: dict[str, tuple[Any, int]] = {}  # by anchor: value and number of values
        self._open: list[tuple[Mapping | Listing, str | None, int]] = []
        self._keys: list[bool] = []  # whether the next scalar of each open part is a key
        self._count = 0
        self._documents = 0

    def refuse(self, line: int, what: str) -> NoReturn:
        raise ValueError(f'{self._name}, line {line}: {what}')

    def add(self, event: Any) -> None:
        line = event.start_mark.line + 1
        if isinstance(event, DocumentStartEvent):
            self._documents += 1
            if self._documents > 1:
                self.refuse(line, 'a second document begins, accepted is one')
        elif isinstance(event, CollectionEndEvent):
            part, anchor, before = self._open.pop()
            self._keys.pop()
            self._remember(anchor, part, self._count - before + 1)
        elif isinstance(event, AliasEvent):
            self._put(self._aliased(event, line), line)
        elif isinstance(event, (ScalarEvent, CollectionStartEvent)):
            if event.tag is not None:
                self.refuse(line, f'the tag {shown(str(event.tag))}, accepted are none')
            self._counted(1, line)
            if isinstance(event, ScalarEvent):
                value = _scalar(event.value) if event.implicit[0] else event.value
                self._remember(event.anchor, value, 1)
                self._put(value, line)
            else:
                self._begin(event, line)

    def _begin(self, event: Any, line: int) -> None:
        part = Mapping(line) if isinstance(event, MappingStartEvent) else Listing(line)
        self._put(part, line)
        self._open.append((part, event.anchor, self._count))
        self._keys.append(isinstance(part, Mapping))
        if len(self._open) > _DEEPEST:
            self.refuse(line, f'it is nested too deep, accepted are {_DEEPEST} levels')

    def _put(self, value: Any, line: int) -> None:
        """Put a value where it belongs, or remember it as the key of the next one."""
        if not self._open:
            self.value = value
            return
        part = self._open[-1][0]
        if isinstance(part, Listing):
            part.append(value)
            part.lines.append(line)
        elif self._keys[-1]:
            if isinstance(value, (dict, list)) or value == '<<':
                self.refuse(line, f'a key is {shown(value)}, accepted is a text or a number')
            if value in part:
                self.refuse(line, f'the key {shown(value)} is there twice, accepted is once')
            part.key, part.lines[value] = value, line
            self._keys[-1] = False
        else:
            part[part.key] = value
            self._keys[-1] = True

    def _aliased(self, event: Any, line: int) -> Any:
        value, size = self._known.get(event.anchor, (None, 0))
        if not self._aliases or not size:
            self.refuse(
                line, 'an alias stands for this part elsewhere, accepted are data without aliases'
            )
        self._counted(size, line)
        return value

    def _remember(self, anchor: str | None, value: Any, size: int) -> None:
        if anchor is not None:
            self._known[anchor] = value, size

    def _counted(self, size: int, line: int) -> None:
        self._count += size
        if self._count > self._most:
            self.refuse(line, f'there are over {self._most} values, accepted are at most as many')


def _scalar(text: str) -> Any:
    """Return the value of a scalar without quotation marks, after the core schema."""
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    if _INTEGER.fullmatch(text):
        return int(text) if text.lstrip('+-').isdecimal() else int(text, 0)
    if _NOT_FINITE.fullmatch(text):
        return float(text.replace('.', ''))
    return float(text) if _FLOAT.fullmatch(text) else text
