"""Node `par4_monitor`: measured against model torque, live; says what drifts and since when."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from par4_dynamics.model_from_file import read_model
from par4_identification.logs.log import Log
from par4_identification.ros.monitor_parameters import MonitorParameters
from par4_identification.trend.drift import DriftWatch, projections
from par4_identification.trend.windows import WINDOW
from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.interface import AMPLIFIER_VOLTAGE, JOINT_STATES, Topic
from par4_kinematics.robot import read_robot
from par4_kinematics.ros.convert import is_foreign, joint_values, time_ns
from par4_kinematics.ros.diagnostics import OK, WARN, NodeState
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.ros.process import run
from par4_kinematics.stamps import SECOND

LONGEST_GAP = 5
"""Longest gap of a window that is looked at, in sample periods."""
ASTRAY_NS = round(2 * WINDOW * SECOND)
"""Distance from the first stamp of a window beyond which a stamp is of another clock or run."""
ABSURD = 10.0
"""Torque, in limits of the drives, from which it is none: one such sample would be most of what the
windows learn."""
BLIND = 5
"""Windows in a row that could not be looked at, from which on the monitor says so."""
STILL, CROWD = 100, 10
"""Joint states of a window with a stamp that was there before from which stamps do not move: a
number, and a multiple of the stamps."""


class MonitorNode(Par4Node):
    """The node `par4_monitor`; `MonitorParameters` says what it does."""

    AWAITS = (JOINT_STATES,)
    PARAMETERS = MonitorParameters
    parameters: MonitorParameters
    REST = 0.01  # a turn of the executor costs more than a message: take them by the dozen

    def __init__(self) -> None:
        super().__init__()
        self._robot = read_robot(self.parameters.robot_file)
        self._read_model()
        self._gain = np.asarray(self._robot.drive_gain)
        self._rms = np.full(len(self._robot.joint_names), np.nan)
        self.counts['skipped_windows'] = 0
        self._skipped, self._reason = 0, ''
        self._forget()
        self.subscribe(JOINT_STATES, self._taken(JOINT_STATES), stream=True)
        self.subscribe(AMPLIFIER_VOLTAGE, self._taken(AMPLIFIER_VOLTAGE))
        self.serve('~/reload_model', self._reload_model)

    def _read_model(self) -> None:
        self._model = read_model(self.parameters.model_file, self._robot)
        self._watch = DriftWatch(len(self._robot.joint_names), self.parameters.learning)

    def _reload_model(self) -> str:
        self._read_model()
        return f'read {self.parameters.model_file}; learning anew'

    def _forget(self) -> None:
        self._position: dict[int, np.ndarray] = {}
        self._effort: dict[int, np.ndarray] = {}
        self._torque: dict[int, np.ndarray] = {}
        self._repeated = 0

    def clock_jumped_back(self) -> None:
        """Begin a window anew."""
        self._forget()
        self._watch.clock_set_back()

    def _taken(self, topic: Topic) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            if is_foreign(message):
                return
            stamp_ns = time_ns(message.header.stamp)
            self._leave_other_times(stamp_ns)
            if topic is AMPLIFIER_VOLTAGE:
                self._keep(self._torque, topic, stamp_ns,
                           self._gain * joint_values(message, 'effort'))
                return
            self._repeated += stamp_ns in self._position
            self._position[stamp_ns] = joint_values(message, 'position')
            try:
                if len(message.effort):
                    self._keep(self._effort, topic, stamp_ns, joint_values(message, 'effort'))
            finally:  # an effort that is rejected takes neither position nor voltage with it
                if stamp_ns - next(iter(self._position)) >= WINDOW * SECOND:
                    self._look()

        return take

    def _keep(self, kept: dict[int, np.ndarray], topic: Topic, stamp_ns: int, torque: np.ndarray
              ) -> None:
        """Keep the torques (4,), N m, of a sample, or reject what no drive gives."""
        limit = self._robot.drives.torque_limit
        joint = int(np.abs(torque).argmax())
        if abs(torque[joint]) > ABSURD * limit:
            self.reject(topic, InputError(
                f'{self._robot.joint_names[joint]} has {torque[joint]:.3g} N m, more than '
                f'{ABSURD:g} times the torque_limit of {limit:g} N m of robot {self._robot.name}: '
                f'left out; send what was measured'))
            return
        kept[stamp_ns] = torque

    def _leave_other_times(self, stamp_ns: int) -> None:
        """Begin a window anew that this stamp is far from: it would wait, and grow, until then."""
        first_ns = next(iter(self._position or self._torque), stamp_ns)
        if abs(stamp_ns - first_ns) > ASTRAY_NS:
            self._forget()
            self._skip(f'a stamp {(stamp_ns - first_ns) / SECOND:.3g} s from its first')

    def _skip(self, why: str) -> None:
        self.count('skipped_windows')
        self._skipped, self._reason = self._skipped + 1, why
        self.get_logger().info(f'window skipped: {why}', throttle_duration_sec=10.0,
                               throttle_time_source_type=self.wall_clock)

    def _look(self) -> None:
        """Look at the window that is complete and begin the next."""
        position, torque = self._position, self._torque or self._effort
        self._forget()
        try:
            log = self._window(position, torque)
            projected, lengths, self._rms = projections(log, self._robot, self._model)
        except Par4Error as error:
            self._skip(str(error))
            return
        self._skipped = 0
        self._watch.take(float(log.t[-1]), projected, lengths)

    def _window(self, position: dict[int, np.ndarray], torque: dict[int, np.ndarray]) -> Log:
        """Return the window on an even grid.

        Raises:
            InputError: samples are missing.
        """
        stamps = np.array(sorted(position.keys() & torque.keys()), dtype=np.int64)
        if len(stamps) < 100:
            raise InputError(f'{len(stamps)} samples with position and torque; publish both with '
                             f'the same stamps')
        steps = np.diff(stamps)
        period = float(np.median(steps)) / SECOND
        if steps.max() > LONGEST_GAP * period * SECOND:
            raise InputError(f'a gap of {steps.max() / SECOND:.3g} s')
        t = np.arange(int((stamps[-1] - stamps[0]) / SECOND / period) + 1) * period
        told = (stamps - stamps[0]) / SECOND
        q, tau = (np.stack([np.interp(t, told, column) for column in np.array(
            [values[stamp] for stamp in stamps]).T], axis=1) for values in (position, torque))
        return Log('window', self._robot.joint_names, int(stamps[0]), period,
                   stamps[0] / SECOND + t, q, tau, (slice(0, len(t)),), None, None)

    def state(self) -> NodeState:
        """Return whether the machine follows its model, and what drifts since when."""
        state = super().state()
        if state.level != OK or state.text.startswith('waiting'):
            return state
        return self._judged()

    def _judged(self) -> NodeState:
        """Return what the windows say of the machine, or why there are none."""
        if self._repeated >= max(STILL, CROWD * len(self._position)):
            return NodeState(WARN, f'the stamps of {JOINT_STATES.name} do not move: nothing is '
                                   f'looked at; stamp each with the time of its measurement',
                             f'{self._repeated} came with a stamp that was there before, the last '
                             f'at {max(self._position) / SECOND:.3f} s')
        if self._skipped >= BLIND:
            return NodeState(WARN, 'nothing is looked at: no window of '
                                   f'{JOINT_STATES.name} and torque can be used',
                             f'the last {self._skipped} were skipped: {self._reason}')
        drifts = self._watch.drifts
        if drifts:
            joints = ', '.join(f'{self._robot.joint_names[drift.joint]} ({drift.acts_like})'
                               for drift in drifts)
            return NodeState(WARN, f'drifts from its model: {joints}',
                             '; '.join(map(str, drifts)))
        if self._watch.learning:
            return NodeState(OK, f'learning, {self._watch.learning} windows of motion to go')
        unknown = ', '.join(self._robot.joint_names[joint] for joint in self._watch.unknown)
        return NodeState(OK, 'follows its model'
                         + (f'; still learning: {unknown}' if unknown else ''))

    def traffic(self) -> dict[str, int]:
        """Return how many windows were looked at."""
        return {'windows': self._watch.windows}

    def measures(self) -> dict[str, str]:
        """Return the rms of the residual of each joint and the ages of the inputs."""
        return {**{f'residual_rms_{joint}': f'{rms:.4f} N m'
                   for joint, rms in enumerate(self._rms)}, **super().measures()}

    def worrying(self, new: dict[str, int]) -> bool:
        """Return whether new faults are worth a warning: windows are skipped at every stop."""
        return bool(new.keys() - {'skipped_windows'})


def main() -> int:
    """Run the node; return its exit code."""
    return run(MonitorNode)


if __name__ == '__main__':
    sys.exit(main())
