"""Scales of a linear axis for the diagnosis, whose own ones are those of joints in radians.

A joint's cogging returns after a turn of 2 pi rad; that of a screw after millimetres of travel.
"""

from __future__ import annotations

import numpy as np

from own_recipe import CONDITIONING
from par4_dynamics import Effect
from par4_dynamics.effects.cogging import Cogging
from par4_dynamics.effects.torque_ripple import TorqueRipple
from par4_identification import LIBRARY, Diagnosis, diagnose
from recording import Recording

SHORTEST = 1e-3
"""m: the shortest period searched, that which slow motion at 40 mm/s passes at 40 Hz."""
SPACING = 10.0
"""Periods per 2 pi m from one tried to the next; a travel of 0.3 m resolves twice as much."""


def periods(travel: float) -> np.ndarray:
    """Return the periods per 2 pi m worth trying: two thirds of the travel down to `SHORTEST`."""
    return np.arange(1.5 * 2.0 * np.pi / travel, 2.0 * np.pi / SHORTEST, SPACING)


class _PerTravel:
    """Periods of a screw in place of those of a joint."""

    def shapes(self, state):
        return tuple({'periods': float(number)} for number in periods(float(np.ptp(state.q))))


class CoggingOfScrew(_PerTravel, Cogging):
    """`cogging` of a linear axis."""


class RippleOfScrew(_PerTravel, TorqueRipple):
    """`torque_ripple` of a linear axis."""


AXIS_LIBRARY: dict[str, Effect] = {**LIBRARY, 'cogging': CoggingOfScrew(),
                                   'torque_ripple': RippleOfScrew()}


def diagnosis_of_axis(recording: Recording) -> Diagnosis:
    """Return what the base model gets wrong about the axis; every effect may be named."""
    return diagnose([recording.log], recording.axis, library=AXIS_LIBRARY,
                    conditioning=CONDITIONING)
