"""Seeded logs of machines that obey the identified model, and scores of what is identified."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from measured import log_of_model
from scipy.stats import norm

from par4_dynamics.base_terms import BASE_TERMS
from par4_dynamics.model_from_file import read_model
from par4_identification.fitting.identification import identify
from robots import OTHER, REFERENCE, other_model

NAMES = tuple(term.name for term in BASE_TERMS)
MACHINES = {'reference': (REFERENCE, read_model('table1', REFERENCE)),
            'other': (OTHER, other_model())}


@dataclass(frozen=True)
class Case:
    """One log.

    Attributes:
        robot: 'reference' or 'other'.
        rigid_body: of the machine and of what is identified.
        noise, noise_time: rms, N m, and correlation time, s, of the torque's noise.
        feedforward: whether the drives know the machine.
        duration: of the excitation, s.
        seed: of excitation and noise.
    """

    robot: str
    rigid_body: str
    noise: float
    noise_time: float
    feedforward: bool
    duration: float
    seed: int


@dataclass(frozen=True)
class Scores:
    """Error over standard deviation of each parameter, (p,), by either formula."""

    honest: np.ndarray
    textbook: np.ndarray


def cases(count: int, first_seed: int, shortest: float = 10.0) -> list[Case]:
    """Return as many different cases: all combinations in turn, sizes at random.

    The longest log takes twice as long as the shortest, s.
    """
    found = []
    for index in range(count):
        random = np.random.default_rng(first_seed + index)
        found.append(Case(
            robot=('reference', 'other')[index % 2],
            rigid_body=('paper', 'full')[index // 2 % 2],
            noise=float(np.exp(random.uniform(*np.log((0.05, 0.5))))),
            noise_time=index // 4 % 2 * float(np.exp(random.uniform(*np.log((0.002, 0.05))))),
            feedforward=bool(index // 8 % 2),
            duration=float(np.round(random.uniform(shortest, 2.0 * shortest), 1)),
            seed=first_seed + index))
    return found


def scores(case: Case) -> Scores:
    """Return what the identification from one simulated log is off by."""
    robot, model = MACHINES[case.robot]
    model = replace(model, rigid_body=case.rigid_body)
    log = log_of_model(robot, model, duration=case.duration, seed=case.seed, noise=case.noise,
                       noise_time=case.noise_time, feedforward=case.feedforward)
    estimate = identify([log], robot, case.rigid_body).estimate
    error = estimate.values - np.array([model.values[name][0] for name in NAMES])
    return Scores(error / estimate.std, error / estimate.textbook_std)


def inside(found: np.ndarray, level: float = 0.95) -> np.ndarray:
    """Return which of these scores lie in the interval of that level."""
    return np.abs(found) <= norm.ppf(0.5 + 0.5 * level)
