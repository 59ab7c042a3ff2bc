"""One scenario from its seed to its outcome, as plain data; and the list of scenarios of a study.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from hidden.hiders import HIDERS
from hidden.recording import Recording
from hidden.scenario import Scenario, Task, draw_scenario, record_scenario, truth_of
from hidden.truth import CHAOTIC, VISIBLE, true_noise
from par4_identification.diagnosis.diagnosis import LIBRARY, Diagnosis, diagnose

COUNTS = {'single': 420, 'pair': 115, 'removed': 110, 'clean': 400, 'below': 50, 'rods': 55}
"""At scale 1: somewhat more than asked where some will not be visible; rods are 5 % of all."""
EVERY_BULLET, EVERY_BAG = 20, 20
"""One single in so many runs in pybullet, another through bags."""
STRIDE = 100_000
"""Between the seeds of two kinds."""


def tasks_of_study(scale: float, first_seed: int) -> list[Task]:
    """Return the tasks of a study, effects in turn; the same for the same arguments.

    The kinds are mixed, so that what is done of a study is a sample of the whole.
    """
    names = list(HIDERS)
    tasks = []
    for row, (kind, count) in enumerate(COUNTS.items()):
        wanted = max(1, round(scale * count))
        for index in range(wanted):
            seed = first_seed + STRIDE * row + index
            effect = None
            if kind == 'rods':
                effect = 'distributed_rods'
            elif kind != 'clean':
                usable = [name for name in names if kind in ('single', 'removed')
                          or name not in CHAOTIC]
                effect = usable[(index * 7 + row) % len(usable)]
            tasks.append((index / wanted, Task(
                kind, seed, effect, coloured=index % 2 == 1,
                fidelity='fast' if kind == 'single' and index % EVERY_BULLET == 3 else 'exact',
                through_bag=kind == 'single' and index % EVERY_BAG == 13)))
    return [task for _, task in sorted(tasks, key=lambda item: item[0])]


def outcome_of(task: Task) -> dict:
    """Return what a scenario held and what the diagnosis made of it, as plain data."""
    started = time.perf_counter()
    scenario = draw_scenario(task)
    fit, heldout = record_scenario(scenario)
    recorded = time.perf_counter()
    truth = truth_of(scenario, fit) if scenario.hidden else None
    hidden = []
    for name, values in scenario.hidden:
        strength = truth.strength(name)
        hidden.append({
            'effect': name, 'values': {key: np.asarray(value).round(9).tolist()
                                       for key, value in values.items()},
            'strength': round(strength, 1), 'visible': bool(strength > VISIBLE),
            'twins': truth.twins(name) if strength > VISIBLE else []})
    missing = (hidden[0]['effect'], *hidden[0]['twins']) if task.kind == 'removed' else ()
    judged = time.perf_counter()
    diagnosis = diagnosis_of(scenario, fit, heldout, missing)
    done = time.perf_counter()
    return {
        **asdict(task), 'robot': scenario.known.name, 'geometry': scenario.known.robot.name,
        'motion': scenario.shape, 'feedforward': scenario.feedforward,
        'noise': {'level': scenario.noise.torque_noise, 'memory': scenario.noise.correlation_time,
                  'wander': scenario.wander.level.tolist() if scenario.wander else None},
        'hidden': hidden, 'verdict': diagnosis.verdict,
        'causes': [{'effect': cause.effect.name, 'twins': list(cause.twins),
                    'joints': list(cause.joints),
                    'values': {name: np.asarray(parameter.value).round(9).tolist()
                               for name, parameter in cause.parameters.items()}}
                   for cause in diagnosis.causes],
        'reasons': list(diagnosis.reasons),
        'rejected': [[item.label, item.reason] for item in diagnosis.rejected],
        'looks_like': diagnosis.remaining.looks_like if diagnosis.remaining else None,
        'floor_excess': diagnosis.remaining.floor_excess if diagnosis.remaining else None,
        'gain': gain_of_truth(scenario, heldout, diagnosis),
        'seconds': {'record': round(recorded - started, 2), 'truth': round(judged - recorded, 2),
                    'diagnose': round(done - judged, 2)}}


def diagnosis_of(scenario: Scenario, fit: Recording, heldout: Recording,
                 missing: Sequence[str] = ()) -> Diagnosis:
    """Return the diagnosis of two recordings by a library that lacks some names."""
    library = {name: effect for name, effect in LIBRARY.items() if name not in missing}
    return diagnose([fit.log], scenario.known.robot, holdout_logs=[heldout.log], library=library)


def gain_of_truth(scenario: Scenario, heldout: Recording, diagnosis: Diagnosis
                  ) -> dict[str, float] | None:
    """Return how far the held-out error fell and would fall with the true model.

    Both over the true noise, in mean squares summed over the joints; what the true model leaves is
    the true noise itself, on the rows that the diagnosis judged. None for what rattles: the true
    machine itself would not rattle alike a second time.
    """
    if (diagnosis.holdout is None or not scenario.hidden
            or any(name in CHAOTIC for name, _ in scenario.hidden)):
        return None
    noise = true_noise(heldout, scenario.known)
    before = after = left = 0.0
    start = 0
    for run, old, new in zip(diagnosis.holdout.runs, diagnosis.holdout.baseline,
                             diagnosis.holdout.extended):
        own = run.rows(noise[start:start + len(run.state.t)])
        start += len(run.state.t)
        for joint in range(4):
            rows = run.valid[:, joint]
            level = max(float(np.mean(own[rows, joint] ** 2)), 1e-12) if rows.any() else 1.0
            before += float(np.sum(old[rows, joint] ** 2)) / level
            after += float(np.sum(new[rows, joint] ** 2)) / level
            left += float(np.sum(own[rows, joint] ** 2)) / level
    return {'found': before - after, 'possible': before - left, 'left': left}
