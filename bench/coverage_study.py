"""Whether the standard deviations of identified parameters hold; prints a table.

Seeded logs of machines that obey the model that is identified: two robots, (20) on the lumped and
`full` on the full mechanism, encoder counts, white and coloured noise of the torque, with and
without feedforward, 10 to 20 s of excitation. How often does the 95 % interval of a parameter
contain the truth, and how often would that of the textbook formula?
`python bench/coverage_study.py`, two to three minutes on two cores.
"""

from __future__ import annotations

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault('OMP_NUM_THREADS', '1')  # the processes share the cores already
sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

import numpy as np
from interval_cases import NAMES, cases, inside, scores
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.stats import binomtest

FIRST_SEED = 30_000
"""Tests use seeds far below."""
POOLED, EACH = (0.93, 0.97), (0.90, 0.99)
"""What is asked of the share of intervals that contain the truth."""


def coverage(found: np.ndarray) -> str:
    """Return the share of intervals that contain the truth, with its Wilson interval."""
    hits = inside(found)
    interval = binomtest(int(hits.sum()), hits.size).proportion_ci(method='wilson')
    return f'{100 * hits.mean():.1f} % ({100 * interval.low:.1f} to {100 * interval.high:.1f})'


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--logs', type=int, default=200)
    parser.add_argument('--first-seed', type=int, default=FIRST_SEED)
    parser.add_argument('--processes', type=int, default=os.cpu_count())
    given = parser.parse_args()
    asked = cases(given.logs, given.first_seed)
    with ProcessPoolExecutor(given.processes) as pool:
        found = list(track(pool.map(scores, asked), 'simulating, identifying', len(asked)))
    honest, textbook = (np.array([getattr(one, name) for one in found])
                        for name in ('honest', 'textbook'))
    table = Table('95 % intervals that contain the truth', 'asked', 'std', 'rms z', 'mean z',
                  'textbook', 'rms z', title=f'{len(asked)} logs')
    rows = [('all parameters', slice(None), slice(None), POOLED)]
    rows += [(name, slice(None), [index], EACH) for index, name in enumerate(NAMES)]
    rows += [(title, [index for index, case in enumerate(asked) if chosen(case)], slice(None), None)
             for title, chosen in (
                 ('white noise', lambda case: case.noise_time == 0.0),
                 ('coloured noise', lambda case: case.noise_time > 0.0),
                 ('paper', lambda case: case.rigid_body == 'paper'),
                 ('full', lambda case: case.rigid_body == 'full'),
                 ('feedforward', lambda case: case.feedforward),
                 ('no feedforward', lambda case: not case.feedforward),
                 ('reference robot', lambda case: case.robot == 'reference'),
                 ('other robot', lambda case: case.robot == 'other'))]
    for title, logs, columns, bounds in rows:
        own, theirs = honest[logs][:, columns], textbook[logs][:, columns]
        table.add_row(
            title, '' if bounds is None else f'{100 * bounds[0]:.0f} to {100 * bounds[1]:.0f} %',
            coverage(own), f'{np.sqrt(np.mean(own ** 2)):.2f}', f'{np.mean(own):+.2f}',
            coverage(theirs), f'{np.sqrt(np.mean(theirs ** 2)):.2f}')
    Console(width=140).print(table)


if __name__ == '__main__':
    main()
