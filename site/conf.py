"""How Sphinx makes the site of the documentation; `make site` calls it, strictly."""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

project = 'Par4'
author = 'Par4 maintainers'
copyright = 'Par4 maintainers, Apache-2.0'
extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon']
html_theme = 'furo'
html_title = 'Par4'
html_show_sphinx = False
myst_heading_anchors = 4
default_role = 'code'
napoleon_use_ivar = True
autodoc_typehints = 'signature'
autodoc_member_order = 'bysource'
autodoc_default_options = {'exclude-members': 'model_config'}
python_maximum_signature_line_length = 80


def plain(_: Sphinx, __: str, ___: str, ____: Any, _____: Any, lines: list[str]) -> None:
    """Let docstrings say |x| and x*: here bars and stars are no markup."""
    lines[:] = [re.sub(r'(?<!`)([|*_])(?!`)', r'\\\1', line) if '`' not in line else
                ''.join(part if part.startswith('`') else re.sub(r'([|*])', r'\\\1', part)
                        for part in re.split(r'(`[^`]*`)', line)) for line in lines]


def setup(app: Sphinx) -> None:
    """Hear of docstrings before they are read."""
    app.connect('autodoc-process-docstring', plain, priority=100)
