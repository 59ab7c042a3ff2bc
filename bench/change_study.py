"""How often what has changed is told right: docs/changes.md.

Machines are simulated, changed on purpose and simulated again: payloads, frictions, gains,
inertias, two at once, or nothing. A model is identified from the recordings before; what differs
after is read. Every `--diagnosed`th machine goes through the whole diagnosis, as
`par4_diagnose --model` does, the others straight to the comparison. Machines are independent tasks
on dask.

    python bench/change_study.py --first-seed 1000 --machines 40 --unchanged 20      developing
    python bench/change_study.py --diagnosed 15     the published score
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import traceback
from collections.abc import Sequence
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

import numpy as np
from blind_study import machine_name, outcomes_of
from changed import KINDS, Change, Changed, drawn_machine
from scipy.stats import binomtest

from par4_dynamics.model import build_model
from par4_identification.changes.changes import (
    changes_since_model,
    explained_change,
    model_of_bags,
)
from par4_identification.changes.explanation import Explanation
from par4_identification.changes.joint_values import fitted_values, values_of_model
from par4_identification.changes.readings import (
    FRICTION,
    Added,
    FrictionFactor,
    GainFactor,
    Reading,
)
from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.diagnosis.evidence.observations import observe
from par4_identification.diagnosis.verdict.answer import Unusable
from par4_identification.fitting.identification import Fitting, identify
from par4_identification.reports.outcome.changes import phrase_of_reading
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


def explanation_of(case: Changed, way: str, diagnosed: bool, closed_loop: bool
                   ) -> Explanation | None:
    """Return what is told of a machine; None where the data are called unusable."""
    robot = case.known.robot
    before, after = (case.log(after=later, closed_loop=closed_loop) for later in (False, True))
    model_file = identify([before], robot, case.rigid_body, fitting=Fitting(
        per_joint=way == WAYS[1])).model_file({})
    if diagnosed:
        diagnosis = diagnose([after], robot, model_file, [
            case.log(after=True, number=1, closed_loop=closed_loop)])
        if isinstance(diagnosis, Unusable):
            return None
        return changes_since_model(diagnosis, robot, model_file, 'the model').explanation
    if way == WAYS[2]:
        model_file = model_of_bags([before], robot, model_file)
    known = build_model(robot, model_file)

    def values(log):
        return fitted_values(observe(runs_of_log(log, robot, CONDITIONING), robot,
                                     model_file.rigid_body, known))

    old = values(before) if way == WAYS[2] else values_of_model(model_file, robot)
    return explained_change(old, values(after), swallowed=way != WAYS[2])[1]


def attempted(every: int, task: tuple[int, int, tuple[str, ...]]) -> dict[str, Any]:
    """Return the outcome of a machine, or the error that ended it: one must not end the study."""
    try:
        return outcome_of(every, task)
    except Exception:
        return {'number': task[0], 'seed': task[1], 'error': traceback.format_exc()}


def outcome_of(every: int, task: tuple[int, int, tuple[str, ...]]) -> dict[str, Any]:
    """Return what was done to a machine and what was told.

    Args:
        every: one machine in so many goes through the whole diagnosis.
        task: its number in the study, seed and kinds of changes.
    """
    number, seed, kinds = task
    started = time.perf_counter()
    case, way = drawn_machine(seed, kinds), WAYS[number % len(WAYS)]
    diagnosed = bool(every) and number % every == every - 1
    closed_loop = number % CLOSED_LOOP == 0
    explanation = explanation_of(case, 'model' if diagnosed else way, diagnosed, closed_loop)
    robot = case.known.robot
    outcome = {'number': number, 'seed': seed, 'kinds': list(kinds),
               'way': 'diagnosis' if diagnosed else way, 'closed_loop': closed_loop,
               'rigid_body': case.rigid_body, 'robot': case.known.name, 'true': [
                   phrase_of_reading(truth_of(item), item.size, robot) for item in case.changes]}
    if explanation is None:
        return outcome | {'right': not kinds, 'claimed': False, 'told': ['unusable data']}
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


def tasks_of(first_seed: int, machines: int, unchanged: int
             ) -> list[tuple[int, int, tuple[str, ...]]]:
    """Return number, seed and kinds of each machine; one in three has two changes."""
    pairs = list(combinations(KINDS, 2))
    np.random.default_rng(15).shuffle(pairs)
    kinds = [tuple(pairs[index // 3 % len(pairs)]) if index % 3 == 2 else
             (KINDS[(index - index // 3) % len(KINDS)],) for index in range(machines)]
    kinds += [()] * unchanged
    return [(number, first_seed + number, own) for number, own in enumerate(kinds)]


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
    lines = ['| machines | right | of | share | 95 % interval |', '|---|---|---|---|---|']
    for name, part in rows:
        lines.append(_row(name, sum(item['right'] for item in part), len(part)))
    lines.append(_row('nothing changed, a change claimed', sum(item['claimed'] for item in still),
                      len(still)))
    misses = [item for item in done if (not item['right'] if item['kinds'] else item['claimed'])]
    lines += ['', 'Misses:', ''] + [
        f'- {item["seed"]} ({item["way"]}, {item["robot"]}, {item["rigid_body"]}): '
        f'{" and ".join(item["true"]) or "nothing"}; told {" and ".join(item["told"]) or "nothing"}'
        + (', and a remainder' if item.get('left') else '') for item in misses]
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
    parser.add_argument('--processes', type=int, default=1, help='on this machine')
    parser.add_argument('--scheduler', help='address of a dask scheduler')
    parser.add_argument('--results', type=Path, default=Path('change_study.jsonl'))
    arguments = parser.parse_args()
    tasks, outcomes = tasks_of(arguments.first_seed, arguments.machines, arguments.unchanged), []
    with arguments.results.open('w', encoding='utf-8') as file:
        for outcome in outcomes_of(partial(attempted, arguments.diagnosed), tasks, arguments):
            outcomes.append(outcome)
            file.write(json.dumps(outcome) + '\n')
            file.flush()
    print(machine_name())
    print(summary(outcomes))


if __name__ == '__main__':
    main()
