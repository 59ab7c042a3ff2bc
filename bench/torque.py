"""Speed of kinematics and inverse dynamics, Pinocchio's beside it; prints a table.

Pinocchio (`pip install pin`) is needed for nothing else in the project.
"""

from __future__ import annotations

import platform
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable

import numpy as np
from comparison import package_to_compare
from rich.console import Console
from rich.table import Table

from par4_dynamics.base_terms import base_columns
from par4_dynamics.model import Model
from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_joints, state_of_platform
from par4_kinematics.acceleration import joint_motion
from par4_kinematics.errors import InputError
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.interface import BASE_FRAME
from par4_kinematics.robot import Robot, read_robot
from par4_sim.description.chains import chains

TIMINGS = 7
"""Runs of which the fastest counts, against what else the computer does."""
CALLS = 2000
"""Of one sample in one run."""


def processor_time(work: Callable[[], object]) -> float:
    """Return the processor time of the fastest run of `work`, s; nothing here uses two cores."""
    work()
    spent = []
    for _ in range(TIMINGS):
        begin = time.process_time()
        work()
        spent.append(time.process_time() - begin)
    return min(spent)


def time_of_one(call: Callable[..., object], samples: list[tuple]) -> float:
    """Return the processor time of one call, s, each with the next of some samples."""
    def many() -> None:
        for sample in samples:
            call(*sample)

    return processor_time(many) / len(samples)


# ------------------------------------------------------------------------- Pinocchio

PINOCCHIO_CALL = "Pinocchio's rnea, one sample from Python"


def open_tree(robot: Robot, model: Model) -> object:
    """Return pinocchio's model of arms, rods, half plates and bars with the loops cut."""
    pinocchio = package_to_compare('pinocchio', 'pin')
    tree = pinocchio.Model()
    mechanism = chains(robot.geometry, model.lumped_bodies(), 'accurate')
    for name, urdf in (mechanism.fixed | mechanism.floating).items():
        chain = ElementTree.fromstring(urdf)
        joints = {joint.find('child').get('link'): joint for joint in chain.iter('joint')}
        numbers = {BASE_FRAME: 0}
        for link in chain.iter('link'):
            key = link.get('name')
            if key == BASE_FRAME:
                continue
            joint = joints.get(key)
            if joint is None:
                kind, parent, origin = pinocchio.JointModelFreeFlyer(), 0, np.zeros(3)
            else:
                kind = (pinocchio.JointModelSpherical() if joint.get('type') == 'spherical' else
                        pinocchio.JointModelRevoluteUnaligned(
                            _vector(joint.find('axis').get('xyz'))))
                parent = numbers[joint.find('parent').get('link')]
                origin = _vector(joint.find('origin').get('xyz'))
            numbers[key] = tree.addJoint(parent, kind, pinocchio.SE3(np.eye(3), origin),
                                         f'{name}/{key}')
            inertial, inertia = link.find('inertial'), link.find('inertial/inertia')
            tree.appendBodyToJoint(numbers[key], pinocchio.Inertia(
                float(inertial.find('mass').get('value')),
                _vector(inertial.find('origin').get('xyz')),
                np.diag([float(inertia.get(entry)) for entry in ('ixx', 'iyy', 'izz')])),
                pinocchio.SE3.Identity())
    return tree


def _vector(numbers: str) -> np.ndarray:
    return np.array([float(number) for number in numbers.split()])


def _add_pinocchio(robot: Robot, model: Model, table: Table) -> None:
    try:
        pinocchio = package_to_compare('pinocchio', 'pin')
    except InputError as error:
        table.add_row(PINOCCHIO_CALL, str(error))
        return
    tree = open_tree(robot, model)
    data, random = tree.createData(), np.random.default_rng(1)
    samples = [(tree, data, pinocchio.integrate(tree, pinocchio.neutral(tree), step), speed, change)
               for step, speed, change in random.normal(size=(CALLS, 3, tree.nv))]
    spent = time_of_one(pinocchio.rnea, samples)
    table.add_row(f'{PINOCCHIO_CALL}, open tree of the same bodies ({tree.nv} freedoms)',
                  f'{1e6 * spent:.2f} us')


# ------------------------------------------------------------------------- the table


def add_torque(robot: Robot, table: Table) -> None:
    """Add what, measured and, if there is one, target: processor time on one core."""
    motion = excitation_motion(robot, duration=30.0, seed=1)
    model = read_model('table1_full', robot)
    geometry, count = robot.geometry, len(motion.t)
    platform_state = (motion.t, motion.x, motion.xd, motion.xdd)
    joints_state = (motion.t, motion.q, motion.qd, motion.qdd)
    state = state_of_platform(geometry, *platform_state)
    for name, work, target in (
            ('joint motion from platform motion',
             lambda: joint_motion(geometry, *platform_state[1:]), ''),
            ('torque from platform motion',
             lambda: model.torque(state_of_platform(geometry, *platform_state)), '8'),
            ('torque from joint motion, forward kinematics included',
             lambda: model.torque(state_of_joints(geometry, *joints_state)), '2'),
            ('torque of a known state', lambda: model.torque(state), ''),
            ('regressor', lambda: base_columns(state), '4')):
        table.add_row(name, f'{count / processor_time(work) / 1e6:.1f} million samples/s', target)
    for name, call, parts in (
            ('torque of platform motion', model.torque_of_platform, platform_state[1:]),
            ('torque of joint motion', model.torque_of_joints, joints_state[1:])):
        rows = zip(*(part[::count // CALLS] for part in parts), strict=True)
        samples = [(geometry, *row) for row in rows]
        table.add_row(f'{name}, one sample from Python, checked',
                      f'{1e6 * time_of_one(call, samples):.2f} us', '5')
    _add_pinocchio(robot, model, table)


def main() -> None:
    """Print the table."""
    table = Table('what', 'measured', 'target',
                  title=f'{platform.machine()}, Python {platform.python_version()}')
    add_torque(read_robot('reference'), table)
    Console(width=120).print(table)


if __name__ == '__main__':
    main()
