"""Messages to arrays and back: joints by name, times in integer nanoseconds.

Duck-typed: live, bag and fake messages are treated alike and no message package is imported.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.errors import InputError
from par4_kinematics.interface import BASE_FRAME
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.stamps import SECOND

ATTRIBUTE = {'positions': 'q', 'velocities': 'qd', 'accelerations': 'qdd', 'effort': 'effort'}
"""Of a Trajectory, by field of a point."""
REFERENCE_FIELDS = ('positions', 'velocities', 'accelerations')
"""What every point of a reference carries."""


@dataclass(frozen=True)
class Trajectory:
    """Points of a JointTrajectory; SI, radians.

    Attributes:
        stamp_ns: of the header; 0 leaves the start to the receiver.
        from_start_ns: time of each point from the stamp, increasing, (n,) int64.
        q, qd, qdd, effort: (n, 4), None where it was not asked for.
    """

    stamp_ns: int
    from_start_ns: np.ndarray
    q: np.ndarray | None = None
    qd: np.ndarray | None = None
    qdd: np.ndarray | None = None
    effort: np.ndarray | None = None

    def times(self, start_ns: int) -> np.ndarray:
        """Return the absolute time of each point (n,), s, if the trajectory starts at `start_ns`.
        """
        return (start_ns + self.from_start_ns) / SECOND

    def rows(self, field: str) -> np.ndarray:
        """Return the rows (n, 4) of a field of the points that was asked for, such as 'effort'.

        Raises:
            KeyError: it was not asked for.
        """
        rows: np.ndarray | None = getattr(self, ATTRIBUTE[field])
        if rows is None:
            raise KeyError(field)
        return rows

    def motion(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return q, qd, qdd, (n, 4) each, of points that were asked for `REFERENCE_FIELDS`.

        Raises:
            KeyError: one of them was not asked for.
        """
        return self.rows('positions'), self.rows('velocities'), self.rows('accelerations')


def time_ns(stamp: Any) -> int:
    """Return the nanoseconds of a Time or Duration."""
    return stamp.sec * SECOND + stamp.nanosec


def write_time(stamp: Any, nanoseconds: int) -> None:
    """Set a Time or Duration."""
    stamp.sec, stamp.nanosec = divmod(int(nanoseconds), SECOND)


def joint_columns(names: Sequence[str]) -> list[int]:
    """Return where each of `JOINT_NAMES` stands in `names`; further names are ignored.

    Raises:
        InputError: a joint that is missing or named twice.
    """
    names = list(names)
    missing = [name for name in JOINT_NAMES if name not in names]
    if missing:
        raise InputError(f'missing joint {", ".join(missing)}; found {", ".join(names) or "none"}; '
                         f'send all of {", ".join(JOINT_NAMES)}')
    twice = [name for name in JOINT_NAMES if names.count(name) > 1]
    if twice:
        raise InputError(f'joint {", ".join(twice)} is named twice; send each once')
    return [names.index(name) for name in JOINT_NAMES]


def is_foreign(message: Any) -> bool:
    """Return whether a JointState tells of other joints only, such as those of a gripper."""
    return len(message.name) > 0 and not set(JOINT_NAMES) & set(message.name)


def joint_values(message: Any, field: str) -> np.ndarray:
    """Return `field` (position, velocity or effort) of a JointState in the order of `JOINT_NAMES`.

    Raises:
        InputError: a missing joint, an array shorter than the names, or a value not finite.
    """
    rows = _joint_rows([getattr(message, field)], field, message.name)
    return rows[0]


def _joint_rows(arrays: Sequence[Sequence[float]], field: str, names: Sequence[str]) -> np.ndarray:
    """Return the values (n, 4) of `JOINT_NAMES` of arrays that follow `names`."""
    columns = joint_columns(names)
    for index, values in enumerate(arrays):
        if len(values) != len(names):
            raise InputError(f'{field}{_point(index, arrays)}: {len(values)} values for '
                             f'{len(names)} joint names; send one for each')
    return _selected(np.array(arrays, dtype=float), field, columns)


