"""How well a motion was followed, in numbers.

Errors are distances of D from where it should be at the same time, over the whole motion.

Overshoot and settling are those of ISO 9283 (position overshoot, position stabilization time),
about the position that is attained at the end, for each of x, y and z on its own, the worst of
which counts: a path with a lift may pass beside a ball around the attained position. The settling
time runs from the instant at which D first crosses the limit band to the instant from which it
stays inside; the overshoot is the largest distance after that crossing, 0 where D does not leave
the band again. The Adept cycle is not one that ISO 9283 prescribes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from par4_kinematics.robot import Workspace
from par4_sim.choices import BAND
from par4_sim.tracking.run import TrackedRun

STILL = 1e-12
"""m: smaller steps of a desired coordinate are rounding."""
ATTAINED = 0.1
"""Seconds at the end of a record over which the attained position is averaged."""


@dataclass(frozen=True)
class Tracking:
    """Figures of one run; m, s, N m, J.

    Attributes:
        rms, peak: error of D over the whole motion at equal times, m.
        excursion: how far D goes beyond the ends of the desired path, along its longest
            direction among x, y and z, m: the overshoot that the paper's Fig. 4 shows.
        overshoot: of ISO 9283, at the end of the motion, m.
        settling_time: position stabilization time of ISO 9283, s; NaN where D is not inside
            the limit band all the last `ATTAINED` seconds.
        arrival: from the end of the motion asked for to where D stays in the limit band, s; 0
            where it is there earlier, NaN as of the settling time.
        peak_torque, rms_torque: over joints and the time of the motion, N m.
        energy: net mechanical work of the four motors a cycle, J: over a closed cycle it is what
            friction takes.
        driving_energy: what the motors put in a cycle while they drive, J: what it costs where
            nothing is fed back while they brake.
        peak_speed: of the joints, as their encoders tell, rad/s.
        outside: how far D goes beyond the radius and the heights of the robot's workspace, m.
        saturated: share of joint samples of the record in which a torque or a speed was limited.
        missing_effort: reference points that came without their feedforward torque.
    """

    rms: float
    peak: float
    excursion: float
    overshoot: float
    settling_time: float
    arrival: float
    peak_torque: float
    rms_torque: float
    energy: float
    driving_energy: float
    peak_speed: float
    outside: float
    saturated: float
    missing_effort: int

    @property
    def settled(self) -> bool:
        """Whether D is inside the limit band all the last `ATTAINED` seconds."""
        return math.isfinite(self.settling_time)


def errors_of(run: TrackedRun) -> np.ndarray:
    """Return the error vectors of D at the samples of the motion, (m, 3) m: obtained - desired."""
    motion = run.motion
    return np.stack([np.interp(motion.t, run.t, run.pose[:, axis]) - motion.x[:, axis]
                     for axis in range(3)], axis=1)


def longest_axis(run: TrackedRun) -> int:
    """Return along which of x, y and z, 0 to 2, the desired path is longest."""
    return int(np.argmax(np.ptp(run.motion.x[:, :3], axis=0)))


def tracking_of(run: TrackedRun, cycles: int = 1, band: float = BAND, space: Workspace | None = None
                ) -> Tracking:
    """Return the figures of a run.

    Args:
        run: the record.
        cycles: how often the motion repeats itself; energies are those of one.
        band: half width of the limit band, m.
        space: that D is to stay in; None where nobody asks.
    """
    distance = np.linalg.norm(errors_of(run), axis=1)
    axis = longest_axis(run)
    wanted, came = run.motion.x[:, axis], run.pose[:, axis]
    excursion = max(came.max() - wanted.max(), wanted.min() - came.min(), 0.0)
    overshoot, settling_time, arrival = _stop_of(run, band)
    moving = (run.t >= 0.0) & (run.t <= run.motion.duration)
    power = np.sum(run.torque * run.qd, axis=1)
    driving = np.sum(np.maximum(run.torque * run.qd, 0.0), axis=1)
    return Tracking(
        float(np.sqrt(np.mean(distance ** 2))), float(distance.max()), float(excursion),
        overshoot, settling_time, arrival, float(np.abs(run.torque[moving]).max()),
        float(np.sqrt(np.mean(run.torque[moving] ** 2))),
        float(np.trapezoid(power, run.t)) / cycles, float(np.trapezoid(driving, run.t)) / cycles,
        float(np.abs(run.qd).max()), _outside(run.pose, space) if space else 0.0,
        run.limited / run.torque.size, run.counts.get('missing_effort', 0))


def _outside(pose: np.ndarray, space: Workspace) -> float:
    """Return how far D leaves a workspace at the most, m; 0 where it stays inside."""
    beyond = (np.hypot(pose[:, 0], pose[:, 1]) - space.radius, space.z[0] - pose[:, 2],
              pose[:, 2] - space.z[1])
    return max(0.0, *(float(part.max()) for part in beyond))


def _stop_of(run: TrackedRun, band: float) -> tuple[float, float, float]:
    """Return overshoot, settling time and arrival of the stop at the end of the motion.

    Times are NaN where D is not inside the band all the last `ATTAINED` seconds.
    """
    wanted, place = run.motion.x[:, :3], run.pose[:, :3]
    ending = run.t > run.t[-1] - ATTAINED
    deviation = place - place[ending].mean(axis=0)
    overshoot = settling_time = arrival = 0.0
    settled = True
    for axis in range(3):
        left = run.t >= run.motion.t[_last_way(wanted[:, axis])]
        side = np.sign(deviation[left][0, axis])
        crossed = left & ((np.abs(deviation[:, axis]) <= band)
                          | (np.sign(deviation[:, axis]) != side))
        entered = int(np.argmax(crossed))
        outside = np.flatnonzero(np.abs(deviation[entered:, axis]) > band)
        stays = entered + (int(outside[-1]) + 1 if len(outside) else 0)
        if len(outside):
            overshoot = max(overshoot, float(np.abs(deviation[entered:, axis]).max()))
        if stays > np.argmax(ending):
            settled = False
            continue
        settling_time = max(settling_time, float(run.t[stays] - run.t[entered]))
        arrival = max(arrival, float(run.t[stays]))
    if not settled:
        return overshoot, math.nan, math.nan
    return overshoot, settling_time, max(arrival - run.motion.duration, 0.0)


def _last_way(wanted: np.ndarray) -> int:
    """Return the row of a desired coordinate (m,) from which it only goes towards its end."""
    steps = np.diff(wanted)
    moving = np.flatnonzero(np.abs(steps) > STILL)
    if not len(moving):
        return len(wanted) - 1
    back = moving[steps[moving] * steps[moving[-1]] < 0.0]
    return int(back[-1]) + 1 if len(back) else 0


def first_limited_torque(run: TrackedRun) -> tuple[float, str] | None:
    """Return when a command was limited first, s, and of which joint and where in words."""
    if not run.counts['saturated_commands']:
        return None
    limit = np.abs(run.command).max()
    row, joint = np.unravel_index(
        np.argmax(np.abs(run.command) >= limit * (1.0 - 1e-9)), run.command.shape)
    t = float(run.t[row])
    return t, (f'torque of joint {joint} above {limit:.4g} N m at {t:.4f} s, at '
               f'{point_in_words(run.pose[row, :3])}')


def point_in_words(place: np.ndarray) -> str:
    """Return a place (3,) in words, m."""
    return f'({", ".join(f"{value:.3f}" for value in place)}) m'
