"""How often a hidden effect is named, on seeds that no test uses; prints a table.

The generator (tests/hidden.py) shares no formula with the diagnosis. A small forerunner of the
blind study: `python bench/hidden_study.py --logs 40`.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import binomtest

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

from hidden import HIDERS, draw, with_coloured_noise
from measured import log_of_machine

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_identification.diagnosis.diagnosis import diagnose

FIRST_SEED = 10_000
"""Tests use seeds far below."""


def case(task: tuple[str, str | None, int]) -> tuple[str, str]:
    """Return the kind of a case and its outcome: right, wrong name, unknown, clean, ..."""
    kind, effect, seed = task
    random = np.random.default_rng((seed, 23))
    hidden = draw(effect, seed)
    if random.uniform() < 0.5:
        hidden = with_coloured_noise(hidden, random.uniform(0.03, 0.1), random)
    noise, feedforward = random.uniform(0.02, 0.2), random.uniform() < 0.5
    fit, heldout = (
        log_of_machine(hidden.robot, hidden.machine, hidden.model, duration=duration,
                       seed=seed + offset, noise=noise, feedforward=feedforward)
        for duration, offset in ((16.0, 0), (10.0, 500_000)))
    library = {name: known for name, known in CATALOGUE.items()
               if kind != 'taken out' or name != effect}
    result = diagnose([fit], hidden.robot, holdout_logs=[heldout], library=library)
    names = [cause.effect.name for cause in result.causes]
    expected = [effect] if effect and kind != 'taken out' else []
    if names == expected:
        return kind, result.verdict if not expected else 'right name'
    if set(expected) < set(names):
        return kind, 'right name and a false one'
    return kind, 'false name' if names else f'no name: {result.verdict}'


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--logs', type=int, default=20, help='cases a row of the table')
    parser.add_argument('--processes', type=int, default=2)
    arguments = parser.parse_args()
    tasks: list[tuple[str, str | None, int]] = []
    for row, (kind, effect) in enumerate([('clean', None), *((name, name) for name in HIDERS),
                                          *(('taken out', name) for name in HIDERS)]):
        count = arguments.logs // (4 if kind == 'taken out' else 1)
        tasks += [(kind, effect, FIRST_SEED + 1000 * row + index) for index in range(count)]
    outcomes: dict[str, Counter] = {}
    with ProcessPoolExecutor(arguments.processes) as pool:
        for kind, outcome in track(pool.map(case, tasks), total=len(tasks),
                                   description='diagnosing'):
            outcomes.setdefault(kind, Counter())[outcome] += 1
    table = Table('hidden', 'outcome', 'cases', 'share', '95 % interval (Wilson)')
    for kind, counts in outcomes.items():
        for outcome, count in counts.most_common():
            share = binomtest(count, counts.total()).proportion_ci(method='wilson')
            table.add_row(kind, outcome, f'{count} of {counts.total()}',
                          f'{count / counts.total():.1%}',
                          f'{share.low:.1%} to {share.high:.1%}')
    Console(width=110).print(table)


if __name__ == '__main__':
    main()
