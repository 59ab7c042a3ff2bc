"""Accuracy and speed of the simulated mechanisms, MuJoCo beside them; prints a table.

Every plant runs the same motion in the same loop: one torque command a step, from Python.
`python bench/plants.py`; MuJoCo (`pip install mujoco`) is needed for nothing else in the project.
"""

from __future__ import annotations

import platform
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from comparison import package_to_compare
from numpy.typing import ArrayLike
from rich.console import Console
from rich.table import Table

from par4_dynamics.mechanism import kinetic_energy, potential_energy
from par4_dynamics.model import Model
from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import GRAVITY, state_of_joints
from par4_kinematics.adept import adept_motion
from par4_kinematics.arrays import as_rows
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.interface import BASE_FRAME
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot, read_robot
from par4_sim.choices import STEP
from par4_sim.closed_loop.simulation import build_plant
from par4_sim.description.chains import (
    PLATE_CHAINS,
    chains,
    leg_chain,
    link_positions,
)
from par4_sim.drives.drive import DriveLoops
from par4_sim.machines.friction import Friction
from par4_sim.machines.machine import Machine
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.plants.exact import ExactPlant
from par4_sim.plants.plant import Plant

ROUND_TRIP = 0.25
"""s"""
THETA_SWING = 0.5 * np.pi
"""rad: theta over +-45 degrees"""
JERK = 30_000.0
"""m/s3; a torque that jumps would be told from the motion around it only by a guess."""
CYCLES = 4
FREE_TIME = 0.3
"""s that the free mechanism swings."""
FREE_POSE = (0.1, 0.05, -0.7, 0.3)
FINE_STEP = 0.05e-3
"""s, of the exact plant that free swings are held against."""
NOTHING = np.zeros(LEGS)
SMALL_STEP, LARGE_STEP = 0.1e-3, 1e-3
"""s"""
FINE = 'exact in eight inner steps'
ENERGY_TARGETS = {'exact': '0.01 %', 'accurate': '0.01 %'}
TORQUE_TARGETS = {('exact', LARGE_STEP): '0.01 %', ('accurate', STEP): '0.1 %',
                  ('fast', STEP): '0.2 %'}
OPENING_TARGETS = {('accurate', STEP): '5 um'}
PACE_TARGETS = {('fast', STEP): '3'}
Builder = Callable[[str, float], Plant]
"""(fidelity or 'mujoco', physics step s) -> plant."""
OPENING_STRIDE = 20
"""Steps from one look at the loops to the next."""
TIMINGS = 5
"""Runs of which the fastest counts, against what else the computer does."""

# ---------------------------------------------------------------------------- MuJoCo

# With its default constraint parameters the loops open by centimetres: these are the stiffest.
CLOSING_STEPS = 2.0
"""Time constant with which a loop closes, over the step; MuJoCo accepts no less."""
RIGIDITY = '0.9999 0.9999 0.001 0.5 2'
"""Impedance of the constraints; MuJoCo accepts no more."""
MUJOCO_JOINTS = {'continuous': 'hinge', 'spherical': 'ball'}


def mujoco_xml(machine: Machine, dt: float) -> str:
    """Return MJCF of the bodies that pybullet gets as 'accurate': 8 rods, 2 bars, free plates."""
    mechanism = chains(machine.geometry, machine.bodies, 'accurate')
    document = ElementTree.Element('mujoco')
    ElementTree.SubElement(document, 'option', timestep=repr(dt), integrator='RK4',
                           gravity=f'0 0 {-GRAVITY!r}')
    world = ElementTree.SubElement(document, 'worldbody')
    for name, urdf in (mechanism.fixed | mechanism.floating).items():
        links = _add_chain(world, name, ElementTree.fromstring(urdf))
        for number, closure in enumerate(mechanism.closures):
            for side, point in zip('ab', (closure.first, closure.second)):
                if point.chain == name:
                    ElementTree.SubElement(links[point.link], 'site', name=f'{side}{number}',
                                           pos=_numbers(point.position))
    equality = ElementTree.SubElement(document, 'equality')
    for number in range(len(mechanism.closures)):
        ElementTree.SubElement(
            equality, 'connect', site1=f'a{number}', site2=f'b{number}',
            solimp=RIGIDITY, solref=f'{CLOSING_STEPS * dt!r} 1')
    return ElementTree.tostring(document, encoding='unicode')