def _selected(rows: np.ndarray, field: str, columns: Sequence[int]) -> np.ndarray:
    """Return the columns (n, 4) of rows (n, -), which are those of `JOINT_NAMES`."""
    rows = rows.take(columns, axis=1)
    finite = np.isfinite(rows)
    if not finite.all():
        index, joint = np.argwhere(~finite)[0]
        raise InputError(f'{field}{_point(index, rows)}: {JOINT_NAMES[joint]} has '
                         f'{rows[index, joint]}; send finite numbers')
    return rows


def _point(index: int, arrays: Sequence[Sequence[float]] | np.ndarray) -> str:
    return f' of point {index}' if len(arrays) > 1 else ''


def write_joint_state(message: Any, stamp_ns: int, position: ArrayLike | None = None,
                      velocity: ArrayLike | None = None, effort: ArrayLike | None = None) -> None:
    """Set stamp and arrays of a JointState whose names are set; None leaves an array as it is."""
    write_time(message.header.stamp, stamp_ns)
    if position is not None:
        message.position = _doubles(position)
    if velocity is not None:
        message.velocity = _doubles(velocity)
    if effort is not None:
        message.effort = _doubles(effort)


def _doubles(values: ArrayLike) -> array[float]:
    # an array of doubles passes a message's setter without a check of every element
    return array('d', np.ascontiguousarray(values, dtype=float).tobytes())


def read_trajectory(message: Any, fields: Sequence[str] = REFERENCE_FIELDS) -> Trajectory:
    """Return the points of a JointTrajectory with `fields` in the order of `JOINT_NAMES`.

    Raises:
        InputError: no point, times that do not increase, a missing joint, a field shorter than
            the names, or a value not finite.
    """
    rows = {field: _joint_rows([getattr(point, field) for point in message.points], field,
                               message.joint_names) if message.points else np.empty(0)
            for field in fields}
    from_start_ns = np.array([time_ns(point.time_from_start) for point in message.points],
                             dtype=np.int64)
    return trajectory_of_rows(time_ns(message.header.stamp), from_start_ns, JOINT_NAMES, rows)


def trajectory_of_rows(stamp_ns: int, from_start_ns: np.ndarray, names: Sequence[str],
                       rows: Mapping[str, np.ndarray]) -> Trajectory:
    """Return the trajectory of rows (n, -) a field that follow `names`; see `read_trajectory`."""
    if len(from_start_ns) == 0:
        raise InputError('no points; send at least one')
    not_later = from_start_ns[1:] <= from_start_ns[:-1]
    if not_later.any():
        point = int(np.argmax(not_later)) + 1
        raise InputError(f'time_from_start of point {point} is not later than that of the point '
                         f'before; send points in order of time')
    columns = joint_columns(names)
    return Trajectory(stamp_ns, from_start_ns, **{
        ATTRIBUTE[field]: _selected(values, field, columns)
        for field, values in rows.items()})


def write_trajectory(message: Any, new_point: Callable[[], Any], trajectory: Trajectory,
                     joint_names: Sequence[str] = JOINT_NAMES) -> None:
    """Set stamp, names and points of a JointTrajectory; `new_point` makes an empty point."""
    write_time(message.header.stamp, trajectory.stamp_ns)
    message.joint_names = list(joint_names)
    message.points = [new_point() for _ in trajectory.from_start_ns]
    for index, point in enumerate(message.points):
        write_time(point.time_from_start, trajectory.from_start_ns[index])
        for field, attribute in ATTRIBUTE.items():
            rows = getattr(trajectory, attribute)
            if rows is not None:
                setattr(point, field, _doubles(rows[index]))


def write_pose(message: Any, stamp_ns: int, x: Iterable[float], rotation_amplification: float
               ) -> None:
    """Set a PoseStamped in `base` to the pose x (4,): D, turned about z by the tool angle."""
    write_time(message.header.stamp, stamp_ns)
    message.header.frame_id = BASE_FRAME
    position, orientation = message.pose.position, message.pose.orientation
    position.x, position.y, position.z, theta = (float(part) for part in x)
    half = 0.5 * rotation_amplification * theta
    orientation.x, orientation.y = 0.0, 0.0
    orientation.z, orientation.w = math.sin(half), math.cos(half)
