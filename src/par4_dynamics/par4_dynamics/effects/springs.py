"""Loads that swing on elastic transmissions: their torque, and its slopes by the logarithms of
compliances, damping and motor share.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from par4_dynamics.effects.spring_steps import swing_through
from par4_dynamics.effects.transmission import MOTOR_SHARE, motor_side, told_part
from par4_dynamics.load_friction import none_at_all
from par4_dynamics.state import State
from par4_kinematics.errors import UnreachableError

DAMPING_RATIO = 0.05
"""Of a transmission, over the critical damping of motor against arm: assumed where nothing tells.
With much less the noise of the encoders would swing the load."""
FOURTH_ORDER, UNBOUNDED = 1.0 / 12.0, 0.25
"""Newmark's beta with which frequencies are right to the fourth power of the step (Fox and Goodwin
1949), and that with which no step is too long."""
POSES, SAFE = 20, 0.7
"""Poses of a motion whose inertia is looked at for the smallest, and share of that which is counted
on in all others."""
FIRST, MOVING = 0.3, 0.02
"""s from the first sample in which the measured torque tells how loads swing there, and speed over
that of the whole motion (rms) from which on friction is known."""
RANK = 1e-8
"""Of the free swings, over the largest, below which the first samples do not tell one."""
RUN_IN, RUN_IN_DAMPING = 1.0, 25.0
"""s before the motion, and times more damping at its start: the swing in which the integration
starts dies away there. It fades to nothing without a kink, which would start another."""


@dataclass(frozen=True)
class Drive:
    """What the transmissions of a machine have in common beside their stiffness.

    Attributes:
        damping_ratio: over the critical damping with which the two parts of the actuator's
            inertia, motor and arm, swing against each other.
        motor_share: of the actuator's inertia that turns with the motor and its encoder.
    """

    damping_ratio: float = DAMPING_RATIO
    motor_share: float = MOTOR_SHARE


USUAL = Drive()
Asked = tuple[Drive, tuple[float, ...], int]
"""What the springs have in common, their compliances (J,), rad/(N m), and samples a step."""
Swung = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""What `Springs._swung` returns."""


