"""How often what has changed is told right: docs/changes.md.

Machines are simulated, changed on purpose and simulated again: payloads, frictions, gains,
inertias, two at once, or nothing. A model is identified from the recordings before; what differs
after is read. Every `--diagnosed`th machine goes through the whole diagnosis, as
`par4_diagnose --model` does, the others straight to the comparison. `--company` hides an effect
beside the changes: one that came with them (new), one that was there before and that the model
lacks (old) or that a diagnosis before found (known). Machines are independent tasks on dask.

    python bench/change_study.py --first-seed 1000 --machines 40 --unchanged 20      developing
    python bench/change_study.py --diagnosed 15     the published score
    python bench/change_study.py --company new      the same beside hidden effects
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

import numpy as np
from blind_study import machine_name, outcomes_of
from scipy.stats import binomtest

from changed import COMPANY, KINDS, Change, Changed, drawn_machine
from par4_dynamics.base_terms import FRICTION
from par4_dynamics.model_from_file import build_model
from par4_identification.changes.changes import (
    Changes,
    changes_since_model,
    explained_change,
    model_of_bags,
)
from par4_identification.changes.explanation import Explanation
from par4_identification.changes.joint_values import fitted_values, values_of_model
from par4_identification.changes.readings import (
    Added,
    FrictionFactor,
    GainFactor,
    Reading,
)
from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.diagnosis.evidence.observations import observe
from par4_identification.diagnosis.verdict.answer import Diagnosis, Unusable
from par4_identification.fitting.identification import Fitting, identify
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.changes import phrase_of_reading
from par4_identification.reports.outcome.outcome import over_joints
from par4_identification.signals.rows import runs_of_log

SCORING_SEED = 8_910_000
"""Seeds from here on are run once, after everything is fixed."""
WAYS = ('model', 'model, joint by joint', 'bags before')
"""What the data are compared with, in turn."""
CLOSED_LOOP = 8
"""One machine in so many is simulated with its drives; the others are led along the motion."""
NEAR = 0.1
"""Share by which a size may be off, if it is not within four standard deviations."""


def truth_of(change: Change) -> Reading:
    """Return the reading that is right."""
    return {
        'payload 1': Added(None, 'platform_mass_1'), 'payload 2': Added(None, 'platform_mass_2'),
        'friction of all': FrictionFactor(None, FRICTION), 'gain of all': GainFactor(None),
        'Coulomb friction of one': Added(change.joint, 'coulomb_friction'),
        'viscous friction of one': Added(change.joint, 'viscous_friction'),
        'gain of one': GainFactor(change.joint),
        'inertia of one': Added(change.joint, 'actuator_inertia')}[change.kind]


@dataclass(frozen=True)
class Task:
    """One machine of the study.

    Attributes:
        number: in the study.
        seed: of all that is drawn.
        kinds: of its changes.
        diagnosed: whether it goes through the whole diagnosis.
        company, effect, radius: see `drawn_machine`.
    """

    number: int
    seed: int
    kinds: tuple[str, ...]
    diagnosed: bool
    company: str | None = None
    effect: str | None = None
    radius: float = 0.0

    @property
    def way(self) -> str:
        """What the data are compared with."""
        return WAYS[self.number % len(WAYS)]

    @property
    def closed_loop(self) -> bool:
        """Whether the machine is simulated with its drives."""
        return self.number % CLOSED_LOOP == 0 and not self.radius


def compared(case: Changed, task: Task) -> Explanation:
    """Return what a comparison tells of a machine."""
    robot, way = case.known.robot, task.way
    before, after = (case.log(after=later, closed_loop=task.closed_loop)
                     for later in (False, True))
    model_file = identify([before], robot, case.rigid_body, fitting=Fitting(
        per_joint=way == WAYS[1])).model_file({})
    if way == WAYS[2]:
        model_file = model_of_bags([before], robot, model_file)
    known = build_model(robot, model_file)

    def values(log):
        return fitted_values(observe(runs_of_log(log, robot, CONDITIONING), robot,
                                     model_file.rigid_body, known))

    old = values(before) if way == WAYS[2] else values_of_model(model_file, robot)
    return explained_change(old, values(after), swallowed=way != WAYS[2])[1]


def diagnosed(case: Changed, task: Task) -> tuple[Diagnosis | Unusable, Changes | None]:
    """Return what `par4_diagnose --model` tells of a machine."""
    robot = case.known.robot

    def logs(after: bool) -> list[Log]:
        return [case.log(after=after, number=number, closed_loop=task.closed_loop)
                for number in (0, 1)]

    before = logs(after=False)[:2 if task.company == 'known' else 1]
    model_file = identify(before[:1], robot, case.rigid_body).model_file({})
    if task.company == 'known':
        earlier = diagnose(before[:1], robot, model_file, before[1:])
        if isinstance(earlier, Diagnosis):
            model_file = earlier.extended_model
    fit, heldout = logs(after=True)
    diagnosis = diagnose([fit], robot, model_file, [heldout])
    if isinstance(diagnosis, Unusable):
        return diagnosis, None
    return diagnosis, changes_since_model(diagnosis, robot, model_file, 'the model')


def attempted(task: Task) -> dict[str, Any]:
    """Return the outcome of a machine, or the error that ended it: one must not end the study."""
    try:
        return outcome_of(task)
    except Exception:
        return {'number': task.number, 'seed': task.seed, 'error': traceback.format_exc()}


def outcome_of(task: Task) -> dict[str, Any]:
    """Return what was done to a machine and what was told."""
    started = time.perf_counter()
    case = drawn_machine(task.seed, task.kinds, task.company, task.effect, task.radius)
    robot = case.known.robot
    outcome: dict[str, Any] = {
        'number': task.number, 'seed': task.seed, 'kinds': list(task.kinds),
        'way': 'diagnosis' if task.diagnosed else task.way, 'closed_loop': task.closed_loop,
        'rigid_body': case.rigid_body, 'robot': case.known.name,
        'true': [phrase_of_reading(truth_of(item), item.size, robot) for item in case.changes]}
    if task.diagnosed:
        diagnosis, changes = diagnosed(case, task)
        if changes is None:
            return outcome | {'right': False, 'claimed': False, 'told': ['unusable data']}
        explanation = changes.explanation
        outcome |= told_beside(case, task, diagnosis, changes)
    else:
        explanation = compared(case, task)
    wanted = {truth_of(item): item.size for item in case.changes}
    told = {item.reading: item for item in explanation.read}
    same = wanted.keys() == told.keys()
    sizes = same and all(abs(told[reading].size - size) < max(
        NEAR * abs(size), 4.0 * told[reading].std) for reading, size in wanted.items())
    covered = len(told) == len(wanted) and all(
        any(reading == item.reading or reading in item.twins for item in explanation.read)
        for reading in wanted)
    return outcome | {
        'right': bool(same and sizes), 'named': bool(same), 'covered': bool(covered),
        'claimed': bool(told) or not explanation.is_complete,
        'left': not explanation.is_complete, 'p_value': explanation.p_value,
        'told': [phrase_of_reading(item.reading, item.size, robot)
                 + f' (std {item.std:.2g}, {len(item.twins)} twins)' for item in explanation.read],
        'seconds': round(time.perf_counter() - started, 2)}


def told_beside(case: Changed, task: Task, diagnosis: Diagnosis, changes: Changes
                ) -> dict[str, Any]:
    """Return the causes, the three rows of error and what became of the hidden effect."""
    names = [name for cause in diagnosis.causes for name in (cause.effect.name, *cause.twins)]
    holdout = diagnosis.holdout
    found = {
        'causes': [cause.effect.name for cause in diagnosis.causes],
        'unnamed': len(diagnosis.unnamed), 'verdict': diagnosis.verdict,
        'errors': [round(over_joints(rms), 5) for rms in (
            changes.given_rms, holdout.baseline_rms, holdout.extended_rms,
            holdout.noise_floor_rms)]}
    if case.effect is None:
        return found
    # an effect that the model has already is no cause
    return found | {'effect': case.effect[0], 'company': task.company,
                    'effect_named': (case.effect[0] in names) == (task.company != 'known')}


def tasks_of(arguments: argparse.Namespace) -> list[Task]:
    """Return the machines; without `--together` one in three has two changes."""
    pairs = list(combinations(KINDS, 2))
    np.random.default_rng(15).shuffle(pairs)
    machines, together = arguments.machines, arguments.together
    kinds = [tuple(pairs[index // 3 % len(pairs)]) if index % 3 == 2 else
             (KINDS[(index - index // 3) % len(KINDS)],) for index in range(machines)]
    if together:
        sets = list(combinations(KINDS, together))
        np.random.default_rng(16).shuffle(sets)
        kinds = [tuple(sets[index % len(sets)]) for index in range(machines)]
    if arguments.radius:
        kinds = [('payload 1',)] * machines
    kinds += [()] * arguments.unchanged
    every = 1 if arguments.company else arguments.diagnosed
    return [Task(number, arguments.first_seed + number, own,
                 bool(every) and number % every == every - 1, arguments.company,
                 arguments.effect, arguments.radius) for number, own in enumerate(kinds)]


def summary(outcomes: Sequence[dict[str, Any]]) -> str:
    """Return the score as a table in Markdown, and every miss."""
    done = [item for item in outcomes if 'error' not in item]
    changed = [item for item in done if item['kinds']]
    still = [item for item in done if not item['kinds']]
    rows = [('all that were changed', changed)]
    rows += [(f'{kind}, alone', [item for item in changed if item['kinds'] == [kind]])
             for kind in KINDS]
    rows.append(('two at once', [item for item in changed if len(item['kinds']) == 2]))
    rows += [(f'compared with: {way}', [item for item in changed if item['way'] == way])
             for way in (*WAYS, 'diagnosis')]
    rows.append(('simulated with drives', [item for item in changed if item['closed_loop']]))
    rows.append(('three at once', [item for item in changed if len(item['kinds']) == 3]))
    lines = ['| machines | right | of | share | 95 % interval |', '|---|---|---|---|---|']
    for name, part in rows:
        lines.append(_row(name, sum(item['right'] for item in part), len(part)))
    lines.append(_row('nothing changed, a change claimed', sum(item['claimed'] for item in still),
                      len(still)))
    company = [item for item in done if 'effect' in item]
    if company:
        lines.append(_row('hidden effect named, or known and not named again',
                          sum(item['effect_named'] for item in company), len(company)))
    misses = [item for item in done if (not item['right'] if item['kinds'] else item['claimed'])]
    lines += ['', 'Misses:', ''] + [
        f'- {item["seed"]} ({item["way"]}, {item["robot"]}, {item["rigid_body"]}): '
        f'{" and ".join(item["true"]) or "nothing"}; told {" and ".join(item["told"]) or "nothing"}'
        + (', and a remainder' if item.get('left') else '')
        + (f'; causes {item["causes"]}' if item.get('causes') else '')
        + (f'; hidden {item["effect"]}' if 'effect' in item else '') for item in misses]
    lines += ['', 'Hidden effects that were not named:', ''] + [
        f'- {item["seed"]}: {item["effect"]}; causes {item["causes"]}, {item["unnamed"]} unnamed'
        for item in company if not item['effect_named']] if company else []
    lines += [f'- {len(outcomes) - len(done)} failed'] if len(done) < len(outcomes) else []
    return '\n'.join(lines)


def _row(name: str, right: int, count: int) -> str:
    if not count:
        return f'| {name} | 0 | 0 | - | - |'
    interval = binomtest(right, count).proportion_ci(method='wilson')
    return (f'| {name} | {right} | {count} | {100.0 * right / count:.1f} % | '
            f'{100.0 * interval.low:.1f} to {100.0 * interval.high:.1f} % |')


def main() -> None:
    """Simulate, compare, score."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--first-seed', type=int, default=SCORING_SEED)
    parser.add_argument('--machines', type=int, default=200, help='that are changed')
    parser.add_argument('--unchanged', type=int, default=100)
    parser.add_argument('--diagnosed', type=int, default=0, metavar='N',
                        help='one machine in N goes through the whole diagnosis; 0 for none')
    parser.add_argument('--together', type=int, default=0, help='changes of each machine')
    parser.add_argument('--company', choices=COMPANY, help='a hidden effect beside the changes; '
                        'all machines go through the whole diagnosis')
    parser.add_argument('--effect', help='which one; drawn if left out')
    parser.add_argument('--radius', type=float, default=0.0,
                        help='m from the axis of the tool at which payloads are')
    parser.add_argument('--processes', type=int, default=1, help='on this machine')
    parser.add_argument('--scheduler', help='address of a dask scheduler')
    parser.add_argument('--results', type=Path, default=Path('change_study.jsonl'))
    arguments = parser.parse_args()
    tasks, outcomes = tasks_of(arguments), []
    with arguments.results.open('w', encoding='utf-8') as file:
        for outcome in outcomes_of(attempted, tasks, arguments):
            outcomes.append(outcome)
            file.write(json.dumps(outcome) + '\n')
            file.flush()
    print(machine_name())
    print(summary(outcomes))


if __name__ == '__main__':
    main()
