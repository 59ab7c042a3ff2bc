"""What is visible in a recording and what cannot be told apart, from the truth alone.

    r = torque recorded without noise - torque of the known machine along the true reading

is the hidden effect's own torque on the motion as it happened. r, and the torque that any other
effect would have there, are compared in the band and at the moments that fit data have, with the
base columns projected out, in units of the true noise: half the squared length of what is left of
r is the log-likelihood ratio of the true regressor. A torque is always that of machines built by
the hiders, through `physics.Torques`; regressors of the diagnosis take no part.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import combinations

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dtbtrs
from scipy.optimize import lsq_linear

from hidden.hider import JOINTS, Column, Hider, Scene, Values, on, part
from hidden.hiders import HIDERS
from hidden.machines import Known
from hidden.physics import OutOfReach, Torques, in_band, rate
from hidden.recording import PERIOD, Recording
from par4_sim.machines.machine import Machine

VISIBLE = 50.0
"""Log-likelihood ratio over the base model at which an effect counts as visible."""
TWIN = 10.0
"""Difference of log-likelihood within which another effect is a twin."""
CHAOTIC = ('backlash',)
"""A rattling gap: no torque along a reading gives it again. Alone it is all that the truth shows;
beside another effect, or as another's twin, it cannot be judged."""
LOOSE = ('elastic_transmission',)
"""Known along a reading only as far as its resonance is far: alone it, too, is all of the truth."""
BAND = 40.0
"""Hz: faster torque is not fit data."""
EVERY = 10
"""Samples from row to row: 100 rows a second."""
SLOW = 0.02
"""rad/s: a slower joint does not say what its friction is, nor do rows that its filter touches."""
REACH = 23
"""Samples that the band's filter remembers."""
RANK = 1e-10
"""Share of the largest eigenvalue below which columns of unit length have no direction left."""
MOST = 50.0
"""Largest factor on the mean size of an effect when it is tried on other joints."""
GREY = 2.0
"""Log-likelihood that a joint must be worth to belong to an effect for certain."""
MEMORY = 100
"""Rows after which noise is taken for forgotten."""


@dataclass(frozen=True)
class Whitener:
    """Rows of a recording in units of its noise.

    Attributes:
        rows: samples taken of each joint.
        roots: of their covariances, lower and banded (MEMORY, rows).
    """

    rows: tuple[np.ndarray, ...]
    roots: tuple[np.ndarray, ...]

    def __call__(self, torque: np.ndarray) -> list[np.ndarray]:
        """Return torque (n, 4) of all samples as independent rows of unit noise, by joint."""
        told = in_band(torque, BAND, PERIOD)
        return [dtbtrs(root, told[rows, joint][:, None], uplo='L')[0][:, 0]
                for joint, (rows, root) in enumerate(zip(self.rows, self.roots))]


def usable(reading: np.ndarray) -> np.ndarray:
    """Return which samples (n, 4) say something of moving joints."""
    slow = np.abs(rate(reading, PERIOD)) < SLOW
    wide = np.ones(2 * REACH + 1)
    near = np.stack([np.convolve(column, wide, mode='same') > 0.5 for column in slow.T], axis=1)
    near[:2 * REACH] = near[-2 * REACH:] = True
    return ~near


def true_noise(recording: Recording, known: Known) -> np.ndarray:
    """Return what no model could explain at the rows of the log (n, 4), N m.

    That is noise, wandering load and encoder counts, which are felt through the inertia that the
    base model takes from the told positions.
    """
    every = recording.every
    smooth = part(known.machine, 'friction', coulomb=np.zeros(4))
    told = in_band(recording.counted[::every], min(4.0 * BAND, 0.4 / (every * PERIOD)),
                   every * PERIOD)
    felt = [Torques(recording.t[::every], q).recorded(smooth)
            for q in (told, recording.reading[::every])]
    return (recording.noise + recording.wander)[::every] + felt[1] - felt[0]


