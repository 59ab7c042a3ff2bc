"""Zeros of the encoders and dimensions of the robot file that are far off.

Hypotheses are the zeros of all joints, each dimension by itself and the lengths of each leg; the
one that leaves least of the torque is believed (see `placement` for how each is fitted). Then those
that are small or not sure are taken off one by one. Small errors are the library's (encoder_offset,
geometry_error, leg_length_error) and left to the diagnosis, and so are eccentric encoders. Where
the poses that come out are ones that no machine takes, the search begins again at errors with which
they are (see `starts`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.parameters import Parameter
from par4_identification.logs.log import Log
from par4_identification.setup_check.equations import Stretch, closing, equations_of
from par4_identification.setup_check.finding import Amount, Finding
from par4_identification.setup_check.placement import (
    DIMENSIONS,
    ERRORS,
    FIRST_LEG,
    OF_LEGS,
    Placed,
    Placement,
    placement_at,
    with_dimensions,
)
from par4_identification.setup_check.starts import possible_starts
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.robot import Robot
from par4_sim.report.words import in_words, listed, number, percent

ZEROS = tuple(range(LEGS))
HYPOTHESES = (ZEROS, *((index,) for index in range(LEGS, FIRST_LEG)),
              *((FIRST_LEG + leg, FIRST_LEG + LEGS + leg) for leg in range(LEGS)))
SMALLEST = np.array((math.radians(1.0),) * LEGS + (8e-3,) * (ERRORS - LEGS))
"""rad and m from which an error is a mistake of the setup."""
LARGEST = np.array((math.radians(20.0),) * LEGS + (0.06,) * (ERRORS - LEGS))
LARGEST_PART = 0.3
"""Of a dimension, by which it can be wrong."""
DEVIATIONS_ALONE, DEVIATIONS_BESIDE = 4.0, 3.0
"""How many clustered standard deviations an error must be from zero: the surest one, and the others
that are told together with it."""
WORTH_FITTING = 2.5, 0.4
"""Standard deviations, and part of `SMALLEST`, that an error must have if all were linear, for its
hypothesis to be fitted."""
UNEXPLAINED = 0.035
"""|residual| / |torque| from which every hypothesis is fitted."""
EACH = 1.025
"""Factor on the squares that are left, for each error that is free: its price."""
FEWER = 0.985
"""Most of the squared error that a mistake may leave."""
ONLY_DIFFERENCE = 'base_radius'
"""The motion shows its difference from the platform's radius alone: either may be wrong."""
HALF_SURE = math.sqrt(0.5)
"""Standard deviation, over its size, of an error that is there with a probability of one half."""
PLAIN = 1.06
"""The plain model is believed if its residual is less than so many times that of the rich one."""
ODD_POSES = 0.002
"""Share of samples that do not close or lie beside a singular pose from which other starts are
tried."""
FEW_LEFT = 0.1
"""The same from which too little is left to believe what the others say."""
BETTER_START = 0.9
"""Most of the error of the first start that another one must leave."""
OTHER_FAULT = 0.1
"""|residual| / |torque| in motion beyond which another fault is the larger one, gains for one, and
zeros or dimensions that do not take half of it away are not told."""
LEAST_WORTH = 0.9
"""Most of `before` that a mistake of the setup leaves. What takes less away is left to the
diagnosis, where it competes with all causes: soft transmissions and readings that leak into each
other moved zeros by 2 to 13 degrees for one to six hundredths of the error."""
LEFT_ONE_BY_ONE = 0.5
"""Share of what is left with zeros and dimensions mended. Logs that leave less when they are fitted
one by one, without that, are those of a machine that changed between them."""
STARTS = 2
LUMPED = 0.004
"""|residual| / |torque| in motion that (20) leaves of a machine as the robot file has it, since it
lumps rods and bars at their ends. A motion that is repeated for ever gives the same error anew each
time, so that no deviation tells how little it says."""
LARGEST_ERROR = 0.3
"""|residual| / |torque| in motion with which the rest is believed."""


