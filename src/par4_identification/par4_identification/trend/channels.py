"""The series that are looked at: what a machine's parts do, rather than the parameters as fitted.

Temperature moves the friction of all joints together, wear that of one. So friction is followed as
the factor that most joints have in common and what each joint has beyond it. A joint that is far
from the median of all has no part in what is common, else its wear would show on the others as the
contrary. The platform masses are those of the one platform.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_dynamics.base_terms import FRICTION, PLATFORM_MASSES, TERMS
from par4_identification.trend.bag_values import BagValues

OUTLYING = 4.0
"""Deviations from the median beyond which a joint has no part in what is common."""


@dataclass(frozen=True)
class Channel:
    """One series.

    Attributes:
        name: of the parameter or effect, with a joint in brackets where it is that of one.
        values: (n,); NaN where a bag does not tell it.
        std: their standard deviations, (n,).
        unit: of both; '1' for a factor.
        yearly: whether it may follow the temperature of the seasons.
    """

    name: str
    values: np.ndarray
    std: np.ndarray
    unit: str
    yearly: bool = False

    @property
    def is_factor(self) -> bool:
        """Whether it is a factor of what it was."""
        return self.unit == '1'


def channels_of(bags: Sequence[BagValues]) -> tuple[Channel, ...]:
    """Return the series of bags in order of time."""
    terms, joints = bags[0].terms, len(bags[0].values)
    values = np.array([bag.values for bag in bags])
    variance = np.array([np.diag(bag.covariance).reshape(bag.values.shape) for bag in bags])
    found = []
    platform = [name for name in PLATFORM_MASSES if name in terms]
    if platform:
        masses = [_masses(bag, platform) for bag in bags]
        for index, name in enumerate(platform):
            found.append(Channel(name, np.array([own[0][index] for own in masses]),
                                 np.array([own[1][index] for own in masses]), TERMS[name].unit))
    for index, name in enumerate(terms):
        if name in platform:
            continue
        own, std = values[..., index], np.sqrt(variance[..., index])
        if name in FRICTION and joints > 1 and np.all(np.median(own, axis=0) > 0.0):
            found += _friction(name, own, std)
        else:
            found += [Channel(_label(name, joint, joints), own[:, joint], std[:, joint],
                              TERMS[name].unit, yearly=name in FRICTION) for joint in range(joints)]
    return (*found, *_effects(bags))


def _masses(bag: BagValues, platform: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the platform masses that all joints tell together, and their deviations."""
    joints, size = bag.values.shape
    columns, shared = [], np.zeros((joints * size, len(platform)))
    for index, name in enumerate(bag.terms):
        if name in platform:
            shared[index::size, platform.index(name)] = 1.0
        else:
            columns += [np.eye(joints * size)[:, joint * size + index] for joint in range(joints)]
    design = np.column_stack((shared, *columns))
    scale = np.sqrt(np.diag(bag.covariance))
    weight = np.linalg.inv(bag.covariance / np.outer(scale, scale))
    design = design / scale[:, None]
    spread = np.linalg.inv(design.T @ weight @ design)
    mean = spread @ design.T @ weight @ (bag.values.ravel() / scale)
    count = len(platform)
    return mean[:count], np.sqrt(np.diag(spread)[:count])


def _friction(name: str, values: np.ndarray, std: np.ndarray) -> list[Channel]:
    """Return the common factor of a friction (n, J) and what each joint has beyond it."""
    usual = np.median(values, axis=0)
    factor, error = values / usual, std / usual
    middle = np.median(factor, axis=1)
    apart = np.abs(factor - middle[:, None])
    # joints may differ from bag to bag by more than the deviations say
    usual_distance = np.maximum(error, np.median(apart, axis=0) / 0.6745)
    alike = apart <= OUTLYING * np.minimum(usual_distance,
                                           np.median(usual_distance, axis=1)[:, None])
    # what is common takes two: against itself alone a joint would be in no doubt
    nearest = apart <= np.partition(apart, 1, axis=1)[:, 1:2]
    alike = np.where(alike.sum(axis=1, keepdims=True) > 1, alike, nearest)
    weight = alike / alike.sum(axis=1, keepdims=True)
    common = np.sum(weight * factor, axis=1)
    spread = np.sqrt(np.sum((weight * error) ** 2, axis=1))
    joints = values.shape[1]
    found = [Channel(name, common, spread, '1', yearly=True)]
    beyond = factor / common[:, None]
    # a joint that has a part in what is common errs less against it: the two err together
    together = 2.0 * beyond * weight * error ** 2
    std = np.sqrt(error ** 2 + (beyond * spread[:, None]) ** 2 - together) / common[:, None]
    found += [Channel(_label(name, joint, joints), beyond[:, joint], std[:, joint], '1')
              for joint in range(joints)]
    return found


def _effects(bags: Sequence[BagValues]) -> list[Channel]:
    labels = list(dict.fromkeys(item.label for bag in bags for item in bag.effects))
    found = []
    for label in labels:
        own = [next((item for item in bag.effects if item.label == label), None) for bag in bags]
        unit = next(item.unit for item in own if item is not None)
        values = np.array([np.nan if item is None else item.value for item in own])
        if '.phase' in label:
            values = _around_the_middle(values)
        found.append(Channel(
            label, values,
            np.array([np.nan if item is None else item.std for item in own]),
            unit if unit != '1' else ''))
    return found


def _around_the_middle(angles: np.ndarray) -> np.ndarray:
    """Return angles, rad, without jumps of a turn: each within half a turn of their mean direction.
    """
    middle = np.angle(np.nanmean(np.exp(1j * angles)))
    return middle + np.remainder(angles - middle + np.pi, 2.0 * np.pi) - np.pi


def _label(name: str, joint: int, joints: int) -> str:
    return name if joints == 1 else f'{name}[{joint}]'
