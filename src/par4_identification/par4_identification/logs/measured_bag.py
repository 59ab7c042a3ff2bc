"""A bag in the contract's format of what a logger's files measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from par4_identification.logs.measured import Measured
from par4_kinematics.errors import InputError
from par4_kinematics.files import written_atomically
from par4_kinematics.interface import AMPLIFIER_VOLTAGE, JOINT_STATES
from par4_sim.bags.bag_writer import BagWriter


def write_measured(measured: Measured, joints: Sequence[str], path: str | Path,
                   storage: str = 'mcap', progress: Callable[[float], None] | None = None) -> None:
    """Write the bag.

    Position, speed and torque go to `joint_states`, voltage to `amplifier_voltage`.

    Args:
        measured: what is written.
        joints: names of its joints.
        path: of the bag, which must not exist; it appears only when complete.
        storage: 'mcap' or 'sqlite3'.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: the path exists or cannot be written.
    """
    if Path(path).exists():
        raise InputError(f'{path}: exists already; give another path or remove it')
    count, values = len(measured.stamp), measured.values
    nothing = np.empty((count, 0))
    position, velocity, torque = (
        values.get(name, nothing) for name in ('position', 'velocity', 'torque'))
    received = np.maximum.accumulate(measured.stamp)  # a clock that goes back was still running
    with (written_atomically(path, new=True) as scratch,
          BagWriter(scratch, storage, path) as bag):
        for row, (stamp, when) in enumerate(zip(measured.stamp.tolist(), received.tolist())):
            bag.write_joint_state(f'/{JOINT_STATES.name}', stamp, joints,
                                  position[row], velocity[row], torque[row], received=when)
            if 'voltage' in values:
                bag.write_joint_state(f'/{AMPLIFIER_VOLTAGE.name}', stamp, joints,
                                      effort=values['voltage'][row], received=when)
            if progress and row % 1000 == 0:
                progress(row / count)
