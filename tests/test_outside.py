"""Causes outside the library do to a machine what their physics says, and are known afterwards."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from hidden.hider import on
from hidden.machines import known_machine
from hidden.outside import OUTSIDE
from hidden.recording import record
from hidden.truth import VISIBLE, Truth

from par4_kinematics.excitation import excitation_motion
from par4_kinematics.velocity import jacobian
from par4_kinematics.workspace import home_pose
from par4_sim.machines.noise import Noise

KNOWN = known_machine('reference')
STEP = 1e-3
NO_TORQUE = np.zeros(4)
EVERYWHERE = np.arange(4)


@dataclass
class Moment:
    """What of a plant a cause reads."""

    time: float = 0.0
    q: np.ndarray = field(default_factory=lambda: np.zeros(4))
    qd: np.ndarray = field(default_factory=lambda: np.zeros(4))
    x: np.ndarray = field(default_factory=lambda: np.zeros(4))


def act_of(name, **values):
    return OUTSIDE[name].starts(KNOWN, values, STEP)


def turning(amplitude=0.3, frequency=0.5, seconds=6.0):
    """Yield moments of all joints swinging together."""
    way = 2.0 * math.pi * frequency
    for time in np.arange(0.0, seconds, STEP):
        yield Moment(time, np.full(4, amplitude * math.sin(way * time)),
                     np.full(4, amplitude * way * math.cos(way * time)))


def told(name, values, recorded=NO_TORQUE):
    t = np.arange(0.0, 10.0, STEP)
    return t, OUTSIDE[name].tells(values, t, np.broadcast_to(recorded, (len(t), 4)),
                                  np.random.default_rng(0))


def test_hysteresis_takes_energy_and_has_a_memory():
    act = act_of('bouc_wen', torque=np.full(4, 0.8), distance=0.1, order=2.0, width=0.7)
    moments = list(turning())
    torque = np.array([act(moment, NO_TORQUE)[0] for moment in moments])
    q, qd = (np.array([getattr(moment, key)[0] for moment in moments]) for key in ('q', 'qd'))
    assert np.abs(torque).max() == pytest.approx(0.8, rel=0.05)
    last = slice(len(q) // 2, None)
    assert np.sum((torque * qd)[last]) * STEP > 0.3  # J in six swings
    # at the same place on the way there and back it pulls to either side
    level = np.abs(q[last]) < 0.005
    assert torque[last][level & (qd[last] > 0)].min() > 0.3
    assert torque[last][level & (qd[last] < 0)].max() < -0.3


def test_a_tight_spot_brakes_at_one_place_alone():
    act = act_of('tight_spot', torque=on([1], 1.5), place=np.full(4, 0.1), width=0.05)
    there, fast = np.full(4, 0.1), np.full(4, 0.5)
    np.testing.assert_allclose(act(Moment(q=there, qd=fast), NO_TORQUE), on([1], 1.5))
    np.testing.assert_allclose(act(Moment(q=there, qd=-fast), NO_TORQUE), on([1], -1.5))
    assert np.abs(act(Moment(q=there + 0.2, qd=fast), NO_TORQUE)).max() < 1e-6


def test_friction_that_varies_over_a_turn_always_opposes_or_always_helps_at_a_place():
    act = act_of('friction_wave', torque=np.full(4, 0.5), periods=10.0, phase=np.zeros(4))
    at = Moment(q=np.full(4, 0.05 * math.pi), qd=np.full(4, 1.0))
    np.testing.assert_allclose(act(at, NO_TORQUE), 0.5)
    at.qd = -at.qd
    np.testing.assert_allclose(act(at, NO_TORQUE), -0.5)


def test_friction_grows_towards_the_bottom():
    low, high = KNOWN.robot.limits.workspace.z
    act = act_of('height_friction', torque=np.ones(4))
    fast = np.full(4, 1.0)
    assert act(Moment(qd=fast, x=np.array((0, 0, low, 0))), NO_TORQUE) == pytest.approx(1.0)
    assert act(Moment(qd=-fast, x=np.array((0, 0, low, 0))), NO_TORQUE) == pytest.approx(-1.0)
    assert act(Moment(qd=fast, x=np.array((0, 0, high, 0))), NO_TORQUE) == pytest.approx(0.0)


def test_a_stop_pushes_back_and_never_pulls():
    act = act_of('contact', stiffness=np.full(4, 10.0), damping=0.02, place=np.full(4, 0.2),
                 side=np.array((1.0, -1.0, 1.0, 1.0)))
    beyond = act(Moment(q=np.full(4, 0.3)), NO_TORQUE)
    # to go further the drives must push; joint 1 has its stop on the other side
    np.testing.assert_allclose(beyond, (1.0, 0.0, 1.0, 1.0))
    leaving = act(Moment(q=np.full(4, 0.21), qd=np.full(4, -5.0)), NO_TORQUE)
    np.testing.assert_allclose(leaving, 0.0)


def test_a_hose_creeps():
    act = act_of('creep', stiffness=np.full(4, 2.0), time=0.5)
    for _ in range(10):
        force = act(Moment(qd=np.full(4, 10.0)), NO_TORQUE).copy()
    np.testing.assert_allclose(force, 2.0 * 0.1, rtol=0.02)
    for _ in range(500):
        later = act(Moment(), NO_TORQUE).copy()
    np.testing.assert_allclose(later, force / math.e, rtol=1e-6)


def test_a_cable_slips_once():
    act = act_of('slip', torque=on([2], 0.7), moment=5.0)
    assert not act(Moment(time=4.9), NO_TORQUE).any()
    np.testing.assert_array_equal(act(Moment(time=5.1), NO_TORQUE), on([2], 0.7))


def test_a_tether_is_slack_until_it_is_stretched():
    """The power that the drives lose is that of the spring's pull."""
    home = home_pose(KNOWN.robot)
    anchor = home[:3] + (0.0, 0.0, 0.4)
    act = act_of('tether', anchor=anchor, stiffness=100.0, length=0.42)
    assert not act(Moment(x=home), NO_TORQUE).any()
    lower = home + (0.03, 0.0, -0.05, 0.0)
    torque = act(Moment(x=lower), NO_TORQUE)
    pull = 100.0 * (np.linalg.norm(lower[:3] - anchor) - 0.42)
    qd = np.array((0.3, -0.2, 0.5, 0.1))
    way = (lower[:3] - anchor) / np.linalg.norm(lower[:3] - anchor)
    xd = jacobian(KNOWN.robot.geometry, lower) @ qd
    assert torque @ qd == pytest.approx(pull * way @ xd[:3])


