"""Keeps a simulation going at the pace of the wall clock and carries out orders between samples."""

from __future__ import annotations

import time
from collections.abc import Callable
from enum import Enum
from queue import Empty, Queue
from threading import Event, Lock

import numpy as np

from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.limits import EndSwitches
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.ros.convert import Trajectory
from par4_kinematics.stamps import SECOND
from par4_sim.closed_loop.simulation import Sample, Simulation
from par4_sim.drives.reference_points import ReferencePoints
from par4_sim.ros.inbox import MOST, Inbox, Torques, as_one
from par4_sim.ros.pace import Pace

BACKLOG = 0.5
"""Seconds behind the wall clock that are caught up; what is beyond is let go."""
IDLE = 0.005
"""Longest wait for an order, s, while the simulation stands."""
PATIENCE = 5.0
"""Seconds to wait for an order to be carried out."""
GRACE = 0.5
"""Seconds of wall time in which, before the end, whoever moves the machine may brake it."""
LONGEST_END, LATEST_END = 2.5, 7.5
"""Seconds after which the loop ends even if the machine moves: of its own time at the pace that is
asked, and of wall time where a busy machine gives it fewer turns than that takes."""
SETTLED_NS = SECOND // 20
"""How long a machine must have rested to count as at rest."""


class End(Enum):
    """How a loop that was asked to end came to its end, in words."""

    PAUSED = 'paused'
    AT_REST = 'at rest'
    BRAKED = 'at rest, braked by the drives'
    IN_MOTION = 'in motion: the time to brake in was over'