@dataclass(frozen=True)
class Calibration:
    """Errors of zeros and dimensions.

    Attributes:
        values: of each zero, rad, as read less true, each of `DIMENSIONS`, m, true less that of the
            robot file, and each leg's `OF_LEGS`, m, alike; zero where there is no mistake.
        std: of `values`, clustered.
        before, after: |residual| / |torque| in motion without and with them.
    """

    values: np.ndarray
    std: np.ndarray
    before: float
    after: float

    @property
    def zeros(self) -> np.ndarray:
        """Error of each zero, rad, (LEGS,)."""
        return self.values[:LEGS]

    def mended(self, log: Log) -> Log:
        """Return the log with the zeros taken off.

        They are taken off its reference, too: the drives follow what the encoders read.
        """
        if not self.zeros.any():
            return log
        reference = log.reference and replace(log.reference, q=log.reference.q - self.zeros)
        return replace(log, q=log.q - self.zeros, reference=reference)

    def right_robot(self, robot: Robot) -> Robot:
        """Return the robot with the dimensions that were found."""
        if not self.values[LEGS:].any():
            return robot
        return robot.model_copy(update={
            'geometry': with_dimensions(robot.geometry, self.values[LEGS:])})


def calibration_of(stretches: Sequence[Stretch], geometry: Geometry) -> Calibration | None:
    """Return the zeros and dimensions that are far off, or None.

    Args:
        stretches: of the logs, positions as they were read.
        geometry: of the robot file.
    """
    nowhere = np.zeros(ERRORS)
    before = _error(stretches, geometry, nowhere)
    if before < LUMPED:
        return None
    here = placement_at(stretches, geometry, nowhere)
    found, least = (None, np.inf) if here is None else _explained(here)
    if here is None or here.odd > ODD_POSES:
        few = here is not None and here.odd < FEW_LEFT
        least *= BETTER_START if found is None or few else np.inf
        for start in possible_starts(stretches, geometry)[:STARTS]:
            there = placement_at(stretches, geometry, start)
            trial, left = (None, np.inf) if there is None else _begun(there, start)
            if trial is not None and left < least:
                found, least = trial, left
    if found is None or (np.abs(found.values) > largest_errors(geometry)).any():
        return None
    after = _error(stretches, geometry, found.values)
    if after >= LARGEST_ERROR or after > min(LEAST_WORTH * before, max(OTHER_FAULT, 0.5 * before)):
        return None
    if _error_apart(stretches, geometry) < LEFT_ONE_BY_ONE * after:
        return None
    if here is not None and _is_eccentric(here, found):
        return None
    return Calibration(found.values, found.std, before, after)


def _is_eccentric(placement: Placement, found: Placed) -> bool:
    """Return whether what was found on one leg is an eccentric encoder, which is the library's.

    In the place of zeros that were wrong by 1.5 and 3 degrees one left 1.01 to 1.4 times as much,
    in its own 0.77 to 0.97 times.
    """
    wrong = set(np.flatnonzero(found.values).tolist())
    leg = next((leg for leg in range(LEGS)
                if wrong <= {leg, FIRST_LEG + leg, FIRST_LEG + LEGS + leg}), None)
    if leg is None:
        return False
    try:
        left = placement.left_if_eccentric(leg)
        return left * EACH < FEWER * placement.fitted(found.values).left
    except UnreachableError:
        return False


def largest_errors(geometry: Geometry) -> np.ndarray:
    """Return the largest errors (ERRORS,) that a setup has, rad and m."""
    lengths = np.array([getattr(geometry, name) for name in DIMENSIONS]
                       + [size for name in OF_LEGS for size in getattr(geometry, f'{name}s')])
    return np.minimum(LARGEST, np.concatenate((np.full(LEGS, np.inf), LARGEST_PART * lengths)))


def _explained(plain: Placement) -> tuple[Placed | None, float]:
    """Return the errors that explain decisively more than none, or None, and what is left."""
    return _plain_or_rich(plain, np.zeros(ERRORS), _best)


def _begun(plain: Placement, start: np.ndarray) -> tuple[Placed | None, float]:
    """Return the errors to which a start leads, or None, and what is left."""
    group = ZEROS if start[:LEGS].any() else tuple(map(int, np.flatnonzero(start)))

    def ended(placement: Placement, start: Placed) -> Placed | None:
        try:
            return _pruned(placement, placement.solve(group, start.values), group)
        except UnreachableError:
            return None

    return _plain_or_rich(plain, start, ended)


