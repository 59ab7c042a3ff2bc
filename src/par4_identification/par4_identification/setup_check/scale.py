"""All torques too large or too small by one factor.

(20) is homogeneous: a factor of all torques is one of all base parameters, and no motion tells it.
What tells it are numbers from elsewhere: the torque limit of the drives, how hard their loops
answer a count, masses that the platform cannot go below, or a model that is known of this machine.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from par4_dynamics.base_terms import BASE_TERMS, FRICTION, INERTIA, PLATFORM_MASSES
from par4_dynamics.model import Model
from par4_identification.setup_check.drive_answer import answer_of
from par4_identification.setup_check.equations import Equations, equations_of, stretches_of
from par4_identification.setup_check.finding import Finding, SetupCheck
from par4_kinematics.errors import UnreachableError
from par4_kinematics.robot import Robot
from par4_sim.report.outcome import Remark, note
from par4_sim.report.words import listed, number, percent

BEYOND_LIMIT = 1.1
"""Ratio of the largest usual torque to the limit of the drives that no measurement allows."""
TOO_LIGHT = 0.8
"""Part of the mass of rods, bars and tool below which a platform cannot weigh."""
SMALLEST = 1.15
"""Smallest common factor of all torques that is taken for a mistake of the setup."""
ALIKE, FRICTION_ALIKE = 0.12, 0.4
"""A factor is common to all torques if the logarithms of those of inertia and of masses differ
by no more than the first number, and that of friction from their mean by no more than the second
times that mean: a payload changes masses alone, warmth friction alone, and a lag hides friction."""
NEAR_GAIN = 0.08
"""Deviation, in logarithm, within which a common factor is taken for the gain of the drives or
for a thousand: then the torques are in a wrong unit."""
THOUSAND = 1e3
NAMES = tuple(term.name for term in BASE_TERMS)
"""Of the base parameters, in the order of their columns."""
UNSEEN = note(
    'Whether all torques are too large or too small by one factor cannot be seen in these '
    'data: every parameter would be so by the same factor.',
    'To tell whether all torques are scaled alike, give a model of this machine (--model) or, to '
    'par4_identify, bags with and without a known payload (--payload).')


def scale_findings(check: SetupCheck, model: Model | None) -> SetupCheck:
    """Return the check with a common factor of all torques found, if anything tells it."""
    machine = check.machine
    if not isinstance(machine, Robot):
        return check
    stretches = stretches_of(check.logs)
    try:
        rows = equations_of(stretches, machine.geometry) if stretches else None
    except UnreachableError:
        rows = None
    if rows is None or not rows.valid.any():
        return check
    values = _plain_values(rows)
    if model is not None:
        return _against_model(check, machine, values, model, rows)
    check = check.remarking(UNSEEN)
    gain = float(np.exp(np.mean(np.log(machine.drives.gain))))
    largest = max(float(np.quantile(np.abs(log.tau), 0.9995)) for log in check.logs)
    limit = machine.drives.torque_limit
    bodies = machine.bodies
    least = 4.0 * bodies.rod_mass + 2.0 * bodies.bar_mass + bodies.tool_mass
    platform = _platform_mass(values)
    joints = tuple(range(rows.tau.shape[1]))
    given = 'torque_limit' in machine.drives.model_fields_set
    if largest > BEYOND_LIMIT * limit and not given:
        check = check.remarking(Remark(
            False, f'Torques reach {number(largest, 3)} N m. The robot file gives no '
            f'drives.torque_limit to hold them against; the drives of the reference robot give '
            f'{number(limit, 3)} N m.', 'Write drives.torque_limit into the robot file.'))
    elif largest > BEYOND_LIMIT * limit:
        return check.after([Finding(
            'wrong_unit', joints, None,
            f'torques reach {number(largest, 3)} N m, the drives of the robot file at most '
            f'{number(limit, 3)} N m; {_smaller(largest, limit, gain)}',
            'If amplifier_voltage carries N m, write volts into it or set drives.gain to 1; if '
            'effort carries mN m, write N m into it; else check drives.gain and '
            'drives.torque_limit of the robot file.', False, True)])
    answer = answer_of(check.logs, machine.drives)
    told = '' if answer is None else (
        f'the drives answer a step of their encoders by {number(answer.measured, 2)} N m/rad, '
        f'velocity_gain x position_gain of the robot file are {number(answer.expected, 2)} N m/rad')
    if answer is not None and answer.scaled_by(gain) and platform > TOO_LIGHT * least * gain:
        return check.after([Finding(
            'wrong_unit', joints, None,
            f'{told}; divided by the gain of {number(gain, 3)} N m/V the answer would be '
            f'{number(answer.measured / gain, 2)} N m/rad, and the platform '
            f'{number(platform / gain, 2)} kg instead of {number(platform, 2)} kg',
            'If amplifier_voltage carries N m, write volts into it or set drives.gain to 1; else '
            'check drives.gain, velocity_gain and position_gain of the robot file.', False, True)])
    light = 0.0 < platform < TOO_LIGHT * least
    if light or (answer is not None and answer.scaled_by(1.0 / gain)):
        why = (f'the platform would weigh {number(platform, 2)} kg, its rods, bars and tool alone '
               f'weigh {number(least, 2)} kg in the robot file' if light else told)
        return check.after([Finding(
            'wrong_unit', joints, None,
            f'{why}; multiplied by the gain of {number(gain, 3)} N m/V the platform would be '
            f'{number(platform * gain, 2)} kg',
            'If the effort of joint_states carries volts, write N m into it, or publish the volts '
            'as amplifier_voltage; else check drives.gain and bodies of the robot file.', False,
            True)])
    return check


def _smaller(largest: float, limit: float, gain: float) -> str:
    """Return which unit's mistake would make torques what the drives can give, in words."""
    if largest > BEYOND_LIMIT * limit * gain:
        return f'as mN m they would be {number(1e-3 * largest, 3)} N m'
    return f'divided by the gain of {number(gain, 3)} N m/V they would reach ' \
           f'{number(largest / gain, 3)} N m'