class Springs:
    """Loads that swing on their transmissions while the motors move as measured.

    A twist s of the joints changes what the load takes to move, to first order in s by
    -(M sdd + C sd + K s), and the springs carry T = T_0 - (M sdd + C sd + K s) = s / c + d sd.
    T_0 is what rigid ones would carry; M, C and K are the derivatives of the load's torque by
    acceleration, velocity and position along the motion. The motors move as measured whatever the
    twist, so that the load swings against motors at rest: at sqrt(1 / c M), which a light machine
    may have far within the band of its torque. There C, some percent of M times that frequency,
    damps or drives as much as the springs themselves do. What the first order misses along the
    motion of the load of a mechanism is added to T_0, and the loads swing once more: the speed of a
    twist may be a third of the joint's, and what goes with its square looks like damping. Joints
    that turn with the load, theta and the passive ones, do so with their friction.

    Args:
        state: the motion with its nominal torque.
    """

    def __init__(self, state: State) -> None:
        state = state.true  # the loads are where they are, not where encoders tell them
        self._state, self._whole_load = state, told_part(state, state.known.load)
        self._still = len(state.t) < 2
        # of the last that was asked for; several threads may ask, so that what is kept is read once
        self._load_torque: tuple[float, np.ndarray] = np.nan, self._whole_load
        self._least_inertia: tuple[float, np.ndarray] = np.nan, np.zeros(state.joints)
        if self._still:
            return
        self._period = (state.t[-1] - state.t[0]) / (len(state.t) - 1)
        self._by_motion = np.stack((state.torque_by_qdd, state.torque_by_qd, state.torque_by_q))
        slips = state.known.slips(state) or none_at_all(state.joints)
        self._turning = np.ascontiguousarray(slips.turning)
        self._slipping = np.einsum('ngaj,nj->nga', slips.turning, state.qd[:len(slips.turning)])
        self._friction = np.stack((slips.coulomb, slips.viscous))
        self._actuator = motor_side(state, np.ones(state.joints), 1.0)
        before = self._before = min(len(state.t) - 1, round(RUN_IN / self._period))
        self._place = np.concatenate((np.zeros(before, dtype=int), np.arange(len(state.t))))
        fade = np.concatenate((np.linspace(1.0, 0.0, before), np.zeros(len(state.t))))
        self._more = 1.0 + RUN_IN_DAMPING * fade ** 2
        self._last: tuple[tuple[Drive, tuple[float, ...]] | None, np.ndarray] = (
            None, self._whole_load)
        self._free: tuple[Asked | None, np.ndarray] = None, self._whole_load
        self._first = min(len(state.t), round(FIRST / self._period))
        self._friction_known = self._known_friction()

    def resonances(self, compliance: np.ndarray, drive: Drive = USUAL) -> np.ndarray:
        """Return the frequency at which each load swings against its resting motor, (J,) Hz.

        `compliance` is (J,), rad/(N m); infinite where it is at most zero.
        """
        with np.errstate(divide='ignore'):
            return np.asarray(1.0 / np.sqrt(np.maximum(compliance, 0.0) * self._load_inertia(
                drive)) / (2.0 * np.pi))

    def damping_of_loads(self, drive: Drive) -> np.ndarray:
        """Return the damping ratio of each load that swings against its resting motor, (J,).

        The load has more inertia than the two parts of the actuator, by which a drive is damped.
        """
        share = drive.motor_share
        return np.asarray(drive.damping_ratio * np.sqrt(
            share * (1.0 - share) * self._actuator / self._load_inertia(drive)))

    def _load_inertia(self, drive: Drive) -> np.ndarray:
        """Return the inertia of each load without its motor, (J,) kg m2, mean of the motion."""
        own = np.mean(np.diagonal(self._by_motion[0], axis1=1, axis2=2), axis=0)
        return np.asarray(own - drive.motor_share * self._actuator)

    def rigid(self, drive: Drive = USUAL) -> np.ndarray:
        """Return what rigid transmissions would carry to the load, (n, J) N m, as far as told."""
        share, torque = self._load_torque
        if share != drive.motor_share:
            torque = self._whole_load - drive.motor_share * self._motor_torque
            self._load_torque = drive.motor_share, torque
        return torque

    def torque(self, compliance: np.ndarray, drive: Drive = USUAL, every: int = 1,
               missed: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return the torque s / c of springs that twist by s, and the change of the load's torque.

        Args:
            compliance: c, (J,), rad/(N m); at most zero is rigid.
            drive: what they have in common.
            every: samples from step to step of the integration; more than one is quick and coarse.
            missed: what `missed` returns of springs nearby; it takes most of the time.

        Returns:
            Two (n, J), N m; the nominal torque and zero where nothing twists, and for springs that
            do not hold the weight of an axis up: its load would fall over, without end.
        """
        rigid = self.rigid(drive)
        if not self._twist(compliance):
            return rigid, np.zeros_like(rigid)
        if missed is None:
            missed = self.missed(compliance, drive, every)
        spring, change, _, _ = self._swung(rigid + missed, compliance, drive, every)
        return self._told(spring, every), self._told(change, every) + missed

    def slopes(self, compliance: np.ndarray, drive: Drive = USUAL, every: int = 1,
               missed: np.ndarray | None = None) -> np.ndarray:
        """Return the slopes of the change of `torque`, (n, J, J + 2), N m.

        They are those by the logarithms of the compliances, of the damping ratio and of the motor
        share. They leave out how what the first order misses changes; rigid joints have none.
        """
        slopes = np.zeros((*self._whole_load.shape, self._whole_load.shape[1] + 2))
        if not self._twist(compliance):
            return slopes
        if missed is None:
            missed = self.missed(compliance, drive, every)
        load = self.rigid(drive) + missed
        found = self._told(self._swung(load, compliance, drive, every, True)[3], every)
        slopes[..., [*np.flatnonzero(compliance > 0.0), -2, -1]] = found
        return slopes

    def _twist(self, compliance: np.ndarray) -> bool:
        """Return whether springs (J,) twist, and hold their load where it stands upside down."""
        if self._still or not np.any(compliance > 0.0):
            return False
        return self._state.geometry is not None or bool(
            np.all(1.0 + compliance * self._by_motion[2].min(axis=0)[0] > 0.0))

    def missed(self, compliance: np.ndarray, drive: Drive = USUAL, every: int = 1) -> np.ndarray:
        """Return what the first order misses of the load's torque along its motion, (n, J), N m.

        It is zero of coarse steps, of an axis, whose load is linear, and where nothing twists. That
        of the last compliances is kept: slopes are asked for where a torque was.
        """
        if every > 1 or self._state.geometry is None or not self._twist(compliance):
            return np.zeros_like(self._whole_load)
        asked = drive, tuple(compliance)
        last, missed = self._last
        if last != asked:
            motion = self._swung(self.rigid(drive), compliance, drive)[2][:, self._before:]
            try:
                missed = self._exact_change(motion, drive) - self._first_order(motion, drive)
            except UnreachableError:  # springs so soft are none that a machine has
                missed = np.zeros_like(self._whole_load)
            self._last = asked, missed
        return missed

    def _told(self, steps: np.ndarray, every: int) -> np.ndarray:
        """Return values (n, ...) at the samples of the motion of those at the steps (m, ...)."""
        if every == 1:
            return steps[self._before:]
        told = np.empty((every * len(steps), *steps.shape[1:]))
        with np.errstate(all='ignore'):  # springs that are tried may throw the loads to infinity
            ahead = np.diff(steps, axis=0, append=steps[-1:])
            for part in range(every):
                told[part::every] = steps + part / every * ahead
        return told[self._before:self._before + len(self._state.t)]

    def _first_order(self, motion: np.ndarray, drive: Drive) -> np.ndarray:
        """Return what `_exact_change` returns, to first order in the twist."""
        twist, speed, rate = motion
        by_rate, by_speed, by_twist = self._by_motion
        return motor_side(self._state, rate, drive.motor_share) - sum(
            np.einsum('nij,nj->ni', slope, change) for slope, change in (
                (by_rate, rate), (by_speed, speed), (by_twist, twist)))

    def _exact_change(self, motion: np.ndarray, drive: Drive) -> np.ndarray:
        """Return the change of the load's torque (n, J), N m, where its springs twist.

        Args:
            motion: twist, its speed and acceleration, (3, n, J), rad, rad/s, rad/s2.
            drive: of the springs.

        Raises:
            UnreachableError: positions of the load with which the mechanism does not close.
        """
        state, (twist, speed, rate) = self._state, motion
        moved = state.moved(state.q - twist, state.qd - speed, state.qdd - rate)
        return (state.known.body_torque(moved) - self._whole
                + motor_side(state, rate, drive.motor_share))

    @cached_property
    def _whole(self) -> np.ndarray:
        """The rigid machine's torque, (n, J) N m."""
        return self._state.known.body_torque(self._state)

    @cached_property
    def _motor_torque(self) -> np.ndarray:
        """The torque that accelerates the whole actuator inertia, as far as told, (n, J) N m."""
        return told_part(self._state, motor_side(self._state, self._state.qdd, 1.0))

    def _swung(self, rigid: np.ndarray, compliance: np.ndarray, drive: Drive,
               every: int = 1, with_slopes: bool = False) -> Swung:
        """Return what `torque` does, to first order, with a run-in before it, and the twists.

        Args:
            rigid: what rigid springs would carry, (n, J), N m.
            compliance, drive, every: of `torque`.
            with_slopes: whether they are asked for.

        Returns:
            Two (m, J), N m; twist, speed and acceleration (3, m, J); slopes of the second (m, J, p)
            by the logarithms of the compliances of the p - 2 joints that twist, of the damping
            ratio and of the motor share, p = 0 unless asked for. All of every so many samples.
        """
        soft = np.flatnonzero(compliance > 0.0)
        twisting = compliance[soft]
        share = drive.motor_share
        motor = share * self._actuator
        reduced = (1.0 - share) * motor[soft]
        lag = 2.0 * drive.damping_ratio * np.sqrt(twisting * reduced)  # c d, s
        h = every * self._period
        beta = self._beta(twisting, soft, h, share)
        numbers, motors = tuple(soft.tolist()), tuple(motor.tolist())
        place, more = map(np.ascontiguousarray, (self._place[::every], self._more[::every]))
        stiffer = 0.5 * (1.0 - 2.0 * share) / (1.0 - share)

        def swing(load: np.ndarray, steps: slice, driven: np.ndarray | None = None,
                  slips: bool = True) -> Swung:
            spring, change = np.empty_like(load), np.empty_like(load)
            twist = np.zeros((3, *load.shape))
            slopes = np.empty((*load.shape, 0 if driven is None else len(soft) + 2))
            swing_through(load, place[steps], self._by_motion, self._turning, self._slipping,
                          self._friction if slips else self._friction[:, :0], motors, numbers,
                          twisting, lag,
                          more[steps], h, beta, load if driven is None else driven, stiffer,
                          spring, change, twist, slopes)
            return spring, change, twist, slopes

        load = self._swinging_at_first(self._with_run_in(rigid, every), rigid - self.rigid(drive),
                                       swing, partial(swing, slips=False), every, soft,
                                       (drive, tuple(compliance), every))
        return swing(load, slice(None), share * self._with_run_in(self._motor_torque, every)
                     if with_slopes else None)

    def _known_friction(self) -> np.ndarray:
        """Return at which of the first samples the sign of the friction is known, (f, J)."""
        speed = np.abs(self._state.qd)
        return speed[:self._first] > MOVING * np.sqrt(np.mean(speed ** 2, axis=0))

    def _swinging_at_first(self, load: np.ndarray, beyond: np.ndarray,
                           swing: Callable[[np.ndarray, slice], Swung],
                           freely: Callable[[np.ndarray, slice], Swung], every: int,
                           soft: np.ndarray, asked: Asked) -> np.ndarray:
        """Return steps (m, J) of what rigid springs would carry, with loads that swing at first.

        What was before the first sample is not known. Whatever it was, the loads swing freely after
        it, each with some twist and some speed: those with which the measured torque of the first
        samples agrees best. A torque before the first step makes the twist, one at that step the
        speed.

        Args:
            load: steps with the run-in.
            beyond: what that has beyond the torque of the motion, (n, J), N m.
            swing: integrates some of the steps.
            freely: the same without the friction of joints that turn with the load, which is none
                of what a kick does.
            every: samples from step to step.
            soft: joints that twist, (k,).
            asked: what tells one `swing` from another.
        """
        begin = -(-self._before // every)
        samples = slice(every * begin - self._before, self._first, every)
        told = self._friction_known[samples].copy()
        told[:2] = False  # where the kicks are
        measured = self._state.measured
        if measured is None or begin < 1 or not told.any():
            return load
        steps = slice(begin - 1, begin + len(told))
        left = (measured - self._state.known.independent - beyond)[samples] - swing(
            load[:steps.stop], slice(0, steps.stop))[1][begin:]
        last, free = self._free
        if last != asked:
            free = self._free_swings(freely, steps, told, soft)
            self._free = asked, free
        sizes = np.linalg.lstsq(free, left[told], rcond=RANK)[0]
        twist, speed = np.split(sizes[:2 * len(soft)], 2)
        begun = load.copy()
        begun[:begin, soft] += twist
        begun[begin, soft] += speed
        return begun

    def _free_swings(self, swing: Callable[[np.ndarray, slice], Swung], steps: slice,
                     told: np.ndarray, soft: np.ndarray) -> np.ndarray:
        """Return the torques of free swings and of constants, (r, 2 k + J), N m.

        Those by a torque before the first step go first, then those by one at that step, of each of
        the `soft` joints (k,). Last is a constant torque of each joint.

        Args:
            swing: integrates some of the steps.
            steps: from the one before the first sample on.
            told: at which of the first samples (f, J), r in all, the torque is asked for.
            soft: joints that twist, (k,).
        """
        kicks = np.zeros((2, len(soft), len(told) + 1, told.shape[1]))
        for kind in range(2):
            kicks[kind, np.arange(len(soft)), kind, soft] = 1.0
        free = [swing(kick, steps)[1][1:][told] for kick in kicks.reshape(-1, *kicks.shape[2:])]
        constant = np.nonzero(told)[1][:, None] == np.arange(told.shape[1])
        return np.column_stack([*free, constant.astype(float)])

    def _with_run_in(self, torque: np.ndarray, every: int) -> np.ndarray:
        """Return every so many steps of a torque (n, J) and what goes before it.

        That is the torque turned about its first sample.
        """
        return np.ascontiguousarray(
            np.concatenate((2.0 * torque[0] - torque[self._before:0:-1], torque))[::every])

    def _beta(self, compliance: np.ndarray, soft: np.ndarray, h: float, share: float) -> np.ndarray:
        """Return Newmark's beta of each joint that twists, (k,), for steps of h, s.

        It is that of `FOURTH_ORDER` where the joint is soft enough. As the springs' stiffness is
        diagonal, steps are stable while M - diag((1/4 - beta) h^2 / c) is positive: no joint's beta
        depends on how stiff the others are.

        Args:
            compliance: of the joints that twist, (k,).
            soft: which ones, (k,).
            h: step.
            share: of the actuator inertia that turns with the motor, which is no part of the load.
        """
        last, inertia = self._least_inertia
        if last != share:
            inertia = self._least_inertia_beside(share * self._actuator)
            self._least_inertia = share, inertia
        least = UNBOUNDED - inertia[soft] * compliance / h ** 2
        return np.maximum(least, FOURTH_ORDER)

    def _least_inertia_beside(self, motor: np.ndarray) -> np.ndarray:
        """Return the inertia (J,), kg m2, of which a diagonal matrix is smaller than the load's.

        `motor` (J,), kg m2, is no part of the load.
        """
        poses = np.linspace(0, len(self._state.t) - 1, POSES).astype(int)
        inertia = self._by_motion[0][poses] - np.diag(motor)
        own = np.diagonal(inertia, axis1=1, axis2=2)
        if np.any(own <= 0.0):
            return np.zeros(own.shape[1])
        both = 0.5 * (inertia + np.swapaxes(inertia, 1, 2))
        scale = np.sqrt(own)
        alike = np.linalg.eigvalsh(both / (scale[:, :, None] * scale[:, None, :]))[:, 0].min()
        return SAFE * max(float(alike), 0.0) * own.min(axis=0)