def _plain_or_rich(plain: Placement, start: np.ndarray,
                   search: Callable[[Placement, Placed], Placed | None]
                   ) -> tuple[Placed | None, float]:
    """Return what a search finds in a plain machine if that explains all that a rich one does.

    Else what it finds beside all that a machine may have; and |residual| / |torque|.
    """
    rich = plain.beside_much()
    begun, bare = plain.fitted(start), rich.fitted(start)
    found = search(plain, begun)
    left = plain.relative(found or begun)
    if found is None and left < PLAIN * rich.relative(bare):
        return None, left
    other = search(rich, bare)
    least = rich.relative(other or bare)
    return (found, left) if left < PLAIN * least else (other, least)


def _best(placement: Placement, nothing: Placed) -> Placed | None:
    """Return the hypothesis that explains most, if it explains decisively more than none.

    None, too, where an error too small for a mistake of the setup explains more: a larger one of
    another dimension would only imitate it.
    """
    least_sure, least_large = WORTH_FITTING
    poor = placement.relative(nothing) > UNEXPLAINED
    worth = [group for group, (values, std) in zip(
        HYPOTHESES, placement.linear(nothing, HYPOTHESES), strict=True)
        if poor or ((np.abs(values) > least_sure * std)
                    & (np.abs(values) > least_large * SMALLEST[list(group)])).any()]
    solved = [(placement.solve(group, nothing.values), list(group)) for group in worth]
    found = [_pruned(placement, solution, group) for solution, group in solved]
    best = min((solution for solution in found if solution is not None),
               key=_weighed, default=nothing)
    small = min((_weighed(solution) for (solution, group), pruned in zip(solved, found)
                 if pruned is None and _is_sure(solution, group)), default=np.inf)
    return best if best.left < FEWER * nothing.left and _weighed(best) < small else None


def _weighed(solution: Placed) -> float:
    """Return what errors leave, the more of them the dearer."""
    return float(solution.left * EACH ** np.count_nonzero(solution.values))


def _is_sure(solution: Placed, free: Sequence[int]) -> bool:
    """Return whether one of the errors is surely not zero."""
    return bool(np.any(np.abs(solution.values[free]) >= DEVIATIONS_ALONE * solution.std[free]))


def _pruned(placement: Placement, solution: Placed, free: Sequence[int]) -> Placed | None:
    """Return the solution without errors that are small or not sure; None where none is left."""
    free = list(free)
    while free:
        values, std = np.abs(solution.values[free]), solution.std[free]
        size = values / np.maximum(SMALLEST[free], DEVIATIONS_BESIDE * std)
        if size.min() >= 1.0:
            return solution if _is_sure(solution, free) else None
        start = solution.values.copy()
        start[free.pop(int(np.argmin(size)))] = 0.0
        if free:
            try:
                solution = placement.solve(free, start)
            except UnreachableError:  # that error is what makes the mechanism close
                return solution
    return None


def _error(stretches: Sequence[Stretch], geometry: Geometry, values: np.ndarray) -> float:
    """Return |residual| / |torque| in motion with some errors; one where no pose closes."""
    other = with_dimensions(geometry, values[LEGS:])
    moved = [closing(replace(part, q=part.q - values[:LEGS]), other) for part in stretches]
    try:
        rows = equations_of(moved, other)
    except UnreachableError:
        return 1.0
    return rows.fit().error if rows.valid.any(axis=0).all() else 1.0


def _error_apart(stretches: Sequence[Stretch], geometry: Geometry) -> float:
    """Return |residual| / |torque| with base parameters of each log by itself; one of one log.

    A mistake of zeros or dimensions is in all logs alike. Logs that explain far more by themselves
    are those of a machine that changed between them.
    """
    logs = {part.log for part in stretches}
    if len(logs) < 2:
        return 1.0
    groups = [[part for part in stretches if part.log == log] for log in logs]
    power = np.array([sum(float(np.sum(part.tau ** 2)) for part in group) for group in groups])
    errors = np.array([_error(group, geometry, np.zeros(ERRORS)) for group in groups])
    return float(np.sqrt(power @ errors ** 2 / max(power.sum(), 1e-30)))


