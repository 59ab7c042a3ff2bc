"""Drive gains G_i of (24) from static pushes on a force sensor, the paper's experiment.

The platform presses on a fixed sensor that measures the force f on D. Of joint i is recorded, in
terms of the gains of the robot file,

    G_i V_i = e_i (u_i + s_i (f_c + mu |u_i|)) + a_i,    u = -J_1^T f,    e_i = nominal / true gain,

s_i = +-1 being the direction in which the joint slides, mu load-dependent friction and a_i what
else rests on the joint (gravity, offsets), one number for each push. At rest friction is unknown
within +-f_c, which is percents of the torque; so rows count at which the joint slides, as it does
when a push slowly grows and slowly fades on a sensor that yields a little: there the direction is
measured, and friction cancels between growing and fading. A joint that never slides both ways
keeps a bound of its gain instead: the worst that friction within +-f_c can do to the fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from par4_dynamics.state import state_of_joints
from par4_identification.estimators.problem import Series, problem_of
from par4_identification.estimators.weighted import weighted
from par4_identification.gains.known_payload import DriveGains
from par4_identification.logs.log import Log
from par4_identification.logs.masks import stretches
from par4_identification.signals.filtering import low_pass, reach_of
from par4_kinematics.errors import InputError
from par4_kinematics.files import why_no_text
from par4_kinematics.robot import Robot
from par4_sim.closed_loop.static_push import FORCE_COLUMNS

CUTOFF_HZ = 5.0
"""Low-pass of torque, force and direction: pushes last seconds."""
ROW_RATE_HZ = 25.0
SLIDING = 1e-3
"""Joint speed (rad/s) above which the direction is sure; encoder noise makes a tenth of it."""
FASTEST = 0.1
"""Joint speed (rad/s) above which it is no static push."""
SETTLED = 2e-3
"""Travel (rad) since a joint turned back, behind which friction has its level: presliding of some
tenths of it would otherwise go into the gain, as friction that grows with the push."""
PRESSED = 0.05
"""Part of the largest force below which the sensor counts as not loaded."""
FEWEST = 10
"""Fewest rows of a push that is used, and fewest rows in each direction of a joint for its
friction to cancel."""
LONGEST_GAP = 0.02
"""Seconds between force readings that are joined."""


@dataclass(frozen=True)
class ForceReadings:
    """What a force sensor measured.

    Attributes:
        t: stamps on the clock of the bag, increasing, (n,) s.
        force: on D, in `base`, (n, 3) N.
    """

    t: np.ndarray
    force: np.ndarray


def read_force(path: str | Path) -> ForceReadings:
    """Return the readings of a CSV with the header t,fx,fy,fz.

    Raises:
        InputError: no such file, another header, numbers missing or not finite, stamps that do not
            increase.
    """
    try:
        header, *lines = Path(path).read_text(encoding='utf-8-sig').splitlines() or ['']
        names = tuple(name.strip() for name in header.split(','))
        if names != FORCE_COLUMNS:
            raise InputError(f'{path}: expected the header {",".join(FORCE_COLUMNS)}, found '
                             f'{header!r}; see docs/identification.md')
        rows = [[float(cell) for cell in line.split(',')] for line in lines if line.strip()]
        table = np.array(rows, dtype=float).reshape(len(rows), len(FORCE_COLUMNS))
    except FileNotFoundError:
        raise InputError(f'{path}: no such file; give the force readings of the bag') from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f'{path}: cannot be read as text ({why_no_text(error)}); give the '
                         f'force readings of the bag as a CSV') from error
    except ValueError as error:
        raise InputError(f'{path}: expected four numbers in every row ({error}); mend the file'
                         ) from error
    if len(table) < 2 or not np.isfinite(table).all() or (np.diff(table[:, 0]) <= 0.0).any():
        raise InputError(f'{path}: expected finite numbers with increasing t in at least two rows, '
                         f'found {len(table)} rows; mend the file')
    return ForceReadings(table[:, 0], table[:, 1:])


@dataclass(frozen=True)
class Push:
    """Rows of one push.

    Attributes:
        bag: name of its log.
        carried: u, the torque that carries the force, (m, J) N m.
        torque: recorded, with the nominal gains, (m, J) N m.
        direction: +-1 where a joint slides, (m, J).
        sliding: rows in which it surely does, (m, J).
    """

    bag: str
    carried: np.ndarray
    torque: np.ndarray
    direction: np.ndarray
    sliding: np.ndarray


def pushes_of_log(log: Log, readings: ForceReadings, robot: Robot) -> list[Push]:
    """Return the pushes of a log.

    Raises:
        InputError: no force readings in the time of the log, or no push.
    """
    found, peak = [], 0.0
    time = 1e-9 * log.start_stamp + log.t
    for segment in log.segments:
        force = _force_at(readings, time[segment])
        for start, end in stretches(np.isfinite(force).all(axis=1)):
            part = slice(start, end)
            if (part.stop - part.start) * log.period < 2.0 / CUTOFF_HZ:
                continue
            rows = slice(segment.start + part.start, segment.start + part.stop)
            found.append((rows, force[part]))
            peak = max(peak, float(np.linalg.norm(force[part], axis=1).max()))
    if not found:
        raise InputError(f'{log.name}: recorded from {time[0]:.3f} to {time[-1]:.3f} s, the force '
                         f'from {readings.t[0]:.3f} to {readings.t[-1]:.3f} s; give readings on '
                         f'the clock of the bag, at least every {LONGEST_GAP:g} s')
    pushes = [push for rows, force in found for push in _pushes(log, rows, force, peak, robot)]
    if not pushes:
        raise InputError(f'{log.name}: no push of at least {FEWEST / ROW_RATE_HZ:g} s is in the '
                         f'force readings; press on the sensor for longer')
    return pushes


def _force_at(readings: ForceReadings, time: np.ndarray) -> np.ndarray:
    """Return the force (n, 3) at times (n,), s; NaN where there are no readings near."""
    after = np.searchsorted(readings.t, time).clip(1, len(readings.t) - 1)
    force = np.stack([np.interp(time, readings.t, axis) for axis in readings.force.T], axis=1)
    outside = (time < readings.t[0]) | (time > readings.t[-1])
    force[outside | (readings.t[after] - readings.t[after - 1] > LONGEST_GAP)] = np.nan
    return force


def _pushes(log: Log, rows: slice, force: np.ndarray, peak: float, robot: Robot) -> list[Push]:
    """Return the pushes in `rows` of a log with the force (n, 3) in them."""
    def smooth(values: np.ndarray) -> np.ndarray:
        return low_pass(values, CUTOFF_HZ, log.period)

    q = smooth(log.q[rows])
    speed = np.gradient(q, log.period, axis=0)
    rest = np.zeros_like(q)
    state = state_of_joints(robot.geometry, log.t[rows], q, rest, rest)
    carried = smooth(-state.torque_of_force(np.column_stack((force, np.zeros(len(force))))))
    slides = (np.abs(speed) > SLIDING) & (np.abs(speed) < FASTEST)
    direction = np.where(slides, np.sign(speed), 0.0)
    reach = int(np.ceil(reach_of(CUTOFF_HZ * log.period)))
    sure = (_least(direction, reach) == 1.0) | (_least(-direction, reach) == 1.0)
    sure &= _travel(q, direction) > SETTLED
    every = max(1, round(1.0 / (ROW_RATE_HZ * log.period)))
    pressed = np.linalg.norm(smooth(force), axis=1) > PRESSED * peak
    pressed &= (np.abs(speed) < FASTEST).all(axis=1)
    torque, parts = smooth(log.tau[rows]), []
    for start, end in stretches(pressed):
        stretch = slice(start, end)
        part = slice(stretch.start, stretch.stop, every)
        if len(range(stretch.start, stretch.stop, every)) >= FEWEST:
            parts.append(Push(log.name, carried[part], torque[part], direction[part], sure[part]))
    return parts


def _least(values: np.ndarray, reach: int) -> np.ndarray:
    """Return the least of `values` (n, J) over `reach` rows to either side."""
    from scipy.ndimage import minimum_filter1d  # slow to load
    return minimum_filter1d(values, 2 * reach + 1, axis=0, mode='nearest')


def _travel(q: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return how far each joint (n, J), rad, has come since it last had another direction."""
    travel = np.zeros_like(q)
    for joint in range(q.shape[1]):
        turns = np.flatnonzero(np.diff(direction[:, joint], prepend=np.nan))
        start = np.repeat(q[turns, joint], np.diff(np.r_[turns, len(q)]))
        travel[:, joint] = np.abs(q[:, joint] - start)
    return travel


