"""The axis and its drive, integrated: synthetic data, and instruments for the measured ones.

Independent of the library: M dv/dt = force - Fv v - Fc sign v - offset by implicit steps, in which
dry friction stops the carriage but never drives it (Moreau's time stepping). The slope Fv may be
another one in each direction.
"""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np

from recording import Recording

SUBSTEPS = 10
"""Steps of integration a sample; the drive holds its voltage for a sample."""


@numba.njit(cache=True, error_model='numpy')
def _closed_loop(reference, values, gain, kp, kv, period, positions, voltages):
    mass, forward, backward, coulomb, offset = values
    step = period / SUBSTEPS
    q, v = reference[0], 0.0
    for row in range(len(reference)):
        voltage = kv * (kp * (reference[row] - q) - v)
        positions[row], voltages[row] = q, voltage
        for _ in range(SUBSTEPS):
            push = mass * v + step * (gain * voltage - offset)
            viscous = forward if push > 0.0 else backward
            new = np.sign(push) * max(abs(push) - step * coulomb, 0.0) / (mass + step * viscous)
            q += 0.5 * step * (v + new)
            v = new


def simulated(recording: Recording, values: np.ndarray, asymmetry: float = 0.0,
              as_stamped: bool = False) -> Recording:
    """Return what an axis with these values does under the same reference.

    The voltage is held for a sample, and the motion answers to its mean: at each stamp stands the
    mean of the samples before and behind it.

    Args:
        recording: the reference and the loops.
        values: M, Fv, Fc, offset.
        asymmetry: half the difference of the slopes Fv forward and backward, N s/m.
        as_stamped: the voltage that the loop puts out at its stamp instead, which acts half a
            sample later.
    """
    mass, viscous, coulomb, offset = values
    position, voltage = np.empty_like(recording.reference), np.empty_like(recording.reference)
    _closed_loop(recording.reference,
                 np.array((mass, viscous + asymmetry, viscous - asymmetry, coulomb, offset)),
                 recording.gain, recording.kp, recording.kv, recording.period, position, voltage)
    held = voltage if as_stamped else np.concatenate((voltage[:1], voltage[:-1]))
    return replace(recording, position=position, voltage=0.5 * (held + voltage))


def synthetic_recording(values: np.ndarray, seed: int = 0, duration: float = 20.0,
                        position_step: float = 2e-6, voltage_noise: float = 0.01,
                        asymmetry: float = 0.0, as_stamped: bool = False) -> Recording:
    """Return a recording of a made-up axis: point-to-point moves of several lengths and speeds.

    Args:
        values: M, Fv, Fc, offset.
        seed: of the noise and of the moves.
        duration: s.
        position_step: of the encoder, m.
        voltage_noise: rms, V.
        asymmetry, as_stamped: see `simulated`.
    """
    random = np.random.default_rng(seed)
    period = 1e-3
    reference, place = [np.zeros(300)], 0.0
    while sum(map(len, reference)) * period < duration:
        goal, seconds = random.uniform(0.0, 0.25), random.uniform(0.8, 2.5)
        s = np.linspace(0.0, 1.0, round(seconds / period))
        reference.append(place + (goal - place) * s ** 3 * (10.0 - 15.0 * s + 6.0 * s ** 2))
        place = goal
    true = simulated(Recording(period, np.concatenate(reference), np.empty(0), np.empty(0), 35.0,
                               160.0, 240.0), values, asymmetry, as_stamped)
    return replace(
        true, position=np.round(true.position / position_step) * position_step,
        voltage=true.voltage + voltage_noise * random.standard_normal(len(true.voltage)))
