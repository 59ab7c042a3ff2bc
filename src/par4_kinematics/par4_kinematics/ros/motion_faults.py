"""Why `par4_motion` gave a motion up: what happened and what to do, in words."""

from __future__ import annotations

import numpy as np

from par4_kinematics.errors import InputError
from par4_kinematics.interface import CLOCK, DIAGNOSTICS, JOINT_STATES
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.stamps import SECOND


def started_again(motion: str) -> InputError:
    """Return the fault of a clock that jumped back."""
    return InputError(f'{motion} aborted: the clock jumped back, so that the simulation was '
                      f'started again; play it anew')


def several_clocks(count: int) -> InputError:
    """Return the fault of more than one simulation."""
    return InputError(f'{count} publish {CLOCK.name}: end all but one simulation, or give each a '
                      f'ROS_DOMAIN_ID of its own')


def strange_clock(stamp_ns: int, now_ns: int) -> InputError:
    """Return the fault of joint states whose stamps are of another clock than the node's."""
    return InputError(f'{JOINT_STATES.name} are stamped {stamp_ns / SECOND:.1f} s, the clock of '
                      f'this node says {now_ns / SECOND:.1f} s: with a simulation give --ros-args '
                      f'-p use_sim_time:=true; with a robot, set its clock')


def ended(motion: str) -> InputError:
    """Return the fault of a robot that nobody speaks for any more."""
    return InputError(f'{motion} aborted: nobody publishes {JOINT_STATES.name} any more, so that '
                      f'the robot or its driver has ended; play it anew')


def unknown_end(motion: str) -> InputError:
    """Return the fault of a robot that did not tell where it stands at the end."""
    return InputError(f'{motion} aborted: {JOINT_STATES.name} came, but no more, so that it is not '
                      f'known where the robot is')


def silent(motion: str, topic: str, seconds: float) -> InputError:
    """Return the fault of a robot that has told nothing new on a topic for some time, s."""
    return InputError(f'{motion} aborted: no new joint state of the robot has come on {topic} for '
                      f'{seconds:.2f} s; see whether its driver runs, its link holds and its '
                      f'stamps go on, then play it anew')


def stands(motion: str, gone: np.ndarray) -> InputError:
    """Return the fault of joints that stood while their references went so far, (4,) rad."""
    joint = int(np.argmax(gone))
    return InputError(f'{motion} aborted: the robot did not follow: {JOINT_NAMES[joint]} stands, '
                      f'while its reference went {gone[joint]:.2g} rad, as after a trip of the '
                      f'drives; {DIAGNOSTICS.name} may say why; see to the robot, then play it '
                      f'anew')


def missed(motion: str, away: np.ndarray) -> InputError:
    """Return the fault of joints that stand so far from the end of a motion, (4,) rad."""
    joint = int(np.argmax(away))
    return InputError(f'{motion} was played, but {JOINT_NAMES[joint]} stands {away[joint]:.2g} rad '
                      f'from its end: the robot did not follow; {DIAGNOSTICS.name} may say why')
