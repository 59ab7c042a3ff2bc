"""par4_simulate: a motion of a simulated Par4 into a bag, without ROS."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from par4_dynamics.model_from_file import read_model
from par4_kinematics.interface import COUNTS
from par4_kinematics.limits import limits_not_given
from par4_kinematics.motion_file import NAMED_MOTIONS, named_motion
from par4_kinematics.robot import read_robot
from par4_kinematics.stamps import SECOND
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import build_simulation
from par4_sim.jobs.motion import refuse_ignored
from par4_sim.machines.machine_effects import read_true_model


def simulated(motion: str, robot: str, model: str, output: Path, fidelity: str,
             feedforward: str | None, duration: float | None, motion_seed: int | None, seed: int,
             torque_noise: float, noise_time: float, position_noise: float, stamp_jitter: float,
             rate: float, date: datetime | None, storage: str,
             progress: Callable[[float], object]) -> str:
    """Simulate a motion into a bag and return what was done, in lines."""
    refuse_ignored(motion, {'duration': duration, 'motion_seed': motion_seed},
                   {'duration': NAMED_MOTIONS})
    machine = read_robot(robot)
    truth = read_true_model(model, machine)
    helping = None if feedforward is None else read_model(feedforward, machine)
    played = named_motion(motion, machine, duration, motion_seed or 0)
    simulation = build_simulation(
        machine, truth, fidelity, 1.0 / rate, seed, torque_noise=torque_noise,
        correlation_time=noise_time, position_noise=position_noise, stamp_jitter=stamp_jitter)
    counts = simulate_to_bag(simulation, played, machine, output, helping, storage, progress,
                             0 if date is None else nanoseconds(date))
    if feedforward is None:
        counts.pop('missing_effort')
    troubles = ', '.join(f'{name} {count} ({COUNTS[name]})'
                         for name, count in counts.items() if count)
    return '\n'.join((
        f'{output}: {played.duration:.1f} s of {played.name} on {machine.name} '
        f'({fidelity}){"; " + troubles if troubles else ""}', *limits_not_given(machine)))


def nanoseconds(date: datetime) -> int:
    """Return the stamp, ns since 1970, of a date in UTC."""
    return round(date.replace(tzinfo=UTC).timestamp()) * SECOND
