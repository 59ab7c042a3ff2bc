"""Causes in words: their sizes, their joints, and where the orders of a periodic torque come from.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_dynamics.parameters import Parameter, parts_of_orders
from par4_identification.diagnosis.verdict.answer import Cause
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.words import in_words, joint_labels, listed, number, phrase_on

TOLD = 6
"""Orders of a periodic torque that a sentence names one by one."""
NEAR = 0.51
"""Periods a turn of the joint by which an order, found as a whole number, may be off."""
STANDS_OUT = 2.0
"""Standard deviations within which a sentence leaves a size out beside another that stands out."""


def phrase_of_cause(cause: Cause, machine: Robot | Axis) -> str:
    """Return a cause with its size and joints, as '0.61 N m of cogging torque on joint 2'."""
    return ' '.join(filter(None, (_phrase_of_name(cause, machine), _phrase_of_joints(
        cause, machine))))


def phrase_of_causes(causes: Sequence[Cause], machine: Robot | Axis) -> str:
    """Return the causes with their sizes, the joints once where they are the same."""
    sizes = [_phrase_of_name(cause, machine) for cause in causes]
    joints = {_phrase_of_joints(cause, machine) for cause in causes}
    if len(causes) > 1 and len(joints) == 1 and joints != {''}:
        return f'{listed(sizes)}, {"both" if len(causes) == 2 else "all of them"} {joints.pop()}'
    return listed([phrase_of_cause(cause, machine) for cause in causes])


def _phrase_of_name(cause: Cause, machine: Robot | Axis) -> str:
    """Return a cause with its size, and the names from which these data do not tell it."""
    size = _phrase_of_size(cause, machine)
    return size if not cause.twins else (
        f'{size} (or {" or ".join(in_words(name) for name in cause.twins)})')


def _phrase_of_size(cause: Cause, machine: Robot | Axis) -> str:
    effect = cause.effect
    phrase = phrase_on(machine, effect.phrase)
    first, *others = effect.parameters
    if effect.by_sign is not None:
        size = cause.parameters[first.name]
        ahead, behind = (phrase_on(machine, told) for told in effect.by_sign)
        return (ahead if size.number > 0.0 else behind).format(
            _size(Parameter(value=abs(size.number), unit=size.unit), machine))
    if any(item.per_order and isinstance(cause.parameters[item.name].value, tuple)
           and item.is_shape for item in effect.parameters):
        return _phrase_of_orders(cause, machine)
    reach = _reach(cause)
    if reach is not None:
        return (f'{number(reach[0], 2)} to {number(reach[1], 2)} {unit_on(machine, first.unit)} of '
                f'{phrase}')
    sizes = {item.name: _size(cause.parameters[item.name], machine) for item in effect.parameters}
    if any(item.unit == first.unit for item in others):  # parts of one whole, as x, y, z
        told = [name for name in sizes if _stands_out(cause.parameters[name])] or list(sizes)
        parts = ', '.join(f'{in_words(name)} {sizes[name]}' for name in told)
        return f'{phrase} ({parts})'
    told = [item.name for item in effect.parameters
            if np.any(np.asarray(cause.parameters[item.name].value) != 0.0)
            and not (item.is_shape and np.all(np.asarray(
                cause.parameters[item.name].value) == item.default))]
    # a power of the speed is its size and its exponent, however uncertain each alone is
    power = any(item.at_unit_speed for item in effect.parameters)
    shown = {name for name in told if power or _stands_out(cause.parameters[name])} or set(told)
    amount = sizes[first.name]
    if first.unit in ('', '1'):
        amount = _size(cause.parameters[first.name], machine, 100.0) + ' %'
    shape = [_phrase_of_periods(cause.parameters[item.name].number, machine)
             if item.unit == '1/turn' else
             f'{in_words(item.name.removeprefix(f"{effect.name}_"))} {sizes[item.name]}'
             for item in others if item.name != 'phase' and item.name in shown]
    whole = f'{amount} of {phrase}' if first.name in shown else phrase
    return f'{whole} with {listed(shape)}' if shape else whole


def _reach(cause: Cause) -> tuple[float, float] | None:
    """Return the least and the greatest torque of a series, N m, whose terms say little; or None.
    """
    terms = [item for item in cause.effect.parameters if item.per_order]
    if not terms or any(item.is_shape for item in terms):  # of a periodic torque, orders
        return None
    values = {name: np.asarray(own.value, dtype=float) for name, own in cause.parameters.items()}
    for item in terms:  # as effects take them, (J, terms)
        values[item.name] = np.reshape(values[item.name], (-1, len(cause.joints))).T
    return cause.effect.reach(values)


def _phrase_of_orders(cause: Cause, machine: Robot | Axis) -> str:
    """Return a periodic torque of several orders, the strongest of them one by one."""
    first, *others = cause.effect.parameters
    periods = next(item.name for item in others if item.unit == '1/turn')
    relative = first.unit in ('', '1')
    unit = unit_on(machine, first.unit)
    orders = []
    for order, size in zip(np.ravel(cause.parameters[periods].value),
                           parts_of_orders(cause.parameters[first.name].value), strict=True):
        sizes = np.atleast_1d(np.asarray(size, dtype=float))
        mean = float(np.mean(sizes))
        text = f'{number(100.0 * mean, 2)} %' if relative else f'{number(mean, 2)} {unit}'
        orders.append((mean, f'{text} with {_phrase_of_periods(float(order), machine)}'))
    orders.sort(key=lambda item: -item[0])
    told = [text for _, text in orders[:TOLD]]
    if len(orders) > TOLD:
        told.append(f'{len(orders) - TOLD} weaker orders')
    return f'{phrase_on(machine, cause.effect.phrase)} of {len(orders)} orders ({", ".join(told)})'


def _phrase_of_periods(order: float, machine: Robot | Axis) -> str:
    """Return an order in words, with what makes it where the nameplate tells; a pitch of a slide.
    """
    if isinstance(machine, Axis) and machine.kind == 'linear':
        return f'a pitch of {number(2e3 * np.pi / order, 3)} mm'
    whole = abs(order - round(order)) < 1e-3
    count = f'{order:.0f}' if whole else number(order, 5)
    source = source_of_order(order, machine)
    return f'{count} periods a turn' + (f', {source}' if source else '')


def source_of_order(order: float, machine: Robot | Axis) -> str | None:
    """Return which part of a drive makes so many periods a turn of the joint, if that is known.

    A motor's magnets make multiples of its pole pairs in a turn of the motor, its slots other
    whole numbers; what is no whole number of them comes from behind the gear. A weight off the axis
    of the joint pulls once in its turn.
    """
    if not isinstance(machine, Axis) or machine.kind == 'linear':
        return None
    gear, pairs = machine.gear_ratio, machine.pole_pairs
    if order == 1.0:
        return 'as of a weight off the axis'
    if gear is None and pairs is None:
        return None
    in_motor = order / (gear or 1.0)
    times = round(in_motor)
    if times < 1 or abs(in_motor - times) > NEAR / (gear or 1.0):
        return 'of the gear or the encoder behind it'
    if pairs is not None and times % pairs == 0:
        multiple = times // pairs
        return 'the motor\'s pole pairs' if multiple == 1 else (
            f'{multiple} times the motor\'s pole pairs')
    if gear is not None and gear != 1.0 and times == 1:
        return 'a turn of the motor'
    return f'{times} in a turn of the motor, as of its slots' if (gear or 1.0) != 1.0 else (
        'as of the motor\'s slots')


def _stands_out(parameter: Parameter) -> bool:
    """Return whether a value, or one of the joints' values, is more than what chance makes."""
    return parameter.std is None or bool(np.any(told_from_zero(
        np.asarray(parameter.value, dtype=float), np.asarray(parameter.std, dtype=float))))


