"""Each hidden effect changes the torque of its machine by the stated size and sign.

The laws are written here once more, from the physics, for a motion that is given; and what a
simulated machine records is held against them.
"""

from __future__ import annotations

import numpy as np
import pytest
from hidden.hider import Column, on
from hidden.hiders import HIDERS, NOT_HIDDEN
from hidden.machines import known_machine
from hidden.physics import Torques, rate
from hidden.recording import record
from hidden.truth import (
    CHAOTIC,
    EVERY,
    TWIN,
    VISIBLE,
    Truth,
    build,
    least_squares,
    true_noise,
    whitener_of,
)

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.state import GRAVITY, state_of_joints
from par4_identification.diagnosis.diagnosis import LIBRARY
from par4_kinematics.excitation import excitation_motion
from par4_sim.machines.noise import Noise

ALL = np.arange(4)


class Case:
    """A machine along a given motion."""

    def __init__(self):
        self.known = known_machine('reference')
        motion = excitation_motion(self.known.robot, 6.0, 3, joint_speed=4.0, acceleration=40.0)
        self.t, self.q, self.qd, self.qdd = motion.t, motion.q, motion.qd, motion.qdd
        self.side = np.sign(rate(motion.q, motion.period))
        self.torques = Torques(motion.t, motion.q)
        self.total = self.torques.recorded(self.known.machine)
        values = self.known.model.values
        self.viscous = values['viscous_friction'] * self.qd
        self.friction = values['coulomb_friction'] * self.side + self.viscous
        self.load = self.total - self.friction
        self.state = state_of_joints(self.known.robot.geometry, self.t, self.q, self.qd, self.qdd)

    def added(self, name, **values):
        """Return what an effect adds, (n, 4), where the joints move."""
        machine = HIDERS[name].build(self.known.machine, values)
        return self.torques.recorded(machine) - self.total


@pytest.fixture(scope='module')
def case():
    return Case()


def check(found, expected, share=0.01):
    """Compare within a share of the largest, away from the ends where rates are one-sided."""
    inner = slice(5, -5)
    size = np.abs(expected[inner]).max()
    assert size > 0
    np.testing.assert_allclose(found[inner], expected[inner], atol=share * size)


ON_JOINTS = {
    'torque_offset': ({'offset': on(ALL, (0.3, -0.2, 0.1, 0.4))},
                      lambda c, v: np.broadcast_to(v['offset'], c.q.shape)),
    'stribeck': ({'stribeck_torque': on(ALL, 0.8), 'stribeck_velocity': np.full(4, 0.2)},
                 lambda c, _: 0.8 * c.side * np.exp(-(c.qd / 0.2) ** 2)),
    'coulomb_asymmetry': ({'asymmetry': on([0, 2], (0.3, -0.2))},
                          lambda c, v: v['asymmetry'] * np.abs(c.side)),
    'viscous_asymmetry': ({'asymmetry': on([0, 2], (0.3, -0.2))},
                          lambda c, v: v['asymmetry'] * np.abs(c.qd)),
    'nonlinear_viscous': ({'quadratic': on(ALL, 0.2)}, lambda c, _: 0.2 * c.qd * np.abs(c.qd)),
    'load_dependent_friction': ({'coefficient': on([1], 0.05)}, lambda c, v: (
        v['coefficient'] * c.side * np.abs(c.load))),
    'friction_drift': ({'drop': 0.1, 'viscous_drop': 0.4, 'time_constant': 2.0}, lambda c, _: (
        -(1.0 - np.exp(-c.t / 2.0))[:, None] * (0.1 * (c.friction - c.viscous)
                                                + 0.4 * c.viscous))),
    'joint_friction_difference': ({'coulomb': on([0], 0.2), 'viscous': on([1], -0.3)},
                                  lambda c, v: v['coulomb'] * c.side + v['viscous'] * c.qd),
    'drive_gain_error': ({'relative': on([0, 3], (0.03, -0.02))},
                         lambda c, v: v['relative'] * c.total),
    'cogging': ({'amplitude': on([0, 2], (0.4, 0.2)), 'periods': 30.0, 'phase': np.full(4, 0.7)},
                lambda c, v: v['amplitude'] * np.sin(30.0 * c.q + 0.7)),
    'torque_ripple': ({'relative': on(ALL, 0.02), 'periods': 30.0, 'phase': np.full(4, 0.7)},
                      lambda c, _: 0.02 * np.sin(30.0 * c.q + 0.7) * c.total),
    'arm_mass_offset': ({'first_moment': on([1], 0.03)},
                        lambda c, v: GRAVITY * v['first_moment'] * np.sin(c.q)),
    'arm_weight_difference': ({'first_moment': on([2], -0.03)},
                              lambda c, v: -GRAVITY * v['first_moment'] * np.cos(c.q)),
    'joint_inertia_difference': ({'actuator_inertia': on([0, 1], (0.01, -0.005))},
                                 lambda c, v: v['actuator_inertia'] * c.qdd),
    'theta_inertia': ({'theta_inertia': 2e-3}, lambda c, _: c.state.torque_of_force(
        2e-3 * c.state.xdd * (0, 0, 0, 1))),
    'theta_friction': ({'viscous': 0.2}, lambda c, _: c.state.torque_of_force(
        0.2 * c.state.xd * (0, 0, 0, 1))),
    'external_force': ({'x': 3.0, 'y': -1.0, 'z': 2.0}, lambda c, _: c.state.torque_of_force(
        (-3.0, 1.0, -2.0, 0.0))),
    'cable_spring': ({'stiffness': np.array((30.0, 0.0, 10.0)),
                      'anchor': np.array((0.1, 0.2, -0.3))},
                     lambda c, _: c.state.torque_of_force(
                         (c.state.x - (0.1, 0.2, -0.3, 0.0)) * (30, 0, 10, 0))),
    'platform_drag': ({'viscous': 0.5}, lambda c, _: c.state.torque_of_force(
        0.5 * c.state.xd * (1, 1, 1, 0))),
}


