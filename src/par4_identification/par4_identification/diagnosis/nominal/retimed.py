"""The nominal torque of data whose largest error is that the torque is read at another time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.effects.effect import Effect
from par4_dynamics.model import Model
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import torque_model
from par4_identification.diagnosis.evidence.evidence import gather
from par4_identification.diagnosis.evidence.extended import extended_model
from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import Observations, with_nominal
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.evidence.whitener import flat_whitener
from par4_identification.diagnosis.search.shapes import EXPANSIONS
from par4_kinematics.robot import Axis, Robot

AGREED = 4
"""Times that base parameters and a time of the torque are fitted in turn."""
RETIMED = 0.5
"""Most of the base model's squared error that a torque of another time may leave, to be taken as
the nominal one."""


def beside_retimed(base_model: Model, observations: Observations, machine: Robot | Axis,
                    baseline: ModelFile | None, rigid_body: str,
                    sigma: np.ndarray, library: Mapping[str, Effect]) -> Model:
    """Return the model fitted together with a lag or a delay, if one explains most of the error.

    Such an effect is bilinear: its column is the rate of a torque that is computed from the base
    parameters, and without it these come out wrong in first order. Both are fitted in turn until
    they agree.
    """
    everywhere = tuple(range(observations.joints))
    whitener = flat_whitener(observations, sigma)
    found = [(RETIMED * project(gather(observations, whitener), []).squares, '', base_model)]
    for effect in library.values():
        if not effect.retimes:
            continue
        time = effect.parameters[0].name
        still = effect.shape_of({time: np.array(0.0)})
        model, hypothesis = base_model, Hypothesis(effect, still, everywhere)
        for _ in range(AGREED):
            evidence = gather(with_nominal(observations, model), whitener)
            for _ in range(EXPANSIONS if effect.expanded else 1):
                fit = solve(evidence, [hypothesis])
                hypothesis = replace(hypothesis, shape=effect.shape_of(
                    {time: fit.coefficients[0][0, 0]}))
            fit = solve(evidence, [hypothesis])
            model = torque_model(machine, extended_model(
                baseline, rigid_body, evidence, [hypothesis], fit), {**CATALOGUE, **library})
        found.append((project(evidence, [hypothesis]).squares, effect.name, model))
    return min(found, key=lambda item: item[:2])[-1]
