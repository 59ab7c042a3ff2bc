"""Backlash, told by its residual: loads rattle in their gaps after their torque changes sign.

A load in a gap bounces between the flanks, and no column computed from the measured motion has its
torque. The residual is then the torque of the load's slip against its motor: large for a while
after the transmitted torque has changed sides, and small while the load leans on one flank.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
import scipy

from par4_dynamics.effects.transmission import load_inertia, transmitted_torque
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.signals.run import Run

FRESH, LEANING = 0.05, 0.15
"""s around and after a change of sides in which a load rattles, and after which it has settled."""
LEAST_ROWS = 40
"""Near changes of sides, and of leaning loads: fewer tell no scatter."""
CONTRAST = 12.0
"""Least ratio of the slip's rms near changes of sides to that of leaning loads. Noise gives 1, lags
and friction that the model lacks up to 10, gaps of some mrad 14 and more."""
CONTRAST_BESIDE = 4.0
"""The same of another joint, where one rattles by `CONTRAST`, and of both with the base values of
all rows: of a sound joint it is up to 1.8, of a gap of a milliradian 5 and more."""
LEANING_GROWTH = 1.8
"""Largest ratio of the slip's rms under large loads to that under small ones, of loads that lean:
noise gives 1, what bounces have made of the base values up to 1.6, a stiffness that differs from
tooth to tooth 2.3 to 3.1."""
SLOWEST_HZ = 6.0
"""Slips are summed up to positions above this frequency; bounces in a gap are faster."""
QUICK_HZ, QUICK = 20.0, 0.3
"""Frequency above which much of the bounces lies, and least share there of the squares of the slip
near changes of sides: of gaps 0.41 and more; of gains that fall under load, which end where the
load changes sides, up to 0.16, of loads on very soft springs 0.09 to 0.57."""
SLOWEST_ROWS_HZ = 80.0
"""Rate of rows below which bounces fall between them; a torque that jumps from sample to sample
leaves the same there."""
ROWS_APART = 5
"""Rows after which the slip is taken for another draw."""
WIDTH_ERROR = 0.3
"""Relative standard deviation of a gap that is read from what its bounces leave. Most of it is the
same for the same motion."""


@dataclass(frozen=True)
class Rattle:
    """Joints whose loads rattle.

    Attributes:
        joints: indices of the joints.
        gap: approximate width of their gaps, (k,) rad.
        p_value: probability of such residuals if no load rattles, family-wise over all joints.
    """

    joints: tuple[int, ...]
    gap: np.ndarray
    p_value: float


@dataclass(frozen=True)
class _Slip:
    """The slip of one joint's load.

    Attributes:
        loud: its acceleration near changes of sides, rad/s2.
        quick: what that has above `QUICK_HZ`, rad/s2.
        quiet: while the load leans on one flank, rad/s2.
        path: what the loud part moves, rad.
        still: what the quiet part moves, rad: noise.
        load: size of the torque that it transmits, one number a row of the quiet part, N m.
    """

    loud: np.ndarray
    quick: np.ndarray
    quiet: np.ndarray
    path: np.ndarray
    still: np.ndarray
    load: np.ndarray

    def rattles(self, contrast: float) -> bool:
        """Return whether it is louder near changes of sides by a contrast: the load is loose.

        Its bounces are quick, and away from them nothing may be left but noise, which does not know
        the load.
        """
        return (self.is_louder(contrast) and self._growth <= LEANING_GROWTH
                and float(np.sum(self.quick ** 2)) >= QUICK * float(np.sum(self.loud ** 2)))

    def is_louder(self, contrast: float) -> bool:
        """Return whether its rms near changes of sides is so many times that of leaning loads."""
        return min(len(self.loud), len(self.quiet)) >= LEAST_ROWS and bool(
            np.std(self.loud) > contrast * np.std(self.quiet))

    @property
    def _growth(self) -> float:
        """Ratio of the quiet part's rms under the larger half of the loads to that under the rest.
        """
        large = self.load > np.median(self.load)
        less = float(np.sqrt(np.mean(self.quiet[~large] ** 2)))
        more = float(np.sqrt(np.mean(self.quiet[large] ** 2))) if large.any() else less
        return more / less if less > 0.0 else float('inf')

    @property
    def p_value(self) -> float:
        """That of equal sizes near changes of sides and away from them (Mann and Whitney)."""
        return float(scipy.stats.mannwhitneyu(
            np.abs(self.loud[::ROWS_APART]), np.abs(self.quiet[::ROWS_APART]),
            alternative='greater').pvalue)

    @property
    def gap(self) -> float:
        """How far the load moves against its motor, rad."""
        return float(np.ptp(np.quantile(self.path, (0.02, 0.98))))

    @property
    def gap_std(self) -> float:
        """Standard deviation of `gap` by noise, rad; another motion may move it by more."""
        return float(np.std(self.still))


def rattle(parts: Sequence[tuple[Observations, Sequence[np.ndarray]]]) -> Rattle | None:
    """Return the joints whose loads rattle in every part of the data; None if there are none.

    In logs whose rows are too slow for bounces, or beside a load without inertia, none are found.

    Args:
        parts: rows with a nominal torque and the torque that the model leaves of them, (m, J) of
            each run, N m.
    """
    if not all(_carries_bounces(observations) for observations, _ in parts):
        return None
    slips = [_slips(observations, left)
             for (observations, _), left in zip(parts, _where_loads_lean(parts))]
    # base values of leaning rows may leave much of all others, though all rows fit
    loud = [all(slip.is_louder(CONTRAST_BESIDE) for slip in same)
            for same in zip(*(_slips(observations, left) for (observations, _), left in zip(
                parts, _beside_base(parts, [run.valid for run in parts[0][0].runs]))))]
    if not any(loud[joint] for joint in _rattling(slips, CONTRAST)):
        return None
    joints = tuple(joint for joint in _rattling(slips, CONTRAST_BESIDE) if loud[joint])
    p_values = [scipy.stats.combine_pvalues([slip[joint].p_value for slip in slips]).pvalue
                for joint in joints]
    return Rattle(joints, np.array([np.mean([slip[joint].gap for slip in slips])
                                    for joint in joints]),
                  float(min(min(p_values) * len(slips[0]), 1.0)))


def gaps(observations: Observations, left: Sequence[np.ndarray]
         ) -> list[tuple[float, float] | None]:
    """Return the gap of each joint and its standard deviation by noise, rad.

    For a joint without a gap the value is what the noise makes. It is None for a joint whose load
    changes sides too rarely, or too often to come to rest in between, and where rows are too slow
    for bounces.

    Args:
        observations: rows with a nominal torque.
        left: torque that the model leaves of them, (m, J) of each run, N m.
    """
    if not _carries_bounces(observations):
        return [None] * observations.joints
    return [None if min(len(slip.path), len(slip.still)) < LEAST_ROWS else
            (slip.gap, slip.gap_std)
            for slip in _slips(observations, *_where_loads_lean([(observations, left)]))]


def _rattling(slips: Sequence[Sequence[_Slip]], contrast: float) -> tuple[int, ...]:
    """Return the joints whose loads rattle by a contrast in every part."""
    return tuple(joint for joint, same in enumerate(zip(*slips))
                 if all(slip.rattles(contrast) for slip in same))


def _carries_bounces(observations: Observations) -> bool:
    """Return whether rows follow one another fast enough for bounces, of a load with an inertia.

    That of an axis may have come out negative, which counts as zero.
    """
    return all(0.0 < run.row_time <= 1.0 / SLOWEST_ROWS_HZ and (
        not observations.of_axis or load_inertia(run.state, run.t[:1])[0, 0, 0] > 0.0)
        for run in observations.runs)


def _where_loads_lean(parts: Sequence[tuple[Observations, Sequence[np.ndarray]]]
                      ) -> list[list[np.ndarray]]:
    """Return what is left of each part beside base values that bounces have not moved.

    They are those of the rows of the first part in which a load leans: the bounces of all others
    can be some fifty times the noise.
    """
    return _beside_base(parts, [_sides(run)[1] for run in parts[0][0].runs])


def _beside_base(parts: Sequence[tuple[Observations, Sequence[np.ndarray]]],
                 rows: Sequence[np.ndarray]) -> list[list[np.ndarray]]:
    """Return what is left of each part beside the base values of some rows (m, J) of the first."""
    observations, left = parts[0]
    columns = np.concatenate([base[own] for base, own in zip(observations.base, rows)])
    change = np.linalg.lstsq(
        columns, np.concatenate([rest[own] for rest, own in zip(left, rows)]), rcond=1e-10)[0]
    return [[rest - base @ change for rest, base in zip(own, part.base)] for part, own in parts]


def _slips(observations: Observations, left: Sequence[np.ndarray]) -> list[_Slip]:
    """Return the slip of each joint."""
    parts: list[list[_Slip]] = [[] for _ in range(observations.joints)]
    for run, rest in zip(observations.runs, left):
        slip, carried = _slip(run, rest), transmitted_torque(run.state)
        path, (fresh, leans) = _positions(slip, run.row_time), _sides(run)
        quick = _filtered(slip, run.row_time, lambda frequency: frequency > QUICK_HZ)
        for joint in range(observations.joints):
            loud, quiet = fresh[:, joint], leans[:, joint]
            load = np.interp(run.t[quiet], run.state.t, carried[:, joint])
            parts[joint].append(_Slip(slip[loud, joint], quick[loud, joint], slip[quiet, joint],
                                      path[loud, joint], path[quiet, joint], np.abs(load)))
    return [_Slip(*(np.concatenate([getattr(part, field.name) for part in own])
                    for field in fields(_Slip))) for own in parts]


def _sides(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return in which rows each load changes sides and in which it leans on a flank, (m, J)."""
    # a torque that jumps at a time which is not quite known leaves what bounces do
    counted = np.all(run.valid & (run.timing_error <= run.noise_floor), axis=1, keepdims=True)
    since, until = (np.stack(times, axis=1) for times in zip(*(
        _around_changes(run.state.t, load, run.t) for load in transmitted_torque(run.state).T)))
    return (counted & ((since < FRESH) | (until < FRESH)),
            counted & (since > LEANING) & (until > FRESH))


