"""How often `par4_monitor` alarms on a healthy machine, and how soon on one that changed.

    python bench/drift_rate.py [SECONDS] [HOURS]

Simulates SECONDS of quasi-random motion of a healthy machine with noise, takes the windows that the
monitor would take, and then draws HOURS of windows from them, in blocks of ten that keep their
order, again and again with other windows to learn from.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np

from par4_dynamics.model_from_file import read_model
from par4_identification.logs.log import Log
from par4_identification.trend.drift import DriftWatch, projections
from par4_identification.trend.windows import LEARNING, WINDOW
from par4_kinematics.motion_file import named_motion
from par4_kinematics.robot import read_robot
from par4_sim.closed_loop.simulation import build_simulation

BLOCK = 10


def windows(model, known, seconds: float, seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return projections and lengths of the windows of a simulated machine."""
    robot = read_robot('reference')
    simulation = build_simulation(robot, model, 'exact', 1e-3, seed, torque_noise=0.05)
    motion = named_motion('excitation', robot, seconds, seed)
    start = simulation.time + 0.1
    simulation.queue_reference(start + motion.t, motion.q, motion.qd, motion.qdd)
    samples = [simulation.next_sample() for _ in range(round(seconds * 1000))]
    simulation.close()
    q, tau = (np.array([getattr(sample, name) for sample in samples]) for name in ('q', 'effort'))
    size, taken = round(WINDOW * 1000), []
    for first in range(size, len(q) - size, size):
        part = slice(first, first + size)
        log = Log('window', robot.joint_names, 1, 1e-3, 1e-3 * np.arange(first, first + size),
                  q[part], tau[part], (slice(0, size),), None, None)
        taken.append(projections(log, robot, known)[:2])
    return taken


def main() -> None:
    """Print both rates."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 600.0
    hours = float(sys.argv[2]) if len(sys.argv) > 2 else 240.0
    robot = read_robot('reference')
    model = read_model('table1_full', robot)
    healthy = windows(model, model, seconds, 1)
    moving = [window for window in healthy if not np.isnan(window[0]).any()]
    print(f'{len(healthy)} windows of {WINDOW:g} s, all joints move in {len(moving)}')
    random = np.random.default_rng(0)
    alarms, watched, trials = 0, 0.0, 10
    for _ in range(trials):
        watch = DriftWatch(4)
        for _ in range(round(hours / trials * 3600.0 / WINDOW / BLOCK)):
            first = random.integers(len(moving) - BLOCK)
            for projected, lengths in moving[first:first + BLOCK]:
                watch.take(WINDOW * watch.windows, projected, lengths)
            if watch.drifts:
                alarms += 1
                print('  false:', *watch.drifts)
                watch = DriftWatch(4)
            watched += BLOCK * WINDOW / 3600.0
    print(f'healthy: {alarms} alarms in {watched:.0f} h of drawn windows')
    for share in (0.02, 0.1):
        base = read_model('table1_full', robot)
        values = dict(base.values)
        values['coulomb_friction'] = values['coulomb_friction'] * (
            1.0 + share * np.array((0.0, 0.0, 1.0, 0.0)))
        odd = windows(replace(base, values=values), model, 60.0, 2)
        watch = DriftWatch(4)
        for projected, lengths in moving[:LEARNING]:
            watch.take(WINDOW * watch.windows, projected, lengths)
        begun = watch.windows
        for projected, lengths in odd:
            watch.take(WINDOW * watch.windows, projected, lengths)
            if watch.drifts:
                break
        told = ', '.join(map(str, watch.drifts)) or 'nothing within 1 min'
        print(f'Coulomb friction of joint 2 by {share:.0%}: after '
              f'{WINDOW * (watch.windows - begun):.0f} s: {told}')


if __name__ == '__main__':
    main()