@pytest.mark.parametrize('name', sorted(ON_JOINTS))
def test_torque_is_that_of_its_law(case, name):
    values, law = ON_JOINTS[name]
    found, expected = case.added(name, **values), law(case, values)
    moving = np.abs(case.qd) > 1e-3
    check(np.where(moving, found, 0.0), np.where(moving, expected, 0.0))


def test_presliding_softens_reversals_alone(case):
    found = case.added('presliding', distance=2e-3)
    level = case.known.model.values['coulomb_friction']
    for joint in range(4):
        turned = np.flatnonzero(np.diff(case.side[:, joint]) != 0.0)
        last = np.concatenate(([0], turned))[np.searchsorted(turned, np.arange(len(case.t)))]
        travel = np.abs(case.q[:, joint] - case.q[last, joint])
        # long after its last reversal a joint has all of its friction; never more
        assert np.abs(found[travel > 10e-3, joint]).max() < 0.02 * level[joint]
        assert np.abs(found[:, joint]).max() > 0.5 * level[joint]
        assert np.all((found * case.side)[:, joint] <= 1e-6)


def test_lag_and_delay_are_those_of_the_record(case):
    smooth = np.abs(case.qd).min(axis=1) > 0.3  # friction jumps elsewhere
    later = case.added('time_offset', delay=2e-3) + case.total
    check(np.where(smooth[2:, None], later[2:], 0.0),
          np.where(smooth[2:, None], case.total[:-2], 0.0), share=0.02)
    lagging = case.added('actuator_lag', time_constant=1e-3) + case.total
    # what a first-order lag makes of the record is the torque that the motion needs
    delivered = np.empty_like(lagging)
    delivered[0] = lagging[0]
    keep = np.exp(-1.0)
    for row in range(1, len(lagging)):
        middle = 0.5 * (lagging[row] + lagging[row - 1])
        delivered[row] = keep * delivered[row - 1] + (1.0 - keep) * middle
    check(np.where(smooth[:, None], delivered, 0.0), np.where(smooth[:, None], case.total, 0.0),
          share=0.03)


def test_tilt_raises_what_stands_against_gravity(case):
    """The power of the tilted weight is that of the masses along the tilted direction."""
    angle = 0.03
    found = case.added('base_tilt', about_x=angle, about_y=0.0)
    masses = case.known.machine.bodies
    slope = GRAVITY * np.array((0.0, np.sin(angle), np.cos(angle) - 1.0))  # up, seen from the base
    bar = case.known.robot.geometry.platform_bar_length
    theta, rate_of_theta = case.state.x[:, 3], case.state.xd[:, 3]
    second = case.state.xd[:, :3] + bar * rate_of_theta[:, None] * np.stack(
        (-np.cos(theta), -np.sin(theta), 0.0 * theta), axis=1)
    power = (masses.platform_mass_1 * case.state.xd[:, :3] + masses.platform_mass_2 * second
             ) @ slope
    azimuth = np.array(case.known.robot.geometry.actuator_azimuth)
    for joint in range(4):
        # the centre of an arm goes out with cos q and down with sin q
        moment = masses.arm_gravity[joint] / GRAVITY * case.qd[:, joint]
        out = -np.sin(case.q[:, joint])
        power = power + moment * (out * np.sin(azimuth[joint]) * slope[1]
                                  - np.cos(case.q[:, joint]) * slope[2])
    check(np.sum(found * case.qd, axis=1), power)


