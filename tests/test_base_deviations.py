"""Deviations of the base parameters beside causes hold, also where a law is only nearly right."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from axes import axis
from foreign import COULOMB, INERTIA, VISCOUS, log_of, swings, torque_of

from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.signals.scales import conditioning_for

TRUE = np.array([INERTIA, COULOMB, VISCOUS])


def found_in(torque, seed, fastest=3.0):
    """Return the diagnosis of an axis whose drive needs `torque` (n,) of its motion beside."""
    t, q, qd, qdd = swings(40.0, fastest=fastest, seed=seed)
    needed = torque_of(qd, qdd) + 0.02 * np.random.default_rng(seed).standard_normal(len(t))
    log = log_of(t, q, torque(needed))
    return diagnose([log], axis(), conditioning=conditioning_for([log], axis(), CONDITIONING))


def pulls_of(parameters):
    """Return how far inertia and frictions are from the truth, over their deviations, (3,)."""
    told = [parameters[name] for name in ('actuator_inertia', 'coulomb_friction',
                                          'viscous_friction')]
    return (np.array([value.number for value in told]) - TRUE) / np.array(
        [value.deviation for value in told])


@pytest.mark.parametrize('seed', [21, 22, 23])
def test_deviations_beside_an_averaged_torque_hold(seed):
    """A mean over 12 ms is nearly a delay, and what it is not went into the parameters."""
    found = found_in(lambda needed: scipy.ndimage.uniform_filter1d(
        needed, 12, origin=5) + 0.8, seed)
    assert {'torque_offset', 'time_offset'} >= {cause.effect.name for cause in found.causes}
    assert found.causes
    assert np.abs(pulls_of(found.base_after)).max() < 4.0
    assert all(entry.std is not None and entry.std == found.base_after[name].std
               for name, entry in found.extended_model.parameters.items())


def test_deviations_of_a_sound_axis_are_no_larger_than_a_hundredth():
    found = found_in(lambda needed: needed, 24)
    assert found.verdict == 'clean'
    assert np.abs(pulls_of(found.base_after)).max() < 3.0
    assert max(value.deviation / value.number for value in found.base_after.values()) < 0.01
