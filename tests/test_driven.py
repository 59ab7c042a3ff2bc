"""Steps of plant and drives in one compiled call are those that Python does one after the other."""

from __future__ import annotations

import numpy as np
import pytest
from experiments import MOTION, entry, machine_of
from measured import holding_torque

from par4_dynamics.model import read_model
from par4_kinematics.errors import UnreachableError
from par4_sim.driven import can_be_driven
from par4_sim.exact import ExactPlant
from par4_sim.noise import Noise
from par4_sim.simulation import Simulation
from robots import REFERENCE

TABLE_1 = read_model('table1', REFERENCE)
MACHINES = {
    'plain': (),
    'sticky, cogged': (entry('stribeck', stribeck_torque=0.8, stribeck_velocity=0.1),
                       entry('cogging', amplitude=0.5, periods=22.0, phase=(0.0, 1.0, 2.0, 3.0))),
    'told late': (entry('time_offset', delay=1.4e-3),),
    'told early': (entry('time_offset', delay=-1.4e-3),),
}


class Stepped(ExactPlant):
    """The same plant; nothing compiled knows it, so that it is stepped from Python."""


def simulation_with(plant, machine):
    return Simulation(REFERENCE, plant(machine), 1e-3, REFERENCE.drives.torque_limit,
                      holding_torque(REFERENCE, TABLE_1), machine.amplifier, machine.sensors,
                      Noise(torque_noise=0.1), seed=3)


@pytest.mark.parametrize('name', MACHINES)
def test_every_sample_is_the_same_to_the_last_digit(name):
    told = []
    for plant in (ExactPlant, Stepped):
        simulation = simulation_with(plant, machine_of(*MACHINES[name]))
        assert can_be_driven(simulation.plant, simulation._loop) == (plant is ExactPlant)
        start = simulation.time + 0.02
        simulation.queue_reference(start + MOTION.t, MOTION.q, MOTION.qd, MOTION.qdd)
        samples = [simulation.next_sample() for _ in range(900)]
        told.append([np.array([getattr(sample, field) for sample in samples]) for field in (
            'time_ns', 'q', 'qd', 'effort', 'true_torque', 'true_pose')])
        assert np.ptp(told[-1][1], axis=0).max() > 0.05
    for driven, stepped in zip(*told, strict=True):
        np.testing.assert_array_equal(driven, stepped)


def test_out_of_reach_is_said_at_the_same_time():
    said = []
    for plant in (ExactPlant, Stepped):
        simulation = simulation_with(plant, machine_of())
        there = np.array((0.0, 0.2))
        q = np.stack((simulation.q, simulation.q + (1.5, -1.5, 1.5, -1.5)))
        simulation.queue_reference(simulation.time + there, q, np.zeros((2, 4)), np.zeros((2, 4)))
        with pytest.raises(UnreachableError, match='out of reach') as error:
            for _ in range(2000):
                simulation.next_sample()
        said.append((str(error.value), simulation.plant.steps))
    assert said[0] == said[1]
