"""par4_identify: measured bags into a model, TABLE 1 and a report."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from par4_dynamics.model_file import RigidBody
from par4_dynamics.model_from_file import build_model, read_model
from par4_identification.diagnosis.verdict.floor import noise_floor
from par4_identification.fitting.axis_gravity import with_gravity_told
from par4_identification.fitting.identification import Fitting, identify
from par4_identification.jobs.beside_causes import beside_causes
from par4_identification.jobs.read_bags import read_bags
from par4_identification.reports.outcome.estimator import estimator_remarks
from par4_identification.reports.outcome.gravity import gravity_remarks
from par4_identification.reports.outcome.identification import (
    ParameterRow,
    identification_json,
    outcome_of_identification,
    table_of_parameters,
)
from par4_identification.reports.outcome.loads import known_payloads, weighed_payload
from par4_identification.reports.outcome.results import model_in_units, provenance
from par4_identification.reports.outcome.setup import setup_json, with_setup
from par4_identification.setup_check.check import check_setup
from par4_identification.setup_check.unusable import sound_or_refused
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.scales import Chosen, conditioning_for
from par4_kinematics.errors import InputError
from par4_kinematics.paths import refuse_unwritable
from par4_kinematics.robot import Axis, Robot, read_machine
from par4_sim.report.results import write_results
from par4_sim.report.terminal import print_table, say
from par4_sim.report.words import in_words, listed, percent, with_std

HEAVIEST = 1000.0
"""Heaviest payload, kg."""


@dataclass(frozen=True)
class IdentificationRequest:
    """What `par4_identify` was asked for, as the command line has it.

    Attributes:
        bags: to identify from.
        robot: file or built-in name.
        output: folder.
        rigid_body: 'paper' or 'full'.
        estimator, per_joint, offsets: of the fit; see `Fitting`.
        payload: known masses, BAG=KG.
        unknown_payload: bags with a payload to be weighed.
        namespace: that the topics sit under.
        cutoff, rows, low_speed: of the filters; None leaves them to the data.
        compare_true: model to be shown beside what is identified, file or built-in name.
        report: whether the page is drawn.
    """

    bags: tuple[str, ...]
    robot: str
    output: Path
    rigid_body: RigidBody
    estimator: str
    per_joint: bool
    offsets: bool
    payload: tuple[str, ...]
    unknown_payload: tuple[str, ...]
    namespace: str | None
    cutoff: float | None
    rows: float | None
    low_speed: float | None
    compare_true: str | None
    report: bool

    @property
    def chosen(self) -> Chosen:
        """What was set of the filters."""
        return Chosen(self.cutoff, self.rows, self.low_speed)

    @property
    def fitting(self) -> Fitting:
        """How the parameters are fitted."""
        return Fitting(self.estimator, self.per_joint, self.offsets)


def identify_bags(asked: IdentificationRequest) -> None:
    """Identify the parameters of equation (20) from measured bags."""
    machine = read_machine(asked.robot)
    truth = None if asked.compare_true is None else read_model(asked.compare_true, machine)
    masses = payload_masses(asked.payload, asked.bags)
    loaded = loaded_bags(asked.unknown_payload, asked.bags)
    refuse_payloads(machine, masses, loaded)
    refuse_unwritable(asked.output)
    with Console(stderr=True).status('reading the bags') as status:
        logs = read_bags(asked.bags, machine, asked.namespace, status.update)
        status.update('looking for mistakes of the setup')
        check = check_setup(logs, machine)
        logs = check.logs
        conditioning = conditioning_for(logs, check.machine, Conditioning(), asked.chosen)
        machine = with_gravity_told(check.machine, logs, conditioning)
        status.update('identifying')
        bare = [log for log in logs if log.name not in loaded]
        identification = sound_or_refused(check, lambda: identify(
            bare, machine, asked.rigid_body, masses, conditioning, asked.fitting))
        # a payload is no cause that would have to be found
        beside = None if masses else sound_or_refused(check, lambda: beside_causes(
            identification, bare, machine, conditioning, asked.chosen, status.update))
        identification = identification if beside is None else beside.identification
        model_file = model_in_units(identification.model_file(provenance(
            'par4_identify', machine, asked.bags,
            {'rigid_body': asked.rigid_body, 'payload': masses, 'unknown_payload': loaded,
             'namespace': asked.namespace, **asdict(asked.fitting), **asdict(conditioning)}),
            machine), machine)
        status.update('measuring the noise floor')
        floor = noise_floor(identification.runs, build_model(machine, model_file))
        status.update('weighing payloads')
        gain_remarks, gain_fields = known_payloads(identification.runs, masses, machine,
                                                   asked.rigid_body)
        mass_remarks, mass_fields = weighed_payload(
            identification.runs, [log for log in logs if log.name in loaded], machine,
            asked.rigid_body, conditioning)
        found = (*gain_remarks, *mass_remarks)
        outcome = outcome_of_identification(identification, floor, machine, bare,
                                            bool(check.useless))
        lacking = () if beside is None else (beside.remark,)
        outcome = with_setup(replace(outcome, remarks=(
            *lacking, *gravity_remarks(machine, bare, conditioning), *outcome.remarks, *found)),
                             check, 'identification')
        table = table_of_parameters(identification, machine, truth)
        page = None
        if asked.report:
            status.update('drawing the report')
            # the plot library is slow to load, and some homes make it talk on stderr
            from par4_identification.reports.identification_report import report_of_identification
            page = report_of_identification(identification, outcome, table, floor, machine, logs,
                                            model_file.provenance, masses)
        write_results(asked.output, {
            'model.yaml': model_file,
            'identification.json': {**identification_json(identification, machine, logs),
                                    'setup': setup_json(check),
                                    **gain_fields, **mass_fields},
            'report.html': page})
    say(*outcome.first)
    print_table(terminal_table(table))
    findings = [remark.text for remark in (*estimator_remarks(identification, machine), *found)
                if remark.good]
    reservations = [f'- {remark.text} {remark.advice}'.rstrip() for remark in outcome.remarks
                    if not remark.good]
    say(*findings, outcome.sentence, *reservations)
    say(f'results{" and report" if asked.report else ""}: {asked.output}', whole=True)


def payload_masses(payloads: Sequence[str], bags: Sequence[str]) -> dict[str, float]:
    """Return bag -> mass, kg, of options BAG=KG.

    Raises:
        InputError: another form, an unknown bag, one that is given twice or no mass.
    """
    masses: dict[str, float] = {}
    for payload in payloads:
        bag, _, mass = payload.rpartition('=')
        same = [name for name in bags if bag and os.path.realpath(name) == os.path.realpath(bag)]
        try:
            value = float(mass)
        except ValueError:
            value = math.nan
        if not same or not 0.0 <= value <= HEAVIEST:
            raise InputError(f'--payload {payload}: expected BAG=KG with a mass of 0 to '
                             f'{HEAVIEST:g} kg and one of the bags given ({", ".join(bags)})')
        if same[0] in masses:
            raise InputError(f'--payload {payload}: found {masses[same[0]]:g} kg for that bag '
                             f'already; give every bag one payload')
        masses[same[0]] = value
    return masses


def loaded_bags(names: Sequence[str], bags: Sequence[str]) -> list[str]:
    """Return the bags, as they were given, that --unknown-payload names.

    Raises:
        InputError: an unknown bag, or no bag left without the payload.
    """
    asked = {os.path.realpath(name): name for name in names}
    loaded = [bag for bag in bags if os.path.realpath(bag) in asked]
    unknown = asked.keys() - {os.path.realpath(bag) for bag in loaded}
    if unknown:
        raise InputError(f'--unknown-payload {asked[min(unknown)]}: expected one of the bags given '
                         f'({", ".join(bags)})')
    if len(loaded) == len(bags):
        raise InputError('--unknown-payload: every bag carries it; give a bag without it too')
    return loaded


def refuse_payloads(machine: Robot | Axis, masses: Mapping[str, float], loaded: Sequence[str]
                    ) -> None:
    """Refuse payloads on an axis, and known together with unknown ones.

    Raises:
        InputError: names what does not go together.
    """
    if isinstance(machine, Axis) and (masses or loaded):
        raise InputError(f'--payload, --unknown-payload: {machine.name} is a single axis without a '
                         f'platform; leave them out')
    if masses and loaded:
        raise InputError('--payload and --unknown-payload together: a mass is known or asked for; '
                         'give one of them')


def terminal_table(rows: Sequence[ParameterRow]) -> Table:
    """Return TABLE 1 for a terminal."""
    paper, truth = (any(getattr(row, name) is not None for row in rows)
                    for name in ('paper', 'true'))
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column('parameter', no_wrap=True)
    for name in (*(['paper'] if paper else []), *(['true'] if truth else []), 'identified',
                 'rel. std'):
        table.add_column(name, justify='right', no_wrap=True)
    table.add_column('unit', no_wrap=True)
    for row in rows:
        table.add_row(
            in_words(row.name),
            *(['' if row.paper is None else f'{row.paper:g}'] if paper else []),
            *([f'{row.true:.5g}'] if truth else []), ' ± '.join(with_std(row.value, row.std)),
            percent(row.relative_std), row.unit)
    printed = list(dict.fromkeys(
        f'{in_words(row.name.partition("[")[0])} {row.printed:g} {row.unit}'
        for row in rows if row.printed))
    if printed:
        table.caption = f'The paper prints {listed(printed)}, which is not plausible.'
        table.caption_justify = 'left'
    return table
