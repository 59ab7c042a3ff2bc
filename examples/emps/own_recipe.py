"""The project's own recipe on the same recording, with every estimator."""

from __future__ import annotations

import numpy as np

from axis_simulation import simulated
from par4_dynamics import base_columns, base_terms
from par4_identification import (
    Conditioning,
    Estimate,
    Problem,
    Run,
    Series,
    consistent,
    instrumental,
    ordinary,
    physical_constraints,
    problem_of,
    robust,
    runs_of_log,
    weighted,
    with_offsets,
)
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
