"""What the models of two effects together leave of the simulated machine; prints a table.

The machine is built by `par4_sim` from the same values, on its exact plant, and logged without
noise. Two models that describe it by themselves may not do so together: friction that warms up also
lowers what another effect adds to it. Pairs that leave decidedly more than both do by themselves
are printed, the worst first. Rows in which the law of one does not tell its torque, as where theta
may rest, are left out.

    python bench/effect_pairs.py [NAME ...]     pairs with these effects only
"""

from __future__ import annotations

import sys
from itertools import combinations
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

import numpy as np
from hidden.machines import known_machine
from hidden.motions import draw_motion
from hidden.recording import record
from rich.console import Console
from rich.progress import track
from rich.table import Table

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_identification.signals.rows import runs_of_log
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.machines.noise import Noise
from robots import model_with

PERIODIC = {'periods': 24.0, 'phase': (0.3, -1.0, 2.0, 0.0)}
VALUES: dict[str, dict[str, object]] = {
    'coulomb_asymmetry': {'asymmetry': (0.3, -0.2, 0.1, 0.25)},
    'viscous_asymmetry': {'asymmetry': (0.1, -0.2, 0.05, 0.15)},
    'nonlinear_viscous': {'quadratic': (0.1, 0.05, 0.02, 0.2)},
    'load_dependent_friction': {'coefficient': (0.05, 0.02, 0.1, 0.03)},
    'friction_drift': {'drop': 0.2, 'viscous_drop': 0.4, 'time_constant': 3.0},
    'presliding': {'distance': 5e-3},
    'stribeck': {'stribeck_torque': 0.8, 'stribeck_velocity': 0.2},
    'joint_friction_difference': {'coulomb': (0.3, -0.3, 0.1, 0.0),
                                  'viscous': (-0.2, 0.2, 0.0, 0.1)},
    'joint_inertia_difference': {'inertia': (0.003, -0.003, 0.002, 0.0)},
    'arm_mass_offset': {'first_moment': (0.02, -0.03, 0.01, 0.05)},
    'arm_weight_difference': {'first_moment': (0.02, -0.03, 0.0, 0.05)},
    'drive_gain_error': {'relative': (0.1, -0.1, 0.05, 0.0)},
    'torque_ripple': {'relative': (0.05, 0.03, 0.05, 0.04), **PERIODIC},
    'cogging': {'amplitude': (0.3, 0.2, 0.3, 0.1), **PERIODIC},
    'torque_offset': {'offset': (0.5, -0.5, 0.3, 0.2)},
    'base_tilt': {'about_x': 0.02, 'about_y': -0.03},
    'external_force': {'x': 2.0, 'y': -3.0, 'z': 1.5},
    'payload': {'mass': 0.7, 'half': 2.0},
    'cable_spring': {'stiffness': (30.0, 60.0, 40.0), 'anchor': (0.5, 0.4, -0.2)},
    'platform_drag': {'viscous': 0.4, 'quadratic': 0.7},
    'theta_friction': {'coulomb': 0.3, 'viscous': 0.05},
    'theta_inertia': {'inertia': 1.5e-3},
    'passive_joint_friction': {'coulomb': 0.05, 'viscous': 0.02},
    'encoder_offset': {'offset': (0.01, -0.01, 0.005, 0.0)},
    'encoder_eccentricity': {'amplitude': (3e-3, 2e-3, 3e-3, 1e-3), 'phase': (0.4, -2.0, 3.0, 1.2)},
    'leg_length_error': {'arm_length': (5e-4, 0.0, -3e-4, 2e-4),
                         'forearm_length': (0.0, -4e-4, 6e-4, 3e-4)},
    'geometry_error': {'arm_length': 5e-4, 'forearm_length': -8e-4, 'base_radius': 1e-3,
                       'platform_radius': -6e-4, 'platform_bar_length': 4e-4},
    'actuator_lag': {'time_constant': 2e-3},
    'time_offset': {'delay': 3e-3},
}
KNOWN = known_machine('reference')
MOTION = draw_motion('circles', KNOWN.robot, 6.5, 7)
MORE = 0.01
"""N m: rms beyond the root of the sum of both squares from which a pair is printed."""


def left_and_size(names: tuple[str, ...]) -> tuple[float, float]:
    """Return what the model with some effects, and that without any, leave of a machine, N m rms.
    """
    model = KNOWN.model
    for name in names:
        model = model_with(model, name, **VALUES[name])
    log = record(KNOWN, machine_of_model(KNOWN.robot, model), MOTION, fidelity='exact',
                 noise=Noise(), seed=1, feedforward=KNOWN.model, wander=None, name='pair').log
    run, = runs_of_log(log, KNOWN.robot)
    sure = run
    for active in model.effects:
        sure = sure.without(active.effect.is_unsure(run.state))
    left, size = ((run.tau - run.rows(part.torque(run.state)))[sure.valid]
                  for part in (model, KNOWN.model))
    return float(np.sqrt(np.mean(left ** 2))), float(np.sqrt(np.mean(size ** 2)))


def main(asked: list[str]) -> None:
    """Print the pairs that leave more than both effects do by themselves."""
    unknown = sorted(set(asked) - set(VALUES))
    if unknown:
        sys.exit(f'error: no values for {", ".join(unknown)}; there are {", ".join(VALUES)}')
    alone = {name: left_and_size((name,)) for name in VALUES}
    pairs = [pair for pair in combinations(VALUES, 2) if not asked or set(pair) & set(asked)]
    found = [(left_and_size(pair)[0], pair) for pair in track(pairs, 'simulating')]
    worse = sorted(((left - np.hypot(*(alone[name][0] for name in pair)), left, pair)
                    for left, pair in found), reverse=True)
    table = Table('pair', 'left', 'left by each', 'size of each', title='N m rms')
    for more, left, pair in worse:
        if more > MORE:
            table.add_row(', '.join(pair), f'{left:.3f}', *(
                ', '.join(f'{alone[name][part]:.3f}' for name in pair) for part in (0, 1)))
    console = Console()
    console.print(table)
    console.print('no values here for', ', '.join(sorted(set(CATALOGUE) - set(VALUES))))
    console.print(f'{len(worse) - table.row_count} of {len(worse)} pairs leave less than {MORE} '
                  f'N m beyond what both do')


if __name__ == '__main__':
    main(sys.argv[1:])
