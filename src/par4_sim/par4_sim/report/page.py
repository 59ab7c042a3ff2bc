"""The page that every report is: one self-contained file of HTML, words first.

Its skeleton and its style are `templates/base.html`, which the template of a report extends.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from par4_sim.report.outcome import Outcome
from par4_sim.report.words import in_words


def rendered(package: str, template: str, outcome: Outcome, title: str, insights_title: str,
             provenance: Mapping[str, Any], facts_title: str = 'Where this comes from',
             bags: Sequence[Mapping[str, Any]] = (), **content: Any) -> str:
    """Return the page of a report.

    Args:
        package: whose `templates` folder holds the template.
        template: name of a file that extends `base.html`.
        outcome: the first screen.
        title: of the page.
        insights_title: of the findings.
        provenance: told at the end, under `facts_title`.
        bags: what was read, a row each.
        content: what the template asks for; also `names` where bags were read.
    """
    loaders = [PackageLoader(package), PackageLoader('par4_sim.report')]
    environment = Environment(loader=ChoiceLoader(loaders), autoescape=True, trim_blocks=True,
                              lstrip_blocks=True, undefined=StrictUndefined)
    environment.filters.update(minus=_minus, symbol=_symbol)
    return environment.get_template(template).render(
        title=title, outcome=outcome, insights_title=insights_title, facts=_facts(provenance),
        facts_title=facts_title, bags=bags, **content)


def _minus(text: object) -> str:
    """Return text with true minus signs in front of numbers."""
    return re.sub(r'(?<![\w.-])-(?=[\d.])', '\N{MINUS SIGN}', str(text))


def _symbol(text: str) -> Markup:
    """Return a symbol of the paper with its indices lowered."""
    primed = str(escape(text)).replace('&#39;', '\N{PRIME}')
    return Markup(re.sub(r'_(\w+)', r'<sub>\1</sub>', primed))


def _facts(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the entries of a provenance, which may hold anything, a line each."""
    facts = []
    for name, value in provenance.items():
        if name == 'bags' and isinstance(value, list):
            facts += [('bag', _bag_fact(bag)) for bag in value]
        elif isinstance(value, dict):
            parts = (f'{key} {item}' for key, item in value.items())
            facts.append((in_words(name), ', '.join(parts)))
        else:
            facts.append((in_words(name), str(value)))
    return [(name, text) for name, text in facts if text]


def _bag_fact(bag: object) -> str:
    if isinstance(bag, dict) and {'path', 'sha256'} <= bag.keys():
        return f'{bag["path"]}, sha256 {str(bag["sha256"])[:16]}…'
    return str(bag)
