"""Robots, models and motions that several tests use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.model import ActiveEffect, Model
from par4_dynamics.model_from_file import read_model
from par4_kinematics.robot import Robot, read_robot
from par4_kinematics.workspace import home_pose

REFERENCE = read_robot('reference')


def with_drives(**changes) -> Robot:
    """Return the reference robot with other drives."""
    return REFERENCE.model_copy(update={'drives': REFERENCE.drives.model_copy(update=changes)})


def other_robot() -> Robot:
    """Return a robot with clearly different dimensions and drives."""
    content = REFERENCE.model_dump(by_alias=True)
    content['name'] = 'other'
    content['geometry'].update(
        arm_length=0.25, forearm_length=0.6, base_radius=0.2, platform_radius=0.05,
        platform_bar_length=0.08)
    content['bodies'].update(rod_mass=0.03, bar_mass=0.02)
    content['drives'].update(gain=(9.0, 9.5, 10.0, 10.5))
    content['limits']['workspace'] = {'radius': 0.25, 'z': (-0.65, -0.42), 'theta': 0.785}
    return Robot.model_validate(content)


OTHER = other_robot()


def uneven_robot() -> Robot:
    """Return the other robot with legs of different lengths."""
    content = OTHER.model_dump(by_alias=True)
    content['name'] = 'uneven'
    content['geometry'].update(arm_length_errors=(0.004, 0.0, -0.003, 0.002),
                               forearm_length_errors=(0.0, -0.005, 0.003, 0.004))
    return Robot.model_validate(content)


UNEVEN = uneven_robot()


def model_with(model: Model, name: str, joints: tuple[int, ...] = (0, 1, 2, 3), **values) -> Model:
    """Return the model with an effect added; values are numbers, one a joint, or vectors."""
    parameters = CATALOGUE[name].parameters
    sizes = {parameter.name: parameter.size if parameter.size > 1 else 4
             for parameter in parameters}
    full = {key: np.broadcast_to(np.asarray(value, dtype=float), (sizes[key],)).copy()
            for key, value in values.items()}
    for parameter in parameters:
        if isinstance(parameter.default, str):
            full.setdefault(parameter.name, full[parameter.default])
        elif parameter.default is not None:
            full.setdefault(parameter.name, np.full(4, float(parameter.default)))
    return replace(model, effects=(*model.effects, ActiveEffect(CATALOGUE[name], joints, full)))


def without_coulomb(model: Model) -> Model:
    """Return the model without Coulomb friction, the torque of which has no jumps."""
    return replace(model, values={**model.values, 'coulomb_friction': np.zeros(4)})


def other_model() -> Model:
    """Return a model for the other robot, of bodies and friction unlike TABLE 1's."""
    table = read_model('table1', OTHER)
    values = {'actuator_inertia': 0.05, 'platform_mass_1': 0.5, 'platform_mass_2': 0.65,
              'arm_gravity': 0.8, 'coulomb_friction': 1.1, 'viscous_friction': 0.7}
    return replace(table, values={name: np.full(4, value) for name, value in values.items()})


def random_poses(robot: Robot, count: int, seed: int, share: float = 0.9) -> np.ndarray:
    """Return poses (count, 4) in the workspace cylinder of the robot."""
    random = np.random.default_rng(seed)
    space = robot.limits.workspace
    radius = share * space.radius * np.sqrt(random.uniform(size=count))
    azimuth = random.uniform(-np.pi, np.pi, count)
    return np.stack((radius * np.cos(azimuth), radius * np.sin(azimuth),
                     random.uniform(*space.z, count),
                     share * random.uniform(-space.theta, space.theta, count)), axis=1)


def growing_waves(robot: Robot, t: np.ndarray, end: float
                  ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, xd, xdd (n, 4) of waves that grow with (t / end)^4 from rest at home."""
    middle = home_pose(robot)
    size = np.array((0.06, 0.05, 0.04, 0.4)) / end ** 4
    rate = 2.0 * np.pi * np.array((6.0, 5.0, 4.0, 7.0))
    t = np.asarray(t)[:, None]
    fade, fade_d, fade_dd = t ** 4, 4.0 * t ** 3, 12.0 * t ** 2
    wave, wave_d = np.sin(rate * t), rate * np.cos(rate * t)
    return (middle + size * fade * wave, size * (fade_d * wave + fade * wave_d),
            size * (fade_dd * wave + 2.0 * fade_d * wave_d - fade * rate ** 2 * wave))
