"""par4_simulate: a motion of a simulated Par4 into a bag, without ROS."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import click

from par4_dynamics.model import read_model
from par4_kinematics.motion_file import named_motion
from par4_kinematics.robot import read_robot
from par4_sim.commands.entry import run
from par4_sim.offline import SECOND, simulate_to_bag
from par4_sim.simulation import FIDELITIES, build_simulation


@click.command('par4_simulate', epilog='\b\nExample:\n'
    '  par4_simulate excitation --duration 20 --torque-noise 0.05 \\\n'
    '      --output my_bag')
@click.argument('motion')
@click.option('--robot', default='reference', show_default=True, help='robot.yaml or built-in name')
@click.option('--model', default='table1_full', show_default=True,
              help='model.yaml or built-in name: the machine as it truly is, effects included')
@click.option('--output', required=True, type=click.Path(path_type=Path), help='bag to write')
@click.option('--fidelity', default='exact', show_default=True, type=click.Choice(FIDELITIES))
@click.option('--feedforward', default=None, help='model whose torques the drives get')
@click.option('--duration', default=None, type=click.FloatRange(min=0.1),
              help='seconds, of a named motion')
@click.option('--motion-seed', default=0, show_default=True, type=int,
              help='seed of the excitation')
@click.option('--seed', default=0, show_default=True, type=int, help='seed of the noise')
@click.option('--torque-noise', default=0.0, show_default=True, type=click.FloatRange(min=0.0),
              help='noise on the recorded voltage, as torque, N m rms')
@click.option('--noise-time', default=0.0, show_default=True, type=click.FloatRange(min=0.0),
              help='correlation time of that noise, s; 0 = white')
@click.option('--position-noise', default=0.0, show_default=True, type=click.FloatRange(min=0.0),
              help='noise on the recorded positions, rad rms')
@click.option('--stamp-jitter', default=0.0, show_default=True, type=click.FloatRange(min=0.0),
              help='error of the stamps, s rms; the values belong to the even times')
@click.option('--rate', default=1000.0, show_default=True, type=click.FloatRange(min=1.0),
              help='samples a second')
@click.option('--date', default=None, type=click.DateTime(),
              help='at which the simulation begins, UTC; without one its clock begins at zero')
@click.option('--storage', default='mcap', show_default=True,
              type=click.Choice(('mcap', 'sqlite3')))
def simulate(motion: str, robot: str, model: str, output: Path, fidelity: str,
             feedforward: str | None, duration: float | None, motion_seed: int, seed: int,
             torque_noise: float, noise_time: float, position_noise: float, stamp_jitter: float,
             rate: float, date: datetime | None, storage: str) -> None:
    """Simulate MOTION (adept, excitation, circle or a motion.yaml) into a bag, without ROS."""
    machine = read_robot(robot)
    truth = read_model(model, machine)
    helping = None if feedforward is None else read_model(feedforward, machine)
    played = named_motion(motion, machine, duration, motion_seed)
    simulation = build_simulation(
        machine, truth, fidelity, 1.0 / rate, seed, torque_noise=torque_noise,
        correlation_time=noise_time, position_noise=position_noise, stamp_jitter=stamp_jitter)
    with click.progressbar(length=1000, label=f'simulating {played.name}') as bar:
        counts = simulate_to_bag(simulation, played, machine, output, helping, storage,
                                 lambda share: bar.update(round(1000 * share) - bar.pos),
                                 0 if date is None else nanoseconds(date))
        bar.update(1000 - bar.pos)
    if feedforward is None:
        counts.pop('missing_effort')
    troubles = ', '.join(f'{name} {count}' for name, count in counts.items() if count)
    click.echo(f'{output}: {played.duration:.1f} s of {played.name} on {machine.name} '
               f'({fidelity}){"; " + troubles if troubles else ""}')


def nanoseconds(date: datetime) -> int:
    """Return the stamp, ns since 1970, of a date in UTC."""
    return round(date.replace(tzinfo=UTC).timestamp()) * SECOND


def main() -> None:
    """Run the executable."""
    run(simulate)
