"""What is said of a text that is not YAML: the line, what is there, what is likely meant."""

from __future__ import annotations

import re
from typing import Any

from ruamel.yaml.error import YAMLError
from ruamel.yaml.reader import ReaderError

from par4_kinematics.errors import quoted

_PROBLEMS = (
    (r"found undefined alias '(.*)'",
     r'*\1 stands for nothing; put text that begins with * in quotes'),
    (r'found duplicate key "(.*?)" with', r'the key \1 is there twice; keep one of them'),
    (r'mapping values are not allowed here',
     'a colon where no key can be; check the indentation, or put the text in quotes'),
    (r'expected <block end>',
     'this does not continue what is above; check indentation and commas'),
    (r"expected ',' or '(.)', but got '<stream end>'", r'a bracket is not closed by \1; close it'),
    (r"expected ',' or '(.)'", r'a comma or \1 is missing before this; add it'),
    (r"but found '<stream end>'", 'a bracket is not closed; close it'),
    (r'expected the node content', 'a value is missing before this; give it'),
    (r"found character '\\t'", 'a tab; indent with spaces'),
    (r"found character '(.)' that cannot start",
     r'no value can begin with \1; put the text in quotes'),
    (r'found unexpected end of stream', 'a quote is not closed; close it'),
    (r"could not find expected ':'", 'a line without a colon; give key: value'),
    (r"constructor for the tag '(.*)'", r'the tag \1 is not known; leave it out'),
    (r'but found another document', 'a second document begins; keep one in a file'),
    (r'escape', 'no such escape in double quotes; use single quotes'),
    (r'unacceptable character', 'a character that is no text; remove it'),
    (r'unhashable key', 'a key that is a list or mapping; give a word'),
)
"""What ruamel tells of a problem -> what is wrong and what to do."""


def problem_in_words(error: YAMLError, text: str) -> str:
    """Return where and how a text is not YAML, and what to do, in one line."""
    mark, problem = _where(error, text)
    words = next((re.sub(rf'(?s).*?{pattern}.*', told, problem) for pattern, told in _PROBLEMS
                  if re.search(pattern, problem)), 'this is not YAML; mend it, or put it in quotes')
    lines = text.split('\n')
    number = min(mark, len(lines) - 1)
    while number and not lines[number].strip():  # a text may end before what it lacks
        number -= 1
    return f'not YAML in line {number + 1}: {words} (found {quoted(lines[number].strip())})'


def _where(error: Any, text: str) -> tuple[int, str]:
    """Return the line, from 0, and ruamel's words."""
    if isinstance(error, ReaderError):
        return text[:error.position].count('\n'), str(error)
    problem = (error.problem or '').replace('tag:yaml.org,2002:', '!!')
    unclosed = re.search('stream end|end of stream', problem) and error.context_mark
    mark = error.context_mark if unclosed else error.problem_mark or error.context_mark
    return (mark.line if mark is not None else 0), problem
