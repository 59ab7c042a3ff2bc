"""From a model.yaml to the model of a machine: values, joints and units are checked on the way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from par4_dynamics.base_terms import AXIS_TERMS, BASE_TERMS, HANGING_TERMS, BaseTerm
from par4_dynamics.effects.catalogue import CATALOGUE, effect_named
from par4_dynamics.effects.effect import Effect, EffectParameter
from par4_dynamics.mechanism import physical_bodies
from par4_dynamics.model import ActiveEffect, Model
from par4_dynamics.model_file import EffectEntry, ModelFile, read_model_file
from par4_dynamics.parameters import Number
from par4_kinematics.errors import InputError, quoted
from par4_kinematics.machine_units import spelled_alike, unit_on
from par4_kinematics.robot import Axis, Bodies, Hanging, Robot


def build_model(machine: Robot | Axis, model_file: ModelFile,
                library: Mapping[str, Effect] = CATALOGUE) -> Model:
    """Return the model of `machine` with the parameters and effects of `model_file`.

    `library` says which effect each name stands for.

    Raises:
        InputError: as `torque_model`; platform masses that differ between joints, or masses that
            make a body negative.
    """
    model = torque_model(machine, model_file, library)
    if isinstance(machine, Robot):
        lumped = model.lumped_bodies()
        if model.rigid_body == 'full':
            physical_bodies(machine.geometry, lumped, model.bodies.rod_mass, model.bodies.bar_mass)
    return model


def torque_model(machine: Robot | Axis, model_file: ModelFile,
                 library: Mapping[str, Effect] = CATALOGUE) -> Model:
    """Return the same for its torque alone, which may be that of bodies that no machine has.

    A diagnosis goes through such models where the causes that it has found so far are not all.

    Raises:
        InputError: a parameter that is missing, in another unit than its own or has the wrong
            number of values, the load of another kind of axis, or an unknown effect.
    """
    joints = len(machine.joint_names)
    is_robot = isinstance(machine, Robot)
    wanted = [term for term in BASE_TERMS if is_robot or not term.needs_platform]
    hung = _hanging_terms(machine, model_file)
    missing = [term.name for term in wanted if term.name not in model_file.parameters]
    if missing:
        raise InputError(f'model for {machine.name}: missing parameters {", ".join(missing)}; '
                         f'found {", ".join(model_file.parameters) or "none"}; add them')
    values = {}
    for term in (*wanted, *hung):
        parameter = model_file.parameters[term.name]
        if parameter.unit:
            _own_unit(term.name, parameter.unit, (term.unit,), machine)
        if isinstance(parameter.value, tuple) and len(parameter.value) != joints:
            raise InputError(f'{term.name}: expected one number or {joints}, found '
                             f'{len(parameter.value)}')
        values[term.name] = parameter.per_joint(joints)
    effects = tuple(_active_effect(entry, effect_named(entry.effect, library), machine)
                    for entry in model_file.effects)
    bodies = machine.bodies if isinstance(machine, Robot) else Bodies()
    return Model(model_file.rigid_body, values, bodies, effects, model_file.torque_limit)


def _hanging_terms(machine: Robot | Axis, model_file: ModelFile) -> list[BaseTerm]:
    """Return the terms of `model_file` by which gravity loads a single axis.

    Raises:
        InputError: of a robot, which has others, or of an axis that does not turn or slide so.
    """
    hung = [term for term in AXIS_TERMS
            if term not in BASE_TERMS and term.name in model_file.parameters]
    if isinstance(machine, Robot):
        if hung:
            raise InputError(f'model for {machine.name}: {hung[0].name} is of a single axis; a '
                             f'robot has arm_gravity and its platform masses')
        return hung
    kind: Hanging = 'turning' if machine.kind == 'revolute' else 'sliding'
    own = HANGING_TERMS[kind]
    for term in hung:
        if term not in own:
            raise InputError(f'model for {machine.name}: {term.name} is no load of a {kind} axis; '
                             f'it has {", ".join(term.name for term in own)}')
    return hung


def _own_unit(name: str, found: str, units: Sequence[str], machine: Robot | Axis) -> str:
    """Return which of its `units` a parameter is given in, as they are on turning joints.

    Raises:
        InputError: another unit, the numbers of which would be misread.
    """
    for alike in (str.__eq__, spelled_alike):
        for unit in units:
            if found and (alike(found, unit) or alike(found, unit_on(machine, unit))):
                return unit
    expected = ' or '.join(repr(unit_on(machine, unit)) for unit in units)
    raise InputError(f'{name}: expected the unit {expected}, found {quoted(found)}; numbers are '
                     f'never converted, give them in {expected}')


def _active_effect(entry: EffectEntry, effect: Effect, machine: Robot | Axis) -> ActiveEffect:
    joints = len(machine.joint_names)
    if effect.needs_platform and not isinstance(machine, Robot):
        raise InputError(f'effect {effect.name} needs a platform, the machine is a single axis')
    if effect.needs_turning and isinstance(machine, Axis) and machine.kind == 'linear':
        raise InputError(f'effect {effect.name} needs a platform or an axis that turns, the '
                         f'machine is a linear axis')
    known = {parameter.name: parameter for parameter in effect.parameters}
    required = {name for name, parameter in known.items() if parameter.default is None}
    if not required <= set(entry.parameters) <= set(known) or not entry.parameters:
        raise InputError(f'effect {effect.name}: expected parameters {", ".join(sorted(known))}, '
                         f'found {", ".join(sorted(entry.parameters)) or "none"}')
    acting = tuple(range(joints)) if entry.joints is None else entry.joints
    if any(not 0 <= joint < joints for joint in acting):
        raise InputError(f'effect {effect.name}: joints must be 0 to {joints - 1}, found '
                         f'{list(acting)}')
    if effect.of_machine and len(acting) < joints:
        raise InputError(f'effect {effect.name} is of the whole machine, found joints '
                         f'{list(acting)}; leave the joints out')
    values, units, orders = {}, {}, _orders(effect, entry)
    for name, given in entry.parameters.items():
        other = known[name].other_unit
        if given.unit or other is not None:
            possible = (known[name].unit, *(() if other is None else (other,)))
            unit = _own_unit(f'effect {effect.name}, {name}', given.unit, possible, machine)
            if other is not None:
                units[name] = unit
        try:
            values[name] = _numbers(known[name], given.value, acting, joints, orders)
        except InputError as error:
            raise InputError(f'effect {effect.name}, {name}: {error}') from None
    for name, parameter in known.items():
        if name not in values:
            values[name] = (values[parameter.default].copy() if isinstance(parameter.default, str)
                            else np.full(joints, parameter.default))
    reason = effect.senseless({
        name: value[list(acting)] if known[name].scope == 'joint' else value
        for name, value in values.items()})
    if reason is not None:
        raise InputError(f'effect {effect.name}, {reason}')
    return ActiveEffect(effect, acting, values, units)


def _orders(effect: Effect, entry: EffectEntry) -> int | None:
    """Return how many orders of a periodic torque, or terms of a series, are listed.

    None where none are.
    """
    if not any(parameter.per_order and parameter.is_shape for parameter in effect.parameters):
        listed = [entry.parameters[parameter.name].value for parameter in effect.parameters
                  if parameter.per_order]
        return next((len(value) for value in listed if isinstance(value, tuple)), None)
    for parameter in effect.parameters:
        given = entry.parameters.get(parameter.name)
        if not (parameter.per_order and parameter.is_shape and given is not None
                and isinstance(given.value, tuple)):
            continue
        if (not all(isinstance(order, float) and order > 0.0 for order in given.value)
                or len(set(given.value)) < len(given.value)):
            raise InputError(f'effect {effect.name}, {parameter.name}: expected one number, or a '
                             f'list of positive ones that differ, one an order; found '
                             f'{given.value}')
        return len(given.value)
    return None


def _numbers(parameter: EffectParameter, given: Number, acting: tuple[int, ...], joints: int,
             orders: int | None) -> np.ndarray:
    """Return the values of a parameter as `Values` has them, from what a model file gives."""
    if orders is not None and parameter.per_order:
        parts = given if isinstance(given, tuple) else (given,) * orders
        if len(parts) != orders:
            raise InputError(f'expected one number, or a list with an entry for each of the '
                             f'{orders} orders; found {len(parts)} entries')
        return np.stack([_numbers(replace(parameter, per_order=False), part, acting, joints, None)
                         for part in parts], axis=-1)
    if isinstance(given, tuple) and any(isinstance(part, tuple) for part in given):
        raise InputError('expected numbers, found a list in a list'
                         + (', which needs a list of periods' if parameter.per_order else ''))
    count = len(given) if isinstance(given, tuple) else 1
    if parameter.size > 1:
        if isinstance(given, float) and parameter.uniform:
            return np.full(parameter.size, given)
        if count != parameter.size:
            one = 'one number or ' if parameter.uniform else ''
            raise InputError(f'expected {one}{parameter.size} numbers, found {given}')
        return np.array(given)
    if parameter.scope == 'machine':  # the law reads it at any joint
        if isinstance(given, tuple) and len(set(given)) != 1:
            raise InputError(f'expected one number, of the whole machine; found {given}')
        return np.full(joints, given[0] if isinstance(given, tuple) else given)
    if isinstance(given, tuple) and count == joints:
        if len(acting) == joints and acting != tuple(range(joints)):
            raise InputError(f'{joints} numbers are those of joints 0 to {joints - 1}, but joints '
                             f'lists {list(acting)}; list the joints in ascending order')
        return np.where(np.isin(np.arange(joints), acting), given, 0.0)
    if isinstance(given, tuple) and count != len(acting):
        raise InputError(f'expected one number, one for each of its {len(acting)} joints or '
                         f'{joints}, found {count}')
    full = np.zeros(joints)
    full[list(acting)] = given
    return full


def read_model(name_or_path: str | Path, machine: Robot | Axis) -> Model:
    """Return the model of a `model.yaml` or built-in name for `machine`.

    Raises:
        InputError: see `read_model_file` and `build_model`.
    """
    return read_file_and_model(name_or_path, machine)[1]


def read_file_and_model(name_or_path: str | Path, machine: Robot | Axis
                        ) -> tuple[ModelFile, Model]:
    """Return what a `model.yaml` or built-in name says and the model that it makes of `machine`.

    Raises:
        InputError: see `read_model_file` and `build_model`; it names the file.
    """
    model_file = read_model_file(name_or_path)
    try:
        return model_file, build_model(machine, model_file)
    except InputError as error:
        raise InputError(f'{name_or_path}: {error}') from None
