"""The EMPS recording: where it is, what is in it, and the same as a log and as a bag."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from par4_identification import Log, Reference
from par4_identification.signals.filtering import central_difference, second_difference
from par4_kinematics import AMPLIFIER_VOLTAGE, JOINT_STATES, REFERENCE, Axis, InputError
from par4_sim import BagWriter

VARIABLE = 'PAR4_EMPS_DATA'
"""Environment variable with the path of DATA_EMPS.mat."""
JOINT = 'carriage'
SECOND = 1_000_000_000
FIRST_STAMP = SECOND
"""Stamp of the first sample, ns; zero would mean 'not set'."""
CHUNK = 250
"""Reference points a message."""


@dataclass(frozen=True)
class Recording:
    """A linear axis in closed loop: voltage = kv (kp (reference - position) - speed).

    Attributes:
        period: s.
        reference: position asked for, (n,) m.
        position: measured, (n,) m.
        voltage: of the amplifier, (n,) V.
        gain: force per volt, N/V.
        kp, kv: gains of the loops, 1/s and V s/m.
    """

    period: float
    reference: np.ndarray
    position: np.ndarray
    voltage: np.ndarray
    gain: float
    kp: float
    kv: float

    @property
    def force(self) -> np.ndarray:
        """Force of the motor, (n,) N."""
        return self.gain * self.voltage

    @property
    def axis(self) -> Axis:
        """The machine, as its robot.yaml describes it."""
        return Axis.model_validate({'schema': 'par4/axis/1', 'name': 'emps', 'joint': JOINT,
                                    'kind': 'linear', 'gain': self.gain})

    @property
    def log(self) -> Log:
        """The same as a log of the library."""
        t = self.period * np.arange(len(self.position))
        wanted = self.reference[:, None]
        return Log(
            name='emps', joint_names=(JOINT,), start_stamp=FIRST_STAMP, period=self.period, t=t,
            q=self.position[:, None], tau=self.force[:, None], segments=(slice(0, len(t)),),
            reference=Reference(t, wanted, central_difference(wanted, self.period),
                                second_difference(wanted, self.period)), accounts=None)


def data_path(argument: str | None = None) -> Path | None:
    """Return where DATA_EMPS.mat is: the argument, else what the variable says, else None."""
    given = argument or os.environ.get(VARIABLE)
    return Path(given) if given else None


def read_recording(path: str | Path) -> Recording:
    """Return the content of DATA_EMPS.mat.

    The published recipe takes the period for 1 ms; the stamps have a jitter of 24 ns.

    Raises:
        InputError: not found, or another file.
    """
    from scipy.io import loadmat

    try:
        data = loadmat(path)
    except (OSError, ValueError) as error:
        raise InputError(f'{path}: cannot be read as a MATLAB file ({error}); give the path of '
                         f'DATA_EMPS.mat, as argument or as {VARIABLE}') from error
    wanted = ('t', 'qg', 'qm', 'vir', 'gtau', 'kp', 'kv')
    missing = [name for name in wanted if name not in data]
    if missing:
        raise InputError(f'{path}: lacks {", ".join(missing)}; give DATA_EMPS.mat')
    t, reference, position, voltage = (data[name].ravel() for name in wanted[:4])
    return Recording(float(np.round(np.mean(np.diff(t)), 6)), reference, position, voltage,
                     *(float(data[name].item()) for name in wanted[4:]))


def write_bag(recording: Recording, path: str | Path) -> None:
    """Write the recording as a bag of the contract: joint_states, amplifier_voltage, reference."""
    log, names = recording.log, (JOINT,)
    stamps = FIRST_STAMP + np.rint(log.t * SECOND).astype(np.int64)
    points = (log.reference.q, log.reference.qd, log.reference.qdd)
    with BagWriter(path) as bag:
        for row, stamp in enumerate(stamps):
            if row % CHUNK == 0:
                part = slice(row, row + CHUNK)
                bag.write_trajectory(f'/{REFERENCE.name}', int(stamp), names,
                                     stamps[part] - stamp, *(column[part] for column in points))
            bag.write_joint_state(f'/{JOINT_STATES.name}', int(stamp), names,
                                  recording.position[row:row + 1])
            bag.write_joint_state(f'/{AMPLIFIER_VOLTAGE.name}', int(stamp), names,
                                  effort=recording.voltage[row:row + 1])