def _add_chain(world: ElementTree.Element, name: str, chain: ElementTree.Element
               ) -> dict[str, ElementTree.Element]:
    """Add the bodies of a chain's URDF; return link name -> body."""
    joints = {joint.find('child').get('link'): joint for joint in chain.iter('joint')}
    bodies = {BASE_FRAME: world}
    for link in chain.iter('link'):
        key = link.get('name')
        if key == BASE_FRAME:
            continue
        joint = joints.get(key)
        parent = bodies[joint.find('parent').get('link')] if joint is not None else world
        origin = joint.find('origin').get('xyz') if joint is not None else '0 0 0'
        body = ElementTree.SubElement(parent, 'body', name=f'{name}/{key}', pos=origin)
        inertial, inertia = link.find('inertial'), link.find('inertial/inertia')
        ElementTree.SubElement(
            body, 'inertial', pos=inertial.find('origin').get('xyz'),
            mass=inertial.find('mass').get('value'),
            diaginertia=' '.join(inertia.get(entry) for entry in ('ixx', 'iyy', 'izz')))
        if joint is None:
            ElementTree.SubElement(body, 'freejoint', name=f'{name}/{key}')
        else:
            ElementTree.SubElement(body, 'joint', name=f'{name}/{key}',
                                   type=MUJOCO_JOINTS[joint.get('type')],
                                   axis=joint.find('axis').get('xyz'))
        bodies[key] = body
    return bodies


def _numbers(values: ArrayLike) -> str:
    return ' '.join(repr(float(value)) for value in values)


class MujocoPlant:
    """The frictionless mechanism in MuJoCo, Runge-Kutta of order four; implements `Plant`."""

    def __init__(self, machine: Machine, dt: float) -> None:
        self.dt = dt
        self.velocity_offset = 0.0
        self.torque_offset = 0.5 * dt
        self._machine = machine
        self._mujoco = package_to_compare('mujoco', 'mujoco')
        self._model = self._mujoco.MjModel.from_xml_string(mujoco_xml(machine, dt))
        self._data = self._mujoco.MjData(self._model)
        arms = [self._model.joint(f'{leg_chain(leg)}/arm') for leg in range(LEGS)]
        self._positions = np.array([arm.qposadr[0] for arm in arms])
        self._velocities = np.array([arm.dofadr[0] for arm in arms])
        self._plate = self._model.joint(f'{PLATE_CHAINS[0]}/plate')
        self._bar = self._model.joint(f'{PLATE_CHAINS[0]}/bar_0')
        self._sites = np.array([[self._model.site(f'{side}{number}').id for side in 'ab']
                                for number in range(self._model.neq)])

    @property
    def time(self) -> float:
        """Seconds since the last reset."""
        return self._data.time

    @property
    def q(self) -> np.ndarray:
        """Joint positions (4,), rad."""
        return self._data.qpos[self._positions]

    @property
    def qd(self) -> np.ndarray:
        """Joint velocities (4,), rad/s."""
        return self._data.qvel[self._velocities]

    @property
    def x(self) -> np.ndarray:
        """Pose of D and theta (4,), m, rad."""
        place = self._plate.qposadr[0]
        return np.append(self._data.qpos[place:place + 3], self._data.qpos[self._bar.qposadr])

    @property
    def xd(self) -> np.ndarray:
        """Velocity of D and thetadot (4,)."""
        place = self._plate.dofadr[0]
        return np.append(self._data.qvel[place:place + 3], self._data.qvel[self._bar.dofadr])

    def reset(self, x: ArrayLike) -> None:
        """Put the machine at rest at pose x (4,); raises UnreachableError."""
        (pose,), _ = as_rows(x, 'pose x')
        self._mujoco.mj_resetData(self._model, self._data)
        positions = link_positions(self._machine.geometry, 'accurate', pose)
        for (chain, link), position in positions.items():
            start = self._model.joint(f'{chain}/{link}').qposadr[0]
            values = np.atleast_1d(position)
            if len(values) == 4:  # MuJoCo's quaternions begin with the scalar
                values = np.roll(values, 1)
            self._data.qpos[start:start + len(values)] = values

    def step(self, tau: ArrayLike) -> None:
        """Advance by dt with actuator torques tau (4,), N m, held."""
        self._data.qfrc_applied[self._velocities] = tau
        self._mujoco.mj_step(self._model, self._data)

    def loop_opening(self) -> float:
        """Return the largest distance between the two points of a cut ball joint, m."""
        self._mujoco.mj_kinematics(self._model, self._data)
        first, second = (self._data.site_xpos[sites] for sites in self._sites.T)
        return float(np.linalg.norm(first - second, axis=1).max())

    def close(self) -> None:
        """Do nothing: the engine's memory goes with the object."""


