"""Bags of an axis whose motion and torque are formulas: as logs of somebody else's machine come."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from axes import axis

from par4_identification.fitting.identification import identify
from par4_identification.logs.log import Log
from par4_identification.logs.measured import Measured
from par4_identification.logs.measured_bag import write_measured
from par4_identification.logs.read_log import read_log
from par4_identification.setup_check.check import check_setup
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.scales import conditioning_for
from par4_kinematics.robot import Axis

INERTIA, COULOMB, VISCOUS = 1.0, 1.5, 2.0
"""Of the axis, in SI units."""


def swings(duration: float = 20.0, rate: float = 1000.0, fastest: float = 0.8, seed: int = 2
           ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return times, positions, speeds and accelerations (n,) of six sines up to `fastest` Hz."""
    generator = np.random.default_rng(seed)
    t = np.arange(round(duration * rate)) / rate
    frequency = generator.uniform(0.1, fastest, 6)
    phase, size = generator.uniform(0.0, 2.0 * np.pi, 6), 1.0 / (1.0 + frequency)
    omega = 2.0 * np.pi * frequency
    angle = np.outer(t, omega) + phase
    return (t, np.sin(angle) @ size, np.cos(angle) @ (size * omega),
            -np.sin(angle) @ (size * omega ** 2))


def torque_of(qd: np.ndarray, qdd: np.ndarray, noise: float = 0.01) -> np.ndarray:
    """Return the torque (n,) of inertia, Coulomb and viscous friction, with noise."""
    return (INERTIA * qdd + VISCOUS * qd + COULOMB * np.sign(qd)
            + noise * np.random.default_rng(0).standard_normal(len(qd)))


def read(path: Path, t: np.ndarray, q: np.ndarray, tau: np.ndarray, machine: Axis | None = None
         ) -> Log:
    """Return the log of a bag of times, positions and torques (n,) as the tools read it."""
    stamp = 1_700_000_000_000_000_000 + np.rint(1e9 * t).astype(np.int64)
    write_measured(Measured('revolute', stamp, {'position': q[:, None], 'torque': tau[:, None]},
                            len(t), 0), ('motor',), path)
    return read_log(path, machine or axis())


def log_of(t: np.ndarray, q: np.ndarray, tau: np.ndarray) -> Log:
    """Return a log of times, positions and torques (n,) that no bag gave."""
    return Log('log', ('motor',), 1, float(t[1] - t[0]), t, q[:, None], tau[:, None],
               (slice(0, len(t)),), None, None)


def identified(log: Log) -> np.ndarray:
    """Return inertia, Coulomb and viscous friction of a log in which no mistake is found, (3,)."""
    check = check_setup([log], axis())
    assert not check.findings
    logs = list(check.logs)
    return identify(logs, axis(), conditioning=conditioning_for(
        logs, axis(), Conditioning())).estimate.values
