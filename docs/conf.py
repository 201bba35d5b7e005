"""Sphinx: the site that `make site` builds, and the pages of the package on docs.ros.org."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

project = 'ahf_ros'
extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon']
default_role = 'code'
rst_epilog = '.. |N - n| replace:: \\|N - n\\|'  # is not a substitution
myst_heading_anchors = 4
autodoc_typehints = 'none'
napoleon_custom_sections = [('Attributes', 'params_style')]
napoleon_use_param = napoleon_use_rtype = False
html_theme = 'furo'
html_title = project
html_show_copyright = False

_NAMED = r'\[[\w/]+\.(?:md|rst)\](\([^)]+\))'
_FIGURES = r'^\| \[([^]]+)\]\((figures/\w+)\.md\)'


def complete(app: Any, name: str, source: list[str]) -> None:
    """Give links titles instead of names of files; and pages of benchmarks a title, and a place.

    Links to files have their names as text, which is what readers of the files themselves need.
    """
    source[0] = re.sub(_NAMED, r'[]\1', source[0])
    page = Path(app.env.doc2path(name))
    if page.name == 'figures.md':
        names = [path for _, path in re.findall(_FIGURES, source[0], re.M)]
        source[0] += '\n'.join(['\n```{toctree}', ':hidden:', '', *names, '```\n'])
    elif page.parent.name == 'figures' and not source[0].startswith('# '):
        titles = re.findall(_FIGURES, (page.parents[1] / 'figures.md').read_text(), re.M)
        title = next((text for text, path in titles if path == f'figures/{page.stem}'), page.stem)
        source[0] = f'# {title[0].upper()}{title[1:]}\n\n{source[0]}'


def setup(app: Any) -> None:
    """Connect what this file does to Sphinx."""
    app.connect('source-read', complete)
