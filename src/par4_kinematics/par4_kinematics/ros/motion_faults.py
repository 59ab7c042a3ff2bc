"""Why `par4_motion` gave a motion up: what happened and what to do, in words."""

from __future__ import annotations

import numpy as np

from par4_kinematics.errors import InputError
from par4_kinematics.interface import CLOCK, DIAGNOSTICS, JOINT_STATES, REFERENCE
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.stamps import SECOND

STRANGE_NS = 100 * SECOND
"""A larger difference between the robot's stamps and the node's clock means two different
clocks."""


def started_again(motion: str) -> InputError:
    """Return the fault of a clock that jumped back."""
    return InputError(f'{motion} aborted: the clock jumped back, so that the simulation was '
                      f'started again; play it anew')


def check_start(motion: str, trouble: str, clocks: int, stamp_ns: int, now_ns: int,
                movers: int) -> None:
    """Refuse to begin a motion of a robot in trouble or in motion, or on another clock than its.

    Args:
        motion: its name.
        trouble: what the robot tells of itself; empty where all is well.
        clocks: how many publish the clock of the node; 0 where that is the wall's.
        stamp_ns: of the newest joint state; 0 where there is none.
        now_ns: of the clock of the node.
        movers: how many publish the reference of a robot that moves, this node among them; 0 where
            it rests.

    Raises:
        InputError: says what is wrong, and names the parameter that is missing.
    """
    if trouble:
        raise InputError(f'{motion} not begun: the robot says: {trouble}; see to it, then play it '
                         f'anew')
    if movers > 1:
        raise InputError(f'{motion} not begun: {movers} publish {REFERENCE.name} and the robot '
                         f'moves; let one move it at a time')
    if clocks > 1:
        raise InputError(f'{clocks} publish {CLOCK.name}: end all but one simulation, or give each '
                         f'a ROS_DOMAIN_ID of its own; one that was killed counts for some 20 s '
                         f'more')
    if clocks == 0 and stamp_ns != 0 and abs(stamp_ns - now_ns) > STRANGE_NS:
        raise InputError(f'{JOINT_STATES.name} are stamped {stamp_ns / SECOND:.1f} s, the clock of '
                         f'this node says {now_ns / SECOND:.1f} s: with a simulation give '
                         f'--ros-args -p use_sim_time:=true; with a robot, set its clock')


def tripped(motion: str, trouble: str) -> InputError:
    """Return the fault of a robot that tells why it does not follow."""
    return InputError(f'{motion} aborted: the robot did not follow, it says: {trouble}; see to it, '
                      f'then play it anew')


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


def stands(motion: str, gone: np.ndarray, told: str) -> InputError:
    """Return the fault of joints that stood while their references went so far.

    Args:
        motion: its name.
        gone: how far, (4,) rad.
        told: what the robot tells of itself that is not well; empty where it tells nothing.
    """
    joint = int(np.argmax(gone))
    why = (f'it says: {told}' if told else
           f'as after a trip of the drives; {DIAGNOSTICS.name} may say why')
    return InputError(f'{motion} aborted: the robot did not follow: {JOINT_NAMES[joint]} stands, '
                      f'while its reference went {gone[joint]:.2g} rad; {why}; see to the robot, '
                      f'then play it anew')


def astray(motion: str, away: np.ndarray, senders: int, told: str) -> InputError:
    """Return the fault of joints that are elsewhere than their references were of late.

    Args:
        motion: its name.
        away: how far, (4,) rad.
        senders: how many publish the reference.
        told: what the robot tells of itself that is not well; empty where it tells nothing.
    """
    joint = int(np.argmax(away))
    why = (f'{senders} publish {REFERENCE.name}, so that another moves the robot, too; let one '
           f'move it at a time' if senders > 1 else f'it says: {told}; see to the robot' if told
           else f'{DIAGNOSTICS.name} may say why; see to the robot')
    return InputError(f'{motion} aborted: the robot did not follow: {JOINT_NAMES[joint]} is '
                      f'{away[joint]:.2g} rad from its reference; {why}, then play it anew')


def missed(motion: str, away: np.ndarray) -> InputError:
    """Return the fault of joints that stand so far from the end of a motion, (4,) rad."""
    joint = int(np.argmax(away))
    return InputError(f'{motion} was played, but {JOINT_NAMES[joint]} stands {away[joint]:.2g} rad '
                      f'from its end: the robot did not follow; {DIAGNOSTICS.name} may say why')