class PhysicsLoop:
    """The thread that calls `run` owns the simulation; every other method is for other threads.

    Its time never runs backward: after a restart the clock goes on from where it was.

    Attributes:
        now_ns: time of the newest sample.
        paused: whether the simulation stands; it may be set.
        fault: why references are refused until a restart, in words; empty while all is well. It
            may be set.
        restarted: whether references are refused, after a restart, until one begins at rest.
        late_steps: samples that came more than a sample period after their time.
        waiting: whether the simulation stands for the torque of a reference point.
        unaided: whether it goes on without that torque, which did not come while it stood.
        ended: how the loop came to its end where `end` asked for it; None before.
    """

    def __init__(self, simulation: Simulation, publish: Callable[[int, Sample], None],
                 refuse: Callable[[Par4Error], None], real_time_factor: float,
                 feedforward_timeout: float, following_error_limit: float,
                 switches: EndSwitches, pace: Pace) -> None:
        """Prepare to publish each sample with its time.

        Args:
            simulation: at rest at home.
            publish: called with the time, ns, and the sample.
            refuse: called with what is wrong with a reference that is not followed.
            real_time_factor: simulated seconds a second, 0 = as fast as it can.
            feedforward_timeout: longest stand, s, for the torque of a reference point.
            following_error_limit: distance of a joint from its reference, rad, beyond which the
                drives brake and take no reference more; 0 for none.
            switches: which brake the machine, too, where it is beyond its limits.
            pace: told how long the physics takes.
        """
        self.now_ns = 0
        self.paused = False
        self.fault = ''
        self.restarted = False
        self.late_steps = 0
        self.waiting = self.unaided = False
        self.ended: End | None = None
        self._end_asked: float | None = None
        self._end_asked_ns = 0
        self._runs = False
        self._braked = False
        self._rests_since_ns: int | None = None
        self._simulation = simulation
        self._publish = publish
        self._refuse = refuse
        self._pace = pace
        self._following_error_limit = following_error_limit
        self._switches = switches
        self._factor = real_time_factor
        self._feedforward_timeout = feedforward_timeout
        self._started_ns = 0
        self._standing_since: float | None = None
        self._references: Inbox[ReferencePoints] = Inbox()
        self._efforts: Inbox[Torques] = Inbox()
        # SimpleQueue.get may wait for ever where its own start outlasts the timeout (CPython 3.11)
        self._orders: Queue[Callable[[], None]] = Queue()

    @property
    def torque_limit(self) -> float:
        """Of the drives, N m."""
        return self._simulation.torque_limit

    @property
    def starved(self) -> bool:
        """Whether the drives brake or have braked because a moving reference was not gone on with.
        """
        return self._simulation.starved

    @property
    def ending(self) -> bool:
        """Whether the loop ends as soon as the machine rests."""
        return self._end_asked is not None

    @property
    def counts(self) -> dict[str, int]:
        """What went wrong so far, by name."""
        return self._simulation.counts | {'late_steps': self.late_steps}

    def queue_reference(self, start_ns: int, points: Trajectory) -> None:
        """Queue reference points that start at `start_ns`."""
        epoch_ns = self._started_ns
        self._references.put(epoch_ns, ReferencePoints.of_motion(
            points.times(start_ns - epoch_ns), *points.motion()))

    def queue_effort(self, start_ns: int, points: Trajectory) -> None:
        """Queue feedforward torques that start at `start_ns`."""
        epoch_ns = self._started_ns
        times, torques = points.times(start_ns - epoch_ns), points.rows('effort')
        for first in range(0, len(times), MOST):
            part = slice(first, first + MOST)
            self._efforts.put(epoch_ns, Torques(times[part], torques[part]))

    def restart(self, simulation: Simulation | None = None) -> None:
        """Put the machine, or another one, at rest at home; return when it is done.

        A motion that is still being sent is refused until one begins where the machine stands.

        Raises:
            InputError: the loop has ended, or is too busy.
        """
        def order() -> None:
            next_ns = self._started_ns + round(self._simulation.time * SECOND)
            if simulation is not None:
                self._simulation.close()
                self._simulation = simulation
            self._simulation.reset()
            self.fault = ''
            self.restarted = True
            self._started_ns = next_ns - round(self._simulation.time * SECOND)

        try:
            self._have_done(order)
        except InputError:
            if simulation is not None:
                simulation.close()
            raise

    def pause(self) -> None:
        """Let the simulation stand; return when its last sample is published.

        Raises:
            InputError: the loop has ended, or is too busy.
        """
        def order() -> None:
            self.paused = True

        self._have_done(order)

    def _have_done(self, order: Callable[[], None]) -> None:
        """Have an order carried out between two samples; return when it is done.

        Raises:
            InputError: the loop has ended, or a sample takes too long, as while a machine of
                another kind is compiled; the order is withdrawn.
        """
        done, withdrawn, either = Event(), Event(), Lock()

        def carried_out() -> None:
            with either:
                if not withdrawn.is_set():
                    order()
                    done.set()

        self._orders.put(carried_out)
        if done.wait(timeout=PATIENCE):
            return
        with either:
            if done.is_set():  # just now
                return
            withdrawn.set()
            raise InputError('the simulation is busy and nothing was changed; call again'
                             if self._runs else 'the simulation has ended; start it again')

    def end(self) -> None:
        """End once the machine rests.

        Whoever moves it has `GRACE` to brake it; then the drives take no reference more and brake
        by themselves.
        """
        if self._end_asked is None:
            self._end_asked_ns = self.now_ns
            self._end_asked = time.monotonic()

    def run(self, finished: Callable[[], bool]) -> None:
        """Simulate and publish until `finished`, or until `end` was asked and the machine rests.

        Raises:
            UnreachableError: the machine was driven out of its workspace; `restart` and `run`
                again.
        """
        self._runs = True
        try:
            self._run(finished)
        finally:
            self._runs = False

    def _run(self, finished: Callable[[], bool]) -> None:
        deadline = time.monotonic()
        while not (finished() or self.ended):
            standing = self.paused or self._waits_for_effort()
            if self._end_asked is not None:
                self._come_to_an_end(self._end_asked)
            self._take_in()
            self._carry_out_orders(standing)
            if standing or self.paused:
                deadline = time.monotonic()
                continue
            began = time.monotonic()
            sample = self._simulation.next_sample()
            self._pace.physics += time.monotonic() - began
            self.now_ns = self._started_ns + sample.time_ns
            self._publish(self.now_ns, sample)
            self._watch(sample)
            if self._factor > 0.0:
                deadline = self._keep_pace(deadline + self._simulation.sample_period / self._factor)

    def _take_in(self) -> None:
        """Hand what came to the simulation, what goes on in time at once."""
        for group in self._references.take(self._started_ns):
            if not (len(group) > 1 and self._follows([ReferencePoints(*as_one(group))],
                                                     looked_at=False)):
                self._follows(group)
        for torques in self._efforts.take(self._started_ns):
            self._simulation.queue_effort(*as_one(torques))

    def _follows(self, references: list[ReferencePoints], looked_at: bool = True) -> bool:
        """Queue reference points and return whether none was refused; tell unless to be retried."""
        kept = True
        for points in references:
            try:
                if self.fault or self._braked:
                    raise InputError(f'not followed: {self.fault or "the simulation is ending"}')
                if self.restarted:
                    self._simulation.check_start(points)
                self._simulation.queue_points(points, looked_at)
                self.restarted = self.restarted and not self._simulation.begun
            except Par4Error as error:
                kept = False
                if looked_at:  # a group is tried again one by one
                    self._refuse(error)
        return kept

    def _carry_out_orders(self, standing: bool) -> None:
        try:
            self._orders.get(block=standing, timeout=IDLE)()
        except Empty:
            return

    def _watch(self, sample: Sample) -> None:
        """Brake and take no reference more where the machine is too far from its reference.

        The same where it is beyond its limits, wherever its encoders tell that it is.
        """
        if self.fault:
            return
        found = ''
        if self._following_error_limit > 0.0:
            errors = np.abs(self._simulation.following_error)
            joint = int(errors.argmax())
            if not errors[joint] <= self._following_error_limit:
                found = (f'{JOINT_NAMES[joint]} was {errors[joint]:.3g} rad from its reference, '
                         f'beyond {self._following_error_limit:g} rad')
        breach = self._switches.breach(sample.true_q, sample.qd, sample.true_pose)
        if breach is not None and not found:
            found = f'the machine is outside its limits: {breach.found}, not {breach.allowed}'
        if found:
            self._simulation.brake()
            self.fault = f'{found}: braked; call ~/reset'

    def _come_to_an_end(self, asked: float) -> None:
        """Brake in time and note the end where the machine rests, or where it has to."""
        if not self._simulation.rests:
            self._rests_since_ns = None
        elif self._rests_since_ns is None:
            self._rests_since_ns = self.now_ns
        elapsed = simulated = time.monotonic() - asked
        if self._factor > 0.0:
            simulated = (self.now_ns - self._end_asked_ns) / SECOND / self._factor
        if self.paused:
            self.ended = End.PAUSED
        elif (self._rests_since_ns is not None
                and self.now_ns - self._rests_since_ns >= SETTLED_NS):
            self.ended = End.BRAKED if self._braked else End.AT_REST
        elif simulated > LONGEST_END or elapsed > LATEST_END:
            self.ended = End.IN_MOTION
        elif elapsed > GRACE and not self._braked:
            self._simulation.end_reference()
            self._braked = True

    def _waits_for_effort(self) -> bool:
        """Note and return whether to stand for a torque."""
        if (self._feedforward_timeout == 0.0 or self._end_asked is not None
                or not self._simulation.effort_missing()):
            self._standing_since = None
            self.waiting = self.unaided = False
            return False
        now = time.monotonic()
        if self._standing_since is None:
            self._standing_since = now
        self.waiting = now - self._standing_since < self._feedforward_timeout
        self.unaided = not self.waiting
        return self.waiting

    def _keep_pace(self, deadline: float) -> float:
        """Sleep until the deadline and return it, or a later one if it is out of reach."""
        ahead = deadline - time.monotonic()
        if ahead > 0.0:
            time.sleep(ahead)
        elif -ahead * self._factor > self._simulation.sample_period:
            self.late_steps += 1
        return max(deadline, time.monotonic() - BACKLOG)

    def close(self) -> None:
        """Release the simulation."""
        self._simulation.close()
