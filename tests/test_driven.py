"""Steps of plant and drives in one compiled call are those that Python does one after the other."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from experiments import MOTION, entry, machine_of
from measured import holding_torque

from par4_dynamics.model_from_file import read_model
from par4_kinematics.errors import UnreachableError
from par4_kinematics.workspace import home_pose
from par4_sim.choices import STEP
from par4_sim.closed_loop.driven import can_be_driven
from par4_sim.closed_loop.force_plate import ForcePlate
from par4_sim.closed_loop.simulation import Simulation, Told
from par4_sim.drives.held_load import HeldLoad
from par4_sim.drives.reference_curve import ReferenceLimits
from par4_sim.machines.noise import Noise
from par4_sim.plants.elastic import ElasticPlant, split_machine
from par4_sim.plants.exact import ExactPlant
from robots import REFERENCE

TABLE_1 = read_model('table1', REFERENCE)
MACHINES = {
    'plain': (),
    'sticky, cogged': (entry('stribeck', stribeck_torque=0.8, stribeck_velocity=0.1),
                       entry('cogging', amplitude=0.5, periods=22.0, phase=(0.0, 1.0, 2.0, 3.0))),
    'told late': (entry('time_offset', delay=1.4e-3),),
    'told early': (entry('time_offset', delay=-1.4e-3),),
    'soft': (entry('elastic_transmission', stiffness=(4e3, 8e3, 6e3, 5e3)),),
    'soft, rattling, told late': (
        entry('elastic_transmission', joints=(1, 2), stiffness=8e3),
        entry('backlash', joints=(0,), gap=5e-4), entry('time_offset', delay=1.4e-3)),
    'soft, loaded, pressed': (entry('elastic_transmission', stiffness=8e3),),
    'loaded': (),
    'pressed': (),
    'loaded, pressed': (),
}


def machine_named(name):
    """Return a machine of `MACHINES` with loads of its own."""
    loads = []
    if 'loaded' in name:  # shorter than a run: the last row lasts
        loads.append(HeldLoad(np.random.default_rng(1).normal(0.0, 0.3, (300, 4)), 1e-3))
    if 'pressed' in name:
        loads.append(ForcePlate(REFERENCE.geometry, home_pose(REFERENCE)[2] + 2e-3, 2e4, noise=0.5,
                                seed=2))
    return replace(machine_of(*MACHINES[name]), loads=tuple(loads))


def readings_of(plant):
    """Return what plates under a machine measured, (n, 4)."""
    exact = plant.driven if isinstance(plant, ElasticPlant) else plant
    return np.concatenate([np.empty((0, 4)), *(
        load.readings for load in exact.loads if isinstance(load, ForcePlate))])


class Stepped(ExactPlant):
    """The same plant; nothing compiled knows it, so that it is stepped from Python."""


def plant_with(plant, machine):
    """Return a machine's plant, of that class behind springs if there are any."""
    if machine.transmission.is_rigid:
        return plant(machine)
    driven, motors = split_machine(machine)
    substeps = motors.substeps(STEP)
    return ElasticPlant(plant(driven, STEP / substeps), motors, substeps)


def simulation_with(plant, machine, period=1e-3, limits=None, kept=0):
    noise = Noise(torque_noise=0.1, correlation_time=0.01, position_noise=1e-5,
                  stamp_jitter=0.1 * period)
    return Simulation(REFERENCE, plant_with(plant, machine), period, REFERENCE.drives.torque_limit,
                      holding_torque(REFERENCE, TABLE_1), machine.amplifier, machine.sensors,
                      noise, seed=3, limits=limits, kept=kept)


@pytest.mark.parametrize('name', MACHINES)
def test_every_sample_is_the_same_to_the_last_digit(name):
    told = []
    for plant in (ExactPlant, Stepped):
        simulation = simulation_with(plant, machine_named(name), kept=100)
        assert can_be_driven(simulation.plant, simulation._loop) == (plant is ExactPlant)
        start = simulation.time + 0.02
        simulation.queue_reference(start + MOTION.t, MOTION.q, MOTION.qd, MOTION.qdd)
        samples = [simulation.next_sample() for _ in range(900)]
        told.append([np.array([getattr(sample, field) for sample in samples]) for field in (
            'time_ns', 'q', 'qd', 'effort', 'true_torque', 'true_pose', 'true_q')])
        told[-1] += [simulation.delivered, readings_of(simulation.plant)]
        assert ('pressed' in name) == (np.abs(told[-1][-1]).max(initial=0.0) > 20.0)
        assert np.ptp(told[-1][1], axis=0).max() > 0.05
    for driven, stepped in zip(*told, strict=True):
        np.testing.assert_array_equal(driven, stepped)


