"""The orders of a periodic torque, found together: the strongest first, each beside the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from par4_dynamics.effects.effect import Effect, Shape, single
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.projection import Projection, project
from par4_identification.diagnosis.search.rules import OF_PAR4, Rules
from par4_identification.diagnosis.search.shapes import best_shape, order_name
from par4_identification.signals.filtering import passed

MOST = 16
"""Orders of a torque; what a motor, its gear and its encoder have together."""
LOW = 3.0
"""Multiple of the distance at which two orders can be told apart up to which each order is looked
at closely: base terms imitate much of such waves, which a spectrum does not see."""
STRONGEST = 12
"""Lines that are looked at closely, at most."""
CLOSE = 0.6
"""Share of what the strongest line explains that an order must explain to be looked at closely: the
spectrum is right to 15 %, for waves that the design imitates to 25 %."""
SPEEDS, SPECTRUM = 64, 64
"""Speeds and orders for which the squares of waves are computed."""
TINY = 1e-300
"""Stands for the squares of a wave without any, by which must be divided."""
FAINTEST = 1e-3
"""The least of these squares, as a share of the largest: of a wave that no filter lets through, no
spectrum says how much it explains."""
PADDED = 4.0
"""Length of a spectrum over the range of positions: its step is a quarter of the distance at which
two orders can be told apart."""
ROUNDS = 2
"""In which orders between whole ones are settled beside each other."""
SETTLING = (0.25, 0.0625, 0.01)
"""Shares of that distance by which an order is moved to settle it."""
BETWEEN = 2.0
"""How many times as much an order between those that were tried gains, at the most: the nearest is
off by an eighth of what tells two apart, of which a wave over all positions loses a twentieth."""
WIDEST_APART = 0.5
"""Distance of orders that can be told apart up to which those between whole ones are looked for."""


def best_orders(effect: Effect, shapes: Sequence[Shape], projection: Projection, rules: Rules,
                known: Shape | None = None, wanted: float = 0.0) -> tuple[Shape, float] | None:
    """Return the orders of an effect beside a projection, and twice what they gain.

    None where they cannot gain what is wanted: each order gains about as much as the one before it
    at the most, and there are `MOST`. Orders imitate a little of anything, so that a strong cause
    without a name yet would have all of them sought.

    An order after the first must gain the sum of three things: what every cause must gain, what
    chance gives to the best of so many orders, and what an error of the orders before it may make.
    Orders are waves on any machine, so that error is the one of a Par4, also on an axis. The range
    of positions must also be wide enough to tell the order from those before it.

    Orders that are known from a search beside other causes are the answer if that search would end
    with them here: the strongest line is one of them, each is worth it beside the others, and no
    further one is. That takes two looks at the lines in place of one for each order.

    Args:
        effect: with a shape parameter that may be a tuple of orders.
        shapes: one order each, evenly spaced.
        projection: of the causes beside it.
        rules: what a cause must gain.
        known: orders that were found beside other causes.
        wanted: twice the gain below which the orders are of no use.
    """
    name = order_name(effect)
    if name is None:
        raise TypeError(f'{effect.name} has no orders')
    search = _Orders(effect, name, np.array([single(shape[name]) for shape in shapes]), projection,
                     rules)
    first, gain = search.strongest(projection, ())
    if gain * MOST < wanted:
        return None
    earlier = None if known is None else known[name]
    if known is not None and isinstance(earlier, tuple) and first in earlier:
        whole = search.whole(earlier)
        if whole is not None:
            return known, projection.squares - whole.squares
    found = [first]
    while len(found) < MOST:
        beside = search.beside(found)
        order, more = search.strongest(beside, found)
        if not search.is_worth(more, beside.squares):
            break
        found.append(order)
        gain += more
        if gain + (MOST - len(found)) * more < wanted:
            return None
    for _ in range(ROUNDS if len(found) > 1 and not set(found) <= set(search.tried) else 0):
        for place, order in enumerate(found):
            if order not in search.tried:
                found[place] = search.settled(order, found[:place] + found[place + 1:])
    return search.shape(sorted(found)), gain


@dataclass(frozen=True)
class _Orders:
    """A search for the orders of an effect.

    Attributes:
        effect: whose they are.
        name: of its shape parameter that has them.
        tried: orders of the grid, evenly spaced, (k,).
        projection: of the causes beside the effect.
        rules: what a cause must gain.
    """

    effect: Effect
    name: str
    tried: np.ndarray
    projection: Projection
    rules: Rules

    @property
    def _slides(self) -> bool:
        return self.projection.evidence.observations.runs[0].state.slides

    @cached_property
    def _apart(self) -> float:
        """Distance of two orders that the range of positions tells apart."""
        runs = self.projection.evidence.observations.runs
        span = max(float(np.max(np.ptp(run.q, axis=0))) for run in runs)
        return 0.999 * 2.0 * np.pi / max(span, 1e-12)

    @cached_property
    def _before(self) -> float:
        """Squares that the base terms leave."""
        return project(self.projection.evidence, ()).squares

    def shape(self, some: Sequence[float]) -> Shape:
        """Return the shape of some orders."""
        return {self.name: some[0] if len(some) == 1 else tuple(some)}

    def beside(self, some: Sequence[float]) -> Projection:
        """Return the projection of the causes and of the effect with some orders."""
        joints = tuple(range(self.projection.evidence.observations.joints))
        known = Hypothesis(self.effect, self.shape(some), joints)
        return project(self.projection.evidence, (*self.projection.hypotheses, known))

    def is_worth(self, more: float, squares: float) -> bool:
        """Return whether an order gains (twice) enough beside others that leave such squares."""
        evidence = self.projection.evidence
        coefficients = 2 * (1 if self.effect.shared else evidence.observations.joints)
        named = max(self._before - squares, 0.0)
        return 0.5 * more >= (
            self.rules.evidence + 0.5 * coefficients * np.log(max(evidence.rows, 2))
            + np.log(len(self.tried)) + 0.5 * OF_PAR4.named_error ** 2 * named)

    def whole(self, some: Sequence[float]) -> Projection | None:
        """Return the projection of the causes and of some orders.

        None unless each of them is worth it beside the others, and no further one is.
        """
        beside = self.beside(some)
        if all(self.is_worth(gain, beside.squares + gain) for gain in beside.last_gains) and (
                len(some) == MOST
                or not self.is_worth(self.strongest(beside, some)[1], beside.squares)):
            return beside
        return None

    def settled(self, order: float, others: Sequence[float]) -> float:
        """Return an order between those of the grid where it gains most beside all others.

        Lines that are hardly apart push each other away, so that one of them may be of a grid of
        whole orders.
        """
        beside = self.beside(sorted(others))

        def worth(some: np.ndarray) -> np.ndarray:
            return beside.gains(self.effect, self._shapes(some))

        settled, gain = self._moved(order, float(worth(np.array([order]))[0]), worth)
        if self._slides:
            return settled
        nearest = float(self.tried[np.argmin(np.abs(self.tried - settled))])
        is_near = abs(nearest - settled) < 0.5 * self._apart and nearest not in others
        if is_near and not _is_decided(gain, float(worth(np.array([nearest]))[0]), self.rules):
            return nearest
        return settled

    def strongest(self, beside: Projection, found: Sequence[float]) -> tuple[float, float]:
        """Return the order that gains most and twice its gain, -inf where none is left.

        Orders that are not apart from those that were found before gain nothing. Where the joint
        makes several turns one may lie between those of the grid, if it explains decidedly more;
        where it slides, the grid means nothing.
        """
        def is_new(some: np.ndarray) -> np.ndarray:
            return np.min(np.abs(some[:, None] - [*found, np.inf]), axis=1) >= self._apart

        def worth(some: Sequence[Shape]) -> np.ndarray:
            beside.evidence.keep(self.effect, some)
            gains = np.full(len(some), -np.inf)
            new = is_new(np.array([single(shape[self.name]) for shape in some]))
            if new.any():
                gains[new] = beside.gains_apart(
                    self.effect, [shape for shape, own in zip(some, new) if own])
            return gains

        lines = Lines(self.effect, beside, float(self.tried[-1]))
        by_lines = np.where(is_new(self.tried), lines.gains(self.tried), -1.0)
        ranks = np.argsort(np.argsort(-by_lines))
        strong = (ranks == 0) | ((ranks < STRONGEST) & (by_lines >= CLOSE * np.max(by_lines)))
        shape, gain = best_shape(self.effect, self._shapes(
            self.tried[strong | (self.tried < LOW * self._apart)]), worth)
        order = single(shape[self.name])
        if self._apart > WIDEST_APART and not self._slides:
            return order, gain

        def is_idle(most: float) -> bool:  # also where it gains more between those tried
            return bool(found) and not self.is_worth(BETWEEN * most, beside.squares)

        if self._slides:
            return (order, gain) if is_idle(gain) else self._moved(
                order, gain, lambda some: worth(self._shapes(some)))
        found_at, most = order, gain
        between = lines.between(self.tried, self._apart)
        if len(between):
            worths = worth(self._shapes(between))
            if _is_decided(float(np.max(worths)), gain, self.rules):
                found_at, most = float(between[np.argmax(worths)]), float(np.max(worths))
        if is_idle(most):
            return order, gain
        moved = self._moved(found_at, most, lambda some: worth(self._shapes(some)))
        return moved if _is_decided(moved[1], gain, self.rules) else (order, gain)

    def _moved(self, order: float, gain: float, worth: Callable[[np.ndarray], np.ndarray]
               ) -> tuple[float, float]:
        """Return the order of the largest worth around one that is right to half of `_apart`.

        Parabolas through three orders lead there. None is lower than the lowest one tried.
        """
        for step in self._apart * np.array(SETTLING):
            below, above = worth(order + step * np.array((-1.0, 1.0)))
            if not np.isfinite(below + above + gain):  # another order is there
                break
            curvature = below + above - 2.0 * gain
            shift = (float(np.clip(0.5 * (below - above) / curvature, -1.0, 1.0))
                     if curvature < 0.0 else float(np.sign(above - below)))
            trial = max(order + shift * step, float(self.tried[0]))
            most = float(worth(np.array([trial]))[0])
            if most > gain:
                order, gain = trial, most
        return order, gain

    def _shapes(self, some: np.ndarray) -> list[Shape]:
        return [{self.name: float(order)} for order in some]


def _is_decided(gain: float, whole: float, rules: Rules) -> bool:
    """Return whether an order gains (twice, each) decidedly more than one of the grid."""
    return gain > whole + 2.0 * rules.evidence + rules.named_error ** 2 * max(whole, 0.0)


@dataclass(frozen=True)
class Lines:
    """What waves of any order explain of a residual, nearly: its spectrum over the joint positions.

    The product of the residual with a whitened, filtered wave is that of the wave itself with the
    residual sent back through whitening and filter (their adjoint). Its samples are summed in cells
    of an eighth of the shortest period, and one Fourier transform of these sums has the products
    with the waves of all orders. A wave's own squares are those of its frequencies at the speeds of
    the motion; what the design has in common with it is not taken from them.

    Attributes:
        effect: whose waves they are.
        projection: leaves the residual.
        highest: order that is asked for.
    """

    effect: Effect
    projection: Projection
    highest: float

    @cached_property
    def _spectrum(self) -> tuple[float, np.ndarray]:
        """Step from order to order, and twice the gains of the orders 0, step, 2 step ..."""
        evidence = self.projection.evidence
        runs = evidence.observations.runs
        height = np.concatenate([self.effect.height(run.state) for run in runs])
        weighted = height * np.concatenate(evidence.sent_back(self.projection.residual))
        cell = np.pi / (4.0 * self.highest)
        cells, count = evidence.once((self.effect, ('cells', self.highest)),
                                     lambda: self._cells(cell))
        step = 2.0 * np.pi / (cell * count)
        orders = step * np.arange(count // 2 + 1)
        gains = np.zeros(len(orders))
        coarse = np.linspace(0.0, self.highest, SPECTRUM)
        squares = evidence.once((self.effect, ('squares', self.highest)), lambda: np.stack(
            [self._squares(joint, coarse) for joint in range(len(cells))]))
        for joint, own in enumerate(squares):
            sums = np.bincount(cells[joint], weighted[:, joint], count)
            least = max(FAINTEST * float(np.max(own)), TINY)
            gains += np.abs(np.fft.rfft(sums)) ** 2 / np.interp(
                orders, coarse, np.maximum(own, least))
        return step, gains

    def _cells(self, cell: float) -> tuple[np.ndarray, int]:
        """Return the cell of each sample, (J, n), and how many cells a transform takes."""
        q = np.concatenate([run.state.q for run in self.projection.evidence.observations.runs]).T
        span = float(np.max(np.ptp(q, axis=1)))
        return ((q - q.min(axis=1, keepdims=True)) / cell).astype(int, order='C'), int(
            scipy.fft.next_fast_len(int(np.ceil(PADDED * span / cell)) + 1, real=True))

    def _squares(self, joint: int, orders: np.ndarray) -> np.ndarray:
        """Return the whitened squares of the sine (or cosine) of each order on a joint, (k,)."""
        evidence = self.projection.evidence
        noise, squares = evidence.whitener.noise[joint], np.zeros(len(orders))
        for run in evidence.observations.runs:
            valid = run.valid[:, joint]
            height = run.at_rows(self.effect.height(run.state))[valid, joint]
            weights, edges = np.histogram(np.abs(run.speed[valid, joint]), SPEEDS,
                                          weights=0.5 * height ** 2)
            hertz = orders[:, None] * (edges[1:] + edges[:-1]) / (4.0 * np.pi)
            period = float(run.state.t[1] - run.state.t[0])
            share = passed(np.minimum(hertz, 0.5 / period), run.conditioning.torque_cutoff_hz,
                           period)
            squares += (share ** 2 * noise.whitened_power(hertz * run.row_time)) @ weights
        return squares

    def gains(self, orders: np.ndarray) -> np.ndarray:
        """Return about twice the gains of some orders, (k,)."""
        step, gains = self._spectrum
        return np.interp(orders, step * np.arange(len(gains)), gains)

    def between(self, orders: np.ndarray, apart: float) -> np.ndarray:
        """Return the strongest lines that are none of the orders, (k,), at most `STRONGEST`.

        A line belongs to an order that is nearer than half of what tells two apart: the torque of
        a motor returns after a turn. Behind a gear it need not.
        """
        step, gains = self._spectrum
        inner = gains[1:-1]
        peaks = 1 + np.flatnonzero((inner >= gains[:-2]) & (inner > gains[2:]))
        places = peaks * step
        distance = np.min(np.abs(orders[np.clip(
            np.searchsorted(orders, places)[:, None] - (0, 1), 0, len(orders) - 1)]
            - places[:, None]), axis=1)
        kept = peaks[(distance > 0.5 * apart) & (places > orders[0]) & (places < orders[-1])]
        return np.sort(kept[np.argsort(-gains[kept])[:STRONGEST]]) * step
