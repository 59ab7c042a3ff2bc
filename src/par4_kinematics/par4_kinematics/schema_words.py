"""What a file that breaks its schema is told: the key, what is expected, what was found."""

from __future__ import annotations

import difflib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from par4_kinematics.errors import quoted

MOST = 4
"""Faults of a file that are told; who mends them will see the others."""
Fault = Mapping[str, Any]
"""What pydantic tells of one: its type and context, where it is, what was found."""
Place = tuple[int | str, ...]
"""Keys and indices from the top of a file to a value."""

_EXPECTED = {
    'float_type': 'a number without quotes or unit',
    'float_parsing': 'a number without quotes or unit',
    'finite_number': 'a finite number',
    'int_type': 'a whole number without quotes',
    'int_parsing': 'a whole number without quotes',
    'int_parsing_size': 'a smaller whole number',
    'int_from_float': 'a whole number',
    'bool_type': 'true or false',
    'bool_parsing': 'true or false',
    'string_type': 'text in quotes',
    'greater_than': 'more than {gt:g}',
    'greater_than_equal': '{ge:g} or more',
    'less_than': 'less than {lt:g}',
    'less_than_equal': '{le:g} or less',
    'literal_error': '{expected}',
    'tuple_type': 'a list',
    'list_type': 'a list',
    'is_instance_of': 'a list',  # of poses or targets, as files have it
    'sequence_str': 'a list',
    'dict_type': 'keys with values',
    'model_type': 'keys with values',
    'invalid_key': 'words as keys',
    'too_short': '{min_length} values or more',
    'too_long': '{max_length} values',
}
"""Type of an error of pydantic -> what is expected; fields of its context in braces."""


def faults_in_words(error: ValidationError, model: type[BaseModel]) -> str:
    """Return the first faults of a file, which should be as `model` has it, in one line."""
    return '; '.join(_faults(error.errors(), model))


def _faults(errors: Sequence[Fault], model: type[BaseModel]) -> Iterator[str]:
    lacking: defaultdict[Place, int] = defaultdict(int)  # list -> how many values it should have
    for item in errors:
        place = item['loc']
        if item['type'] == 'missing' and isinstance(place[-1], int):
            lacking[place[:-1]] = place[-1] + 1
    told = set[Place]()
    for item in errors:
        kind, place = item['type'], item['loc']
        short = kind == 'missing' and place[:-1] in lacking
        if short or kind == 'invalid_key':  # of which the list or mapping is told
            place = place[:-1]
        if place in told:
            continue
        if len(told) == MOST:
            return
        told.add(place)
        words = f'expected {lacking[place]} values' if short else _words(item, model)
        found = ('' if isinstance(item['input'], Mapping) and item['type'] not in _EXPECTED else
                 f' (found {quoted(item["input"])})')
        yield f'{".".join(map(str, place)) or "file"}: {words}{found}'


def _words(item: Fault, model: type[BaseModel]) -> str:
    kind, place = item['type'], item['loc']
    if kind == 'missing':
        return 'the key is missing'
    if kind == 'extra_forbidden':
        known = _keys_beside(place, model)
        meant = difflib.get_close_matches(str(place[-1]), known, 1)
        return (f'no such key, did you mean {meant[0]}?' if meant else
                f'no such key; known are {", ".join(known)}')
    if kind in _EXPECTED:
        return f'expected {_EXPECTED[kind].format(**item.get("ctx", {}))}'
    return item['msg'].removeprefix('Value error, ')


def _keys_beside(place: Place, model: type[BaseModel]) -> list[str]:
    """Return the keys that there may be where one at `place` is unknown."""
    for key in place[:-1]:
        for name, field in model.model_fields.items():
            if key in (name, field.alias):
                model = _model_in(field.annotation) or model
    return [field.alias or name for name, field in model.model_fields.items()]


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """Return the model of a field, or of the entries of its list or mapping."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_model_in, get_args(annotation))), None)
