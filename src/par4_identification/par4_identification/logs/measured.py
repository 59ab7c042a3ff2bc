"""What a logger's files measured, and what looks wrong about it.

What can be checked without knowing the machine is checked: stamps, gaps, jumps, ranges, and whether
the speed is the slope of the position, which tells a wrong unit of either.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_identification.logs.accounts import clipped_words, held_words
from par4_identification.logs.clips import SWITCHED, clips_of, levels_of
from par4_identification.logs.counters import restarts_of
from par4_identification.logs.integrated import ways_of
from par4_identification.logs.jumps import count_of, jumps_of, median_of_others
from par4_identification.logs.refresh import FEWEST, jumps, refresh_of
from par4_identification.logs.stamps import GAP, SHORTEST_PERIOD
from par4_identification.logs.units import JointKind, si_unit

FEW = 10.0
"""Spacings up to so many usual ones tell the rate: rounded stamps and jitter average out."""
JUMP = 0.4
"""Turns between two samples above which a position has wrapped around or slipped."""
LEAST_TIME = 0.1
"""Of the usual time from reading to reading, that one may have come after another at least."""
WHOLE_TURN = 0.02
"""Turns by which the range of a counter may miss whole ones."""
RESTS, REPEATED = 0.3, 0.5
"""s for which a joint that moves repeats no reading, and share of repeated ones to tell of."""
BAND = 0.5
"""Least ratio of the smallest changes of a torque that repeats to the usual ones from which a dead
band of the logger made them: 0.9 with one, 0.03 of a torque that is set to random levels."""
KNOTS, MOST_ROWS = 0.8, 50
"""Share of the bends of a position in one row of so many, up to `MOST_ROWS`, from which the others
were interpolated: 0.9 of a log of 1 ms made of one of 16 ms, an even share of others."""
COARSE = 0.005
"""Step of a position or speed over its range from which it is told: a speed in steps of 0.0056 left
16 times the noise of its torque, a position in steps of 0.0016 no more than its noise."""
FACTOR = 2.0
"""By which a recorded speed may differ from the slope of the position: loggers filter and quantise
speeds, a wrong unit makes a factor of six at least."""
LARGEST = 1e12
"""SI units; what is beyond is no reading of a machine, and its square may be infinite."""
PLAIN_TURNS = 1e3
"""Turns beyond which whole numbers are counts rather than angles."""
LONGEST_PERIOD = 0.5
"""s from row to row from which times are likely to count another unit."""
BOTH_WAYS, NEAR_ZERO = 0.2, 0.01
"""Share of the steps of one way over those of the other from which a joint moves both ways, and
part of its largest value below which a torque comes down to zero."""
FASTEST_JOINT = {'revolute': 1e4, 'linear': 50.0}
"""rad/s and m/s; a motor turns at a tenth of the former, a slide moves at a tenth of the latter."""


@dataclass(frozen=True)
class Measured:
    """What files measured, in SI units, ready to be written.

    Attributes:
        kind: of the joints.
        stamp: (n,) ns.
        values: quantity -> (n, J).
        rows: that the files have.
        untimed: of them without a time, left out.
        integrated: whether the position is the integral of the velocity.
        tables: whose rows are put between each other: what each holds, and its times (n,), s. In
            the rows of one the quantities of others have no number. Empty if there is one.
        time_step: of times that are 32-bit numbers and coarse beside their spacing, s; 0 of others.
    """

    kind: JointKind
    stamp: np.ndarray
    values: dict[str, np.ndarray]
    rows: int
    untimed: int
    integrated: bool = False
    tables: tuple[tuple[str, np.ndarray], ...] = ()
    time_step: float = 0.0

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return self.values['position'].shape[1]

    @property
    def _motion(self) -> str:
        """What tells the motion."""
        return 'velocity' if self.integrated else 'position'

    @property
    def period(self) -> float:
        """Usual spacing of the stamps, s: the median, made exact by the mean where no gap is."""
        return _period_of(1e-9 * self.stamp)

    @property
    def coarse_times(self) -> str:
        """What to know and to do of times that are 32-bit numbers, in words."""
        rate = (len(self.stamp) - 1) / (1e-9 * float(np.ptp(self.stamp)))
        return (f'the times are 32-bit numbers with steps of {1e3 * self.time_step:.3g} ms; if no '
                f'row is missing, leave the column of the time out and give --rate {rate:.4g}')

    def account(self) -> tuple[str, ...]:
        """Return what was read, a line each: rate, then range of every quantity."""
        lines = [_of_times(f'{len(self.stamp)} of {self.rows} rows', 1e-9 * self.stamp, self.period)
                 ] if not self.tables else [
            f'{len(self.stamp)} of {self.rows} rows of {len(self.tables)} tables beside each other',
            *(_of_times(f'{what}: {len(time)} rows', time, _period_of(time))
              for what, time in self.tables)]
        for quantity, values in self.values.items():
            unit = si_unit(quantity, self.kind)
            ranges = ', '.join(
                f'{low:.4g} to {high:.4g}' if np.isfinite(low) else 'no numbers'
                for low, high in zip(*_ranges(values)))
            lines.append(f'{quantity}: {ranges} {unit}')
        return tuple(lines)

    def findings(self, lifts: bool = False) -> tuple[str, ...]:
        """Return what looks wrong, in words; nothing for good files.

        Args:
            lifts: whether the machine is known to carry a weight, whose torque may keep its sign.
        """
        found = [] if not self.integrated else [
            'no position: it is the integral of the velocity from zero on; what it tells of places '
            '(cogging, weight) drifts with the errors of the velocity']
        found += [f'{count} {words}' for count, words in (
            (self.untimed, 'rows without a time, left out'),
            (np.count_nonzero(np.diff(self.stamp) == 0), 'stamps repeated'),
            (np.count_nonzero(np.diff(self.stamp) < 0), 'times the clock goes back')) if count]
        if self.time_step:
            found.append(self.coarse_times)
        for quantity, values in self.values.items():
            empty = np.count_nonzero(~np.isfinite(values))
            if empty and not self.tables and not (
                    self.integrated and quantity == 'position'):
                found.append(f'{quantity}: {empty} of {values.size} cells hold no number')
            absurd = np.count_nonzero(np.isfinite(values) & ~are_readings(values))
            if absurd:
                found.append(f'{quantity}: {absurd} of {values.size} cells are beyond {LARGEST:g} '
                             f'{si_unit(quantity, self.kind)}; mend the file there')
            for joint, (low, high) in enumerate(zip(*_ranges(values))):
                if not low < high:
                    what = 'the same in all rows' if low == high else 'no numbers'
                    found.append(f'{quantity} of joint {joint}: {what}; is it the right column?')
        return (*found, *self._twins(), *self._held(), *self._clipped(), *self._worked_on(),
                *self._odd_times(),
                *self._odd_positions(), *self._odd_speeds(),
                *(() if lifts else self._unsigned_torques()))

    def _twins(self) -> list[str]:
        """Return which columns hold the numbers of another one that does not stand still."""
        found = []
        columns = [(f'{quantity} of joint {joint}', column)
                   for quantity, values in self.values.items()
                   for joint, column in enumerate(values.T)]
        for index, (name, column) in enumerate(columns):
            twin = next((other for other, earlier in columns[:index]
                         if np.array_equal(column, earlier, equal_nan=True)), None)
            if twin is not None and len(np.unique(column[np.isfinite(column)])) > 1:
                found.append(f'{name}: the same numbers as {twin}; is it the right column?')
        return found

    def _held(self) -> list[str]:
        """Return which quantities are refreshed more slowly than the rows come."""
        found = []
        for quantity, values in self.values.items():
            refresh = refresh_of(values[are_readings(values).all(axis=1)])
            if refresh is None:
                found += self._repeats(quantity) if quantity == self._motion else []
            else:
                held = refresh.every * self.period
                found.append(f'{quantity}: {held_words(held, self.period)}; the tools use only '
                             f'its changes, at {1.0 / held:.3g} Hz')
        return found

    def _clipped(self) -> list[str]:
        """Return which positions and speeds stand at an end of their range in motion."""
        found = []
        for quantity, clips in clips_of(self.values).items():
            if self.integrated and quantity == 'position':
                continue
            done = {('position', False): 'the tools leave these rows out',
                    ('velocity', True): 'the position has no number there, so that the log is cut',
                    ('velocity', False): 'the recorded position rules'}[quantity, self.integrated]
            less = 'less far' if quantity == 'position' else 'more slowly'
            for joint, (column, mask) in enumerate(zip(self.values[quantity].T, clips.T)):
                if mask.any():
                    said = clipped_words(levels_of(column, mask), float(mask.mean()),
                                         si_unit(quantity, self.kind))
                    found.append(f'{quantity} of joint {joint}: {said}; {done}; widen the range of '
                                 f'what carries it, or move {less}')
        return found

    def _worked_on(self) -> list[str]:
        """Return what loggers made of readings: interpolated, coarse, left out in a dead band."""
        found = []
        for quantity, values in self.values.items():
            moves = quantity in ('position', 'velocity')
            if self.tables or (self.integrated and quantity == 'position'):
                continue
            whole = values[are_readings(values).all(axis=1)]
            held = refresh_of(whole)
            for joint, column in enumerate(values.T):
                own = column[are_readings(column)] if held is None else whole[held.rows, joint]
                unit = si_unit(quantity, self.kind)
                every = _interpolated(own) if moves else 0
                if every:
                    found.append(f'{quantity} of joint {joint}: bends every {every} rows and is '
                                 f'straight between: interpolated; log what was read, at its rate')
                step = np.diff(own)
                step = np.abs(step[step != 0.0])
                if len(step) < FEWEST:
                    continue
                least = count_of(step)
                if moves and least > COARSE * np.ptp(own):
                    found.append(f'{quantity} of joint {joint}: in steps of {least:.3g} {unit}, '
                                 f'{100.0 * least / np.ptp(own):.2g} % of its range; log it finer')
                band = float(np.quantile(step, 0.02))
                if (not moves and len(step) < REPEATED * len(own) and least < band
                        and band > BAND * np.median(step)
                        and np.median(step) < SWITCHED * np.ptp(own)):
                    found.append(f'{quantity} of joint {joint}: repeats in '
                                 f'{100.0 * (1.0 - len(step) / len(own)):.0f} % of the rows and '
                                 f'never changes by less than {band:.3g} {unit}, as behind a dead '
                                 f'band; log each reading')
        return found

    def _repeats(self, quantity: str) -> list[str]:
        """Return whether readings of a motion repeat in no rhythm, so that their times are unknown.

        Those of a rest do not count, and those of a slow joint are a count of its encoder apart.
        A speed that a drive rounds repeats, too, and matters only where it is all there is.
        """
        found = []
        for joint, column in enumerate(self.values[quantity].T):
            q = column[are_readings(column)]
            changes = np.flatnonzero(np.diff(q)) + 1
            held = np.diff(changes)
            moving = held * self.period < RESTS
            if np.count_nonzero(moving) < FEWEST or not jumps(
                    q[changes - 1][:, None], q[changes][:, None]):
                continue
            share = 1.0 - np.count_nonzero(moving) / float(held[moving].sum())
            if share > REPEATED:
                longest = 1e3 * self.period * held[moving].max()
                found.append(f'{quantity} of joint {joint}: {100.0 * share:.0f} % of the readings '
                             f'repeat while it moves, for up to {longest:.3g} ms and in no rhythm, '
                             f'so that nobody knows when they were taken; log each reading once')
        return found

    def _odd_times(self) -> list[str]:
        """Return what the rate says of the unit of times, and speeds of those of times and ways."""
        if self.period >= LONGEST_PERIOD or self.period <= SHORTEST_PERIOD:
            return [f'time: {self.period:.3g} s from row to row; is its unit right?']
        found, fastest = [], FASTEST_JOINT[self.kind]
        for joint, column in enumerate(self.values['position'].T):
            known = are_readings(column)
            spacing = 1e-9 * np.diff(self.stamp[known])
            steps = np.abs(np.diff(column[known]))[spacing > 0.0] / spacing[spacing > 0.0]
            speed = float(np.quantile(steps, 0.9)) if len(steps) else 0.0
            if speed > fastest:
                found.append(f'position of joint {joint}: moves at {speed:.3g} '
                             f'{si_unit("velocity", self.kind)}; are the units of positions and '
                             f'times right?')
        return found

    def _unsigned_torques(self) -> list[str]:
        """Return where a torque comes near zero and never below though its joint goes both ways."""
        found = []
        for quantity in sorted({'torque', 'voltage'} & self.values.keys()):
            for joint, (q, tau) in enumerate(zip(self.values['position'].T,
                                                 self.values[quantity].T)):
                known = are_readings(q) & are_readings(tau)
                steps = np.diff(q[known])
                ways = [np.count_nonzero(part) for part in (steps > 0.0, steps < 0.0)]
                if min(ways) < BOTH_WAYS * max(ways) or max(ways) == 0:
                    continue
                if 0.0 <= tau[known].min() < NEAR_ZERO * tau[known].max():
                    found.append(f'{quantity} of joint {joint}: never negative though the joint '
                                 f'moves both ways; is its sign lost?')
        return found

    def _odd_positions(self) -> list[str]:
        """Return where positions that were read jump as no joint does between two readings."""
        if self.integrated:
            return []
        found, unit = [], si_unit('position', self.kind)
        for joint, column in enumerate(self.values['position'].T):
            rows = np.flatnonzero(are_readings(column))
            if len(rows) < 2:
                continue  # said elsewhere
            q, apart, spacing = column[rows], np.diff(rows), np.diff(self.stamp[rows])
            again = restarts_of(q, apart / np.median(apart))
            jumped = np.flatnonzero(_wraps(q, spacing) & (apart <= GAP * np.median(apart))
                                    & (spacing <= FEW * np.median(spacing)))
            if again is not None:
                whole = again.way / (2.0 * np.pi) if self.kind == 'revolute' else 0.5
                option = ('--unwrap' if round(whole) and abs(whole - round(whole)) < WHOLE_TURN
                          else '--wraps-after with its range in the unit of the file')
                found.append(f'position of joint {joint}: jumps by {again.way:.4g} {unit} '
                             f'{len(again.steps)} times, as a counter that starts again; give '
                             f'{option}, or log one that counts on')
            elif self.kind == 'linear':
                continue
            elif len(jumped):
                turns = f'{abs(q[jumped[0] + 1] - q[jumped[0]]) / (2.0 * np.pi):.3g}'
                more = {1: '', 2: ' and once more'}.get(
                    len(jumped), f' and {len(jumped) - 1} times more')
                found.append(f'position of joint {joint}: jumps by {turns} '
                             f'turn{"" if turns == "1" else "s"} at row {rows[jumped[0] + 1] + 1}'
                             f'{more}; where the encoder wraps around, give --unwrap, or '
                             f'--wraps-after with its range in the unit of the file')
            elif np.abs(q).max() > 2.0 * np.pi * PLAIN_TURNS and np.array_equal(q, np.rint(q)):
                found.append(f'position of joint {joint}: whole numbers up to '
                             f'{np.abs(q).max():.4g} rad; are they counts?')
        return found

    def _odd_speeds(self) -> list[str]:
        """Return where the integral of the speed is not the position but a multiple of it.

        What happens in gaps of the log, and where positions jump, belongs to neither.
        """
        if 'velocity' not in self.values:
            return []
        found = []
        for joint, columns in enumerate(zip(self.values['position'].T, self.values['velocity'].T)):
            known = np.logical_and(*map(are_readings, columns))
            if np.count_nonzero(known) < 2:
                continue  # said elsewhere
            q, qd = (column[known] for column in columns)
            spacing = 1e-9 * np.diff(self.stamp[known])
            whole = (spacing > 0.0) & (spacing <= GAP * np.median(spacing)) & ~jumps_of(q)[1]
            if self.kind == 'revolute':
                whole &= ~_wraps(q, spacing)
            q, way = (np.cumsum(np.where(whole, steps, 0.0)) for steps in (
                np.diff(q), ways_of(qd, spacing)))
            if np.ptp(q) == 0.0 or np.ptp(way) == 0.0:
                continue  # said elsewhere
            q, way = q - q.mean(), way - way.mean()
            ratio = float(q @ way / (q @ q))
            alike = float(q @ way / np.sqrt((q @ q) * (way @ way)))
            if abs(alike) > 0.9 and not 1.0 / FACTOR < ratio < FACTOR:
                found.append(f'velocity of joint {joint}: {ratio:.4g} times the slope of the '
                             f'position; check the unit of either')
            elif abs(alike) <= 0.9:
                found.append(f'velocity of joint {joint}: not the slope of the position (their '
                             f'correlation is {alike:.2f}); check the columns')
        return found


def _interpolated(values: np.ndarray) -> int:
    """Return every how many rows readings (n,) bend, being straight between; 0 if everywhere."""
    bends = np.abs(np.diff(values, 2))
    if not len(bends):
        return 0
    bends = np.minimum(bends, np.quantile(bends, 0.99))  # a few jumps would count for all rows
    for every in range(min(MOST_ROWS, len(bends) // FEWEST), 1, -1):
        whole = bends[:len(bends) // every * every].reshape(-1, every)
        shares = whole.sum(axis=0)
        if shares.max() > KNOTS * shares.sum():
            return every
    return 0


def _wraps(q: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """Return which steps of positions (n,), rad, are as large as those of an encoder that wraps.

    That is beside the motion around them, of which a slow log of a fast joint has as much in the
    time (n - 1,) from one reading to the next.
    """
    step = np.diff(q)
    time = np.maximum(spacing, LEAST_TIME * max(float(np.median(spacing)), 1e-30))
    turns = np.abs(step - time * median_of_others(step / time)) / (2.0 * np.pi)
    return turns > max(JUMP, 20.0 * float(np.median(turns)))


def are_readings(values: np.ndarray) -> np.ndarray:
    """Return which values a machine can have."""
    return np.abs(values) <= LARGEST


def _ranges(values: np.ndarray) -> tuple[list[float], list[float]]:
    """Return least and largest finite value of each column, NaN without one."""
    finite = np.where(np.isfinite(values), values, np.nan)
    low, high = [], []
    for column in finite.T:
        known = column[~np.isnan(column)]
        low.append(float(known.min()) if len(known) else np.nan)
        high.append(float(known.max()) if len(known) else np.nan)
    return low, high


def _period_of(time: np.ndarray) -> float:
    """Return the usual spacing of times (n,), s: the median, made exact by the mean without gaps.
    """
    spacing = np.diff(time)
    usual = np.median(spacing)
    near = spacing[np.abs(spacing) < FEW * usual]
    return float(near.sum() / np.round(near / usual).sum())


def _of_times(what: str, time: np.ndarray, period: float) -> str:
    """Return duration, rate and gaps of times (n,), s, in words."""
    spacing = np.diff(time)
    missing = spacing > GAP * period
    onward = spacing > 0.0  # a clock that is set back takes nothing off what was recorded
    jitter = np.sqrt(np.mean((spacing[onward & ~missing] - period) ** 2))
    return (f'{what}, {spacing[onward].sum():.6g} s at {1.0 / period:.5g} Hz (every '
            f'{1e3 * period:.4g} ms +- {1e3 * np.round(jitter, 9):.2g} ms rms), '
            f'{np.count_nonzero(missing)} gaps'
            + (f', the longest {spacing.max():.4g} s' if missing.any() else ''))
