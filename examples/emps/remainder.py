"""What the named causes leave, and whether what repeats with the place does so everywhere.

Both by the published recipe, so that its relative error tells what each is worth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from axis_scales import SPACING, periods
from diagnosed import columns_of_causes, moving
from par4_identification import Diagnosis, Estimate, Series, ordinary
from published_recipe import COLUMNS, problem_of_columns, recipe_columns, recipe_motion
from recording import Recording

STOOD_FOR = ('time_offset', 'nonlinear_viscous')
"""Names in whose place a delay of the force and friction of low speed are tried."""


@dataclass(frozen=True)
class LowSpeed:
    """The recipe with friction Fc v / (|v| + width) in place of Fc sign v.

    Attributes:
        delay: by which the force was moved, s.
        width: speed at which friction has reached half its level, m/s; 0 is sign v.
        estimate: over all rows.
        heldout: relative error over the second half of the record of a fit to the first.
    """

    delay: float
    width: float
    estimate: Estimate
    heldout: float


@dataclass(frozen=True)
class Periodic:
    """The periodic force that explains most in a part of the record.

    Attributes:
        forward: direction of the motion.
        half: of the record, 0 or 1.
        period: m.
        amplitude: N.
        place: of its upward zero crossing nearest the middle of the travel, m.
        gain: share of the squared error of the part that it removes.
    """

    forward: bool
    half: int
    period: float
    amplitude: float
    place: float
    gain: float


def low_speed_friction(recording: Recording, diagnosis: Diagnosis, delays: Sequence[float],
                       widths: Sequence[float]) -> list[LowSpeed]:
    """Return what friction that builds up with the speed explains, beside the causes named.

    Args:
        recording: the data.
        diagnosis: its causes count but those that this stands for: the force is moved by `delays`
            and friction builds up with the speed instead.
        delays: s.
        widths: m/s.
    """
    own = recipe_columns(recording.position, recording.period, COLUMNS)
    causes = {label: column for label, column in columns_of_causes(recording, diagnosis).items()
              if not label.startswith(STOOD_FOR)}
    first = np.arange(len(recording.position)) < len(recording.position) // 2
    found = []
    for delay in delays:
        force = _force_at(recording, delay)
        for width in widths:
            friction = own['Fc'] if width == 0.0 else own['Fv'] / (np.abs(own['Fv']) + width)
            columns = {**own, 'Fc': friction, **causes}
            learnt = ordinary(problem_of_columns(columns, force, first))
            other, = problem_of_columns(columns, force, ~first).series
            found.append(LowSpeed(delay, width, ordinary(problem_of_columns(columns, force)),
                                  _relative_error(other, learnt.values)))
    return found


def strongest_periods(recording: Recording, delay: float) -> list[Periodic]:
    """Return the periodic force that explains most, of each direction and half of the record.

    Beside the recipe's own columns, whatever the diagnosis named, over rows that move.

    Args:
        recording: the data.
        delay: of the force, s.
    """
    place, speed, _ = recipe_motion(recording.position, recording.period)
    own = recipe_columns(recording.position, recording.period, ('M', 'Fv', 'offset'))
    force, moves = _force_at(recording, delay), moving(recording)
    middle, first = 0.5 * (place.min() + place.max()), np.arange(len(place)) < len(place) // 2

    def rows_of(number):
        angle = number * (place - middle)
        waves = {'sin': np.sin(angle), 'cos': np.cos(angle)}
        return problem_of_columns(waves, force).series[0].columns[:, 0]

    coarse = {number: rows_of(number) for number in periods(float(np.ptp(place)))}
    found = []
    for forward in (True, False):
        for half in (0, 1):
            counts = moves & ((speed > 0.0) == forward) & (first == (half == 0))
            part, = problem_of_columns(own, force, counts).series
            valid = part.valid[:, 0]
            base, target = part.columns[valid, 0], part.target[valid, 0]
            nearest = _best(coarse, base, target, valid)
            fine = {number: rows_of(number)
                    for number in nearest + SPACING * np.linspace(-0.5, 0.5, 21)}
            number = _best(fine, base, target, valid)
            design = np.hstack([base, fine[number][valid]])
            sine, cosine = np.linalg.lstsq(design, target, rcond=None)[0][-2:]
            found.append(Periodic(
                forward, half, float(2.0 * np.pi / number), float(np.hypot(sine, cosine)),
                float(middle - np.arctan2(cosine, sine) / number),
                1.0 - _squares(design, target) / _squares(base, target)))
    return found


def _best(waves: Mapping[float, np.ndarray], base: np.ndarray, target: np.ndarray,
          valid: np.ndarray) -> float:
    """Return the number of periods whose rows (m, 2) beside `base` leave least of `target`."""
    return min(waves, key=lambda number: _squares(np.hstack([base, waves[number][valid]]), target))


def _squares(design: np.ndarray, target: np.ndarray) -> float:
    """Return the squared error that the columns of `design` leave of `target`."""
    left = target - design @ np.linalg.lstsq(design, target, rcond=None)[0]
    return float(left @ left)


def _force_at(recording: Recording, delay: float) -> np.ndarray:
    """Return the force (n,) that was recorded `delay` later than the motion it belongs to."""
    t = recording.log.t
    return CubicSpline(t, recording.force)(np.clip(t + delay, t[0], t[-1]))


def _relative_error(part: Series, values: np.ndarray) -> float:
    left = (part.target - part.columns @ values)[part.valid]
    return float(np.linalg.norm(left) / np.linalg.norm(part.target[part.valid]))