@pytest.mark.parametrize('name', MACHINES)
@pytest.mark.parametrize('period', [1e-3, 2.5e-4])
def test_many_samples_at_once_are_those_of_one_after_the_other(name, period):
    """A stream that ends in motion, so that the drives brake; and single samples in between."""
    told, counts, readings = [], [], []
    for pieces in ((1,) * 1200, (1, 7, 392, 1, 1, 798)):
        simulation = simulation_with(ExactPlant, machine_named(name), period,
                                     ReferenceLimits(REFERENCE))
        part = slice(0, round(600 * period / MOTION.period))
        start = simulation.time + 0.02
        simulation.queue_reference(start + MOTION.t[part], MOTION.q[part], MOTION.qd[part],
                                   MOTION.qdd[part])
        simulation.queue_effort(start + MOTION.t[part][::2], np.ones((len(MOTION.t[part][::2]), 4)))
        samples = [simulation.next_sample() if count == 1 else simulation.next_samples(count)
                   for count in pieces]
        told.append([np.concatenate([np.reshape(getattr(sample, field.name), (
            (-1, 4) if field.name != 'time_ns' else -1)) for sample in samples])
            for field in fields(Told)])
        readings.append(readings_of(simulation.plant))
        counts.append(simulation.counts)
    assert counts[0] == counts[1]
    np.testing.assert_array_equal(*readings)
    assert counts[0]['interrupted_references'] == 1
    assert counts[0]['missing_effort'] > 50
    for one_by_one, at_once in zip(*told, strict=True):
        assert len(at_once) == 1200
        np.testing.assert_array_equal(at_once, one_by_one)


def test_many_samples_of_a_plant_that_is_not_compiled():
    one, many = (simulation_with(Stepped, machine_of()) for _ in range(2))
    samples = [one.next_sample() for _ in range(50)]
    told = many.next_samples(50)
    for field in fields(Told):
        np.testing.assert_array_equal(getattr(told, field.name), [
            getattr(sample, field.name) for sample in samples])


def test_the_torques_of_the_last_steps_are_kept():
    """A step's torque is what the amplifiers delivered, the mean of two at a sample between."""
    simulation = simulation_with(ExactPlant, machine_of(), 2.5e-4, kept=400)
    start = simulation.time + 0.02
    simulation.queue_reference(start + MOTION.t, MOTION.q, MOTION.qd, MOTION.qdd)
    told, delivered = simulation.next_samples(400), simulation.delivered
    assert np.ptp(delivered, axis=0).min() > 0.1
    # a sample tells that at its time, between the steps before and after it
    ahead = len(delivered) - 400
    middle = 0.5 * (delivered[:-1] + delivered[1:])
    np.testing.assert_allclose(middle[:399 + ahead][:399], told.true_torque[1:], atol=1e-12)
    np.testing.assert_array_equal(simulation_with(ExactPlant, machine_of()).delivered,
                                  np.empty((0, 4)))


def test_a_load_in_time_holds_each_row_for_a_period_and_the_last_for_ever():
    torque = np.arange(12.0).reshape(3, 4)
    held, silence = HeldLoad(torque, 0.5), np.zeros(4)
    for time, row in ((0.0, 0), (0.49, 0), (0.51, 1), (1.2, 2), (1.6, 2), (99.0, 2)):
        np.testing.assert_array_equal(held(time, silence, silence), torque[row])


def no_load(_time, _q, _qd):
    return np.zeros(4)


def test_a_load_of_a_kind_or_in_an_order_that_is_not_compiled_is_stepped():
    plate = ForcePlate(REFERENCE.geometry, -1.0)
    held = HeldLoad(np.zeros((1, 4)), 1e-3)
    for loads, driven in (((held, plate), True), ((plate, held), False), ((held, held), False),
                          ((no_load,), False)):
        simulation = simulation_with(ExactPlant, replace(machine_of(), loads=loads))
        assert can_be_driven(simulation.plant, simulation._loop) == driven
        simulation.next_samples(3)


@pytest.mark.parametrize('at_once', [False, True])
def test_out_of_reach_is_said_at_the_same_time(at_once):
    said = []
    for plant in (ExactPlant, Stepped):
        simulation = simulation_with(plant, machine_of())
        there = np.array((0.0, 0.2))
        q = np.stack((simulation.q, simulation.q + (1.5, -1.5, 1.5, -1.5)))
        simulation.queue_reference(simulation.time + there, q, np.zeros((2, 4)), np.zeros((2, 4)))
        with pytest.raises(UnreachableError, match='out of reach') as error:
            if at_once:
                simulation.next_samples(2000)
            for _ in range(2000):
                simulation.next_sample()
        said.append((str(error.value), simulation.plant.steps))
    assert said[0] == said[1]