def whitener_of(noise: np.ndarray, valid: np.ndarray, every: int = 1) -> Whitener:
    """Return the whitener of a noise at the valid samples (n, 4).

    Args:
        noise: at every `every`-th sample, (n / every, 4) N m.
    """
    told = in_band(noise, BAND, every * PERIOD)[::EVERY // every]
    rows, roots = [], []
    for joint in JOINTS:
        taken = np.flatnonzero(valid[::EVERY, joint])
        inside = np.where(valid[::EVERY, joint], told[:, joint], 0.0)
        # biased covariances under a window that ends stay those of a noise
        counts = np.correlate(valid[::EVERY, joint].astype(float),
                              valid[::EVERY, joint].astype(float), 'full')[len(inside) - 1:]
        sums = np.correlate(inside, inside, 'full')[len(inside) - 1:]
        lags = np.arange(MEMORY)
        window = np.where(lags < MEMORY / 2, 1 - 6 * (lags / MEMORY) ** 2 * (1 - lags / MEMORY),
                          2 * (1 - lags / MEMORY) ** 3)
        covariance = window * sums[:MEMORY] / np.maximum(counts[0], 1.0)
        covariance[0] *= 1.001
        rows.append(taken * EVERY)
        # rows far apart share no noise: below the diagonal the covariance is a band
        band = np.zeros((MEMORY, len(taken)))
        for below in range(min(MEMORY, len(taken))):
            lag = taken[below:] - taken[:len(taken) - below]
            near = lag < MEMORY
            band[below, :len(lag)][near] = covariance[lag[near]]
        roots.append(cholesky_banded(band, lower=True))
    return Whitener(tuple(rows), tuple(roots))


class Truth:
    """What one fit recording holds.

    Args:
        recording: of the machine with its effects.
        known: the machine without them.
        hidden: (name, values) of the effects.

    Attributes:
        left: what the base model leaves of the torque of the effects, whitened rows (m,).
    """

    def __init__(self, recording: Recording, known: Known,
                 hidden: Sequence[tuple[str, Values]]) -> None:
        self._known = known
        self._hidden = dict(hidden)
        self._torques = Torques(recording.t, recording.reading)
        self._valid = usable(recording.reading)
        self._white = whitener_of(true_noise(recording, known), self._valid, recording.every)
        self._plain = self._torques.recorded(known.machine)
        self._scene = Scene(
            float(np.ptp(recording.reading, axis=0).min()),
            tuple(float(values['periods']) for _, values in hidden if 'periods' in values))
        base = np.stack([
            np.concatenate(self._white(self._torques.recorded(machine) - self._plain))
            for machine in base_variants(known.machine)], axis=1)
        self._base = np.linalg.qr(base)[0]
        self.left = self._projected(np.concatenate(self._white(
            recording.torque - recording.wander - recording.outside - self._plain)))
        self._strange = self._projected(np.concatenate(self._white(recording.outside)))
        self._shapes: dict[str, list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = {}

    def _projected(self, rows: np.ndarray) -> np.ndarray:
        return rows - self._base @ (self._base.T @ rows)

    @property
    def evidence(self) -> float:
        """Log-likelihood ratio of all that is hidden over the base model."""
        return 0.5 * float(self.left @ self.left)

    def torque(self, hider: Hider, values: Values) -> np.ndarray:
        """Return the torque (n, 4), N m, that an effect adds on the motion as it happened."""
        return self._torques.recorded(hider.build(self._known.machine, values)) - self._plain

    def shapes(self, name: str) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Return columns (m, k) and their bounds for each shape of an effect, base taken out."""
        if name not in self._shapes:
            hider = HIDERS[name]
            if name in CHAOTIC:
                return [(self.left[:, None], np.zeros(1), np.ones(1))]
            family = hider.family(self._scene)
            if name in self._hidden:
                family = [*family, [Column(self._hidden[name], 0.0, 2.0)]]
            self._shapes[name] = [self.columns(hider, shape) for shape in family]
            if name in LOOSE and list(self._hidden) == [name]:
                self._shapes[name].append((self.left[:, None], np.zeros(1), np.ones(1)))
        return self._shapes[name]

    def columns(self, hider: Hider, shape: list[Column]
                ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return a shape's columns (m, k), base taken out, and the bounds of their factors."""
        rows, bounds = [], []
        for column in shape:
            told = self._white(self.torque(hider, column.values))
            split = hider.own_joints and column.values is not self._hidden.get(hider.name)
            for joint in JOINTS if split else (None,):
                rows.append(np.concatenate([
                    one if joint in (None, other) else np.zeros_like(one)
                    for other, one in enumerate(told)]))
                bounds.append((column.low, column.high))
        low, high = np.array(bounds).T
        return self._projected(np.stack(rows, axis=1)), low, high

    def rest(self, name: str | None = None, beside: Sequence[str] = (), limit: float = np.inf
             ) -> float:
        """Return half the squared length of what effects together leave of the truth.

        Args:
            name: an effect in whichever of its shapes leaves least; None for nothing.
            beside: hidden effects, there besides in their own shapes.
            limit: above which the answer may be lower than what bounded factors leave.
        """
        taken = self._beside(beside)
        left = self.left - taken @ (taken.T @ self.left)
        if name is None:
            return 0.5 * float(left @ left)
        return min(least_squares(columns - taken @ (taken.T @ columns), left, low, high, limit)
                   for columns, low, high in self.shapes(name))

    def _beside(self, names: Sequence[str]) -> np.ndarray:
        """Return an orthonormal basis (m, k) of the torques of hidden effects."""
        columns = [self.shapes(name)[-1][0] for name in names]
        if not columns:
            return np.zeros((len(self.left), 0))
        return np.linalg.qr(np.concatenate(columns, axis=1))[0]

    @property
    def strangeness(self) -> float:
        """Log-likelihood ratio of the cause outside the library over the base model."""
        return 0.5 * float(self._strange @ self._strange)

    def impostors(self) -> list[str]:
        """Return the effects that explain the cause outside the library to within `TWIN`."""
        own, self.left = self.left, self._strange
        try:
            return [name for name in HIDERS
                    if name not in CHAOTIC and self.rest(name, limit=TWIN) <= TWIN]
        finally:
            self.left = own

    def carried(self) -> dict[str, float]:
        """Return the share of the evidence that the true model without each effect leaves."""
        hidden = list(self._hidden.items())
        whole = self._torques.recorded(build(self._known.machine, hidden))
        shares = {}
        for name in self._hidden:
            without = self._torques.recorded(build(
                self._known.machine, [item for item in hidden if item[0] != name]))
            lost = self._projected(np.concatenate(self._white(whole - without)))
            shares[name] = 0.5 * float(lost @ lost) / self.evidence
        return shares

    def joint_sets(self, name: str) -> list[list[int]] | None:
        """Return the sets of joints that are right answers to where a hidden effect is.

        These are, of the sets that explain within `TWIN` of the best one, the smallest ones, and
        those that no set of fewer joints equals to within `GREY`. Shapes are the true ones, other
        effects are there besides. None: the effect has no joints of its own, or rattles.
        """
        hider = HIDERS[name]
        if not hider.per_joint or name in CHAOTIC:
            return None
        sets = [joints for size in range(1, 5) for joints in combinations(JOINTS, size)]
        left = dict(zip(sets, self._rests_on(hider, sets)))
        best = min(left.values())
        near = [joints for joints in sets if left[joints] <= best + TWIN]
        fewest = min(map(len, near))
        return [list(joints) for joints in near if len(joints) == fewest or not any(
            left[other] <= left[joints] + GREY for other in sets if len(other) < len(joints))]

    def _rests_on(self, hider: Hider, sets: Sequence[tuple[int, ...]]) -> list[float]:
        """Return half the squared lengths that an effect on some joints leaves of the truth."""
        columns, owners = self._unit_columns(hider)
        least = min(column.low for column in hider.family(self._scene)[0])
        taken = self._beside([other for other in self._hidden if other != hider.name])
        columns = columns - taken @ (taken.T @ columns)
        left = self.left - taken @ (taken.T @ self.left)
        rests = []
        for joints in sets:
            own = np.isin(owners, joints)
            high = np.full(own.sum(), MOST)
            rests.append(least_squares(columns[:, own], left,
                                       np.zeros_like(high) if least == 0.0 else -high, high))
        return rests

    def _unit_columns(self, hider: Hider) -> tuple[np.ndarray, list[int]]:
        """Return an effect's columns (m, k) on each joint in its true shape, and their joints."""
        values = self._hidden[hider.name]
        turns = (0.0, 0.5 * np.pi) if 'phase' in values else (0.0,)
        columns, owners = [], []
        for size in hider.sizes:
            if not np.any(values.get(size, 0.0)):
                continue
            true = np.asarray(values[size], dtype=float)
            full = np.where(true, true, np.abs(true[true != 0.0]).mean())
            for turn in turns:
                shape = {key: np.zeros(4) if key in hider.sizes else value
                         for key, value in values.items()}
                if turn:
                    shape['phase'] = values['phase'] + turn
                for joints in ([JOINTS] if hider.own_joints else [[joint] for joint in JOINTS]):
                    unit = {**shape, size: on(joints, full[list(joints)])}
                    told = self._white(self._reachable(hider, unit, size))
                    for joint in joints:
                        rows = told if not hider.own_joints else [
                            one if joint == other else np.zeros_like(one)
                            for other, one in enumerate(told)]
                        columns.append(self._projected(np.concatenate(rows)))
                        owners.append(joint)
        return np.stack(columns, axis=1), owners

    def _reachable(self, hider: Hider, values: Values, size: str) -> np.ndarray:
        """Return the torque of an effect, a tenth of its size where its machine cannot move so."""
        try:
            return self.torque(hider, values)
        except OutOfReach:
            return 10.0 * self.torque(hider, {**values, size: 0.1 * np.asarray(values[size])})

    def strength(self, name: str) -> float:
        """Return the log-likelihood that a hidden effect is worth beside the others hidden."""
        others = [other for other in self._hidden if other != name]
        return self.rest(None, others) - self.rest(name, others)

    def twins(self, name: str) -> list[str]:
        """Return the effects that explain a hidden one to within `TWIN`, beside the others."""
        others = [other for other in self._hidden if other != name]
        limit = self.rest(name, others) + TWIN
        return [rival for rival in HIDERS if rival not in (*self._hidden, *CHAOTIC)
                and self.rest(rival, others, limit) <= limit]


def least_squares(columns: np.ndarray, target: np.ndarray, low: np.ndarray, high: np.ndarray,
                  limit: float = np.inf) -> float:
    """Return half the squared length of what bounded factors on columns leave of a target.

    Args:
        columns, target: (m, k) and (m,).
        low, high: of the factors, (k,).
        limit: if even free factors leave more, what these leave is returned.
    """
    length = np.linalg.norm(columns, axis=0)
    length = np.where(length > 1e-9, length, 1.0)
    columns = columns / length
    weights, axes = np.linalg.eigh(columns.T @ columns)
    kept = weights > RANK * weights[-1]
    roots, axes = np.sqrt(weights[kept]), axes[:, kept]
    reached = axes.T @ (columns.T @ target) / roots
    free = 0.5 * max(float(target @ target - reached @ reached), 0.0)
    factors = axes @ (reached / roots)
    if free > limit or np.all((factors >= low * length) & (factors <= high * length)):
        return free
    fit = lsq_linear(roots[:, None] * axes.T, reached, (low * length, high * length),
                     method='bvls')
    return free + float(fit.cost)


def build(machine: Machine, hidden: Iterable[tuple[str, Values]]) -> Machine:
    """Return a machine with effects (name, values) built in, one after the other."""
    return reduce(lambda built, item: HIDERS[item[0]].build(built, item[1]), hidden, machine)


def base_variants(machine: Machine) -> list[Machine]:
    """Return the machine with a little more of each base parameter of (20)."""
    bodies, friction = machine.bodies, machine.friction
    return [part(machine, 'bodies', actuator_inertia=bodies.actuator_inertia + 0.01),
            part(machine, 'bodies', platform_mass_1=bodies.platform_mass_1 + 0.1),
            part(machine, 'bodies', platform_mass_2=bodies.platform_mass_2 + 0.1),
            part(machine, 'bodies', arm_gravity=bodies.arm_gravity + 0.1),
            part(machine, 'friction', coulomb=friction.coulomb + on(JOINTS, 0.1)),
            part(machine, 'friction', viscous=friction.viscous + on(JOINTS, 0.1))]