# ---------------------------------------------------------------------------- measuring


def frictionless(robot: Robot, model: Model) -> tuple[Machine, Model]:
    """Return the machine of `model` without friction and its model."""
    none = {name: np.zeros(4) for name in ('coulomb_friction', 'viscous_friction')}
    return (replace(machine_of_model(robot, model), friction=Friction()),
            replace(model, values={**model.values, **none}))


def cycles(robot: Robot, dt: float, number: int) -> Motion:
    """Return the jerk-limited Adept motion of 15 G with theta over its range."""
    return adept_motion(robot, theta_swing=THETA_SWING, jerk=JERK, round_trip=ROUND_TRIP,
                        cycles=number, period=dt)


@dataclass(frozen=True)
class Run:
    """A plant driven along a motion.

    Attributes:
        torque: applied step by step, (n, 4) N m.
        q, qd: joint readings before the steps, (n, 4) rad, rad/s.
        opening: largest loop opening seen, m.
    """

    torque: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    opening: float


def follow(plant: Plant, robot: Robot, model: Model, motion: Motion) -> Run:
    """Return the run of the plant under its drives with feedforward along the motion."""
    plant.reset(motion.x[0])
    forward = model.torque(
        state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd))
    loops = DriveLoops(robot.drives.model_copy(update={'encoder_counts': 0}), 1e6, plant.dt)
    loops.restart(forward[0])
    q, qd, applied, opening = [], [], [], 0.0
    for k, target in enumerate(np.concatenate(
        (motion.q, motion.qd, forward, motion.qdd, forward), axis=1)):
        q.append(plant.q)
        qd.append(plant.qd)
        applied.append(loops.follow(target, q[-1], qd[-1]).copy())
        plant.step(applied[-1])
        if k % OPENING_STRIDE == 0:
            opening = max(opening, plant.loop_opening())
    return Run(np.array(applied), np.array(q), np.array(qd), opening)


def torque_error(plant: Plant, robot: Robot, model: Model, run: Run) -> tuple[float, float]:
    """Return worst and rms error of the torque over its peak.

    What torque was applied in a step is held against the inverse dynamics of the motion that came
    of it. Symplectic Euler: central differences of the positions around the beginning of the step.
    A held torque: the cubic through positions and velocities at both ends, in the middle of the
    step; what is left of a perfect plant there is the curvature of its acceleration, h^2 / 24.
    """
    dt, q, qd = plant.dt, run.q, run.qd
    if plant.torque_offset > 0.0:
        applied = run.torque[:-1]
        gain, way = np.diff(qd, axis=0), np.diff(q, axis=0)
        middle = (q[:-1] + 0.5 * way - dt / 8.0 * gain,
                  1.5 * way / dt - 0.25 * (qd[1:] + qd[:-1]), gain / dt)
    else:
        applied = run.torque[1:-1]
        middle = (q[1:-1], (q[2:] - q[:-2]) / (2.0 * dt),
                  (q[2:] - 2.0 * q[1:-1] + q[:-2]) / dt ** 2)
    came = state_of_joints(robot.geometry, dt * np.arange(len(applied)), *middle)
    error = applied - model.torque(came)
    peak = np.abs(applied).max()
    return float(np.abs(error).max() / peak), float(np.sqrt(np.mean(error ** 2)) / peak)