def test_rods_take_from_the_kinetic_energy(case):
    """Mass along a rod moves less than at its ends: work over the motion is the energy's change."""
    found = case.added('distributed_rods', rod_mass=0.05)
    power = np.sum(found * case.qd, axis=1)
    energy = np.cumsum(power) * (case.t[1] - case.t[0])
    assert energy.max() < 1e-3 * np.abs(energy).max()
    assert abs(energy[-1]) < 1e-2 * np.abs(energy).max()


def test_passive_joints_dissipate(case):
    for size in ({'coulomb': 0.05}, {'viscous': 0.02}):
        power = np.sum(case.added('passive_joint_friction', **size) * case.qd, axis=1)
        assert power.min() > -1e-9 < 0.01 < power.max()


def test_wrong_encoders_and_dimensions_move_the_true_machine(case):
    for name, values in (('encoder_offset', {'offset': on([0], 4e-3)}),
                         ('encoder_eccentricity', {'amplitude': on([0], 4e-3),
                                                   'phase': np.full(4, 0.5 * np.pi)}),
                         ('geometry_error', {'arm_length': 1e-3})):
        machine = HIDERS[name].build(case.known.machine, values)
        error = {'encoder_offset': on([0], 4e-3),
                 'encoder_eccentricity': on([0], 4e-3) * np.cos(case.q)}.get(name)
        if error is None:
            assert machine.geometry.arm_length == case.known.robot.geometry.arm_length + 1e-3
            assert machine.geometry.packed[0] == machine.geometry.arm_length
        else:
            true = Torques(case.t, case.q - error).recorded(case.known.machine)
            check(case.added(name, **values), true - case.total, share=0.05)
    assert np.abs(case.added('geometry_error', arm_length=1e-3)).max() > 1e-3
    one_leg = case.added('leg_length_error', arm_length=on([2], 1e-3))
    # the others answer by the platform that it moves
    assert np.abs(one_leg).max(axis=0).min() > 1e-4
    assert int(np.abs(one_leg).max(axis=0).argmax()) == 2


def test_every_effect_has_a_hider_or_a_reason_for_none():
    assert set(HIDERS) == set(CATALOGUE) - NOT_HIDDEN
    assert set(CATALOGUE) >= NOT_HIDDEN
    assert {name for name in CATALOGUE if CATALOGUE[name].of_axis} <= NOT_HIDDEN
    assert set(CATALOGUE) - set(LIBRARY) <= NOT_HIDDEN


def test_every_hider_draws_usual_sizes_and_its_family_spans_them(case):
    random = np.random.default_rng(0)
    for name, hider in HIDERS.items():
        values = hider.draw(random, case.known, ALL)
        assert any(np.any(values.get(size, 0.0)) for size in hider.sizes), name
        machine = hider.build(case.known.machine, values)
        assert machine is not case.known.machine


@pytest.fixture(scope='module')
def motion():
    return excitation_motion(known_machine('reference').robot, 8.0, 5, joint_speed=4.0,
                             acceleration=40.0)


def recorded(known, motion, hidden, every=1):
    return record(known, build(known.machine, hidden), motion, fidelity='exact',
                  noise=Noise(torque_noise=0.05), seed=1, feedforward=known.model, wander=None,
                  name='fit', every=every)


@pytest.mark.parametrize(('name', 'values', 'twins'), [
    ('coulomb_asymmetry', {'asymmetry': on([0, 1], (0.2, -0.3))}, {'torque_offset'}),
    ('stribeck', {'stribeck_torque': on(ALL, 0.8), 'stribeck_velocity': np.full(4, 0.1)}, set()),
])
def test_the_truth_of_a_recording_is_the_effect_that_made_it(motion, name, values, twins):
    """Two ways to the torque of an effect meet: the plant's record and the chain backwards."""
    known = known_machine('reference')
    truth = Truth(recorded(known, motion, [(name, values)]), known, [(name, values)])
    assert truth.evidence > 20 * VISIBLE
    assert truth.rest(name) < 0.2 * truth.evidence
    assert truth.strength(name) > 0.8 * truth.evidence
    assert set(truth.twins(name)) == twins


