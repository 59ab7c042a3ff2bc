"""Whether par4_trend tells what happened to a machine, and when: docs/trend.md.

    python bench/trend_study.py years       50 years of simulated estimates, the score
    python bench/trend_study.py years --first-seed 1000 --years 10    developing
    python bench/trend_study.py bags FOLDER --number 200       one year, every bag simulated

Estimates are drawn with the covariance that a simulated bag of 20 s gives, around parameters that
the seasons, the weather, wear, a repair, a payload and grease move. A change counts as found if one
is told within two bags of it; whatever else is told is a false alarm. Years in which nothing but
seasons and weather happens count false alarms alone.
"""

from __future__ import annotations

import argparse
import sys
import time
from datetime import UTC, datetime
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

import numpy as np
from blind_study import machine_name
from rich.progress import track
from scipy.stats import binomtest
from year import BEGIN, Year, drawn_year

from par4_dynamics.model_from_file import build_model
from par4_identification.changes.joint_values import fitted_values
from par4_identification.diagnosis.diagnosis import CONDITIONING
from par4_identification.diagnosis.evidence.observations import observe
from par4_identification.logs.log import Log
from par4_identification.signals.rows import runs_of_log
from par4_identification.trend.life import Life, life_of
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.stamps import SECOND
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import build_simulation
from robots import REFERENCE

SCORING_SEED = 8_950_000
"""Seeds from here on are run once, after everything is fixed."""
NEAR = 2
"""Bags within which a change is told in time."""
DURATION = 20.0
"""s of a bag."""
NOISE = 0.05
"""N m."""


def covariance_of_a_bag() -> np.ndarray:
    """Return the covariance (24, 24) of what one simulated recording tells."""
    year = drawn_year(0, 2, eventful=False)
    model_file = year.model_file(0)
    simulation = build_simulation(REFERENCE, build_model(REFERENCE, model_file), 'exact',
                                  seed=1, torque_noise=NOISE)
    motion = excitation_motion(REFERENCE, DURATION, 1)
    simulation.queue_reference(simulation.time + 0.5 + motion.t, motion.q, motion.qd, motion.qdd)
    samples = [simulation.next_sample() for _ in range(round((DURATION + 1.0) / 1e-3))]
    simulation.close()
    t = 1e-3 * np.arange(len(samples))
    log = Log('a bag', REFERENCE.joint_names, 0, 1e-3, t, np.array([s.q for s in samples]),
              np.array([s.effort for s in samples]), (slice(0, len(t)),), None, None)
    known = build_model(REFERENCE, model_file)
    return fitted_values(observe(runs_of_log(log, REFERENCE, CONDITIONING), REFERENCE, 'full',
                                 known)).covariance


def told(life: Life, year: Year) -> tuple[list[str], list[str], int]:
    """Return what was found, what was missed and how much was told of nothing."""
    left = [event.index for event in life.events]
    found, missed = [], []
    for item in year.happened:
        place = int(np.searchsorted(year.t, item.day))
        near = [index for index in left if abs(index - place) <= NEAR]
        if near:
            left.remove(min(near, key=lambda index: abs(index - place)))
        # two that happen within a few bags are one event
        same = [index for index in (event.index for event in life.events)
                if abs(index - place) <= NEAR]
        (found if same else missed).append(item.what)
    return found, missed, len(left) + len({index for index, _ in life.odd})


def study_of_years(first_seed: int, years: int, bags: int) -> None:
    """Print the score of simulated years."""
    covariance = covariance_of_a_bag()
    found, missed, alarms = [], [], {True: 0, False: 0}
    seconds, notes = 0.0, []
    for number in track(range(2 * years), 'years'):
        eventful, seed = number % 2 == 0, first_seed + number
        year = drawn_year(seed, bags, eventful)
        started = time.perf_counter()
        life = life_of(year.bags(covariance, np.random.default_rng((seed, 1))))
        seconds += time.perf_counter() - started
        own, lost, false = told(life, year)
        found += own
        missed += lost
        alarms[eventful] += false
        if lost or false:
            notes.append(f'{seed}: missed {lost}, false alarms {false}; happened '
                         f'{[(h.what, int(np.searchsorted(year.t, h.day))) for h in year.happened]}'
                         f', told {[event.index for event in life.events]}')
    count = len(found) + len(missed)
    interval = binomtest(len(found), count).proportion_ci(method='wilson')
    print(machine_name())
    print(f'changes told within {NEAR} bags: {len(found)} of {count}, '
          f'{100.0 * len(found) / count:.1f} % ({100.0 * interval.low:.1f} to '
          f'{100.0 * interval.high:.1f} %)')
    for what in sorted(set(found + missed)):
        print(f'  {what}: {found.count(what)} of {found.count(what) + missed.count(what)}')
    for eventful, words in ((False, 'in which nothing happens'), (True, 'in which things happen')):
        print(f'false alarms in {years} years {words}: {alarms[eventful]} in {years * bags} bags')
    print(f'{seconds / (2 * years):.2f} s a year')
    print('\n'.join(notes))


def year_of_bags(folder: Path, seed: int, number: int, duration: float) -> None:
    """Write one year as bags, every one of them simulated, and what happened in it."""
    year = drawn_year(seed, number)
    folder.mkdir(parents=True, exist_ok=True)
    for index in track(range(number), 'bags'):
        began = BEGIN + 86400.0 * year.t[index]
        name = datetime.fromtimestamp(began, UTC).strftime('%Y-%m-%d_%H%M%S')
        if (folder / name).exists():
            continue
        model = build_model(REFERENCE, year.model_file(index))
        simulation = build_simulation(REFERENCE, model, 'exact', seed=index, torque_noise=NOISE)
        simulate_to_bag(simulation, excitation_motion(REFERENCE, duration, index % 3), REFERENCE,
                        folder / name, began=round(began) * SECOND)
    for item in year.happened:
        print(f'{datetime.fromtimestamp(BEGIN + 86400.0 * item.day, UTC):%d %B}: {item.what}'
              + (f' of joint {year.joint}, {100.0 * year.rate:.1f} % a week'
                 if item.what == 'wear' else ''))


def main() -> None:
    """Score years, or simulate one."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    words = parser.add_subparsers(dest='command', required=True)
    years = words.add_parser('years', help='score simulated years of estimates')
    years.add_argument('--first-seed', type=int, default=SCORING_SEED)
    years.add_argument('--years', type=int, default=50)
    years.add_argument('--number', type=int, default=200, help='bags a year')
    bags = words.add_parser('bags', help='simulate one year')
    bags.add_argument('folder', type=Path)
    bags.add_argument('--seed', type=int, default=3)
    bags.add_argument('--number', type=int, default=200)
    bags.add_argument('--duration', type=float, default=DURATION, help='of a bag, s')
    arguments = parser.parse_args()
    if arguments.command == 'years':
        study_of_years(arguments.first_seed, arguments.years, arguments.number)
    else:
        year_of_bags(arguments.folder, arguments.seed, arguments.number, arguments.duration)


if __name__ == '__main__':
    main()