def _plain_values(rows: Equations) -> dict[str, float]:
    """Return the base parameters that explain the torque best, nothing taken out, by name."""
    columns, target = rows.columns[rows.valid], rows.tau[rows.valid]
    values = np.linalg.lstsq(columns, target, rcond=1e-10)[0]
    return dict(zip(NAMES, values.tolist(), strict=True))


def _platform_mass(values: Mapping[str, float]) -> float:
    return sum(values[name] for name in PLATFORM_MASSES)


def _against_model(check: SetupCheck, robot: Robot, values: Mapping[str, float],
                   model: Model, rows: Equations) -> SetupCheck:
    """Return the check with the factor by which all parameters differ from those of a model."""
    known = {name: float(np.mean(model.values[name])) for name in NAMES}
    coulomb, viscous = FRICTION
    speed = float(np.median(np.abs(rows.columns[..., NAMES.index(viscous)][rows.valid])))
    sizes = np.array([(part[INERTIA], _platform_mass(part), part[coulomb] + speed * part[viscous])
                      for part in (values, known)])
    if (sizes <= 0.0).any():
        return check
    inertia, mass, friction = ratio = np.log(sizes[0] / sizes[1]).tolist()
    factor = 0.5 * (inertia + mass)
    if (abs(factor) < math.log(SMALLEST) or abs(inertia - mass) > ALIKE
            or abs(friction - factor) > max(ALIKE, FRICTION_ALIKE * abs(factor))):
        return check
    joints = tuple(range(rows.tau.shape[1]))
    gains = np.asarray(robot.drives.gain, dtype=float)
    gain = float(np.mean(np.log(gains)))
    factors = listed([number(float(np.exp(part)), 3) for part in ratio])
    told = f'inertia, masses and friction come out {factors} times those of the model'
    for sign, mend in ((1.0, 'Write volts, not N m, into amplifier_voltage, or set drives.gain of '
                             'the robot file to 1.'),
                       (-1.0, 'Write N m, not volts, into the effort of joint_states, or publish '
                              'the volts as amplifier_voltage.')):
        if abs(factor - sign * gain) < NEAR_GAIN:
            scale = gains ** -sign
            unit = 'N m where volts belong' if sign > 0 else 'volts where N m belong'
            return check.after([Finding(
                'wrong_unit', joints, None,
                f'{told}, which is the gain of the drives{"" if sign > 0 else ", inverted"}: the '
                f'log carries {unit}', mend, True)],
                [replace(log, tau=log.tau * scale) for log in check.logs])
    for sign, unit in ((1.0, 'mN m'), (-1.0, 'kN m')):
        if abs(factor - sign * math.log(THOUSAND)) < NEAR_GAIN:
            return check.after([Finding(
                'wrong_unit', joints, None,
                f'{told}: the log carries {unit} where N m belong',
                'Write N m into the effort of joint_states, or check the unit of drives.gain of '
                'the robot file.', True)],
                [replace(log, tau=log.tau * THOUSAND ** -sign) for log in check.logs])
    common = float(np.exp(factor))
    return check.after([Finding(
        'common_gain', joints, None,
        f'{told}: all torques are recorded {number(common, 3)} times too large '
        f'(+- {percent(abs(inertia - mass) / 2.0)})' if common > 1.0 else
        f'{told}: all torques are recorded too small by the factor {number(common, 3)} '
        f'(+- {percent(abs(inertia - mass) / 2.0)})',
        f'Divide drives.gain of the robot file by {number(common, 4)}, or check the scale of the '
        'torque where it is recorded.', True)],
        [replace(log, tau=log.tau / common) for log in check.logs])