def told_from_zero(values: np.ndarray, stds: np.ndarray) -> np.ndarray:
    """Return which values (...) are farther from zero than their standard deviations explain."""
    return np.abs(values) > STANDS_OUT * stds


def _phrase_of_joints(cause: Cause, machine: Robot | Axis) -> str:
    joints = joint_labels(machine)
    if len(joints) == 1 or all(item.scope == 'machine' for item in cause.effect.parameters):
        return ''
    if len(cause.joints) == len(joints):
        return 'on all joints'
    numbers = listed([str(joint) for joint in cause.joints])
    return f'on joint{"s" if len(cause.joints) > 1 else ""} {numbers}'


def _size(parameter: Parameter, machine: Robot | Axis, factor: float = 1.0) -> str:
    """Return a value, or the range of those of the joints that are not zero by chance, with its
    unit if it has one.
    """
    unit = unit_on(machine, parameter.unit)
    values = factor * np.atleast_1d(np.asarray(parameter.value, dtype=float))
    if parameter.std is not None:
        told = told_from_zero(values, factor * np.atleast_1d(
            np.asarray(parameter.std, dtype=float)))
        values = values[told] if told.any() else values
    low, high = float(values.min()), float(values.max())
    text = number(float(values.mean()), 2)
    if high - low > 0.1 * max(abs(low), abs(high)):
        text = f'{number(low, 2)} to {number(high, 2)}'
    return text if unit in ('', '1') else f'{text} {unit}'