def test_arms_behind_springs_follow_their_motors(motion):
    known, hidden = known_machine('reference'), {'compliance': on(ALL, 5e-5)}
    recording = recorded(known, motion, [('elastic_transmission', hidden)])
    truth = Truth(recording, known, [('torque_offset', {'offset': on(ALL, 0.1)})])
    columns = truth.columns(HIDERS['elastic_transmission'], [Column(hidden, 0.9, 1.1)])
    assert least_squares(columns[0], truth.left, *columns[1:]) < 0.02 * truth.evidence


def test_a_clean_recording_holds_nothing(motion):
    known = known_machine('reference')
    truth = Truth(recorded(known, motion, []), known, [])
    quiet = [name for name in HIDERS if name not in (*CHAOTIC, 'elastic_transmission')]
    worth = {name: truth.evidence - truth.rest(name) for name in quiet}
    # sampling and sticking leave traces, which some shapes follow; none as far as to be visible
    assert max(worth.values()) < VISIBLE, worth
    assert TWIN < VISIBLE


@pytest.mark.parametrize(('name', 'values', 'sets'), [
    # what three joints share the base parameters take, so that the fourth is the odd one
    ('drive_gain_error', {'relative': on([0, 1, 3], 0.05)}, [[2]]),
    ('joint_friction_difference', {'coulomb': on([1, 3], 0.2), 'viscous': on([1, 3], 0.1)},
     [[0, 2], [1, 3]]),
    # none is between: any three differ from the fourth
    ('joint_inertia_difference', {'actuator_inertia': on([0, 1, 2], (0.005, 0.003, -0.002))},
     [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]),
    ('encoder_offset', {'offset': on([1], 5e-3)}, [[1]]),
])
def test_joints_are_the_fewest_that_explain_alike(motion, name, values, sets):
    known, hidden = known_machine('reference'), [(name, values)]
    assert Truth(recorded(known, motion, hidden), known, hidden).joint_sets(name) == sets


def test_effects_carry_what_the_model_without_them_leaves(motion):
    known = known_machine('reference')
    hidden = [('cogging', {'amplitude': on(ALL, 0.3), 'periods': 40.0, 'phase': np.zeros(4)}),
              ('external_force', {'x': 1.0, 'y': 0.0, 'z': 0.0}),
              ('theta_inertia', {'theta_inertia': 1e-6})]
    truth = Truth(recorded(known, motion, hidden), known, hidden)
    shares = truth.carried()
    alone = Truth(recorded(known, motion, hidden[:1]), known, hidden[:1])
    # these laws have little in common: what is left without one is what it is worth alone
    assert shares['cogging'] == pytest.approx(alone.evidence / truth.evidence, rel=0.05)
    assert sum(shares.values()) == pytest.approx(1.0, abs=0.05)
    assert shares['theta_inertia'] < 1e-3


def test_a_slow_logger_tells_less_of_the_same(motion):
    known, hidden = known_machine('reference'), [('torque_offset', {'offset': on([0], 0.2)})]
    whole, fifth = (recorded(known, motion, hidden, every) for every in (1, 5))
    np.testing.assert_array_equal(fifth.log.q, whole.log.q[::5])
    np.testing.assert_array_equal(fifth.log.tau, whole.log.tau[::5])
    assert fifth.log.period == pytest.approx(5 * whole.log.period)
    assert len(true_noise(fifth, known)) == len(fifth.log.t)
    # a fifth of the samples of a white noise holds it five times as loud in the band
    evidence = [Truth(item, known, hidden).evidence for item in (whole, fifth)]
    assert 3.0 < evidence[0] / evidence[1] < 7.0


def test_whitened_noise_is_white():
    random = np.random.default_rng(4)
    noise = np.zeros((60_000, 4))
    for row in range(1, len(noise)):
        noise[row] = 0.97 * noise[row - 1] + random.standard_normal(4)
    valid = np.ones(noise.shape, dtype=bool)
    valid[20_000:25_000, 1] = False
    first, second = noise[:30_000], noise[30_000:]
    for joint, rows in enumerate(whitener_of(first, valid[:30_000])(second)):
        assert len(rows) == valid[:30_000:EVERY, joint].sum()
        assert rows.std() == pytest.approx(1.0, abs=0.08)
        assert abs(np.corrcoef(rows[1:], rows[:-1])[0, 1]) < 0.06
