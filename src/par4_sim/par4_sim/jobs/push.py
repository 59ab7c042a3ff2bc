"""par4_push: the paper's static push on a force sensor, simulated."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from par4_kinematics.limits import limits_not_given
from par4_kinematics.robot import read_robot
from par4_sim.closed_loop.static_push import simulate_push
from par4_sim.machines.machine_effects import read_true_model


def pushed(robot: str, model: str, output: Path, force: float, fidelity: str, seed: int,
           torque_noise: float, force_noise: float, progress: Callable[[float], object]) -> str:
    """Simulate slow pushes into a bag and a CSV; return what was done, in lines."""
    machine = read_robot(robot)
    readings = output.parent / f'{output.name}.csv'  # of '.', too, which is refused further on
    simulate_push(machine, read_true_model(model, machine), output, readings, force, fidelity,
                  seed, torque_noise, force_noise, progress=progress)
    return '\n'.join((
        f'{output}: static pushes of {force:g} N on {machine.name} ({fidelity}); force in '
        f'{readings}', *limits_not_given(machine)))
