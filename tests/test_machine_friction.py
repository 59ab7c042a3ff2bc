"""The friction of simulated joints, effect by effect, against what friction does in a workshop.

Plateaus are read where strong springs lead the joints at constant speed; what the same journey
takes without friction is subtracted.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from experiments import (
    ASIDE,
    FIDELITIES,
    HOME,
    TABLE,
    changed,
    entry,
    gradient,
    guided,
    machine_of,
    plant_of,
    ramp,
    weight_energy,
)

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_sim.machines.machine_effects import ON_JOINTS

COULOMB, VISCOUS = TABLE['coulomb_friction'], TABLE['viscous_friction']
SPEEDS = (0.06, -0.06, 0.3, -0.3, 1.5, -1.5)
RISE = np.array((1.2, 0.5, 0.8, 0.0))
LEAN = np.array((0.3, -0.2, 0.1, 0.0))
SLOPE = np.array((0.2, -0.4, 0.1, 0.0))
CURVE = np.array((0.3, 0.1, -0.1, 0.0))
LEVEL = np.array((0.9, 0.4, 0.6, 0.0))
EXPONENT = np.array((0.5, 0.35, 1.7, 1.0))
SHARE = np.array((0.1, 0.05, 0.2, 0.0))
DROP, THINNING, WARMING = 0.4, 0.7, 0.12
JOURNEY, WINDOW = 0.2, 60
"""Seconds and, at its end, steps that are averaged."""
WARM = 1.0 - np.exp(-(JOURNEY - 0.5 * WINDOW * 0.25e-3) / WARMING)
"""Share of its drop that a friction has lost by then."""


def journey(machine, fidelity, speed):
    """Return the mean torque (4,) and speed (4,) at the end of a journey at constant speed."""
    with plant_of(machine, fidelity) as plant:
        _, qd, torque = guided(plant, ramp(speed), JOURNEY)
    return torque[-WINDOW:].mean(axis=0), qd[-WINDOW:].mean(axis=0)


@cache
def frictionless_journey(fidelity, speed):
    return journey(machine_of(friction=False), fidelity, speed)


LAWS = {
    'stribeck': (entry('stribeck', stribeck_torque=tuple(RISE), stribeck_velocity=0.2),
                 lambda v, _, s: s * (COULOMB + RISE * np.exp(-(v / 0.2) ** 2)) + VISCOUS * v),
    'coulomb_asymmetry': (
        entry('coulomb_asymmetry', asymmetry=tuple(LEAN)),
        lambda v, _, s: s * COULOMB + LEAN + VISCOUS * v),
    'viscous_asymmetry': (
        entry('viscous_asymmetry', asymmetry=tuple(SLOPE)),
        lambda v, _, s: s * COULOMB + np.where(v > 0, VISCOUS + SLOPE, VISCOUS - SLOPE) * v),
    'quadratic': (
        entry('nonlinear_viscous', quadratic=tuple(CURVE)),
        lambda v, _, s: s * (COULOMB + VISCOUS * abs(v) + CURVE * v ** 2)),
    'power law': (
        entry('nonlinear_viscous', torque=tuple(LEVEL), exponent=tuple(EXPONENT)),
        lambda v, _, s: s * (COULOMB + VISCOUS * abs(v) + LEVEL * abs(v) ** EXPONENT)),
    'load_dependent_friction': (
        entry('load_dependent_friction', coefficient=tuple(SHARE)),
        lambda v, load, s: s * (COULOMB + SHARE * abs(load)) + VISCOUS * v),
    'joint_friction_difference': (
        entry('joint_friction_difference', coulomb=tuple(LEAN), viscous=tuple(SLOPE)),
        lambda v, _, s: s * (COULOMB + LEAN) + (VISCOUS + SLOPE) * v),
    'joints of an effect': (
        entry('coulomb_asymmetry', joints=(1, 3), asymmetry=0.5),
        lambda v, _, s: s * COULOMB + np.array((0.0, 0.5, 0.0, 0.5)) + VISCOUS * v),
    'friction_drift': (
        entry('friction_drift', drop=DROP, time_constant=WARMING),
        lambda v, _, s: (s * COULOMB + VISCOUS * v) * (1.0 - DROP * WARM)),
    'a lubricant that thins': (
        entry('friction_drift', drop=0.0, viscous_drop=THINNING, time_constant=WARMING),
        lambda v, _, s: s * COULOMB + VISCOUS * v * (1.0 - THINNING * WARM)),
    'presliding': (  # bent for good after some distances
        entry('presliding', distance=1e-3),
        lambda v, _, s: s * COULOMB + VISCOUS * v),
}
OF_THE_ENGINE = (0.06, -0.3, 1.5)
"""Both directions and all sizes: the laws are those of the exact plant, which shows them all."""
CASES = [(name, fidelity, speed) for name in LAWS for fidelity in FIDELITIES for speed in SPEEDS
         if fidelity == 'exact' or (fidelity == 'fast' and speed in OF_THE_ENGINE)
         or (fidelity == 'accurate' and name in ('stribeck', 'load_dependent_friction')
             and abs(speed) == 0.3)]


@pytest.mark.parametrize(('name', 'fidelity', 'speed'), CASES)
def test_friction_at_constant_speed(name, fidelity, speed):
    effect, law = LAWS[name]
    load, _ = frictionless_journey(fidelity, speed)
    torque, found = journey(machine_of(effect), fidelity, speed)
    expected = law(found, load, np.sign(speed))
    np.testing.assert_allclose(torque - load, expected, atol=0.004, rtol=1e-3)


def test_every_law_is_well_above_what_is_resolved():
    """The test above would see a law that is not there."""
    for name, (_, law) in LAWS.items():
        seen = [np.max(np.abs(law(v, np.full(4, 5.0), np.sign(v)) - np.sign(v) * COULOMB
                              - VISCOUS * v)) for v in SPEEDS]
        assert (max(seen) > 0.25) == (name != 'presliding')


def test_code_switches_friction_on_as_a_model_does():
    machine = changed(machine_of(), 'friction', stribeck_torque=RISE,
                      stribeck_velocity=np.full(4, 0.2))
    torque, _ = journey(machine, 'exact', 0.06)
    expected, _ = journey(machine_of(LAWS['stribeck'][0]), 'exact', 0.06)
    np.testing.assert_array_equal(torque, expected)


def test_every_effect_that_is_friction_of_the_machine_says_of_which_kind():
    """So that warmth lowers it in a model as it does on the machine."""
    parts = {name for name, (part, _) in ON_JOINTS.items() if part == 'friction'}
    assert {name for name, effect in CATALOGUE.items() if effect.friction_term is not None} == parts


# --------------------------------------------------------------------------- sticking

WEIGHT = gradient(weight_energy, ASIDE)
BREAKAWAY = {
    'base': ((), COULOMB, COULOMB),
    'stribeck': ((entry('stribeck', stribeck_torque=tuple(RISE), stribeck_velocity=0.1),),
                 COULOMB + RISE, COULOMB + RISE),
    'coulomb_asymmetry': ((entry('coulomb_asymmetry', asymmetry=tuple(LEAN)),),
                          COULOMB + LEAN, COULOMB - LEAN),
    # with a load: what goes on behind the friction of a joint at rest is the weight
    'load_dependent_friction': ((entry('load_dependent_friction', coefficient=tuple(SHARE)),),
                                COULOMB + SHARE * abs(WEIGHT), COULOMB + SHARE * abs(WEIGHT)),
    'joint_friction_difference': ((entry('joint_friction_difference', coulomb=tuple(LEAN)),),
                                  COULOMB + LEAN, COULOMB + LEAN),
    'friction_drift': ((entry('friction_drift', drop=DROP, time_constant=1e-3),),
                       COULOMB * (1.0 - DROP), COULOMB * (1.0 - DROP)),
    'all of them': ((entry('stribeck', stribeck_torque=tuple(RISE), stribeck_velocity=0.1),
                     entry('coulomb_asymmetry', asymmetry=tuple(LEAN)),
                     entry('load_dependent_friction', coefficient=tuple(SHARE)),
                     entry('friction_drift', drop=DROP, time_constant=1e-3)),
                    (1.0 - DROP) * (COULOMB + RISE + LEAN + SHARE * abs(WEIGHT)),
                    (1.0 - DROP) * (COULOMB + RISE - LEAN + SHARE * abs(WEIGHT))),
}
STICKING = [(name, fidelity) for name in BREAKAWAY for fidelity in FIDELITIES]


@pytest.mark.parametrize(('name', 'fidelity'), STICKING)
def test_a_joint_breaks_away_at_its_level_and_not_before(name, fidelity):
    """Each joint alone, both directions; the other three do not stir."""
    entries, forward, back = BREAKAWAY[name]
    with plant_of(machine_of(*entries), fidelity, ASIDE) as plant:
        start = plant.q
        for joint in range(4):
            for direction, level in ((1.0, forward), (-1.0, back)):
                for share, moves in ((0.995, False), (1.005, True)):
                    plant.reset(ASIDE)
                    # warm first: a drifting level is reached from above
                    for _ in range(40):
                        plant.step(WEIGHT)
                    torque = WEIGHT.copy()
                    torque[joint] += direction * share * np.broadcast_to(level, 4)[joint]
                    for _ in range(40):
                        plant.step(torque)
                    moved = direction * (plant.q - start)
                    assert (moved[joint] > 0.0) == moves
                    np.testing.assert_array_equal(np.delete(moved, joint), 0.0)


@pytest.mark.parametrize(('name', 'fidelity'), STICKING)
def test_a_held_joint_stays_where_it_is(name, fidelity):
    entries, forward, back = BREAKAWAY[name]
    with plant_of(machine_of(*entries), fidelity, ASIDE) as plant:
        start = plant.q
        level = 0.95 * np.stack((np.broadcast_to(forward, 4), -np.broadcast_to(back, 4)))
        for step in range(400):
            # waves as large as friction holds, each joint at its own rate
            wave = np.sin(0.05 * step * np.array((1.0, 1.3, 0.7, 2.0)))
            plant.step(WEIGHT + np.where(wave > 0.0, level[0], -level[1]) * wave)
        np.testing.assert_array_equal(plant.q, start)
        assert np.abs(plant.qd).max() < 1e-15


@pytest.mark.parametrize('fidelity', ['exact', 'fast'])
@pytest.mark.parametrize('play', [entry('elastic_transmission', stiffness=5e3),
                                  entry('backlash', gap=2e-3)], ids=['elastic', 'backlash'])
def test_a_held_motor_stays_where_it_is(play, fidelity):
    """Behind springs and gaps the friction is that of the motors; what swings is the arm."""
    with plant_of(machine_of(play), fidelity, ASIDE) as plant:
        start, arms = plant.q, plant.arms
        for step in range(400):
            plant.step(WEIGHT + 0.8 * COULOMB * np.sin(0.05 * step + np.arange(4)))
        np.testing.assert_array_equal(plant.q, start)
        np.testing.assert_allclose(plant.arms, arms, atol=1e-3)


# --------------------------------------------------------------------------- presliding

DISTANCE = 2e-3


def dahl(travel, reversal):
    """Return the bending after a forward travel of `reversal`, then back to `travel`, rad."""
    there = 1.0 - np.exp(-reversal / DISTANCE)
    return -1.0 + (there + 1.0) * np.exp(-(reversal - travel) / DISTANCE)


@pytest.mark.parametrize('fidelity', ['exact', 'fast'])
def test_presliding_runs_through_dahls_loop(fidelity):
    """From rest f_c (1 - exp(-q / x_s)); back from there with up to twice the stiffness f_c / x_s.
    """
    reach, speed = 4e-3, 0.01

    def travel(t):
        forward = t < reach / speed
        return (np.full(4, speed * t if forward else 2.0 * reach - speed * t),
                np.full(4, speed if forward else -speed))

    runs = []
    for coulomb in (COULOMB, 0.0):
        machine = machine_of(entry('presliding', distance=DISTANCE), coulomb_friction=coulomb,
                             viscous_friction=0.0)
        with plant_of(machine, fidelity) as plant:
            start = plant.q
            q, qd, torque = guided(plant, travel, 0.75)
            runs.append((q - start, qd, torque))
    (moved, qd, torque), (_, _, plain) = runs
    found = (torque - plain) / COULOMB
    top, turn = moved.max(axis=0), int(np.argmax(moved[:, 0]))
    forward, back = slice(200, turn - 10), slice(turn + 200, None)
    assert (qd[forward] > 0.0).all()
    assert (qd[back] < 0.0).all()
    np.testing.assert_allclose(found[forward], 1.0 - np.exp(-moved[forward] / DISTANCE), atol=0.01)
    np.testing.assert_allclose(found[back], dahl(moved[back], top), atol=0.01)
    assert (found[forward].min(axis=0) < 0.5).all()
    assert (found[back].max(axis=0) > 0.4).all()
    assert (found[back].min(axis=0) < -0.45).all()


@pytest.mark.parametrize('fidelity', FIDELITIES)
def test_with_presliding_a_held_joint_gives_way_and_comes_back(fidelity):
    """A push below f_c bends the contacts, and they unbend, on Dahl's branches."""
    push = np.array((0.3, -0.3, 0.1, -0.05)) * COULOMB
    machine = machine_of(entry('presliding', distance=DISTANCE), viscous_friction=60.0)
    with plant_of(machine, fidelity, ASIDE) as plant:
        start, ends = plant.q, []
        for torque in (WEIGHT + push, WEIGHT):
            for _ in range(1500):
                plant.step(torque)
            # the contacts take what is not weight
            ends.append((plant.q - start, torque - gradient(weight_energy, plant.x)))
    side = np.sign(push)
    (there, taken), (back, left) = ((side * moved, side * held) for moved, held in ends)
    assert (there > 5e-5).all()
    np.testing.assert_allclose(taken, COULOMB * (1.0 - np.exp(-there / DISTANCE)), atol=3e-3)
    np.testing.assert_allclose(left, COULOMB * dahl(back, there), atol=3e-3)
    assert (np.abs(left) < 0.02).all()
    assert (np.abs(back) < 0.35 * there).all()


@pytest.mark.parametrize('fidelity', ['exact', 'fast'])
def test_friction_takes_the_energy_that_is_lost(fidelity):
    """A push and a free swing to rest: its work becomes height and friction, by hand."""
    entries, _, _ = BREAKAWAY['stribeck']
    with plant_of(machine_of(*entries), fidelity) as plant:
        hold = gradient(weight_energy, HOME)
        work = lost = 0.0
        for step in range(1600):
            torque = hold + (np.array((9.0, -7.0, 6.0, -5.0)) if step < 300 else 0.0)
            before = plant.q
            plant.step(torque)
            moved = plant.q - before
            speed = np.abs(moved) / plant.dt
            work += float(torque @ moved)
            lost += float(np.sum((COULOMB + RISE * np.exp(-(speed / 0.1) ** 2) + VISCOUS * speed)
                                 * np.abs(moved)))
        assert np.abs(plant.qd).max() < 1e-12
        height = weight_energy(plant.x) - weight_energy(HOME)
    assert lost > 0.5
    assert work == pytest.approx(lost + height, abs=0.01 * lost)
