"""Pictures of steady speeds: mean torques over speed, and what models say of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.model_from_file import build_model
from par4_dynamics.state import State
from par4_identification.diagnosis.verdict.answer import Diagnosis
from par4_identification.reports.names import Names
from par4_identification.signals.run import Run
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.drawing import AFTER, BEFORE, FLOOR, INK, drawn, image, legend

POINTS = 801
"""At which models are drawn."""


@dataclass(frozen=True)
class SteadySpeeds:
    """Mean torques at steady speeds, and what models say of them.

    Attributes:
        speed, torque: of the plateaus, (m,).
        heldout: which took no part in the fit, (m,).
        left: torque less that of the extended model, or of the one there is, (m,).
        curve: speeds at which the models are drawn, (n,).
        before, after: torque of the old and of the extended model there, (n,); the second is None
            where there is one model only.
        floor: standard deviation of a mean torque.
    """

    speed: np.ndarray
    torque: np.ndarray
    heldout: np.ndarray
    left: np.ndarray
    curve: np.ndarray
    before: np.ndarray
    after: np.ndarray | None
    floor: float


def steady_speeds_of(diagnosis: Diagnosis, machine: Robot | Axis) -> SteadySpeeds:
    """Return the plateaus of a diagnosis with the old model and the extended one."""
    fitted, held = diagnosis.fit_runs, diagnosis.holdout.runs
    speed, torque, place = (np.concatenate([_counted(run, name) for run in (*fitted, *held)])
                            for name in ('speed', 'tau', 'q'))
    count = sum(int(run.valid.sum()) for run in fitted)
    before, after = (build_model(machine, file, diagnosis.effects)
                     for file in (diagnosis.refitted_model, diagnosis.extended_model))
    state = fitted[0].state
    curve = np.linspace(speed.min(), speed.max(), POINTS)
    middle = np.full_like(curve, place.mean())
    return SteadySpeeds(
        speed, torque, np.arange(len(speed)) >= count,
        torque - _torque_of(after, state, speed, place), curve,
        _torque_of(before, state, curve, middle),
        _torque_of(after, state, curve, middle) if diagnosis.causes else None,
        float(diagnosis.holdout.noise_floor_rms[0]))


def steady_speeds_with(model: Model, runs: Sequence[Run], floor: float) -> SteadySpeeds:
    """Return the plateaus of runs with a model."""
    speed, torque, place = (np.concatenate([_counted(run, name) for run in runs])
                            for name in ('speed', 'tau', 'q'))
    curve = np.linspace(min(speed.min(), 0.0), max(speed.max(), 0.0), POINTS)
    state = runs[0].state
    return SteadySpeeds(
        speed, torque, np.zeros(len(speed), dtype=bool),
        torque - _torque_of(model, state, speed, place), curve,
        _torque_of(model, state, curve, np.full_like(curve, place.mean())), None, floor)


def _torque_of(model: Model, state: State, qd: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the torque (n,) of a model at constant speeds qd and positions q, (n,)."""
    return model.torque(replace(state, t=np.arange(float(len(qd))), q=q[:, None], qd=qd[:, None],
                                qdd=np.zeros((len(qd), 1))))[:, 0]


def _counted(run: Run, name: str) -> np.ndarray:
    values: np.ndarray = getattr(run, name)
    return values[run.valid[:, 0], 0]


def torque_over_speed(told: SteadySpeeds, names: Names) -> str:
    """Return mean torques over speed with the models, and what is left beneath."""
    models = [(told.before, BEFORE)] + ([] if told.after is None else [(told.after, AFTER)])
    with drawn(4.4) as figure:
        above, below = figure.subplots(2, 1, sharex=True,
                                       gridspec_kw={'height_ratios': (1.8, 1.0)})
        for values, colour in models:
            for side in (told.curve < 0.0, told.curve > 0.0):
                above.plot(told.curve[side], values[side], color=colour, linewidth=1.1)
        below.axhspan(-2.0 * told.floor, 2.0 * told.floor, color=FLOOR, linewidth=0)
        for rows, face in ((~told.heldout, INK), (told.heldout, 'none')):
            for axis, values in ((above, told.torque), (below, told.left)):
                axis.plot(told.speed[rows], values[rows], 'o', color=INK, markersize=3.8,
                          markerfacecolor=face)
        above.set_ylabel(f'{names.torque}, {names.torque_unit}')
        below.set_ylabel(f'left, {names.torque_unit}')
        below.set_xlabel(f'speed, {names.speed_unit}')
        for axis in (above, below):
            axis.locator_params(axis='y', nbins=5)
        legend(figure, (('mean torque of a plateau' + (', hollow: held out' if told.heldout.any()
                                                       else ''), INK),
                        *((('model', BEFORE),) if told.after is None else
                          (('old model', BEFORE), ('extended model', AFTER))),
                        ('noise of a mean, ± 2 standard deviations', FLOOR)))
        return image(figure)