def _slip(run: Run, rest: np.ndarray) -> np.ndarray:
    """Return the acceleration (m, J), rad/s2, of the loads against their motors."""
    inertia = load_inertia(run.state, run.t)
    return np.linalg.solve(inertia, np.where(run.valid, rest, 0.0)[..., None])[..., 0]


def _positions(acceleration: np.ndarray, period: float) -> np.ndarray:
    """Return what accelerations (m, J) move, above `SLOWEST_HZ`."""
    def weight(frequency: np.ndarray) -> np.ndarray:
        ratio = (frequency / SLOWEST_HZ) ** 4
        rate = 2.0 * np.pi * np.maximum(frequency, frequency[1])
        return np.asarray(-ratio / (1.0 + ratio) / rate ** 2)

    return _filtered(acceleration, period, weight)


def _filtered(rows: np.ndarray, period: float, weight: Callable[[np.ndarray], np.ndarray]
              ) -> np.ndarray:
    """Return rows (m, J) whose frequencies, Hz, are weighted."""
    weights = weight(np.fft.rfftfreq(len(rows), period))
    return np.fft.irfft(np.fft.rfft(rows, axis=0) * weights[:, None], len(rows), axis=0)


def _around_changes(time: np.ndarray, load: np.ndarray, rows: np.ndarray
                    ) -> tuple[np.ndarray, np.ndarray]:
    """Return the time since and until a load (n,) changes sides, (m,) s, at times `rows`."""
    changes = time[np.flatnonzero(np.diff(np.sign(load)))]
    after = np.searchsorted(changes, rows, side='right')
    bounds = np.concatenate(([-np.inf], changes, [np.inf]))
    return rows - bounds[after], bounds[after + 1] - rows
