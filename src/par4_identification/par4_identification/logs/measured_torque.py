"""The measured torque of a bag: gain x amplifier voltage, or effort."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from par4_identification.logs.clock import Clock
from par4_identification.logs.raw_bag import RawBag
from par4_identification.logs.sources import Source
from par4_identification.logs.stamped_rows import StampedRows, stamped_rows
from par4_identification.logs.stamps import EVEN
from par4_identification.logs.topic_signal import Signal, interpolated, signal_of
from par4_kinematics.errors import InputError
from par4_kinematics.interface import AMPLIFIER_VOLTAGE, JOINT_STATES
from par4_kinematics.robot import Axis, Robot

WITHOUT_GAIN = ('voltages and no torque, and the robot file of {} has no gain; write gain '
                'into it, the torque or force at the joint per volt, or gain: 1.0 to have volts in '
                'its place')
"""What to do where nobody knows which torque a voltage makes."""


def measured_torque(path: str | Path, bag: RawBag, machine: Robot | Axis, clock: Clock,
                    kept: Source) -> tuple[Signal, str, tuple[float, ...] | None, float]:
    """Return the torques, their source, how far the other source disagrees, and by how many
    seconds the stamps of the torques were moved to the clock of the positions.

    Args:
        path: of the bag.
        bag: its messages.
        machine: names the joints and their gains.
        clock: of the positions.
        kept: the machine or simulation whose messages count.

    Raises:
        InputError: there is none, or voltages alone of an axis whose gain is not known.
    """
    states = bag.joints[JOINT_STATES.name]
    rows = stamped_rows(path, states, states.effort, machine.joint_names, 'effort')
    effort = None if rows is None else _signal(path, rows, clock, kept)
    voltages = bag.joints.get(AMPLIFIER_VOLTAGE.name)
    rows = None if voltages is None else stamped_rows(
        path, voltages, voltages.effort, machine.joint_names, 'voltage')
    no_gain = isinstance(machine, Axis) and machine.gain is None
    if effort is not None and (rows is None or no_gain):
        return effort, 'effort', None, 0.0
    if rows is None:
        raise InputError(f'{path}: no torque, neither {AMPLIFIER_VOLTAGE.name} nor effort in '
                         f'{states.topic}; record one of them')
    if no_gain:
        raise InputError(f'{path}: {WITHOUT_GAIN.format(machine.name)}')
    rows = kept.of_its_clock(rows)
    offset = clock.offset(rows)
    voltage = _signal(path, replace(rows, stamp=rows.stamp + offset), clock, kept)
    torque = replace(voltage, values=voltage.values * machine.drive_gain)
    disagreement = None if effort is None else _disagreement(torque, effort, clock)
    return torque, AMPLIFIER_VOLTAGE.name, disagreement, 1e-9 * offset


def _signal(path: str | Path, rows: StampedRows, clock: Clock, kept: Source) -> Signal:
    own = kept.of_its_clock(rows)
    return signal_of(path, kept.unmixed(own, clock.time(own.received, own.stamp)), clock)


def _disagreement(torque: Signal, effort: Signal, clock: Clock) -> tuple[float, ...] | None:
    other = interpolated(effort, torque.stamp, clock, EVEN * torque.period)
    common = np.isfinite(other).all(axis=1)
    if not common.any():
        return None
    values = torque.values
    if not common.all():
        values, other = values[common], other[common]
    largest = np.maximum(np.abs(values).max(axis=0), np.abs(other).max(axis=0))
    scale = np.where(largest > 0.0, largest, 1.0)  # damaged numbers may be too large to be squared
    values, other = values / scale, other / scale
    size = np.maximum(np.linalg.norm(values, axis=0), np.linalg.norm(other, axis=0))
    difference = np.linalg.norm(values - other, axis=0)
    return tuple(np.divide(difference, size, out=np.zeros_like(size), where=size > 0).tolist())
