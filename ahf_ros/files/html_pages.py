"""HTML pages that need no other file: a folder has the template, the styles and the scripts."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ahf_ros.base.extras import need

_COMMON = Path(__file__).parent / 'html'  # the head and the colours of all pages


def page_style(folder: Path, name: str) -> str:
    """Return the colours of all pages and the styles of one."""
    files = _COMMON / 'colours.css', folder / name
    return '\n'.join(it.read_text(encoding='utf-8') for it in files)


def page_script(folder: Path, names: Iterable[str]) -> str:
    """Return scripts of a page, in their order."""
    return '\n'.join((folder / f'{it}.js').read_text(encoding='utf-8') for it in names)


def page_template(folder: Path, name: str) -> Any:
    """Return a template of jinja2, or raise a `MissingExtra`."""
    need('report')
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader([folder, _COMMON]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)


def script_json(value: Any) -> str:
    """Return JSON that a script element can hold, whatever texts are in it."""
    text = json.dumps(value, separators=(',', ':'), allow_nan=False)
    return text.replace('<', '\\u003c')
