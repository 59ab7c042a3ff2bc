"""`model.yaml`: parameters and effects for identification, feedforward and simulation alike."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Final, Literal

from pydantic import Field, StrictFloat, field_validator

from par4_dynamics.base_terms import AXIS_TERMS, BASE_TERMS
from par4_dynamics.parameters import Parameter
from par4_kinematics.files import (
    FileModel,
    Whole,
    expect_schema,
    parse,
    read_yaml,
    resolve_builtin,
    write_yaml,
)

MODEL_SCHEMA: Final = 'par4/model/1'
PAGE = 'docs/model_file.md'
"""Of the documentation: every key."""
RigidBody = Literal['paper', 'full']
"""Equation (20) as printed, or with the masses of rods and bars where they are."""


class EffectEntry(FileModel):
    """One effect of a model: its name in the catalogue, the joints it acts on, its parameters."""

    effect: str
    joints: tuple[Whole, ...] | None = None
    parameters: dict[str, Parameter]

    @field_validator('joints')
    @classmethod
    def _each_once(cls, joints: tuple[int, ...] | None) -> tuple[int, ...] | None:
        if joints is not None and len(set(joints)) < len(joints):
            raise ValueError('a joint is listed twice; list each once')
        if joints == ():
            raise ValueError('no joint is listed; leave joints out for all, or the effect')
        return joints


class ModelFile(FileModel):
    """The content of `model.yaml`.

    Attributes:
        schema_name: of the file.
        rigid_body: 'paper' for (20), 'full' with the robot's rods and bars distributed.
        parameters: name of a base parameter -> value with unit and standard deviation.
        effects: what the machine does beyond (20).
        torque_limit: of the drives, N m, if the model needs another one than the robot file.
        provenance: where the model comes from; only for readers.
    """

    page: ClassVar[str] = PAGE
    schema_name: Literal['par4/model/1'] = Field(MODEL_SCHEMA, alias='schema')
    rigid_body: RigidBody = 'paper'
    parameters: dict[str, Parameter]
    effects: tuple[EffectEntry, ...] = ()
    torque_limit: StrictFloat | None = Field(None, gt=0)
    provenance: dict[str, Any] = {}

    @field_validator('parameters')
    @classmethod
    def _known_parameters(cls, parameters: dict[str, Parameter]) -> dict[str, Parameter]:
        known = {term.name: term for term in (*BASE_TERMS, *AXIS_TERMS)}
        for name, parameter in parameters.items():
            if name not in known:
                raise ValueError(f'unknown parameter {name}; known are {", ".join(known)}')
            if isinstance(parameter.value, tuple) and not all(
                    isinstance(part, float) for part in parameter.value):
                raise ValueError(f'{name}: expected one number or one a joint, found a list of '
                                 f'lists')
            lowest = parameter.per_joint(4 if not isinstance(parameter.value, tuple)
                                         else len(parameter.value)).min()
            if known[name].nonnegative and lowest < 0:
                raise ValueError(f'{name} must not be negative, found {lowest} '
                                 f'{known[name].unit}')
        return parameters

    def to_yaml(self) -> dict[str, Any]:
        """Return the content as plain dicts and lists, ready to be written."""
        return _plain(self.model_dump(by_alias=True, exclude_none=True))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value


def read_model_file(name_or_path: str | Path) -> ModelFile:
    """Return the model of a `model.yaml` or of a built-in name.

    Raises:
        InputError: not found, not YAML, wrong schema, unknown names, values out of range.
    """
    path = resolve_builtin(name_or_path, 'par4_dynamics')
    content = read_yaml(path)
    expect_schema(content, (MODEL_SCHEMA,), str(path), PAGE)
    return parse(content, ModelFile, str(path))


def write_model_file(path: str | Path, model_file: ModelFile) -> None:
    """Write a `model.yaml`, whole or not at all.

    Raises:
        InputError: the file cannot be written.
    """
    write_yaml(path, model_file.to_yaml())