def test_a_supply_sags_with_what_all_drives_draw():
    act = act_of('supply_sag', sag=0.1, power=100.0, loss=0.0, time=0.01)
    working = Moment(qd=np.array((5.0, 0.0, 0.0, 0.0)))
    for _ in range(200):
        lost = act(working, np.array((20.0, 10.0, 0.0, -5.0)))
    np.testing.assert_allclose(lost, 0.1 * np.array((20.0, 10.0, 0.0, -5.0)), rtol=1e-6)
    for _ in range(200):  # brakes feed nothing back
        lost = act(working, np.array((-20.0, 10.0, 0.0, -5.0)))
    assert np.abs(lost).max() < 1e-6


def test_a_motor_weakens_as_it_warms():
    act = act_of('gain_drift', loss=on([0], 0.2), time=0.2)
    full = np.full(4, 10.0)
    first = act(Moment(), full).copy()
    for _ in range(2000):
        lost = act(Moment(), full)
    assert first[0] < 0.02
    np.testing.assert_allclose(lost, on([0], 2.0), rtol=1e-3)


def test_small_currents_are_swallowed():
    act = act_of('dead_band', width=on([0, 1], 0.5))
    np.testing.assert_allclose(act(Moment(), np.array((0.3, -4.0, 0.3, 2.0))),
                               (0.3, -0.5, 0.0, 0.0))


def test_a_current_rises_only_so_fast():
    act = act_of('slew', slew=100.0, joints=np.array([3]))
    act(Moment(), NO_TORQUE)
    delivered = [1.0 - act(Moment(), np.ones(4))[3] for _ in range(12)]
    np.testing.assert_allclose(delivered, np.minimum(0.1 * np.arange(1, 13), 1.0))


def test_channels_leak_into_their_neighbours():
    _, added = told('cross_talk', {'share': np.full(4, 0.05)}, np.array((10.0, 20.0, 0.0, 0.0)))
    np.testing.assert_allclose(added[0], (0.0, 0.5, 1.0, 0.0))


def test_hum_has_its_lines_and_bursts_their_moments():
    t, added = told('hum', {'frequencies': np.array((7.0, 20.0)),
                            'amplitudes': np.array((np.full(4, 0.4), np.full(4, 0.1)))})
    spectrum = 2.0 / len(t) * np.abs(np.fft.rfft(added[:, 0]))
    assert spectrum[70] == pytest.approx(0.4)
    assert spectrum[200] == pytest.approx(0.1)
    spectrum[[70, 200]] = 0.0
    assert spectrum.max() < 1e-6
    _, added = told('bursts', {'torque': on([1], 2.0), 'number': 4, 'length': 0.1})
    loud = np.abs(added[:, 1]) > 0.2
    assert 0.02 < loud.mean() < 0.2
    assert np.abs(added[:, 1]).max() > 1.0
    assert not added[:, [0, 2, 3]].any()


def test_every_cause_acts_in_one_place_and_has_usual_sizes():
    assert len(OUTSIDE) >= 10
    for name, cause in OUTSIDE.items():
        assert (cause.starts is None) != (cause.tells is None), name
        assert cause.draw(np.random.default_rng(1), KNOWN, EVERYWHERE), name


@pytest.mark.parametrize('name', ['bouc_wen', 'supply_sag', 'tether'])
def test_what_a_machine_records_is_the_known_one_and_the_cause(name):
    """Two ways meet: the plant under the cause, and the cause's own torque on top of the chain."""
    motion = excitation_motion(KNOWN.robot, 8.0, 5, joint_speed=4.0, acceleration=40.0)
    cause = OUTSIDE[name]
    values = cause.draw(np.random.default_rng(3), KNOWN, EVERYWHERE)
    recording = record(KNOWN, KNOWN.machine, motion, fidelity='exact',
                       noise=Noise(torque_noise=0.05), seed=1, feedforward=KNOWN.model,
                       wander=None, name='fit', outside=(cause, values))
    truth = Truth(recording, KNOWN, [])
    assert truth.strangeness > 20 * VISIBLE
    assert truth.evidence < 0.5 * VISIBLE
