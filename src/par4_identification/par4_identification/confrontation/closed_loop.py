"""A simulated machine under its own drives along a path, recorded at the times of a log."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace

import numpy as np

from par4_dynamics.base_terms import FRICTION
from par4_dynamics.effects.effect import Base
from par4_dynamics.model import Model
from par4_dynamics.state import state_of_joints
from par4_identification.fitting.simulated import PERIOD, shift_of, simulated_along
from par4_identification.logs.log import Reference
from par4_kinematics.approach import approach_to
from par4_kinematics.robot import Robot
from par4_sim.closed_loop.simulation import build_simulation
from par4_sim.drives.reference import TARGET, interpolate
from par4_sim.drives.reference_curve import COLUMNS

BLEND = 0.5
"""Seconds from rest to the speed at which a stretch begins."""


def closed_loop(robot: Robot, model: Model, path: Reference, t: np.ndarray, fidelity: str,
                late: float = 0.0, progress: Callable[[float], None] | None = None
                ) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and recorded torques (n, 4) of a machine along a path at times t (n,), s.

    The machine approaches the first point from home, and its drives settle. They read speeds
    `late` seconds late, whatever those of the plant are.
    """
    with closing(build_simulation(robot, model, 'exact', PERIOD)) as home:
        approach = approach_to(path.q[0], robot, home.q, PERIOD, 'the stretch')
        shift = shift_of(path, home.time + approach.duration + BLEND)
    with closing(build_simulation(robot, _begun(model, -shift), fidelity, PERIOD)) as simulation:
        # a speed read by d too late lets the drives ask for velocity_gain d qdd more; the plant's
        # are late by -velocity_offset
        late += simulation.plant.velocity_offset
        simulation.queue_effort(shift + path.t, known_effort(path)
                                + late * robot.drives.velocity_gain * path.qdd)
        return simulated_along(simulation, approach, path, shift, t, progress)


def _begun(model: Model, begin: float) -> Model:
    """Return the model for a clock that begins `begin` seconds after that of the log."""
    base: Base = model.values
    effects = []
    for active in model.effects:
        values, base = active.effect.begun(active.values, base, begin)
        effects.append(replace(active, values=dict(values)))
    levels = {name: np.divide(base[name], model.values[name], out=np.ones(len(base[name])),
                              where=model.values[name] != 0.0) for name in FRICTION}
    effects = [replace(active, values=dict(active.effect.lowered(active.values, levels)))
               for active in effects]
    return replace(model, effects=tuple(effects), values=dict(base))


def torque_along(robot: Robot, model: Model, path: Reference) -> np.ndarray:
    """Return the feedforward torque (m, 4), N m, of a model along a path."""
    return model.torque(state_of_joints(robot.geometry, path.t, path.q, path.qd, path.qdd))


def targets_at(path: Reference, t: np.ndarray) -> np.ndarray:
    """Return the targets (n, TARGET) of a path at times t (n,), as the drives see them."""
    points = np.zeros((len(path.t), COLUMNS))
    points[:] = np.concatenate((path.q, path.qd, path.qdd, known_effort(path)), axis=1)
    targets = np.empty((len(t), TARGET))
    for row, time in enumerate(t):
        interpolate(path.t, points, time, 0.0, targets[row])
    return targets


def known_effort(path: Reference) -> np.ndarray:
    """Return the feedforward torque (m, 4), N m, of a path; what is missing counts as zero."""
    return np.zeros_like(path.q) if path.effort is None else np.nan_to_num(path.effort)
