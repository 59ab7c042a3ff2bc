"""What the node `par4_simulation` does and can be told: its help, apart from its work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from par4_kinematics.errors import InputError
from par4_kinematics.ros.parameters import NodeParameters, parameter
from par4_sim.choices import FIDELITIES, POSITION_LAWS, STEP, TORQUE_LAW

POSITION, TORQUE = 'position', 'torque'
"""Modes of the drives."""


@dataclass(frozen=True)
class SimulationParameters(NodeParameters):
    """Simulates Par4 with its drives: reference and feedforward_torque -> joint_states and clock.

    The physics runs in the main thread, callbacks in another. ~/reset puts the machine at rest at
    home, ~/reload_model too; the clock goes on, and references are refused until one begins at rest
    where the machine stands. A reference beyond the limits of robot.yaml is refused; one that ends
    in motion is braked.
    """

    NAME: ClassVar[str] = 'par4_simulation'
    EXAMPLE: ClassVar[str] = '-p fidelity:=exact -p torque_noise:=0.05'

    robot_file: str = parameter('reference', 'robot.yaml: a path or a built-in name')
    model_file: str = parameter('table1_full', 'the machine as it truly is, model.yaml: a '
                                               'path or a built-in name')
    fidelity: str = parameter('fast', 'how exactly the mechanism is simulated', choices=FIDELITIES)
    physics_step: float = parameter(
        STEP, 'of the physics and the drives, s; larger is faster and less exact', 1e-5, 1e-3)
    drive_mode: str = parameter(
        POSITION, 'position: the controller follows the reference, feedforward helps it; torque: '
                  'feedforward_torque is the command, the loops take over where it is missing',
        choices=(POSITION, TORQUE))
    controller: str = parameter(
        POSITION_LAWS[0], 'of the drives in position mode: their own loops, computed torque, or '
                          'computed torque that keeps the limits which lie 50 ms ahead',
        choices=POSITION_LAWS)
    controller_model: str = parameter(
        'table1', 'what computed torque and predictive control know of the machine, model.yaml: '
                  'a path or a built-in name')
    publish_rate_hz: float = parameter(1000.0, 'samples a second of simulated time, Hz', 1.0, 1e4)
    real_time_factor: float = parameter(1.0, 'simulated seconds a second; 0 = as fast as it can',
                                        0.0)
    seed: int = parameter(0, 'of the measurement noise', 0)
    torque_noise: float = parameter(0.0, 'noise of the recorded torque, N m rms', 0.0)
    noise_correlation_time: float = parameter(
        0.0, 'of the noise of the recorded torque, s; 0 = white', 0.0)
    position_noise: float = parameter(0.0, 'noise of the recorded positions, rad rms', 0.0)
    stamp_jitter: float = parameter(
        0.0, 'error of the stamps, s rms; the values belong to the even times', 0.0)
    publish_clock: bool = parameter(True, 'publish simulated time on /clock')
    window: bool = parameter(False, 'show the robot in a window; needs a screen')
    feedforward_timeout: float = parameter(
        0.0, 'longest wait (s of wall time) for the torque of reference points '
             'that come next, or that the drives look ahead at', 0.0)
    following_error_limit: float = parameter(
        0.25, 'distance of a joint from its reference, rad, beyond which the drives brake and ask '
              'for ~/reset; 0 = none', 0.0)

    @property
    def law(self) -> str:
        """Law of the drives, of LAWS.

        Raises:
            InputError: a controller of positions in torque mode.
        """
        if self.drive_mode == POSITION:
            return self.controller
        if self.controller != POSITION_LAWS[0]:
            raise InputError(
                f'parameter controller: {self.controller!r} asked with drive_mode {TORQUE}, where '
                f'feedforward_torque is the command; leave one of the two out')
        return TORQUE_LAW
