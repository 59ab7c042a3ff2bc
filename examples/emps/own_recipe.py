"""The project's own recipe on the same recording, with every estimator."""

from __future__ import annotations

import numpy as np

from axis_simulation import simulated
from par4_dynamics.base_terms import base_columns, base_terms
from par4_identification.estimators.consistent import consistent
from par4_identification.estimators.estimate import Estimate
from par4_identification.estimators.instrumental import instrumental
from par4_identification.estimators.ordinary import ordinary
from par4_identification.estimators.problem import Problem, Series, problem_of, with_offsets
from par4_identification.estimators.robust import robust
from par4_identification.estimators.weighted import weighted
from par4_identification.fitting.physical import physical_constraints
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.rows import Run, runs_of_log
from recording import Recording

CONDITIONING = Conditioning(low_speed=0.005)
"""The default filters; m/s, a twenty-fifth of the top speed, below which friction is not known."""
PUBLISHED_NAMES = {'actuator_inertia': 'M', 'viscous_friction': 'Fv', 'coulomb_friction': 'Fc',
                   'offset': 'offset'}


def own_estimates(recording: Recording) -> dict[str, Estimate]:
    """Return the estimates by estimator; instruments come from a simulation of the axis."""
    run = _run_of(recording)
    problem = _problem(run, run.valid)
    constraints = physical_constraints(problem.labels, recording.axis, 'paper')
    found = {'ordinary': ordinary(problem), 'weighted': weighted(problem),
             'robust': robust(problem), 'consistent': consistent(problem, constraints)}
    values = values_by_name(found['weighted'])
    twin = _run_of(simulated(recording, [values[name] for name in ('M', 'Fv', 'Fc', 'offset')]))
    valid = run.valid & twin.valid
    instruments, = _problem(twin, valid).series
    found['instrumental'] = instrumental(_problem(run, valid), [instruments.columns])
    return found


def values_by_name(estimate: Estimate) -> dict[str, float]:
    """Return the values by the names of the publication."""
    return {PUBLISHED_NAMES[label.name]: float(value)
            for label, value in zip(estimate.labels, estimate.values)}


def _run_of(recording: Recording) -> Run:
    run, = runs_of_log(recording.log, recording.axis, CONDITIONING)
    return run


def _problem(run: Run, valid: np.ndarray) -> Problem:
    """Return the problem of rows `valid` (m, 1): (20) of an axis, and an offset."""
    terms = base_terms(run.state)
    series = Series(run.tau, run.rows(base_columns(run.state)), valid)
    return with_offsets(problem_of([series], [term.name for term in terms],
                                   [term.unit for term in terms]), 'offset', 'N m')
