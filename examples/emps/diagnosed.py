"""The causes that the diagnosis names, in the published recipe.

Each cause adds its columns, of the shape diagnosed, to those of the recipe: computed from the
recipe's motion, filtered and decimated as its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from own_recipe import CONDITIONING
from par4_dynamics import Parameter, State, build_model, state_of_joints
from par4_identification import Diagnosis, Estimate, ordinary
from par4_identification.diagnosis.evidence.holdout import Gain
from par4_identification.diagnosis.evidence.projection import project
from published_recipe import COLUMNS, problem_of_columns, recipe_columns, recipe_motion
from recording import Recording


@dataclass(frozen=True)
class Claim:
    """A named cause with its evidence.

    Attributes:
        name: of the effect.
        parameters: as diagnosed.
        likelihood_ratio: twice the gain in log-likelihood given the other causes.
        p_value: family-wise.
        gain: share of the held-out squared error that it removes.
        twins: names that explain the data as well.
    """

    name: str
    parameters: dict[str, Parameter]
    likelihood_ratio: float
    p_value: float
    gain: Gain
    twins: tuple[str, ...]


@dataclass(frozen=True)
class Step:
    """The published recipe with some causes.

    Attributes:
        names: of the causes; none is the published model.
        estimate: over all rows, as the recipe takes them.
        moving: over the rows that the diagnosis looks at.
    """

    names: tuple[str, ...]
    estimate: Estimate
    moving: Estimate


def claims(diagnosis: Diagnosis) -> list[Claim]:
    """Return the causes, strongest first."""
    found = []
    for index, cause in enumerate(diagnosis.causes):
        others = [item for item in diagnosis.hypotheses if item.effect.name != cause.effect.name]
        own = diagnosis.hypotheses[index]
        ratio = project(diagnosis.evidence, others).gain(own.effect, own.shape)
        found.append(Claim(cause.effect.name, cause.parameters, ratio, cause.p_value, cause.gain,
                           cause.twins))
    return found


def columns_of_causes(recording: Recording, diagnosis: Diagnosis) -> dict[str, np.ndarray]:
    """Return what a unit of each coefficient of each cause adds to the force, (n,), on all rows.

    The names are 'effect' or, of several coefficients, 'effect 0', 'effect 1', ... The recipe has
    an offset of its own: `torque_offset` adds none.
    """
    state = _state(recording, diagnosis)
    columns = {}
    for item in diagnosis.hypotheses:
        if item.effect.name == 'torque_offset':
            continue
        part = item.effect.columns(state, item.shape)[:, 0]
        for number in range(part.shape[1]):
            label = f'{item.effect.name} {number}' if part.shape[1] > 1 else item.effect.name
            columns[label] = part[:, number]
    return columns


def steps(recording: Recording, diagnosis: Diagnosis) -> list[Step]:
    """Return the recipe without and with one more cause at a time, refitted, strongest first."""
    own = recipe_columns(recording.position, recording.period, COLUMNS)
    added = columns_of_causes(recording, diagnosis)
    counts = moving(recording)
    found, names, columns = [], (), dict(own)
    for cause in (None, *diagnosis.causes):
        if cause is not None:
            names = (*names, cause.effect.name)
            columns |= {label: column for label, column in added.items()
                        if label.split()[0] == cause.effect.name}
        found.append(Step(names, *(ordinary(problem_of_columns(columns, recording.force, which))
                                   for which in (None, counts))))
    return found


def error_as_diagnosed(recording: Recording, diagnosis: Diagnosis) -> tuple[float, float]:
    """Return the relative error of the diagnosed model, nothing refitted: all rows and moving."""
    model = build_model(recording.axis, diagnosis.extended_model)
    predicted = model.torque(_state(recording, diagnosis))[:, 0]
    errors = []
    for counts in (None, moving(recording)):
        part, = problem_of_columns({'model': predicted}, recording.force, counts).series
        left = part.target - part.columns[..., 0]
        errors.append(float(np.linalg.norm(left[part.valid])
                            / np.linalg.norm(part.target[part.valid])))
    return errors[0], errors[1]


def moving(recording: Recording) -> np.ndarray:
    """Return the samples (n,) within whose filter's reach the axis never rests or reverses."""
    _, speed, _ = recipe_motion(recording.position, recording.period)
    reach = int(np.ceil(CONDITIONING.reach / recording.period))
    slow = np.abs(speed) < CONDITIONING.low_speed
    return np.convolve(slow, np.ones(2 * reach + 1), 'same') < 0.5


def _state(recording: Recording, diagnosis: Diagnosis) -> State:
    """Return the recipe's motion with the torque of the diagnosed model."""
    motion = (part[:, None] for part in recipe_motion(recording.position, recording.period))
    state = state_of_joints(None, recording.log.t, *motion)
    model = build_model(recording.axis, diagnosis.extended_model)
    return replace(state, nominal=model.nominal(state))