def calibration_findings(calibration: Calibration, robot: Robot) -> list[Finding]:
    """Return what zeros and dimensions say, as findings."""
    gain = (f'with that the rigid bodies leave {percent(calibration.after)} of the torque in '
            f'motion instead of {percent(calibration.before)}')
    found = []
    joints = tuple(int(joint) for joint in np.flatnonzero(calibration.zeros))
    if joints:
        sizes = [f'{number(math.degrees(calibration.zeros[joint]), 3)} +- '
                 f'{number(math.degrees(calibration.std[joint]), 2)} degrees (joint {joint})'
                 for joint in joints]
        offsets = [f'{number(calibration.zeros[joint], 4)} rad from joint {joint}'
                   for joint in joints]
        found.append(Finding(
            'zero_error', joints, None,
            f'positions read too large by {listed(sizes)}; {gain}',
            f'Set the zero of the encoder anew, or take {listed(offsets)} where the messages are '
            'made.', True, amount=Amount('encoder_offset', joints, {'offset': Parameter(
                value=tuple(calibration.zeros[list(joints)].tolist()),
                std=tuple(calibration.std[list(joints)].tolist()), unit='rad')})))
    wrong = [(name, float(error), float(std)) for name, error, std in
             zip(DIMENSIONS, calibration.values[LEGS:FIRST_LEG], calibration.std[LEGS:FIRST_LEG],
                 strict=True) if error]
    if wrong:
        sizes = [f'{in_words(name)} {number(1e3 * getattr(robot.geometry, name), 4)} mm, these '
                 f'data say {number(1e3 * (getattr(robot.geometry, name) + error), 4)} +- '
                 f'{number(1e3 * std, 2)} mm' for name, error, std in wrong]
        lines = ', '.join(f'{name}: {getattr(robot.geometry, name) + error:.4f}'
                          for name, error, _ in wrong)
        radius = (' (or platform_radius changed by as much the other way: only their difference '
                  'shows)' if any(name == ONLY_DIFFERENCE for name, _, _ in wrong) else '')
        found.append(Finding(
            'wrong_dimensions', tuple(range(LEGS)), None,
            f'the robot file has {listed(sizes)}; {gain}',
            f'Measure the machine and set geometry: {{{lines}}}{radius} in the robot file.', True,
            amount=Amount('geometry_error', (), {
                name: Parameter(value=error, unit='m', std=math.hypot(
                    std, HALF_SURE * error if name == ONLY_DIFFERENCE else 0.0))
                for name, error, std in wrong})))
    return found + _leg_findings(calibration, robot, gain)


def _leg_findings(calibration: Calibration, robot: Robot, gain: str) -> list[Finding]:
    """Return what the lengths of single legs say."""
    of_legs, deviations = (part[FIRST_LEG:].reshape(-1, LEGS)
                           for part in (calibration.values, calibration.std))
    legs = tuple(int(leg) for leg in np.flatnonzero(of_legs.any(axis=0)))
    if not legs:
        return []
    sizes, lines, parameters = [], [], {}
    for name, errors, std in zip(OF_LEGS, of_legs, deviations, strict=True):
        if not errors.any():
            continue
        lengths = getattr(robot.geometry, f'{name}s')
        sizes += [f'{in_words(name)} {number(1e3 * lengths[leg], 4)} mm of leg {leg}, these data '
                  f'say {number(1e3 * (lengths[leg] + errors[leg]), 4)} +- '
                  f'{number(1e3 * std[leg], 2)} mm' for leg in legs if errors[leg]]
        whole = np.add(getattr(robot.geometry, f'{name}_errors'), errors)
        lines.append(f'{name}_errors: [{", ".join(f"{error:.4f}" for error in whole)}]')
        parameters[name] = Parameter(value=tuple(errors[list(legs)].tolist()), unit='m',
                                     std=tuple(std[list(legs)].tolist()))
    return [Finding(
        'wrong_dimensions', legs, None, f'the robot file has {listed(sizes)}; {gain}',
        f'Measure the machine and set geometry: {{{", ".join(lines)}}} in the robot file.', True,
        amount=Amount('leg_length_error', legs, parameters))]
