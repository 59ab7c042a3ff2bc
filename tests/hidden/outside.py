"""Causes that no library has: what else happens to machines, each written as what it does.

A cause acts in one of two places. What acts on the machine takes torque from the joints at every
physics step, whatever the drives deliver: `starts` returns a fresh one, with a memory of its own,
for each run. What acts on the record alone adds to the recorded torque: `tells`. Either way the
recorded torque is afterwards more than a machine without the cause would need, and by how much is
kept with the recording.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hidden.friction_hiders import coulomb
from hidden.hider import JOINTS, Values, on, signs
from hidden.hiders import RATED
from hidden.machines import Known
from par4_kinematics.geometry import LEGS
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.velocity import jacobian
from par4_kinematics.workspace import home_pose
from par4_sim.plants.plant import Plant

Act = Callable[[Plant, np.ndarray], np.ndarray]
"""(plant at the step's beginning, torque delivered (4,)) -> torque lost on the way (4,), N m."""
Tell = Callable[[Values, np.ndarray, np.ndarray, np.random.Generator], np.ndarray]
"""(values, t (n,), recorded torque (n, 4), random) -> what the record has on top, (n, 4) N m."""
CREEP = 0.01
"""rad/s: speed over which dry friction of these causes turns its sign, so that a step in time
follows it."""


@dataclass(frozen=True)
class Outside:
    """One cause outside the library.

    Attributes:
        name: in the tables.
        acts_like: kinds of nameless causes that describe it; none for what follows no motion.
        draw: (random, known, joints (k,)) -> values.
        starts: (known, values, step s) -> act, or None.
        tells: what the record has on top, or None.
    """

    name: str
    acts_like: tuple[str, ...]
    draw: Callable[[np.random.Generator, Known, np.ndarray], Values]
    starts: Callable[[Known, Values, float], Act] | None = None
    tells: Tell | None = None


def _some(random: np.random.Generator, joints: np.ndarray, low: float, high: float) -> np.ndarray:
    return on(joints, random.uniform(low, high, len(joints)))


def _side(qd: np.ndarray) -> np.ndarray:
    return np.tanh(qd / CREEP)


# --- friction of other laws ---------------------------------------------------------------------

def _hysteresis(_known: Known, values: Values, step: float) -> Act:
    """Bouc-Wen: dz = (1 - |z|^n (b sign(qd z) + c)) dq / x; rubber seals, cable packs."""
    z = np.zeros(LEGS)

    def act(plant: Plant, _torque: np.ndarray) -> np.ndarray:
        qd = plant.qd
        loop = np.abs(z) ** values['order'] * (
            values['width'] * np.sign(qd * z) + 1.0 - values['width'])
        z[:] = np.clip(z + step * qd / values['distance'] * (1.0 - loop), -1.5, 1.5)
        return values['torque'] * z

    return act


BOUC_WEN = Outside(
    'bouc_wen', ('memory', 'speed', 'position', 'drift'),
    lambda random, known, joints: {
        'torque': on(joints, random.uniform(0.15, 0.5, len(joints)) * coulomb(known)[joints]),
        'distance': random.uniform(0.05, 0.2), 'order': random.uniform(1.5, 3.0),
        'width': random.uniform(0.6, 0.9)},
    starts=_hysteresis)


def _tight(_known: Known, values: Values, _step: float) -> Act:
    def act(plant: Plant, _torque: np.ndarray) -> np.ndarray:
        away = (plant.q - values['place']) / values['width']
        return values['torque'] * np.exp(-away ** 2) * _side(plant.qd)

    return act


def _home(known: Known) -> np.ndarray:
    """Return the joint positions at home (4,), rad."""
    return inverse_kinematics(known.robot.geometry, home_pose(known.robot)[None])[0]


TIGHT_SPOT = Outside(
    'tight_spot', ('place', 'position', 'speed', 'periodic', 'platform'),
    lambda random, known, joints: {
        'torque': _some(random, joints, 0.3, 1.2),
        'place': _home(known) + random.uniform(-0.2, 0.2, LEGS),
        'width': random.uniform(0.05, 0.15)},
    starts=_tight)


def _uneven(_known: Known, values: Values, _step: float) -> Act:
    """Friction that rises and falls over a turn of a bearing that was bored askew."""
    def act(plant: Plant, _torque: np.ndarray) -> np.ndarray:
        wave = np.sin(values['periods'] * plant.q + values['phase'])
        return values['torque'] * wave * _side(plant.qd)

    return act


FRICTION_WAVE = Outside(
    'friction_wave', ('uneven', 'place', 'periodic', 'position', 'speed'),
    lambda random, known, joints: {
        'torque': on(joints, random.uniform(0.15, 0.5, len(joints)) * coulomb(known)[joints]),
        'periods': float(random.integers(6, 25)), 'phase': random.uniform(-3.1, 3.1, LEGS)},
    starts=_uneven)


def _high(known: Known, values: Values, _step: float) -> Act:
    """Friction of arms whose bearings bind the more the lower the platform hangs."""
    low, high = known.robot.limits.workspace.z

    def act(plant: Plant, _torque: np.ndarray) -> np.ndarray:
        depth = (high - plant.x[2]) / (high - low)
        return values['torque'] * depth * _side(plant.qd)

    return act


HEIGHT_FRICTION = Outside(
    'height_friction', ('pose', 'place', 'speed', 'platform', 'position', 'drift'),
    lambda random, known, joints: {
        'torque': on(joints, random.uniform(0.3, 0.8, len(joints)) * coulomb(known)[joints])},
    starts=_high)


# --- loads --------------------------------------------------------------------------------------

def _bumper(_known: Known, values: Values, _step: float) -> Act:
    """A rubber stop that an arm runs into: a spring that only pushes, with a little damping."""
    def act(plant: Plant, _torque: np.ndarray) -> np.ndarray:
        way = values['side'] * (plant.q - values['place'])
        push = values['stiffness'] * (way + values['damping'] * values['side'] * plant.qd)
        return values['side'] * np.where(way > 0.0, np.maximum(push, 0.0), 0.0)

    return act


def _draw_bumper(random, known, joints):
    side = signs(random, JOINTS)
    return {'stiffness': _some(random, joints, 3.0, 15.0), 'damping': random.uniform(0.0, 0.02),
            'place': _home(known) + side * random.uniform(0.05, 0.2, LEGS), 'side': side}


CONTACT = Outside('contact', ('position', 'platform', 'wrench'), _draw_bumper, starts=_bumper)


def _hose(_known: Known, values: Values, step: float) -> Act:
    """A hose along the arm (Maxwell): a spring whose force creeps away."""
    force = np.zeros(LEGS)
    keep = math.exp(-step / values['time'])

    def act(plant: Plant, _torque: np.ndarray) -> np.ndarray:
        force[:] = keep * force + values['stiffness'] * plant.qd * step
        return force

    return act


CREEP_HOSE = Outside(
    'creep', ('creep', 'position', 'time', 'drift', 'speed', 'platform', 'wrench'),
    lambda random, _known, joints: {'stiffness': _some(random, joints, 1.5, 5.0),
                                    'time': random.uniform(0.3, 3.0)},
    starts=_hose)


def _slip(_known: Known, values: Values, _step: float) -> Act:
    """A cable that jumps off its guide at one moment and pulls from then on."""
    def act(plant: Plant, _torque: np.ndarray) -> np.ndarray:
        return values['torque'] * float(plant.time > values['moment'])

    return act


SLIP = Outside(
    'slip', ('time',),
    lambda random, _known, joints: {
        'torque': on(joints, signs(random, joints) * random.uniform(0.3, 1.0, len(joints))),
        'moment': random.uniform(4.0, 7.0)},
    starts=_slip)


def _tether(known: Known, values: Values, _step: float) -> Act:
    """A hose from the ceiling to the platform that pulls once it is stretched."""
    def act(plant: Plant, _torque: np.ndarray) -> np.ndarray:
        pose = plant.x
        away = pose[:3] - values['anchor']
        distance = float(np.linalg.norm(away))
        if distance <= values['length']:
            return np.zeros(LEGS)
        force = values['stiffness'] * (distance - values['length']) * away / distance
        return jacobian(known.robot.geometry, pose[None])[0].T @ np.append(force, 0.0)

    return act


def _draw_tether(random, known, _joints):
    home = home_pose(known.robot)[:3]
    aside = known.robot.limits.workspace.radius * random.uniform(0.5, 1.0)
    heading = random.uniform(-math.pi, math.pi)
    anchor = home + (aside * math.cos(heading), aside * math.sin(heading), 0.4)
    return {'anchor': anchor, 'stiffness': random.uniform(30.0, 120.0),
            'length': float(np.linalg.norm(home - anchor)) + random.uniform(0.0, 0.03)}


TETHER = Outside('tether', ('wrench', 'platform'), _draw_tether, starts=_tether)


# --- drives -------------------------------------------------------------------------------------

def _sagging(_known: Known, values: Values, step: float) -> Act:
    """One supply feeds all drives: the more power they draw together, the less each delivers."""
    level = [0.0]
    keep = math.exp(-step / values['time'])

    def act(plant: Plant, torque: np.ndarray) -> np.ndarray:
        drawn = float(np.sum(np.maximum(torque * plant.qd, 0.0) + values['loss'] * torque ** 2))
        level[0] = keep * level[0] + (1.0 - keep) * drawn
        return torque * min(values['sag'] * level[0] / values['power'], 0.5)

    return act


SUPPLY_SAG = Outside(
    'supply_sag', ('gain', 'torque', 'load', 'speed', 'acceleration', 'rate', 'platform'),
    lambda random, _known, _joints: {
        'sag': random.uniform(0.05, 0.2), 'power': 100.0, 'loss': 0.05,
        'time': random.uniform(0.005, 0.05)},
    starts=_sagging)


def _warming(_known: Known, values: Values, step: float) -> Act:
    """Magnets of a motor weaken with the heat of its winding."""
    heat = np.zeros(LEGS)
    keep = math.exp(-step / values['time'])

    def act(_plant: Plant, torque: np.ndarray) -> np.ndarray:
        heat[:] = keep * heat + (1.0 - keep) * (2.0 * torque / RATED) ** 2
        return torque * np.minimum(values['loss'] * heat, 0.5)

    return act


GAIN_DRIFT = Outside(
    'gain_drift', ('gain', 'torque', 'time', 'drift', 'load', 'acceleration', 'platform'),
    lambda random, _known, joints: {'loss': _some(random, joints, 0.03, 0.1),
                                    'time': random.uniform(3.0, 15.0)},
    starts=_warming)


def _dead_band(_known: Known, values: Values, _step: float) -> Act:
    """An output stage that does not carry small currents."""
    def act(_plant: Plant, torque: np.ndarray) -> np.ndarray:
        return np.clip(torque, -values['width'], values['width'])

    return act


DEAD_BAND = Outside(
    'dead_band', ('gain', 'torque', 'load', 'speed', 'acceleration', 'platform'),
    lambda random, _known, joints: {'width': _some(random, joints, 0.2, 0.8)},
    starts=_dead_band)


def _slewing(_known: Known, values: Values, step: float) -> Act:
    """An output stage whose current rises only so fast."""
    output = np.full(LEGS, np.nan)

    def act(_plant: Plant, torque: np.ndarray) -> np.ndarray:
        if np.isnan(output[0]):
            output[:] = torque
        change = values['slew'] * step
        output[:] += np.clip(torque - output, -change, change)
        return np.where(np.isin(JOINTS, values['joints']), torque - output, 0.0)

    return act


SLEW = Outside(
    'slew', ('torque', 'rate', 'load', 'acceleration', 'platform', 'speed'),
    lambda random, _known, joints: {'slew': random.uniform(1e3, 3e3),
                                    'joints': np.array(joints)},
    starts=_slewing)


# --- the record alone ---------------------------------------------------------------------------

def _cross_talk(values: Values, _t, torque: np.ndarray, _random) -> np.ndarray:
    """Return what leaks from the neighbour's channel into each."""
    return values['share'] * np.roll(torque, 1, axis=1)


CROSS_TALK = Outside(
    'cross_talk', ('coupling', 'torque', 'load', 'platform', 'acceleration', 'wrench', 'position'),
    lambda random, _known, joints: {'share': on(
        joints, signs(random, joints) * random.uniform(0.02, 0.08, len(joints)))},
    tells=_cross_talk)


def _hum(values: Values, t: np.ndarray, _torque, random: np.random.Generator) -> np.ndarray:
    """Return lines of steady frequencies; each run begins at phases of its own."""
    phases = random.uniform(-math.pi, math.pi, (len(values['frequencies']), LEGS))
    return sum(amplitude * np.sin(2.0 * math.pi * frequency * t[:, None] + phase)
               for frequency, amplitude, phase in zip(
                   values['frequencies'], np.atleast_2d(values['amplitudes']), phases))


def _draw_hum(random, _known, joints):
    count = int(random.integers(1, 3))
    return {'frequencies': np.sort(random.uniform(3.0, 35.0, count)),
            'amplitudes': np.stack([_some(random, joints, 0.1, 0.5) for _ in range(count)])}


HUM = Outside('hum', (), _draw_hum, tells=_hum)


def _bursts(values: Values, t: np.ndarray, _torque, random: np.random.Generator) -> np.ndarray:
    """Return fits of noise, some tenths of a second each, at moments that follow nothing."""
    told = np.zeros((len(t), LEGS))
    for moment in random.uniform(1.0, t[-1] - 1.0, int(values['number'])):
        shape = np.exp(-0.5 * ((t - moment) / values['length']) ** 2)
        told += shape[:, None] * values['torque'] * random.standard_normal((len(t), LEGS))
    return told


BURSTS = Outside(
    'bursts', (),
    lambda random, _known, joints: {
        'torque': _some(random, joints, 1.0, 4.0), 'number': int(random.integers(3, 9)),
        'length': random.uniform(0.03, 0.2)},
    tells=_bursts)

OUTSIDE: dict[str, Outside] = {cause.name: cause for cause in (
    BOUC_WEN, TIGHT_SPOT, FRICTION_WAVE, HEIGHT_FRICTION, CONTACT, CREEP_HOSE, SLIP, TETHER,
    SUPPLY_SAG, GAIN_DRIFT, DEAD_BAND, SLEW, CROSS_TALK, HUM, BURSTS)}
"""Beside one effect of the library or alone."""
