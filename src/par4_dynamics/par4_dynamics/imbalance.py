"""The torque of a mass that the tool carries beside its axis.

A belt or a gear turns the tool by k theta (`Geometry.rotation_amplification`). A mass m of the tool
is beside the axis by b = R(k theta) s, s where it is at theta = 0; b' = z x b. The part of its
kinetic energy that is linear in m s, m v . db/dt with v the velocity of D, asks for the force
m d2b/dt2 = m (k theta'' b' - (k theta')^2 b) at D and for the moment m k a . b' about theta, a the
acceleration of D (Lagrange). The axis is vertical, so that gravity asks for nothing.
"""

from __future__ import annotations

import numpy as np

from par4_dynamics.state import State


def imbalance_columns(state: State) -> np.ndarray:
    """Return the torque (n, J, 2), N m, of a first moment m s of 1 kg m along x and along y.

    Raises:
        TypeError: a single axis has no tool.
    """
    platform = state.platform
    ratio = platform.geometry.rotation_amplification
    turn, rate, change = (ratio * part[:, 3] for part in (platform.x, platform.xd, platform.xdd))
    along = np.stack((np.cos(turn), np.sin(turn)), axis=1)
    across = np.stack((-along[:, 1], along[:, 0]), axis=1)
    columns = []
    for beside, ahead in ((along, across), (across, -along)):
        force = change[:, None] * ahead - rate[:, None] ** 2 * beside
        moment = ratio * np.sum(platform.xdd[:, :2] * ahead, axis=1)
        columns.append(state.torque_of_force(np.column_stack(
            (force, np.zeros(len(force)), moment))))
    return np.stack(columns, axis=-1)