def gains_of_pushes(pushes: Sequence[Push], robot: Robot,
                    coulomb_friction: float | None = None) -> DriveGains:
    """Return the drive gains that static pushes tell.

    Args:
        pushes: of one or several logs, recorded with the nominal gains of `robot`.
        robot: whose gains are nominal.
        coulomb_friction: largest friction at rest, N m; bounds the gain of joints that do not
            slide both ways.

    Raises:
        InputError: a joint that does not slide both ways and no friction to bound it with, or
            pushes that do not load a joint.
    """
    nominal = np.asarray(robot.drives.gain)
    found = [_slope_of_joint(pushes, joint, coulomb_friction) for joint in range(len(nominal))]
    slope, std, bound = np.array(found).T
    if np.any(slope < 0.1):
        raise InputError(f'joint {int(np.argmin(slope))}: the recorded torque grows by '
                         f'{slope.min():.2g} N m for each N m of the force; check unit, sign, '
                         f'frame and clock of the readings: the force on the platform in base, N')
    gain = nominal / slope
    return DriveGains(gain, np.diag((gain * std / slope) ** 2), nominal, gain * bound / slope)


def _slope_of_joint(pushes: Sequence[Push], joint: int, coulomb_friction: float | None
                    ) -> tuple[float, float, float]:
    """Return e_i of a joint, its standard deviation and its bound."""
    long = [push for push in pushes if push.sliding[:, joint].sum() >= FEWEST]
    growing, fading = (sum(int((push.sliding[:, joint] & (side * push.direction[:, joint] > 0)
                                ).sum()) for push in long) for side in (1.0, -1.0))
    slides = min(growing, fading) >= FEWEST
    if not slides and coulomb_friction is None:
        raise InputError(
            f'joint {joint}: {growing} and {fading} rows in which it slides forward and back while '
            f'it pushes, {FEWEST} are needed for friction to cancel, of pushes in which it slides '
            f'for {FEWEST} rows; let pushes grow and fade slowly, or give --coulomb-friction for a '
            f'bound')
    series, names = [], ['carried', *(['friction', 'friction of load'] if slides else [])]
    used = long if slides else pushes
    for column, push in enumerate(used):
        valid = push.sliding[:, joint] if slides else np.ones(len(push.torque), dtype=bool)
        carried, direction = push.carried[:, joint], push.direction[:, joint]
        level = np.zeros((len(carried), len(used)))
        level[:, column] = 1.0
        friction = [direction, direction * np.abs(carried)] if slides else []
        series.append(Series(push.torque[:, [joint]],
                             np.column_stack((carried, *friction, level))[:, None],
                             valid[:, None]))
    names += [f'level of push {index}' for index in range(len(used))]
    estimate = weighted(problem_of(series, names, ['1'] * len(names)))
    slope, std = float(estimate.values[0]), float(estimate.std[0])
    if slides or coulomb_friction is None:
        return slope, std, 0.0
    stacked = np.concatenate([part.columns[:, 0] for part in series])
    share = np.linalg.pinv(stacked)[0]  # of each row in the slope
    return slope, std, coulomb_friction * float(np.abs(share).sum())