def pace(plant: Plant, start: np.ndarray, torque: np.ndarray) -> float:
    """Return simulated over processor time for applying the torques (n, 4) once more."""
    spent = []
    for _ in range(TIMINGS):
        plant.reset(start)
        begin = time.process_time()
        for command in torque:
            plant.step(command)
        spent.append(time.process_time() - begin)
    return len(torque) * plant.dt / min(spent)


def free_swing(plant: Plant, machine: Machine) -> tuple[float, np.ndarray]:
    """Return the largest energy error over the peak kinetic energy, and the poses (n, 4)."""
    plant.reset(FREE_POSE)
    x, xd = [plant.x], [plant.xd]
    for _ in range(round(FREE_TIME / plant.dt)):
        plant.step(NOTHING)
        x.append(plant.x)
        xd.append(plant.xd)
    x, xd = np.array(x)[:-1], np.array(xd)
    xd = 0.5 * (xd[:-1] + xd[1:]) if plant.velocity_offset < 0.0 else xd[:-1]
    kinetic = kinetic_energy(machine.geometry, machine.bodies, x, xd)
    potential = potential_energy(machine.geometry, machine.bodies, x)
    error = np.abs(kinetic + potential - potential[0])[1:].max()
    return float(error / kinetic.max()), x


def resident_mib() -> float:
    """Return the memory that this process holds, MiB; Linux."""
    status = Path('/proc/self/status').read_text(encoding='ascii')
    (line,) = [line for line in status.splitlines() if line.startswith('VmRSS')]
    return int(line.split()[1]) / 1024


@dataclass(frozen=True)
class Endurance:
    """What many cycles did to a plant.

    Attributes:
        tracking: largest tracking error of the tenth and of the last cycle, rad.
        change: largest difference of joint position between these two cycles, rad.
        opening: largest loop opening in the last cycle, m.
        memory: held after a tenth of the cycles and after all, MiB.
    """

    tracking: tuple[float, float]
    change: float
    opening: float
    memory: tuple[float, float]


