"""Four free inertias behind the interface of a plant: what their drives do can be told by hand."""

from __future__ import annotations

import numpy as np

from par4_kinematics.robot import Robot
from par4_sim.closed_loop.simulation import Simulation
from par4_sim.machines.amplifier import Amplifier
from par4_sim.machines.noise import Noise
from par4_sim.machines.sensors import Sensors
from robots import REFERENCE


class Flywheels:
    """J qdd = tau on each joint, integrated exactly under held torques; implements `Plant`."""

    def __init__(self, inertia=1.0, dt: float = 0.25e-3, start=0.0) -> None:
        self.dt, self.velocity_offset, self.torque_offset = dt, 0.0, 0.5 * dt
        self.inertia = np.broadcast_to(inertia, (4,)).astype(float)
        self.start = np.broadcast_to(start, (4,)).astype(float)
        self.applied: list[np.ndarray] = []
        self.reset(None)

    def reset(self, x) -> None:  # noqa: ARG002
        self.q, self.qd, self.time = self.start.copy(), np.zeros(4), 0.0
        self.x = self.xd = np.zeros(4)
        self.applied.clear()

    def step(self, tau) -> None:
        tau = np.array(tau, dtype=float)
        self.applied.append(tau)
        rate = tau / self.inertia
        self.q = self.q + self.dt * self.qd + 0.5 * self.dt ** 2 * rate
        self.qd = self.qd + self.dt * rate
        self.time += self.dt

    def loop_opening(self) -> float:
        return 0.0

    def close(self) -> None:
        pass


def spinning(plant=None, robot: Robot = REFERENCE, amplifier: Amplifier | None = None,
             sensors: Sensors | None = None, noise: Noise | None = None, seed: int = 0,
             torque_limit: float = 1000.0) -> Simulation:
    """Return drives that turn flywheels."""
    return Simulation(robot, plant or Flywheels(), 1e-3, torque_limit, np.zeros(4),
                      amplifier or Amplifier(), sensors or Sensors(), noise or Noise(), seed)


def wave(t, rates=(5.0, 7.0, 9.0, 11.0), size=0.5):
    """Return q, qd, qdd (n, 4) that oscillate from rest, each joint at its rate, rad/s."""
    angle = np.outer(t, rates)
    rates = np.asarray(rates)
    return (size * (1.0 - np.cos(angle)), size * rates * np.sin(angle),
            size * rates ** 2 * np.cos(angle))


def played(simulation: Simulation, periods: int = 600, rest: float = 0.05, **options) -> dict:
    """Return what `periods` samples tell while the wave is the reference, by name."""
    t = np.arange(0.0, 1e-3 * periods + 1.0, 1e-3)
    simulation.queue_reference(rest + t, *wave(t, **options))
    samples = [simulation.next_sample() for _ in range(periods)]
    return {name: np.array([getattr(sample, name) for sample in samples])
            for name in ('time_ns', 'q', 'qd', 'effort', 'voltage', 'true_torque')}
