"""Drive gains in words, as JSON and as rows of a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from par4_identification.gains.force_timing import LateReadings
from par4_identification.gains.known_payload import DriveGains
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.outcome import data_remark
from par4_identification.reports.outcome.results import data_of_logs
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome, Remark, Standing, note
from par4_sim.report.results import plain
from par4_sim.report.words import joint_labels, listed, number, percent, with_std

BEYOND_CHANCE = 3.0
"""Standard deviations behind its bound from which a gain differs from the nominal one."""
MATTERS = 0.005
"""Relative difference below which a nominal gain may stay."""
FAR = 4.0 / 3.0
"""Factor between a gain and the nominal one from which a mistake is likelier than the drive: shunts
and magnets are off by percents, and of usual mistakes the smallest, rms for peak, is 1.41."""
UNLIKELY = 1e-3
"""Probability below which the assumptions behind gains are doubted."""


def gains_in_words(gains: DriveGains) -> str:
    """Return the gains with what they are known to."""
    spread = gains.std + gains.bound
    told = listed([' ± '.join(with_std(float(value), float(std)))
                   for value, std in zip(gains.values, spread, strict=True)])
    return f'{told} N m/V'


def wrong_gains(gains: DriveGains) -> np.ndarray:
    """Return which nominal gains (J,) are beyond doubt wrong by what matters."""
    off = np.abs(gains.values - gains.nominal)
    return ((off > BEYOND_CHANCE * gains.std + gains.bound)
            & (off > MATTERS * gains.nominal))


def far_gains(gains: DriveGains) -> np.ndarray:
    """Return which gains (J,) are farther from the nominal ones than drives are."""
    return wrong_gains(gains) & (np.abs(np.log(gains.values / gains.nominal)) > math.log(FAR))


def gains_remarks(gains: DriveGains, machine: Robot | Axis, source: str, checks: str
                  ) -> tuple[Remark, ...]:
    """Return what the gains say of those of the robot file.

    Args:
        gains: as estimated.
        machine: whose gains are nominal.
        source: what told them, in words.
        checks: what to look at first where they are far off, in words.
    """
    wrong = wrong_gains(gains)
    off = gains.values / gains.nominal - 1.0
    told = f'{source} the drive gains are {gains_in_words(gains)}'
    if not wrong.any():
        agree = Remark(True, f'{told}: those of the robot file are right within '
                             f'{percent(float(np.abs(off).max()))}.')
    else:
        named = listed([f'{label} {100.0 * part:+.3g} %' for label, part, is_wrong
                        in zip(joint_labels(machine), off, wrong, strict=True) if is_wrong])
        agree = Remark(False, f'{told}; they differ from those of the robot file: {named}. '
                              f'Torques and parameters scale with them.',
                       'Write the gains into drives.gain of the robot file and identify again.'
                       if not far_gains(gains).any() else
                       f'Drives are hardly ever off by more than a third: look first whether '
                       f'{checks}, and whether the gains of the robot file are those of this '
                       f'machine.')
    if gains.p_value is None or gains.p_value > UNLIKELY:
        return (agree,)
    return agree, Remark(
        False, f'By their gains the joints do not agree on the platform masses (p = '
               f'{number(gains.p_value, 2)}): the machine does something that the model lacks, so '
               f'that the gains are less certain than their standard deviations say.')


def _late_remarks(late: LateReadings | None) -> tuple[Remark, ...]:
    """Return what is told of readings that are late or early."""
    if late is None:
        return ()
    told = f'{number(abs(late.delay))} s {"late" if late.delay > 0.0 else "early"}'
    return Remark(
        False, f'The readings of the force are {told} against the torques: without that the '
               f'gains would be known to {percent(late.mended)} instead of {percent(late.spread)}.',
        f'Let the clocks of sensor and robot agree, or '
        f'{"subtract" if late.delay > 0.0 else "add"} {number(abs(late.delay))} s '
        f'{"from" if late.delay > 0.0 else "to"} the t of the readings.'),


def outcome_of_gains(gains: DriveGains, machine: Robot, logs: Sequence[Log], pushes: int,
                     late: LateReadings | None = None) -> Outcome:
    """Return what static pushes say of the drive gains, in words."""
    bounded = [label for label, bound in zip(joint_labels(machine), gains.bound, strict=True)
               if bound > 0.0]
    friction = (
        Remark(False, f'{listed(bounded).capitalize()} did not slide both ways: friction at rest '
                      f'does not cancel, and the gains are off by it within the bound given.',
               'Let the pushes grow and fade slowly, on a sensor that yields a little.')
        if bounded else
        Remark(True, 'All joints slid both ways while they pushed, so that friction cancels.'))
    sensor = note('An error of scale of the force sensor is one of the gains too: they are no '
                  'better than its calibration and the geometry of the robot file.')
    remarks = (*_late_remarks(late),
               *gains_remarks(gains, machine, f'By {pushes} static pushes',
                               'the force is in N and not in kN, the clocks of sensor and robot '
                               'agree and the voltages are in V'),
               *(Remark(False, f'{log.name}: {text}.') for log in logs
                 for text in log.bag_accounts.of_torques()),
               friction, sensor, data_remark(logs))
    relative = float(((gains.std + gains.bound) / gains.values).max())
    sentence = (f'The drive gains are {gains_in_words(gains)}, known to {percent(relative)} or '
                f'better from {pushes} static pushes.')
    far = far_gains(gains)
    if far.any():
        sentence = (f'By {pushes} static pushes the drive gains would be {gains_in_words(gains)}, '
                    f'more than a third off those of the robot file: a mistake is likelier.')
    standing: Standing = ('bad' if far.any() or late is not None else
                          'good' if relative < 0.01 else 'fair' if relative < 0.05 else 'bad')
    return Outcome(sentence, standing, remarks)


def gains_json(gains: DriveGains) -> dict[str, Any]:
    """Return the gains as a field of a result file."""
    return plain({'value': gains.values, 'std': gains.std, 'bound': gains.bound,
                  'nominal': gains.nominal, 'relative_std': gains.std / gains.values,
                  'unit': 'N m/V', 'p_value': gains.p_value})


def drive_gain_json(gains: DriveGains, logs: Sequence[Log], pushes: int,
                    provenance: dict[str, Any], late: LateReadings | None = None
                    ) -> dict[str, Any]:
    """Return `drive_gain.json`."""
    return plain({'schema': 'par4/drive_gain/1', 'drive_gain': gains_json(gains),
                  'data': {'pushes': pushes, 'bags': data_of_logs(logs),
                           'force_delay': None if late is None else late.delay},
                  'provenance': provenance})


def gains_rows(gains: DriveGains, machine: Robot) -> list[tuple[str, ...]]:
    """Return label, nominal, value, std, bound and difference of each joint."""
    return [(label, number(float(nominal), 4), *with_std(float(value), float(std)),
             number(float(bound), 2), f'{100.0 * (value / nominal - 1.0):+.2f} %')
            for label, nominal, value, std, bound in zip(
                joint_labels(machine), gains.nominal, gains.values, gains.std, gains.bound,
                strict=True)]
