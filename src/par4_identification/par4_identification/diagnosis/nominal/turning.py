"""When joints turn back, as far as friction and inertia of a first model tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.state import state_of_joints
from par4_identification.signals.run import Run

SPACING = 0.05
"""s between the samples at which inertias are looked at."""


def turning(runs: Sequence[Run], model: Model, inertia_told: bool) -> list[Run]:
    """Return runs whose joints turn back when the friction of a model lets them.

    Args:
        runs: of a machine.
        model: with base values that are about right.
        inertia_told: whether its inertia is. An axis may be any machine, with any friction where it
            turns: times of turning are then as wrong as they may be, but not corrected.
    """
    friction = np.maximum(model.values['coulomb_friction'], 0.0)
    return [run if run.conditioning.steady else run.with_friction(
        friction, _inertia(run, model) if inertia_told else np.full_like(friction, np.inf))
        for run in runs]


def _inertia(run: Run, model: Model) -> np.ndarray:
    """Return the inertia that each joint moves, (J,) kg m2; infinite where it is none."""
    every = max(1, round(SPACING / float(run.state.t[1] - run.state.t[0])))
    t, q, qd, qdd = (np.ascontiguousarray(part[::every]) for part in (
        run.state.t, run.state.q, run.state.qd, run.state.qdd))
    some = replace(state_of_joints(run.state.geometry, t, q, qd, qdd), hanging=run.state.hanging)
    matrix = replace(some, nominal=model.nominal(some)).torque_by_qdd
    inertia = np.median(np.einsum('njj->nj', matrix), axis=0)
    return np.where(inertia > 0.0, inertia, np.inf)
