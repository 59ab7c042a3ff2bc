"""What physics forbids base parameters to be, as constraints on an estimate."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_dynamics.base_terms import BASE_TERMS
from par4_dynamics.model_file import RigidBody
from par4_identification.estimators.consistent import Constraint
from par4_identification.estimators.problem import Label
from par4_kinematics.robot import Axis, Robot


def physical_constraints(labels: Sequence[Label], machine: Robot | Axis, rigid_body: RigidBody
                         ) -> list[Constraint]:
    """Return the constraints on values with these labels.

    No mass, inertia or friction is negative. With rods and bars distributed (`full`) this holds
    for the bodies behind the base parameters: m_1 = m_1' - m_3 - 2 m_5, m_2 = m_2' - m_3 - 2 m_5,
    i_a + i_m = i_act - m_5 L^2, with the arm L of the leg that a value is of, or the longest arm
    where all legs share it.
    """
    held: dict[str, tuple[str, tuple[float, ...]]] = {
        term.name: (term.name, (0.0,)) for term in BASE_TERMS if term.nonnegative}
    if rigid_body == 'full' and isinstance(machine, Robot):
        rod, bar = machine.bodies.rod_mass, machine.bodies.bar_mass
        held.update({
            'actuator_inertia': ('motor_and_arm_inertia', tuple(
                (rod * np.array(machine.geometry.arm_lengths) ** 2).tolist())),
            'platform_mass_1': ('half_plate_1_mass', (bar + 2.0 * rod,)),
            'platform_mass_2': ('half_plate_2_mass', (bar + 2.0 * rod,))})
    unit = np.eye(len(labels))
    constraints = []
    for index, label in enumerate(labels):
        if label.name in held:
            name, bounds = held[label.name]
            lower = (max(bounds) if label.output is None or len(bounds) == 1
                     else bounds[label.output])
            joint = '' if label.output is None else f'[{label.output}]'
            constraints.append(Constraint(name + joint, unit[index], lower))
    return constraints
