"""A measured log: joint positions and torques on an even grid, and the motion asked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_identification.logs.accounts import Accounts
from par4_kinematics.errors import InputError


@dataclass(frozen=True)
class Reference:
    """The motion that was asked for; SI, radians.

    Attributes:
        t: on the clock of the log, increasing, (m,) s.
        q, qd, qdd: (m, J); NaN where the messages carried none.
        effort: feedforward torque, (m, J) N m, NaN where none came; None without any.
    """

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    effort: np.ndarray | None = None


@dataclass(frozen=True)
class Log:
    """Measured positions and torques of J joints on an even grid; SI, radians.

    Attributes:
        name: path of the bag.
        joint_names: of the columns.
        start_stamp: of the first sample of the bag, ns; t = 0.
        period: of the grid within a segment, s.
        t: (n,) s.
        q: (n, J) rad.
        tau: (n, J) N m.
        segments: stretches without a gap, in order, covering all n samples; no filter may reach
            across their ends.
        reference: the motion that was asked for, if the bag holds one.
        accounts: counts of what was read, repaired and dropped; None if the samples come from no
            bag.
        doubtful: whether the torque of a joint must not be compared with a model at a sample,
            because position or torque there are filled in or wrong, (n, J); None if no sample is.
        integrated: whether the positions are the integral of measured speeds.
    """

    name: str
    joint_names: tuple[str, ...]
    start_stamp: int
    period: float
    t: np.ndarray
    q: np.ndarray
    tau: np.ndarray
    segments: tuple[slice, ...]
    reference: Reference | None
    accounts: Accounts | None
    doubtful: np.ndarray | None = None
    integrated: bool = False

    @property
    def bag_accounts(self) -> Accounts:
        """What was read, repaired and dropped.

        Raises:
            TypeError: the samples come from no bag.
        """
        if self.accounts is None:
            raise TypeError(f'{self.name}: comes from no bag')
        return self.accounts


def refuse_logs(logs: Sequence[Log]) -> None:
    """Refuse logs from which nothing can be told.

    Raises:
        InputError: none, two of one name, positions or torques that are no numbers, or torques
            that never change.
    """
    if not logs:
        raise InputError('no log is given; give at least one')
    names = [log.name for log in logs]
    for log in logs:
        if names.count(log.name) > 1:
            raise InputError(f'{log.name}: two logs have this name; give each its own')
        for what, values in (('positions', log.q), ('torques', log.tau)):
            wrong = np.count_nonzero(~np.isfinite(values).all(axis=1))
            if wrong:
                raise InputError(f'{log.name}: {wrong} of {len(values)} {what} are no numbers; '
                                 f'leave these samples out')
        still = np.flatnonzero(np.ptp(log.tau, axis=0) == 0.0)
        if len(still):
            raise InputError(f'{log.name}: the torque of joint {still[0]} never changes; check '
                             f'what measures torque or current')
