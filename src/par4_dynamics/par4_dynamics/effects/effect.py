"""What an effect is: named parameters, regressor columns, torque, plausibility, signature."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from par4_dynamics.load_friction import LoadFriction
from par4_dynamics.state import State

Machine = Literal['par4', 'revolute', 'linear']
"""A Par4, or an axis that turns or slides."""
Shape = Mapping[str, float | tuple[float, ...]]
"""Shape parameter -> its value, or its values of several orders."""
Values = Mapping[str, np.ndarray]
"""Parameter -> (J,), (size,) of a vector, or (J, orders) where several orders are given."""

Base = Mapping[str, np.ndarray]
"""Base parameter -> (J,). Of a single axis also `FAST`."""
FAST = 'fast_speed'
"""Speed that a twentieth of the motion exceeds, (J,), rad/s or m/s: an axis may have any."""

CERTAIN = 3.0
"""Standard deviations out of bounds from which on an estimate cannot be inside by chance."""


@dataclass(frozen=True)
class EffectParameter:
    """A parameter of an effect.

    Attributes:
        name: of the parameter, in `model.yaml` and `diagnosis.json`.
        unit: of its value, on a machine whose joints turn.
        scope: 'joint' if each joint has its own value, 'machine' if there is one.
        default: value that it has if a model does not give one: a number, or the name of another
            parameter whose value it then has. None if a model must give it.
        other_unit: a second unit, which gives the parameter another meaning; see the effect.
        size: number of numbers it has; more than one for a vector of the machine.
        uniform: whether one number may stand for all numbers of a vector.
        is_shape: whether the columns depend on it; if not, it is a coefficient.
        vanishing: whether there is no effect where this shape is zero, such as the distance over
            which friction builds up.
        per_order: whether it may have a value for each order of a periodic torque, or for each term
            of a series. The one of these parameters that is a shape lists the orders.
        qualifies: whether it says of another parameter where, from what point or with which power
            it acts, such as a phase or an exponent.
        at_unit_speed: whether it is what a power of the speed is at 1 rad/s. How large that is goes
            with the exponent where the machine moves at other speeds, whether it is zero does not.
        nonnegative: whether no plant takes it below zero. An estimate may come out there by chance.
        positive: whether no law has it at zero or below, such as a time constant. A model file with
            such a value is refused.
        meaning: what it is, where its name does not say so.
    """

    name: str
    unit: str
    scope: Literal['joint', 'machine']
    default: float | str | None = None
    other_unit: str | None = None
    size: int = 1
    uniform: bool = False
    is_shape: bool = False
    vanishing: bool = False
    per_order: bool = False
    qualifies: bool = False
    at_unit_speed: bool = False
    nonnegative: bool = False
    positive: bool = False
    meaning: str = ''

    @property
    def is_size(self) -> bool:
        """Whether there is no effect where it is zero, and the other sizes are, too."""
        return not (self.is_shape or self.qualifies)


@dataclass(frozen=True)
class Signature:
    """How an effect shows best in a plot: the residual over `abscissa` (n, J), with its label."""

    abscissa: np.ndarray
    label: str


def beyond(value: ArrayLike, std: ArrayLike, low: ArrayLike = -np.inf, high: ArrayLike = np.inf
           ) -> int | None:
    """Return the index of the estimate that is farthest out of bounds, None if all may be inside.

    An estimate counts as out of bounds only if it misses them by more than `CERTAIN` of its
    standard deviations: what is zero in truth is estimated a little below zero half of the time.

    Args:
        value: estimates, one number or an array; the index is that into the flat one.
        std: their standard deviations, likewise.
        low, high: bounds, likewise, in the same unit.
    """
    value = np.asarray(value, dtype=float)
    outside = np.ravel(np.maximum(low - value, value - high) - CERTAIN * np.asarray(std))
    worst = int(np.argmax(outside))
    return worst if outside[worst] > 0.0 else None


def single(value: float | tuple[float, ...]) -> float:
    """Return the value of a shape parameter that has one, not one an order.

    Raises:
        TypeError: it has several.
    """
    if isinstance(value, tuple):
        raise TypeError(f'expected one value of a shape parameter, found {len(value)}')
    return value


class Effect(ABC):
    """One effect of the catalogue.

    For given shape parameters its torque is linear in coefficients c. On joint j it is
    torque_j = sum_k columns[:, j, k] c_k if the joints share the coefficients, and
    torque_j = sum_k columns[:, j, k] c_kj if each joint has its own.

    Attributes:
        name: the name in `diagnosis.json` and `model.yaml`.
        parameters: the parameters that a user gives or reads.
        shared: whether the joints share the coefficients.
        separable: sets of shared coefficients (indices of columns) of which a machine may have one
            without the others, such as the zero of one encoder; empty if all belong together.
        needs_platform: whether only a machine with a platform can have it.
        needs_turning: whether an axis can have it only if it turns, because it needs an angle.
        needs_nominal: whether its columns need `State.nominal`.
        is_body: whether its torque is that of masses, so that it is part of the load that others
            shift, or carry with friction or on springs.
        is_force: whether its torque is that of a force on the platform, so that it is part of the
            load that others carry with friction or on springs.
        rubs: whether it is friction of joints that turn with the load (`slips`).
        friction_term: the friction of (20) that its torque is part of, so that both fall by the
            same share while a machine warms up: a name of `FRICTION`, or None.
        of_angle: whether its torque is bound to where a joint is, like teeth, so that it moves with
            the zero of the encoder.
        fixed_coefficients: whether the coefficients are 1 on any machine that has it, so that only
            the shape is free. A fit that gives other coefficients is evidence against the effect.
        fixed_range: lowest and highest fitted coefficient that is still believed to be such a 1.
        expanded: whether the columns are a first-order series around a value of its one
            coefficient. The shape `expanded_at` holds that value; a search looks for the value at
            which the fitted coefficient equals it.
        scales: whether it is the scale in which a drive tells its torque, `State.scaled`.
        retimes: whether it is, to first order, the torque of the motion at another time: that
            which the drives tell, `State.told`.
        against_the_others: whether the part that all joints have in common is a base parameter, so
            that only differences between joints show.
        of_base: whether its columns are sums of base columns, so that one run tells it and base
            parameters together only.
        looks_around: whether its torque at an instant follows from the motion before and after it.
        memory: s before an instant from which on what happened has died away. What happened before
            a log begins in mid-motion is not known.
        needs_both_ways: whether it cannot be told from friction if the joint moves one way only
            (for a torque that is read at another time: from a torque at another position).
        of_axis: whether it is searched on single axes only, because the loads of a Par4's arms are
            effects of their own.
        shows: whether it adds torque to a motion; what adds none is not looked for.
        told_by_speeds: whether its torque is a function of the joint's speed alone, so that mean
            torques at steady speeds can tell it.
        variables: of how many quantities of the motion its force is a function where it acts, in a
            joint, in theta or on the platform: of none if it is constant, of one if it is friction
            by a speed. Of explanations with equally many numbers that with the fewest is simplest.
        law: the shape parameter whose values are different laws of the effect, if data may not
            tell which one holds; None if there is one law.
        phrase: the effect in words, for the report, e.g. 'cogging torque'.
        by_sign: how its one size is told where it is positive and where it is negative, with {}
            for the amount; None where its sign is told as a number.
    """

    name: ClassVar[str]
    parameters: ClassVar[tuple[EffectParameter, ...]]
    shared: ClassVar[bool] = False
    separable: ClassVar[tuple[tuple[int, ...], ...]] = ()
    needs_platform: ClassVar[bool] = False
    needs_turning: ClassVar[bool] = False
    needs_nominal: ClassVar[bool] = False
    is_body: ClassVar[bool] = False
    is_force: ClassVar[bool] = False
    rubs: ClassVar[bool] = False
    friction_term: ClassVar[str | None] = None
    of_angle: ClassVar[bool] = False
    fixed_coefficients: ClassVar[bool] = False
    fixed_range: ClassVar[tuple[float, float]] = (0.5, 1.5)
    expanded: ClassVar[bool] = False
    retimes: ClassVar[bool] = False
    scales: ClassVar[bool] = False
    against_the_others: ClassVar[bool] = False
    of_base: ClassVar[bool] = False
    looks_around: ClassVar[bool] = False
    memory: ClassVar[float] = 0.0
    needs_both_ways: ClassVar[bool] = False
    of_axis: ClassVar[bool] = False
    shows: ClassVar[bool] = True
    told_by_speeds: ClassVar[bool] = False
    variables: ClassVar[int] = 1
    law: ClassVar[str | None] = None
    phrase: ClassVar[str]
    by_sign: ClassVar[tuple[str, str] | None] = None

    @property
    def of_machine(self) -> bool:
        """Whether no joint can have it by itself, so that a model lists no joints for it."""
        return self.shared and all(parameter.scope == 'machine' for parameter in self.parameters)

    def is_sought_on(self, machine: Machine) -> bool:
        """Return whether a diagnosis looks for it on a Par4, a turning or a sliding axis."""
        if machine == 'par4':
            return self.shows and not self.of_axis
        return self.shows and not (self.needs_platform or self.against_the_others or (
            machine == 'linear' and self.needs_turning))

    def shapes(self, state: State) -> tuple[Shape, ...]:
        """Return the shapes worth trying on this motion: one, empty, if the torque is linear."""
        return ({},)

    def refined(self, shape: Shape, step: float) -> tuple[Shape, ...]:
        """Return shapes around `shape`; `step` is in units of the spacing of `shapes`."""
        return (shape,)

    def parts(self, shape: Shape) -> tuple[Shape, ...]:
        """Return the shapes whose columns, side by side, are those of `shape`."""
        return (shape,)

    def shape_of_sets(self, shape: Shape, sets: tuple[int, ...]) -> Shape:
        """Return the shape of a machine that has only some of the `separable` sets."""
        return shape

    def sets_of(self, shape: Shape) -> tuple[int, ...]:
        """Return the numbers of the `separable` sets that a machine of a shape can have."""
        return tuple(range(len(self.separable)))

    def exact_at(self, shape: Shape, joints: int) -> np.ndarray | None:
        """Return the only shared coefficients (K,) at which the columns of a shape are exact.

        None if the torque is linear in the coefficients, so that the columns are always exact.
        """
        return None

    @property
    def is_series(self) -> bool:
        """Whether it is a series over the position, which has no law: waves, polynomials."""
        return any(parameter.per_order for parameter in self.parameters)

    def free_numbers(self, shape: Shape) -> int:
        """Return how many numbers of a shape a fit chooses besides the coefficients.

        Where a series is expanded is none of them, because its coefficients tell that.
        """
        return sum(np.size(value) for value in shape.values())

    def terms(self, shape: Shape) -> int:
        """Return how many coefficients a shape has beyond those of the simplest shape."""
        return 0

    def with_fewer_terms(self, shape: Shape) -> tuple[Shape, ...]:
        """Return the shapes of the same series with fewer coefficients, the fewest first."""
        return ()

    def simpler(self, values: Values, std: Values) -> str | None:
        """Return the name of the effect that this one is but for values that may be zero.

        Args:
            values: of the parameters.
            std: their standard deviations.
        """
        return None

    def with_more_terms(self, shape: Shape, count: int) -> Shape | None:
        """Return the shape of the same series with `count` more coefficients, if it is a series."""
        return None

    @abstractmethod
    def columns(self, state: State, shape: Shape) -> np.ndarray:
        """Return the torque per unit coefficient, (n, J, K), N m."""

    def height(self, state: State) -> np.ndarray:
        """Return the torque (n, J), N m, that a wave of coefficient 1 has where it is highest.

        Asked only of effects whose shape is the order of a wave over the joint position.
        """
        return np.ones_like(state.q)

    def coefficients(self, values: Values) -> np.ndarray:
        """Return the coefficients (K, J) of parameter values, each (J,).

        By default they are the values of the parameters that are no shapes, in their order.
        """
        return np.stack([values[parameter.name] for parameter in self.parameters
                         if not parameter.is_shape])

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        """Return the parameter values, each (J,), of coefficients (K, J) and a shape."""
        rows = iter(coefficients)
        return {parameter.name: np.full_like(coefficients[0], shape[parameter.name])
                if parameter.is_shape else next(rows) for parameter in self.parameters}

    def halfway(self, state: State, values: Values) -> State:
        """Return the motion halfway to that of a machine that has the effect.

        It is another one only if the effect is an error of readings or dimensions. The columns of
        such an effect are slopes of the torque, and hold halfway for larger errors than at the
        motion as it is read (midpoint rule).

        Raises:
            UnreachableError: joint positions with which the mechanism does not close.
        """
        return state

    def senseless(self, values: Values) -> str | None:
        """Return why no law has these values, of the joints that it acts on; None if one has.

        A model file with such values is refused. `implausible` judges whether a machine may have
        them.
        """
        for parameter in self.parameters:
            least = float(np.min(values[parameter.name])) if parameter.positive else np.inf
            if least <= 0.0:
                unit = '' if parameter.unit == '1' else f' {parameter.unit}'
                return f'{parameter.name}: expected more than 0{unit}, found {least:g}'
        return None

    def base_part(self, values: Values) -> Mapping[str, np.ndarray]:
        """Return what it adds to base parameters (J,), by their names, where that is all it is.

        Dry friction that differs between the directions is half the difference, `ASYMMETRY`.
        """
        return {}

    def friction(self, state: State, values: Values, joints: tuple[int, ...]
                 ) -> dict[str, np.ndarray]:
        """Return the parts of its torque (n, J), N m, that are friction, by names of `FRICTION`."""
        if self.friction_term is None:
            return {}
        return {self.friction_term: self.torque(state, values, joints)}

    def dry_share(self, t: np.ndarray, values: Values) -> np.ndarray:
        """Return the share of dry friction that the effect leaves at times t (n,), s."""
        return np.ones(len(t))

    def lowered(self, values: Values, shares: Mapping[str, np.ndarray]) -> Values:
        """Return its values where each friction of (20) has another level.

        Args:
            values: of all parameters.
            shares: level over that of the values (J,), by the names of `FRICTION`.
        """
        if self.friction_term is None:
            return values
        return {**values, **{parameter.name: shares[self.friction_term] * values[parameter.name]
                             for parameter in self.parameters if parameter.is_size}}

    def begun(self, values: Values, base: Base, begin: float) -> tuple[Values, Base]:
        """Return its values and the base parameters on a clock that begins later.

        Args:
            values: of all parameters.
            base: base parameters (J,) that belong to them.
            begin: time, s, on the clock of the values, that is zero on the other.
        """
        return values, base

    def assumes(self, values: Values) -> str | None:
        """Return what is taken for granted of machine and log, which no data told, in a sentence.

        None if nothing. Standard deviations do not hold it.
        """
        return None

    @abstractmethod
    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        """Return why no machine can have these values, or None if one may.

        Args:
            values: of all parameters.
            std: their standard deviations, of the same shapes; zero where a value is known. What
                is refused with some of them is refused without any, so that a search asks for
                them only where exact values are refused.
            base: base parameters (J,) that were fitted together with the values.
        """

    def slips(self, state: State, values: Values) -> LoadFriction | None:
        """Return the friction of joints that turn with the load, None if it is none of these."""
        return None

    def passed(self, state: State, values: Values) -> np.ndarray | None:
        """Return the torque (n, J), N m, that a transmission passes on; None if it is none."""
        return None

    def is_unsure(self, state: State) -> np.ndarray:
        """Return where the law does not tell the torque of a machine that has the effect, (n,).

        Friction of what rests is anything up to that of Coulomb.
        """
        return np.zeros(len(state.t), dtype=bool)

    def reach(self, values: Values) -> tuple[float, float] | None:
        """Return the least and the greatest torque, N m; None where the parameters tell the size.
        """
        return None

    @abstractmethod
    def signature(self, state: State) -> Signature:
        """Return the quantity over which the effect shows best in a plot, and its label."""

    def shape_of(self, values: Values) -> Shape:
        """Return the shape parameters among the values of one joint."""
        shape = {}
        for parameter in self.parameters:
            if parameter.is_shape:
                value = np.asarray(values[parameter.name], dtype=float).tolist()
                shape[parameter.name] = tuple(value) if isinstance(value, list) else value
        return shape

    def shape_of_joints(self, values: Values, joints: tuple[int, ...]) -> Shape:
        """Return the one shape with which an effect with values is fitted on `joints`.

        It is that of the first of them, where each has its own.

        Args:
            values: of all parameters, for all joints of the machine.
            joints: where the effect acts.
        """
        vectors = [parameter.name for parameter in self.parameters if parameter.size > 1]
        return self.shape_of({name: value if name in vectors else value[joints[0]]
                              for name, value in values.items()})

    def torque(self, state: State, values: Values, joints: tuple[int, ...]) -> np.ndarray:
        """Return the torque (n, J), N m; zero on joints not in `joints`.

        Args:
            state: the motion.
            values: of all parameters, for all joints of the machine.
            joints: where the effect acts; a shared effect acts on all.
        """
        coefficients = self.coefficients(values)
        if self.shared:
            shape = self.shape_of({name: value[0] for name, value in values.items()})
            return self.columns(state, shape) @ coefficients[:, 0]
        total = np.zeros_like(state.q)
        last: Shape | None = None
        for joint in joints:  # a joint's shape may be its own, most often it is that of all
            shape = self.shape_of({name: value[joint] for name, value in values.items()})
            if shape != last:
                columns, last = self.columns(state, shape), shape
            total[:, joint] = columns[:, joint] @ coefficients[:, joint]
        return total
