"""The model of a machine: the base terms of (20), the bodies it leaves out, and effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from par4_dynamics.base_terms import (
    AXIS_TERMS,
    BASE_TERMS,
    FRICTION,
    HANGING_TERMS,
    OFFSET,
    PLATFORM_MASSES,
    BaseTerm,
    torque_of_values,
    values_of_bodies,
)
from par4_dynamics.effects.catalogue import CATALOGUE, effect_named
from par4_dynamics.effects.effect import Effect, EffectParameter
from par4_dynamics.mechanism import LumpedBodies, physical_bodies
from par4_dynamics.model_file import EffectEntry, ModelFile, RigidBody, read_model_file
from par4_dynamics.parameters import Number
from par4_dynamics.rigid_body import (
    torque_of_joints_sample,
    torque_of_platform_sample,
    value_table,
)
from par4_dynamics.state import Nominal, State, state_of_joints, state_of_platform
from par4_kinematics.arrays import as_matching_rows
from par4_kinematics.errors import InputError, UnreachableError, quoted
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.machine_units import spelled_alike, unit_on
from par4_kinematics.robot import Axis, Bodies, Hanging, Robot


@dataclass(frozen=True)
class ActiveEffect:
    """An effect with its values: parameter name -> (J,), and the joints it acts on.

    Attributes:
        units: parameter name -> unit, where a model gave one of two.
    """

    effect: Effect
    joints: tuple[int, ...]
    values: dict[str, np.ndarray]
    units: dict[str, str] = field(default_factory=dict)

    def torque(self, state: State) -> np.ndarray:
        """Return its torque (n, J), N m."""
        return self.effect.torque(state, self.values, self.joints)


@dataclass(frozen=True)
class Model:
    """The model of a machine: torque = W chi of (21) + distributed bodies (`full`) + effects.

    Attributes:
        rigid_body: 'paper' for (20), 'full' for distributed rods and bars.
        values: base parameter name -> (J,).
        bodies: masses of rods and bars, which `full` distributes along them.
        effects: the effects of the machine, with values and joints.
        torque_limit: of the drives, N m, if the model needs another one than the robot file; else
            None.
        apart: what base parameters have beyond `values`, name -> (J,), of a recording from which
            its torque was taken; its bodies are carried all the same.
    """

    rigid_body: RigidBody
    values: dict[str, np.ndarray]
    bodies: Bodies
    effects: tuple[ActiveEffect, ...] = ()
    torque_limit: float | None = None
    apart: dict[str, np.ndarray] = field(default_factory=dict)

    def limit_of_drives(self, robot: Robot) -> float:
        """Return the largest torque of the drives, N m: the model's, or else the robot's."""
        return self.torque_limit or robot.drives.torque_limit

    def base_torque(self, state: State) -> np.ndarray:
        """Return W chi (n, J), N m: equation (20)."""
        return torque_of_values(state, self.values)

    def distributed_torque(self, state: State) -> np.ndarray:
        """Return what distributed bodies add to (20), (n, J) N m; zero for `paper`."""
        return torque_of_values(state, self._distributed)

    def rigid_torque(self, state: State) -> np.ndarray:
        """Return the torque of the bodies alone, no friction, no effects, (n, J) N m."""
        return torque_of_values(state, {name: value for name, value in self._linear.items()
                                        if name not in FRICTION})

    def body_torque(self, state: State) -> np.ndarray:
        """Return `rigid_torque` with the bodies that are effects or `apart`, (n, J) N m."""
        apart = {name: value for name, value in self.apart.items()
                 if name not in (*FRICTION, OFFSET.name)}
        return self.rigid_torque(state) + torque_of_values(state, apart) + sum(
            (active.torque(state) for active in self.effects if active.effect.is_body),
            np.zeros_like(state.q))

    def angle_torque(self, state: State) -> np.ndarray:
        """Return the torque of the effects that are bound to where each joint is, (n, J) N m.

        The motion has its nominal torque, which some of them scale with.
        """
        return sum((active.torque(state) for active in self.effects if active.effect.of_angle),
                   np.zeros_like(state.q))

    def following_torque(self, state: State) -> np.ndarray:
        """Return the torque (n, J), N m, of the effects that follow from the nominal one."""
        return sum((active.torque(state) for active in self.effects if active.effect.needs_nominal),
                   np.zeros_like(state.q))

    def nominal(self, state: State, bound: Model | None = None) -> Nominal:
        """Return the nominal torque of a motion, which effects need that scale or shift torque.

        Args:
            state: the motion.
            bound: the model whose effects are bound to where joints are (`angle_torque`), this one
                by default. A search fits the others by the angle that is read.
        """
        added = sum(active.torque(state) for active in self.effects
                    if not active.effect.needs_nominal)
        nominal = Nominal(torque_of_values(state, self._linear), self.body_torque(state),
                          self.values, self.body_torque,
                          (bound or self).angle_torque, added)
        read = state.with_nominal(nominal)
        try:
            halfway = self._half_the_way(read)
            true = self._half_the_way(halfway)
        except UnreachableError:  # the errors of the model are more than the mechanism allows
            return nominal
        if halfway is read:
            return nominal
        return replace(nominal, halfway=replace(halfway, nominal=nominal), true=replace(
            true, nominal=replace(nominal, load=self.body_torque(true))))

    def _half_the_way(self, state: State) -> State:
        """Return the motion half of the known errors away from this one, see `Effect.halfway`."""
        for active in self.effects:
            state = active.effect.halfway(state, active.values)
        return state

    def known_torque(self, state: State) -> np.ndarray:
        """Return the torque (n, J), N m, of distributed bodies and effects: all but W chi."""
        return self._with_effects(state, self.distributed_torque(state))

    def torque(self, state: State) -> np.ndarray:
        """Return the joint torques (n, J), N m, that this motion needs."""
        return self._with_effects(state, torque_of_values(state, self._linear))

    def torque_of_platform(self, geometry: Geometry, x: ArrayLike, xd: ArrayLike, xdd: ArrayLike,
                           t: ArrayLike = 0.0) -> np.ndarray:
        """Return the joint torques (..., 4), N m, of platform motion x, xd, xdd (..., 4) at t.

        Quick for one sample (4,) of a model without effects: control loops.

        Raises:
            UnreachableError: a pose that a leg cannot reach.
            InputError: shapes that do not match or values that are not finite.
        """
        torque = self._torque_of_one(torque_of_platform_sample, geometry, x, xd, xdd)
        if torque is not None:
            return torque
        (x, xd, xdd), leading = as_matching_rows({'x': x, 'xd': xd, 'xdd': xdd})
        t = np.broadcast_to(t, leading).reshape(-1)
        return self.torque(state_of_platform(geometry, t, x, xd, xdd)).reshape((*leading, LEGS))

    def torque_of_joints(self, geometry: Geometry, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike,
                         t: ArrayLike = 0.0) -> np.ndarray:
        """Return the joint torques (..., 4), N m, of joint motion q, qd, qdd (..., 4) at t.

        Quick for one sample (4,) of a model without effects: control loops.

        Raises:
            UnreachableError: joint positions with which the mechanism does not close.
            InputError: shapes that do not match or values that are not finite.
        """
        torque = self._torque_of_one(torque_of_joints_sample, geometry, q, qd, qdd)
        if torque is not None:
            return torque
        (q, qd, qdd), leading = as_matching_rows({'q': q, 'qd': qd, 'qdd': qdd})
        t = np.broadcast_to(t, leading).reshape(-1)
        return self.torque(state_of_joints(geometry, t, q, qd, qdd)).reshape((*leading, LEGS))

    def _torque_of_one(self, sample: Callable[..., Any], geometry: Geometry, *motion: ArrayLike
                       ) -> np.ndarray | None:
        """Return the torques (4,) of one sample, None if it is not one or not so simple."""
        if self.effects or any(np.shape(part) != (LEGS,) for part in motion):
            return None
        torque = np.empty(LEGS)
        if sample(geometry.packed, self._table, np.array(motion, dtype=float), torque):
            return torque
        return None  # what is wrong is for the checks to say

    @cached_property
    def _distributed(self) -> dict[str, float]:
        return values_of_bodies(self.bodies) if self.rigid_body == 'full' else {}

    @cached_property
    def _linear(self) -> dict[str, np.ndarray | float]:
        """All that the torque is linear in but the effects: parameter -> value."""
        return {**self.values, **self._distributed}

    @cached_property
    def _table(self) -> np.ndarray:
        return value_table(self._linear)

    @cached_property
    def rigid_table(self) -> np.ndarray:
        """The bodies alone as the compiled kernels take them, no friction, no effects, (36,)."""
        return value_table({name: value for name, value in self._linear.items()
                            if name not in FRICTION})

    def _with_effects(self, state: State, torque: np.ndarray) -> np.ndarray:
        if any(active.effect.needs_nominal for active in self.effects):
            state = state.with_nominal(self.nominal(state))
        for active in self.effects:
            torque = torque + active.torque(state)
        return torque

    def lumped_bodies(self) -> LumpedBodies:
        """Return the rigid bodies as the equations of motion take them.

        Raises:
            InputError: platform masses that differ between joints.
        """
        for name in PLATFORM_MASSES:
            if np.ptp(self.values[name]) > 0:
                raise InputError(f'{name}: expected one number for the machine, found '
                                 f'{self.values[name].tolist()}')
        full = self.rigid_body == 'full'
        return LumpedBodies(
            self.values['actuator_inertia'], float(self.values['platform_mass_1'][0]),
            float(self.values['platform_mass_2'][0]), self.values['arm_gravity'],
            self.bodies.rod_mass if full else 0.0, self.bodies.bar_mass if full else 0.0,
            self.bodies.theta_inertia if full else 0.0)

    def without_effects(self) -> Model:
        """Return the same model with no effects."""
        return replace(self, effects=())


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
                         f'found {", ".join(model_file.parameters)}; add them')
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
