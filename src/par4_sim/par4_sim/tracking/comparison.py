"""Runs of one motion side by side: what each controller and each model made of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_sim.report.outcome import Outcome, Remark
from par4_sim.report.results import plain
from par4_sim.report.words import in_words, number, percent
from par4_sim.tracking.metrics import Tracking
from par4_sim.tracking.run import Run

NO_FEEDFORWARD = 'none'
MILLI = 1e3


@dataclass(frozen=True)
class Case:
    """One run of a comparison.

    Attributes:
        controller: its name.
        feedforward: name of the model whose torques the drives got, or `NO_FEEDFORWARD`.
        run: the record.
        tracking: its figures.
    """

    controller: str
    feedforward: str
    run: Run
    tracking: Tracking

    @property
    def label(self) -> str:
        """What it is called in tables and pictures."""
        helped = ('no feedforward' if self.feedforward == NO_FEEDFORWARD else
                  f'feedforward of {self.feedforward}')
        return f'{in_words(self.controller)}, {helped}'


def outcome_of_tracking(cases: Sequence[Case], motion: Motion, machine: str) -> Outcome:
    """Return what a comparison found, in words; at least one case."""
    best, worst = (choose(cases, key=lambda case: case.tracking.rms) for choose in (min, max))
    sentence = (f'{_sentence(best.label)} follows {motion.name} on {machine} with '
                f'{_millimetres(best.tracking.rms)} rms and {_millimetres(best.tracking.peak)} '
                f'peak error')
    if best is not worst:
        sentence += (f'; {worst.label} with {_millimetres(worst.tracking.rms)} rms, '
                     f'{number(worst.tracking.rms / best.tracking.rms, 2)} times as much')
    limited = [case for case in cases if case.tracking.saturated > 0.0]
    lost = [case for case in cases if case.tracking.missing_effort > 0]
    remarks = [
        *(Remark(False, f'{_sentence(case.label)}: torque or speed was limited in '
                        f'{percent(case.tracking.saturated)} of all samples.',
                 'Slow the motion down, or raise the limits of the robot file.')
          for case in limited),
        *(Remark(False, f'{_sentence(case.label)}: {case.tracking.missing_effort} reference points '
                        f'came without feedforward torque.') for case in lost),
        *([] if limited else [Remark(True, 'No torque and no speed was limited.')]),
        Remark(True, f'The largest torque was '
                     f'{number(max(case.tracking.peak_torque for case in cases))} N m.')]
    return Outcome(f'{sentence}.', 'good' if not limited and not lost else 'fair', tuple(remarks))


def tracking_json(cases: Sequence[Case], motion: Motion, robot: Robot, cycles: int, band: float,
                  provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return `tracking.json`."""
    return plain({
        'schema': 'par4/tracking/1', 'robot': robot.name,
        'motion': {'name': motion.name, 'duration': motion.duration, 'cycles': cycles},
        'band': band,
        'runs': [{'controller': case.controller, 'feedforward': case.feedforward}
                 | asdict(case.tracking) for case in cases],
        'provenance': provenance})


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]


def _millimetres(value: float) -> str:
    return f'{number(MILLI * value)} mm'


COLUMNS: tuple[tuple[str, str, float], ...] = (
    ('rms error, mm', 'rms', MILLI), ('peak error, mm', 'peak', MILLI),
    ('beyond the ends, mm', 'excursion', MILLI), ('overshoot, mm', 'overshoot', MILLI),
    ('settling time, ms', 'settling_time', MILLI), ('arrival, ms', 'arrival', MILLI),
    ('peak torque, N m', 'peak_torque', 1.0), ('rms torque, N m', 'rms_torque', 1.0),
    ('energy a cycle, J', 'energy', 1.0), ('driving, J', 'driving_energy', 1.0))
"""Heading, field of `Tracking` and factor of the columns of the table."""
FIELDS = tuple(field for _, field, _ in COLUMNS)


BRIEF = ('rms', 'peak', 'settling_time', 'peak_torque', 'energy')
"""Fields whose columns fit a terminal."""


def headings_of(fields: Sequence[str]) -> list[str]:
    """Return the headings of the columns of these fields."""
    return [heading for heading, field, _ in COLUMNS if field in fields]


def cells_of(case: Case, fields: Sequence[str]) -> list[str]:
    """Return the cells of a case in the columns of these fields."""
    return [number(factor * getattr(case.tracking, field))
            for _, field, factor in COLUMNS if field in fields]
