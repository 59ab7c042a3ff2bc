"""The model of a machine: the base terms of (20), the bodies it leaves out, and effects."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from par4_dynamics.base_terms import BASE_TERMS, base_columns, base_terms, distributed_torque
from par4_dynamics.effects.catalogue import effect_named
from par4_dynamics.effects.effect import Effect
from par4_dynamics.mechanism import LumpedBodies, physical_bodies
from par4_dynamics.model_file import EffectEntry, ModelFile, read_model_file
from par4_dynamics.state import Nominal, State
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Bodies, Robot


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
    """Torque of a motion: W chi of (21), plus distributed bodies (`full`), plus effects.

    Attributes:
        rigid_body: 'paper' for (20), 'full' for distributed rods and bars.
        values: base parameter name -> (J,).
        bodies: the masses that `full` distributes.
        effects: what else the machine does.
        torque_limit: of the drives where the model needs its own, N m.
    """

    rigid_body: str
    values: dict[str, np.ndarray]
    bodies: Bodies
    effects: tuple[ActiveEffect, ...] = ()
    torque_limit: float | None = None

    def base_torque(self, state: State) -> np.ndarray:
        """Return W chi (n, J), N m: equation (20)."""
        columns = base_columns(state)
        chi = np.stack([self.values[term.name] for term in base_terms(state)])
        return np.einsum('njp,pj->nj', columns, chi)

    def distributed_torque(self, state: State) -> np.ndarray:
        """Return what distributed bodies add to (20), (n, J) N m; zero for `paper`."""
        return (distributed_torque(self.bodies, state) if self.rigid_body == 'full'
                else np.zeros_like(state.q))

    def rigid_torque(self, state: State) -> np.ndarray:
        """Return the torque of the bodies alone, no friction, no effects, (n, J) N m."""
        return self.base_torque(state) - self.friction_torque(state) + self.distributed_torque(state)

    def friction_torque(self, state: State) -> np.ndarray:
        """Return Coulomb and viscous friction of (20), (n, J) N m."""
        return (self.values['coulomb_friction'] * np.sign(state.qd)
                + self.values['viscous_friction'] * state.qd)

    def nominal(self, state: State) -> Nominal:
        """Return the torque of a motion without effects, as effects refer to it."""
        torque = self.base_torque(state) + self.distributed_torque(state)
        return Nominal(torque, self.friction_torque(state), self.values, self.rigid_torque)

    def known_torque(self, state: State) -> np.ndarray:
        """Return what is not linear in the base parameters (n, J): bodies and effects."""
        total = self.distributed_torque(state)
        if any(active.effect.needs_nominal for active in self.effects):
            state = replace(state, nominal=self.nominal(state))
        for active in self.effects:
            total = total + active.torque(state)
        return total

    def torque(self, state: State) -> np.ndarray:
        """Return the joint torques (n, J), N m, that this motion needs."""
        return self.base_torque(state) + self.known_torque(state)

    def lumped_bodies(self) -> LumpedBodies:
        """Return the rigid bodies as the equations of motion take them.

        Raises:
            InputError: platform masses that differ between joints.
        """
        for name in ('platform_mass_1', 'platform_mass_2'):
            if np.ptp(self.values[name]) > 0:
                raise InputError(f'{name}: one number for the machine, found '
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


def build_model(machine: Robot | Axis, model_file: ModelFile) -> Model:
    """Return the model of `machine` with the parameters and effects of `model_file`.

    Raises:
        InputError: a parameter that is missing or has the wrong number of values, an unknown
            effect, or masses that make a body negative.
    """
    joints = len(machine.joint_names)
    is_robot = isinstance(machine, Robot)
    wanted = [term for term in BASE_TERMS if is_robot or not term.needs_platform]
    missing = [term.name for term in wanted if term.name not in model_file.parameters]
    if missing:
        raise InputError(f'model for {machine.name}: missing parameters {", ".join(missing)}; '
                         f'found {", ".join(model_file.parameters)}; add them')
    values = {}
    for term in wanted:
        parameter = model_file.parameters[term.name]
        if isinstance(parameter.value, tuple) and len(parameter.value) != joints:
            raise InputError(f'{term.name}: expected one number or {joints}, found '
                             f'{len(parameter.value)}')
        values[term.name] = parameter.per_joint(joints)
    effects = tuple(_active_effect(entry, joints, is_robot) for entry in model_file.effects)
    bodies = machine.bodies if is_robot else Bodies()
    model = Model(model_file.rigid_body, values, bodies, effects, model_file.torque_limit)
    if is_robot and model.rigid_body == 'full':
        physical_bodies(machine.geometry, model.lumped_bodies(), bodies.rod_mass, bodies.bar_mass)
    return model


def _active_effect(entry: EffectEntry, joints: int, is_robot: bool) -> ActiveEffect:
    effect = effect_named(entry.effect)
    if effect.needs_platform and not is_robot:
        raise InputError(f'effect {effect.name} needs a platform, the machine is a single axis')
    known = {parameter.name: parameter for parameter in effect.parameters}
    required = {name for name, parameter in known.items() if parameter.default is None}
    if not required <= set(entry.parameters) <= set(known) or not entry.parameters:
        raise InputError(f'effect {effect.name}: expected parameters {", ".join(sorted(known))}, '
                         f'found {", ".join(sorted(entry.parameters)) or "none"}')
    acting = tuple(range(joints)) if entry.joints is None else entry.joints
    if any(not 0 <= joint < joints for joint in acting):
        raise InputError(f'effect {effect.name}: joints must be 0 to {joints - 1}, found '
                         f'{list(acting)}')
    values = {name: np.full(joints, parameter.default) for name, parameter in known.items()
              if parameter.default is not None}
    units = {}
    for name, parameter in entry.parameters.items():
        if known[name].other_unit is not None:
            both = (known[name].unit, known[name].other_unit)
            if parameter.unit not in both:
                raise InputError(f'effect {effect.name}, {name}: give its unit, {both[0]!r} or '
                                 f'{both[1]!r}; found {parameter.unit!r}')
            units[name] = parameter.unit
        given = parameter.value
        if known[name].size > 1:
            if not isinstance(given, tuple) or len(given) != known[name].size:
                raise InputError(f'effect {effect.name}, {name}: expected {known[name].size} '
                                 f'numbers, found {given}')
            values[name] = np.array(given)
            continue
        full = np.zeros(joints)
        if isinstance(given, tuple) and len(given) not in (joints, len(acting)):
            raise InputError(f'effect {effect.name}, {name}: expected one number, one for each of '
                             f'its {len(acting)} joints or {joints}, found {len(given)}')
        if isinstance(given, tuple) and len(given) == joints:
            full[:] = given
        else:
            full[list(acting)] = given
        values[name] = full
    return ActiveEffect(effect, acting, values, units)


def read_model(name_or_path: str | Path, machine: Robot | Axis) -> Model:
    """Return the model of a `model.yaml` or built-in name for `machine`; see `build_model`."""
    return build_model(machine, read_model_file(name_or_path))