def endure(plant: Plant, robot: Robot, model: Model, number: int) -> Endurance:
    """Return how the plant, under drives, comes through `number` cycles."""
    motion = cycles(robot, plant.dt, 1)
    steps = round(ROUND_TRIP / plant.dt)
    forward = model.torque(
        state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd))
    targets = np.concatenate(
        (motion.q, motion.qd, forward, motion.qdd, forward), axis=1)[:steps]
    plant.reset(motion.x[0])
    loops = DriveLoops(robot.drives.model_copy(update={'encoder_counts': 0}), 1e6, plant.dt)
    loops.restart(forward[0])
    q, kept, memory, opening = np.empty((steps, LEGS)), {}, {}, 0.0
    for cycle in range(1, number + 1):
        for k, target in enumerate(targets):
            q[k] = plant.q
            plant.step(loops.follow(target, q[k], plant.qd))
            if cycle == number and k % OPENING_STRIDE == 0:
                opening = max(opening, plant.loop_opening())
        if cycle in (10, number):
            kept[cycle] = q.copy()
        if cycle in (number // 10, number):
            memory[cycle] = resident_mib()
    tracking = {cycle: float(np.abs(came - targets[:, :LEGS]).max())
                for cycle, came in kept.items()}
    return Endurance((tracking[10], tracking[number]),
                     float(np.abs(kept[number] - kept[10]).max()), opening,
                     (memory[number // 10], memory[number]))


class FinePlant(ExactPlant):
    """The exact plant with inner steps: what of a torque error is the measure's own."""

    INNER = 8

    def step(self, tau: ArrayLike) -> None:
        """Advance by dt with torques tau (4,), N m, held."""
        whole, self.dt = self.dt, self.dt / self.INNER
        for _ in range(self.INNER):
            super().step(tau)
        self.dt = whole


# ---------------------------------------------------------------------------- the table


def add_plants(robot: Robot, table: Table) -> None:
    """Add what, measured and, if there is one, target, for every plant and for MuJoCo."""
    machine, model = frictionless(robot, read_model('table1_full', robot))

    def built(fidelity: str, dt: float) -> Plant:
        if fidelity == 'mujoco':
            return MujocoPlant(machine, dt)
        if fidelity == FINE:
            return FinePlant(machine, dt)
        return build_plant(machine, fidelity, dt)

    try:
        package_to_compare('mujoco', 'mujoco')
    except InputError as error:
        table.add_row('mujoco', str(error))
        others = ()
    else:
        others = ('mujoco',)
    _add_runs(robot, model, built, others, table)
    _add_energy(machine, built, others, table)
    _add_endurance(robot, model, built, table)


def _add_runs(robot: Robot, model: Model, built: Builder, others: tuple[str, ...], table: Table
              ) -> None:
    paces = {}
    runs = [('exact', STEP), ('exact', LARGE_STEP), (FINE, LARGE_STEP), ('fast', STEP),
            ('fast', LARGE_STEP), ('accurate', STEP), ('accurate', SMALL_STEP)]
    for fidelity, dt in runs + [(other, LARGE_STEP) for other in others]:
        motion = cycles(robot, dt, CYCLES)
        plant = built(fidelity, dt)
        run = follow(plant, robot, model, motion)
        worst, rms = torque_error(plant, robot, model, run)
        paces[fidelity, dt] = pace(plant, motion.x[0], run.torque)
        plant.close()
        name = f'{fidelity}, {1e3 * dt:g} ms'
        table.add_row(f'{name}: torque error, worst (rms), of peak', f'{worst:.4%} ({rms:.4%})',
                      TORQUE_TARGETS.get((fidelity, dt), ''))
        table.add_row(f'{name}: loop opening', f'{1e6 * run.opening:.3g} um',
                      OPENING_TARGETS.get((fidelity, dt), ''))
        table.add_row(f'{name}: one torque a step from Python',
                      f'{paces[fidelity, dt]:.2f} x real time',
                      PACE_TARGETS.get((fidelity, dt), ''))
    for other in others:
        ratio = paces['exact', LARGE_STEP] / paces[other, LARGE_STEP]
        table.add_row(f'speed of exact over {other}, 1 ms', f'{ratio:.1f}', '15')


def _add_energy(machine: Machine, built: Builder, others: tuple[str, ...], table: Table) -> None:
    _, true_x = free_swing(built('exact', FINE_STEP), machine)
    runs = [('exact', LARGE_STEP), ('accurate', SMALL_STEP), ('fast', SMALL_STEP)]
    for fidelity, dt in runs + [(other, LARGE_STEP) for other in others]:
        plant = built(fidelity, dt)
        error, x = free_swing(plant, machine)
        # with a velocity of half a step ago zero, the swing began half a step ago
        first, stride = round(-plant.velocity_offset / FINE_STEP), round(dt / FINE_STEP)
        apart = np.abs(x - true_x[first::stride][:len(x)])[1:, :3].max()
        plant.close()
        name = f'{fidelity}, {1e3 * dt:g} ms: free swing'
        table.add_row(f'{name}, energy error of peak kinetic energy', f'{100 * error:.2g} %',
                      ENERGY_TARGETS.get(fidelity, ''))
        table.add_row(f'{name}, distance from exact at {1e3 * FINE_STEP:g} ms',
                      f'{1e6 * apart:.2g} um')


def _add_endurance(robot: Robot, model: Model, built: Builder, table: Table) -> None:
    for fidelity, number in (('exact', 1000), ('fast', 1000)):
        plant = built(fidelity, STEP)
        came = endure(plant, robot, model, number)
        plant.close()
        name = f'{fidelity}, {number} cycles'
        first, last = came.tracking
        table.add_row(f'{name}: tracking error, tenth, last cycle',
                      f'{1e3 * first:.4f}, {1e3 * last:.4f} mrad')
        table.add_row(f'{name}: last cycle from the tenth', f'{came.change:.1e} rad', 'no drift')
        table.add_row(f'{name}: loop opening in the last cycle', f'{1e6 * came.opening:.3g} um')
        table.add_row(f'{name}: memory after {number // 10}, {number} cycles',
                      f'{came.memory[0]:.1f}, {came.memory[1]:.1f} MiB', 'flat')


def main() -> None:
    """Print the table."""
    table = Table('what', 'measured', 'target',
                  title=f'{platform.machine()}, Python {platform.python_version()}')
    add_plants(read_robot('reference'), table)
    Console(width=120).print(table)


if __name__ == '__main__':
    main()
