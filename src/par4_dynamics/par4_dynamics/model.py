"""The model of a machine: the base terms of (20), the bodies it leaves out, and effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from par4_dynamics.base_terms import (
    FRICTION,
    OFFSET,
    PLATFORM_MASSES,
    torque_of_values,
    values_of_bodies,
)
from par4_dynamics.effects.effect import Effect
from par4_dynamics.load_friction import LoadFriction, together
from par4_dynamics.mechanism import LumpedBodies
from par4_dynamics.model_file import RigidBody
from par4_dynamics.rigid_body import (
    torque_of_joints_sample,
    torque_of_platform_sample,
    value_table,
)
from par4_dynamics.state import Nominal, State, state_of_joints, state_of_platform
from par4_kinematics.arrays import as_matching_rows
from par4_kinematics.errors import InputError, UnreachableError
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.robot import Bodies, Robot


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

    def pull_torque(self, state: State) -> np.ndarray:
        """Return the torque (n, J), N m, of the forces on the platform that are no friction."""
        return self._torque_of(state, _pulls)

    def force_torque(self, state: State) -> np.ndarray:
        """Return the torque of the effects that are forces on the platform, (n, J) N m."""
        return self._torque_of(state, lambda effect: effect.is_force)

    def passed_torque(self, state: State) -> np.ndarray:
        """Return what goes on behind the friction of joints, of a motion with its nominal torque.

        That is the load, or what springs pass on of it, (n, J) N m.
        """
        found = [own for own in (active.effect.passed(state, active.values)
                                 for active in self.effects) if own is not None]
        return found[0] if found else state.known.load

    def slips(self, state: State) -> LoadFriction | None:
        """Return the friction of joints that turn with the load, None if there is none."""
        found = [own for own in (active.effect.slips(state, active.values)
                                 for active in self.effects) if own is not None]
        return together(found) if found else None

    def angle_torque(self, state: State) -> np.ndarray:
        """Return the torque of the effects that are bound to where each joint is, (n, J) N m.

        The motion has its nominal torque, which some of them scale with; not that of effects which
        follow from it, as zeros of encoders follow from the angles.
        """
        known = state.nominal
        if known is not None:
            state = state.with_nominal(replace(
                known, unscaled=lambda _: known.added, effects=lambda _: known.added,
                scaling=lambda _: 0.0))
        return self._torque_of(state, lambda effect: effect.of_angle)

    def friction(self, state: State) -> dict[str, np.ndarray]:
        """Return the friction (n, J), N m, of the effects, by the base parameter that they are part
        of (`Effect.friction_term`). The motion has its nominal torque."""
        found: dict[str, np.ndarray] = {}
        for active in self.effects:
            for name, torque in active.effect.friction(state, active.values, active.joints).items():
                found[name] = found.get(name, 0.0) + torque
        return found

    def dry_share(self, t: np.ndarray) -> np.ndarray:
        """Return the share of its dry friction that a machine has left at times t (n,), s, (n, 1).
        """
        return np.prod([active.effect.dry_share(t, active.values) for active in self.effects]
                       or [np.ones(len(t))], axis=0)[:, None]

    def following_torque(self, state: State) -> np.ndarray:
        """Return the torque (n, J), N m, of the effects that follow from the nominal one."""
        return self._torque_of(state, lambda effect: effect.needs_nominal)

    def scaling_torque(self, state: State) -> np.ndarray:
        """Return the torque (n, J), N m, of those that scale what the drives deliver."""
        return self._torque_of(state, lambda effect: effect.scales)

    def scale(self, state: State) -> np.ndarray | float:
        """Return what drives tell of a torque over that torque, (n, J), or 1; it follows from q."""
        if not any(active.effect.scales for active in self.effects):
            return 1.0
        one = Nominal(np.ones_like(state.q), state.q, self.values, self.body_torque,
                      self.angle_torque, self.whole)
        return 1.0 + self.scaling_torque(state.with_nominal(one))

    def unscaled_torque(self, state: State) -> np.ndarray:
        """Return the torque (n, J), N m, of all effects of the machine itself.

        What is told of it, in whatever scale, and recorded, late or not, follows from it.
        """
        return self._torque_of(state, lambda effect: not (effect.scales or effect.retimes))

    def _torque_of(self, state: State, has: Callable[[Effect], bool]) -> np.ndarray:
        return sum((active.torque(state) for active in self.effects if has(active.effect)),
                   np.zeros_like(state.q))

    @cached_property
    def whole(self) -> dict[str, np.ndarray]:
        """The base parameters (J,) with what effects add to them (`Effect.base_part`)."""
        whole = {name: value.astype(float) for name, value in self.values.items()}
        for active in self.effects:
            joints = list(active.joints)
            for name, part in active.effect.base_part(active.values).items():
                whole.setdefault(name, np.zeros(len(part)))[joints] += part[joints]
        return whole

    def nominal(self, state: State, bound: Model | None = None) -> Nominal:
        """Return the nominal torque of a motion, which effects need that scale or shift torque.

        Args:
            state: the motion.
            bound: the model whose effects are bound to where joints are (`angle_torque`) and are
                scaled by drives (`unscaled_torque`), this one by default. A search fits the others
                by the angle that is read, in the scale of the record.
        """
        bound = bound or self
        added = sum(active.torque(state) for active in self.effects
                    if not active.effect.needs_nominal)
        forces = self.force_torque(state)
        pulls = any(_pulls(active.effect) for active in self.effects)
        nominal = Nominal(
            torque=torque_of_values(state, self._linear), load=self.body_torque(state) + forces,
            values=self.values, whole=self.whole, body_torque=self.body_torque,
            angle_torque=bound.angle_torque, pull=self.pull_torque if pulls else None, added=added,
            unscaled=bound.unscaled_torque, scale=self.scale(state), effects=self.unscaled_torque,
            scaling=self.scaling_torque, slips=self.slips, friction=self.friction,
            passed=self.passed_torque)
        read = state.with_nominal(nominal)
        try:
            halfway = self._half_the_way(read)
            true = self._half_the_way(halfway)
        except UnreachableError:  # the errors of the model are more than the mechanism allows
            return nominal
        if halfway is read:
            return nominal
        return replace(nominal, halfway=replace(halfway, nominal=nominal), true=replace(
            true, nominal=replace(nominal, load=self.body_torque(true) + self.force_torque(true))))

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

    def with_payload(self, mass: float) -> Model:
        """Return the model of the same machine, a Par4, with a known mass, kg, at the tool."""
        if not mass:
            return self
        at_tool = self.values[PLATFORM_MASSES[0]] + mass
        return replace(self, values={**self.values, PLATFORM_MASSES[0]: at_tool})

    def without_effects(self) -> Model:
        """Return the same model with no effects."""
        return replace(self, effects=())


def _pulls(effect: Effect) -> bool:
    return effect.is_force and not effect.rubs
