"""Simulated axes like those that others measured: a motor that a controller turns, with cogging.

The plant is stepped in time with its own physics and its own sums of sines; nothing of the
effects of the library is used.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from par4_identification.logs.log import Log
from par4_kinematics.robot import Axis

STEP = 5e-4
ASPERITIES = 600


def axis(**facts):
    """Return an axis that turns, with facts of its nameplate."""
    return Axis.model_validate({'schema': 'par4/axis/1', 'name': 'axis', 'joint': 'motor',
                                'kind': 'revolute', 'gain': 1.0, **facts})


def there_and_back(t):
    """Return positions that go slowly over a turn and back."""
    return 1.02 * np.pi * (1.0 - np.cos(2.0 * np.pi * t / 24.0))


@dataclass(frozen=True)
class Motor:
    """A motor in SI units.

    Attributes:
        inertia, coulomb, viscous: of the rotor, kg m2, N m, N m s/rad.
        lines: order -> amplitude and phase of the cogging, N m and rad.
        hanging: weight times lever, N m; zero angle hangs down.
        held: what else holds the motor where it stands, N m: a spring, a magnet.
        by_load: friction that the load adds, over the torque of weight and inertia.
    """

    inertia: float
    coulomb: float
    viscous: float
    lines: dict[int, tuple[float, float]] = field(default_factory=dict)
    hanging: float = 0.0
    held: Callable[[float], float] = lambda _q: 0.0
    by_load: float = 0.0

    def cogging(self, q):
        """Return the torque that the motor needs against its cogging, N m."""
        return sum((size * np.sin(order * q + phase)
                    for order, (size, phase) in self.lines.items()), np.zeros_like(q))


def recorded(motor: Motor, reference, duration: float, rate: float, counts: int = 20000,
             noise: float = 1e-5, seed: int = 0, stiffness: float | None = None) -> Log:
    """Return the log of a motor under position and speed control along `reference(t)`.

    Args:
        motor: the plant.
        reference: position asked for at a time, rad.
        duration: s.
        rate: of the samples, Hz.
        counts: of the encoder, a turn.
        noise: of the torque, rms, N m.
        seed: of the noise.
        stiffness: of the loop, rad/s; how fast it follows.
    """
    loop = 60.0 if stiffness is None else stiffness
    position_gain, speed_gain = motor.inertia * loop ** 2, 2.0 * motor.inertia * loop
    lines = [(float(order), *line) for order, line in motor.lines.items()]
    t = STEP * np.arange(round(duration / STEP))
    asked = reference(t)
    speed = np.gradient(asked, STEP)
    acceleration = np.gradient(speed, STEP)
    q, qd = float(asked[0]), float(speed[0])
    positions, torques = np.empty_like(t), np.empty_like(t)
    # numbers of Python: for a single one numpy takes several times as long
    for index, (asked_q, asked_qd, asked_qdd) in enumerate(zip(
            asked.tolist(), speed.tolist(), acceleration.tolist())):
        weight = motor.hanging * math.sin(q)
        coulomb = motor.coulomb + motor.by_load * abs(weight + motor.inertia * asked_qdd)
        load = (sum(size * math.sin(order * q + phase) for order, size, phase in lines) + weight
                + motor.held(q) + motor.viscous * qd + coulomb * math.tanh(qd / 1e-3))
        # the loop has an observer of the load, as slow loops of real drives have an integral part
        torque = (load + motor.inertia * asked_qdd
                  + position_gain * (asked_q - q) + speed_gain * (asked_qd - qd))
        positions[index], torques[index] = q, torque
        qd += STEP * (torque - load) / motor.inertia
        q += STEP * qd
    every = round(1.0 / (rate * STEP))
    random = np.random.default_rng(seed)
    t, q, tau = t[::every], positions[::every], torques[::every]
    q = np.round(q * counts / (2.0 * np.pi)) * (2.0 * np.pi / counts)
    tau = tau + noise * random.standard_normal(len(tau))
    return Log(f'axis {seed}', ('motor',), 1, every * STEP, t, q[:, None], tau[:, None],
               (slice(0, len(t)),), None, None)


def held_speeds(friction: Callable[[float], float], speeds: Sequence[float], noise: float,
                seed: int = 0) -> list[Log]:
    """Return logs of a drive that holds one speed each and averages its torque over a sample.

    Slow speeds are sampled slowly, as such drives do. The speed hunts a little around what was
    asked.

    Args:
        friction: torque at a speed, N m.
        speeds: rad/s.
        noise: of a sample of the torque, rms, N m; half of it lasts for a second.
        seed: of noise and hunting.
    """
    random, logs = np.random.default_rng(seed), []
    for number, speed in enumerate(speeds):
        period = float(np.clip(0.1 / abs(speed), 0.0064, 0.256))
        t = period * np.arange(400)
        hunting = 0.02 * speed * np.sin(2.0 * np.pi * 1.3 * t + random.uniform(0.0, 6.0))
        q = np.cumsum(period * (speed + hunting))
        q = np.round(q * 20000 / (2.0 * np.pi)) * (2.0 * np.pi / 20000)
        kernel = np.ones(max(1, round(1.0 / period)))
        slow = np.convolve(random.standard_normal(len(t)), kernel / np.sqrt(len(kernel)), 'same')
        tau = friction(speed) + noise * (random.standard_normal(len(t)) + slow) / np.sqrt(2.0)
        logs.append(Log(f'speed {number}', ('motor',), 1, period, t, q[:, None], tau[:, None],
                        (slice(0, len(t)),), None, None))
    return logs


def built_up(q: np.ndarray, distance: float) -> np.ndarray:
    """Return the share -1 .. 1 of dry friction along positions (n,) of a rough contact.

    Its asperities are `ASPERITIES` springs alike, each of which slips at a deflection of its own.
    These are spread so that a contact that has slipped as a whole and turns over has lost the share
    1 - exp(-x / distance) of twice its friction after a way x. Without a distance it is the sign.
    """
    steps = np.diff(q, prepend=2.0 * q[0] - q[1])
    if not distance:
        return np.sign(steps)
    limits = -0.5 * distance * np.log1p(-(np.arange(ASPERITIES) + 0.5) / ASPERITIES)
    bent, forces = np.zeros(ASPERITIES), np.empty(len(q))
    for row, step in enumerate(steps.tolist()):
        bent = np.minimum(np.maximum(bent + step, -limits), limits)
        forces[row] = bent.sum()
    return forces / limits.sum()
