"""An identification in words: TABLE 1, whether it can be trusted, `identification.json`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from par4_dynamics.base_terms import HANGING_TERMS, INERTIA, OFFSET, values_of_bodies
from par4_dynamics.effects.torque_offset import TorqueOffset
from par4_dynamics.model import Model
from par4_dynamics.model_file import read_model_file
from par4_dynamics.parameters import Parameter
from par4_identification.estimators.instrumental import InstrumentalEstimate
from par4_identification.fitting.identification import Identification
from par4_identification.fitting.lumping_bias import Lumping, lumping_of
from par4_identification.fitting.validation import LARGEST_ERROR
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.estimator import (
    MATERIAL,
    estimator_in_words,
    estimator_json,
    estimator_remarks,
)
from par4_identification.reports.outcome.outcome import (
    FLOOR_EXCESS,
    data_remark,
    duration,
    over_joints,
)
from par4_identification.reports.outcome.results import data_of_logs
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot, read_robot
from par4_sim.report.outcome import Outcome, Remark, note
from par4_sim.report.results import plain
from par4_sim.report.words import in_words, joint_labels, listed, number, percent, torque_name

LARGEST_CONDITION = 200.0
"""Condition number of W above which a motion excites the parameters weakly."""
WORST_CONDITION = 1000.0
"""Condition number of W above which a model is of no use."""
LARGEST_STD = 0.1
"""Relative standard deviation above which a parameter is not determined."""
GRAVITY = tuple(term.name for term in HANGING_TERMS['turning'])
"""Base parameters of a load that hangs on an axis."""
MEMORY = 0.15
"""Autocorrelation of a residual, behind the filters' own, above which it is not noise."""
UNEQUAL = 1.5
"""Residual over noise floor of a joint, over that of the median joint, that stands out."""
TOLD_FROM = 2.0
"""Standard deviations by which the residual must tell rods as in the robot file from none."""
HALF = 0.5
"""Share between none of them and all."""
LARGEST_BIASES = 3
"""How many biased values are named, the worst first."""
DIAGNOSE = 'Run par4_diagnose on these bags: it looks for the cause.'

_RECORD = {
    'actuator_inertia': 'faster motions',
    'platform_mass_1': 'faster motions of the platform that also turn theta',
    'platform_mass_2': 'faster motions of the platform that also turn theta',
    'arm_gravity': 'slow sweeps over the whole range of every joint',
    'coulomb_friction': 'slow motions in both directions',
    'viscous_friction': 'motions at several speeds in both directions',
    'gravity_sine': 'slow motions over a wide range of positions',
    'gravity_cosine': 'slow motions over a wide range of positions',
    'gravity_load': 'slow motions in both directions'}


@dataclass(frozen=True)
class ParameterRow:
    """A row of TABLE 1.

    Attributes:
        name, symbol, unit: of the parameter; the name tells the joint where each has its own.
        value, std, relative_std: identified; the latter a fraction.
        paper, paper_relative_std: of TABLE 1, its f_v read as 2.04; None for machines of other
            dimensions.
        printed: what TABLE 1 prints where that is not plausible, else None.
        true: what the machine was simulated with, else None.
    """

    name: str
    symbol: str
    unit: str
    value: float
    std: float
    relative_std: float
    paper: float | None
    paper_relative_std: float | None
    printed: float | None
    true: float | None


def table_of_parameters(identification: Identification, machine: Robot | Axis,
                        truth: Model | None = None) -> tuple[ParameterRow, ...]:
    """Return TABLE 1: identified values beside the paper's and, if given, the true ones.

    The paper's are shown of a robot with the dimensions of the paper's.
    """
    is_papers = (isinstance(machine, Robot)
                 and machine.geometry == read_robot('reference').geometry)
    paper = read_model_file('table1').parameters if is_papers else {}
    printed = read_model_file('table1_as_printed').parameters if is_papers else {}
    symbols = {term.name: term.symbol for term in identification.terms}
    estimate, rows = identification.estimate, []
    for label, value, std in zip(estimate.labels, estimate.values, estimate.std, strict=True):
        name, theirs, true = label.name, paper.get(label.name), None
        odd = theirs is not None and printed[name].value != theirs.value
        if truth is not None:
            whose = slice(None) if label.output is None else label.output
            true = float(np.mean(_true_values(truth, name)[whose]))
        rows.append(ParameterRow(
            name if len(machine.joint_names) == 1 else str(label),
            symbols.get(name, ''), unit_on(machine, label.unit), float(value), float(std),
            _relative(Parameter(value=value, std=std)), None if theirs is None else theirs.number,
            None if theirs is None else _relative(theirs),
            printed[name].number if odd else None, true))
    return tuple(rows)


def _true_values(truth: Model, name: str) -> np.ndarray:
    """Return what a simulated machine truly has of a parameter, (J,); 0 if its model lacks it."""
    nothing = np.zeros_like(truth.values['coulomb_friction'])
    if name != OFFSET.name:  # the load of gravity on an axis may be left out of a model
        return truth.values.get(name, nothing)
    offsets = [active.values['offset'] for active in truth.effects
               if active.effect.name == TorqueOffset.name]
    return np.sum(offsets, axis=0) if offsets else nothing


def _left_out_remarks(identification: Identification) -> list[Remark]:
    return [Remark(
        False, f'Steady speeds do not show the {in_words(term.name)}; it is left out and counts as '
        f'zero.', 'Record a motion that goes faster and slower as well.')
        for term in identification.left_out if term.name == INERTIA]


def outcome_of_identification(identification: Identification, floor: np.ndarray,
                              machine: Robot | Axis, logs: Sequence[Log],
                              useless: bool = False) -> Outcome:
    """Return whether the identified model can be trusted, why, and what to do next.

    Args:
        identification: the fit.
        floor: noise floor of each joint, (J,), N m.
        machine: that was identified.
        logs: behind the fit.
        useless: whether a finding about the setup forbids to use them.
    """
    estimate, unit = identification.estimate, unit_on(machine, 'N m')
    relative = relative_deviations(identification.parameters)
    unsure = [name for name, value in relative.items() if value > LARGEST_STD]
    rms, noise = over_joints(estimate.rms), over_joints(floor)
    condition = identification.excitation
    remarks = (
        *estimator_remarks(identification, machine), *_bias_remarks(identification, machine),
        _excitation_remark(condition, machine), _precision_remark(relative, unsure),
        _sign_remark(identification), floor_remark(rms, noise, unit),
        _memory_remark(identification), *_left_out_remarks(identification),
        *_joints_remark(estimate.rms, floor, machine),
        data_remark(logs))
    sentence = (
        f'The {len(relative)} parameters are identified from {number(duration(logs), 2)} s of '
        f'recording to {percent(max(relative.values()))} or better; they leave {number(rms, 2)} '
        f'{unit} rms, {percent(estimate.relative_error)} of the {torque_name(machine)}, the noise '
        f'floor being {number(noise, 2)} {unit}')
    if useless:
        return Outcome(f'{sentence}: do not use this model, what was found before anything else '
                       f'forbids it.', 'bad', remarks)
    if (estimate.relative_error > LARGEST_ERROR
            or condition > WORST_CONDITION):
        return Outcome(f'{sentence}: do not use this model.', 'bad', remarks)
    if unsure:
        are = 'is' if len(unsure) == 1 else 'are'
        return Outcome(f'{sentence}; {listed([in_words(name) for name in unsure])} {are} not '
                       f'determined.', 'bad', remarks)
    if rms > FLOOR_EXCESS * noise:
        return Outcome(f'{sentence}: good on average, but the machine does something that the '
                       f'model lacks.', 'fair', remarks)
    if not all(remark.good for remark in remarks):
        return Outcome(f'{sentence}: the model can be used; what weakens it stands below.', 'fair',
                       remarks)
    return Outcome(f'{sentence}: the model can be trusted.', 'good', remarks)


def _bias_remarks(identification: Identification, machine: Robot | Axis) -> list[Remark]:
    """Return what biases the values, or may; nothing for an axis, which has no cause of it."""
    if not isinstance(machine, Robot):
        return []
    remarks = []
    if identification.rigid_body == 'paper' and any(values_of_bodies(machine.bodies).values()):
        remarks.append(_lumping_remark(identification, lumping_of(identification, machine)))
    if not isinstance(identification.estimate, InstrumentalEstimate):
        remarks.append(note(
            'Whether noise of the positions biases the values was not tested.',
            'Identify once more with --estimator instrumental, which takes bags with the topic '
            'reference: it tells whether noise of the positions biases least squares.'))
    return remarks


def _lumping_remark(identification: Identification, lumping: Lumping) -> Remark:
    """Return whether the rods and bars that (20) lumps bias the values."""
    estimate = identification.estimate
    size = np.abs(lumping.bias) / np.maximum(estimate.std, 1e-30)
    if size.max() < MATERIAL:
        return Remark(True, f'Lumping rods and bars, as equation (20) does, biases no value by '
                            f'more than {number(size.max(), 2)} of its standard deviations.')
    margin = TOLD_FROM * lumping.share_std
    if lumping.share + margin < HALF:
        return Remark(True, 'No bias from lumping rods and bars, as equation (20) does: the '
                            'residual shows that the machine is not as the robot file describes '
                            'them, distributed.')
    worst = [index for index in np.argsort(-size)[:LARGEST_BIASES] if size[index] >= MATERIAL]
    named = listed([f'{in_words(str(label))} by {number(lumping.bias[index], 2)} {label.unit}'
                    for index in worst for label in (estimate.labels[index],)])
    amount = f'{named}, up to {number(size.max(), 2)} standard deviations'
    if lumping.share - margin > HALF:
        return Remark(False, f'Equation (20) lumps rods and bars; the residual shows that they are '
                             f'distributed as the robot file says, which biases {amount}.',
                      'Identify with --rigid-body full.')
    return Remark(False, f'Equation (20) lumps rods and bars. If they are as the robot file says, '
                         f'this biases {amount}; the residual does not tell whether they are.',
                  'Identify with --rigid-body full, or record longer, faster and with less noise: '
                  'then the residual tells.')


def _excitation_remark(condition: float, machine: Robot | Axis) -> Remark:
    size = (f'the condition number of the regressor is {number(condition)} '
            f'(good below {LARGEST_CONDITION:.0f}).')
    if condition <= LARGEST_CONDITION:
        return Remark(True, f'The motion excites all parameters: {size}')
    return Remark(False, f'The motion excites some parameters weakly: {size}',
                  'Record a richer motion: slow and fast, ' + (
                      'all joints, the whole workspace; par4_excite designs one.'
                      if isinstance(machine, Robot) else 'both ways, over the whole range.'))


def _precision_remark(relative: dict[str, float], unsure: list[str]) -> Remark:
    if not unsure:
        return Remark(True, f'Every parameter is known to {percent(max(relative.values()))} or '
                            f'better (one standard deviation, for residuals correlated in time).')
    named = listed([f'{in_words(name)} ({percent(relative[name])})' for name in unsure])
    return Remark(False, f'Not determined: {named}, by relative standard deviation.',
                  _record(unsure))


def _record(names: Sequence[str]) -> str:
    """Return what to record so that these parameters show."""
    return f'Record {listed(list(dict.fromkeys(_RECORD[name] for name in names)))}.'


def _sign_remark(identification: Identification) -> Remark:
    parameters = identification.parameters
    doubtful = [term.name for term in identification.terms if term.nonnegative
                and np.any(np.less(parameters[term.name].value,
                                   2.0 * np.asarray(parameters[term.name].std)))]
    if not doubtful:
        return Remark(True, 'Every inertia, mass and friction is positive beyond doubt.')
    named = listed([in_words(name) for name in doubtful])
    return Remark(False, f'Cannot be told from zero: {named}.', _record(doubtful))


def floor_remark(rms: float, noise: float, unit: str) -> Remark:
    """Return how a residual compares with the noise floor, both over all joints."""
    size = (f'The residual of {number(rms, 2)} {unit} rms is {number(rms / max(noise, 1e-12), 2)} '
            f'times the noise floor of {number(noise, 2)} {unit}')
    if rms <= FLOOR_EXCESS * noise:
        return Remark(True, f'{size}: hardly more than noise is left.',
                      'Validate it on a bag of another motion with par4_validate.')
    return Remark(False, f'{size}: the machine does something that the model lacks, which may bias '
                         f'the parameters by more than their standard deviations.',
                  DIAGNOSE)


def _memory_remark(identification: Identification) -> Remark:
    estimate = identification.estimate
    left = residual_memory(identification)
    if left <= MEMORY:
        return Remark(True, 'The residual keeps no memory beyond that of the filters, like noise.')
    widening = float(np.max(estimate.std / np.maximum(estimate.textbook_std, 1e-30)))
    return Remark(False, f'The residual remembers itself beyond the filters (autocorrelation '
                         f'{left:.2f}), so it is not noise; standard deviations are up to '
                         f'{number(widening, 2)} times those for white noise.', DIAGNOSE)


def _joints_remark(rms: np.ndarray, floor: np.ndarray, machine: Robot | Axis) -> list[Remark]:
    """Return whether the joints fit alike; nothing where there are too few to tell."""
    if len(rms) < 3:
        return []
    excess = rms / np.maximum(floor, 1e-12)
    worse = [label for label, own in zip(joint_labels(machine), excess, strict=True)
             if own > UNEQUAL * np.median(excess)]
    if not worse:
        return [Remark(True, 'All joints fit alike.')]
    return [Remark(False, f'Worse than the other joints: {listed(worse)}.',
                   f'Check gain, zero and mechanics of {listed(worse)}.')]


def autocorrelation(residuals: Sequence[np.ndarray], valid: Sequence[np.ndarray], lags: int
                    ) -> np.ndarray:
    """Return the autocorrelation (lags, J) of residuals (m, J) of runs over pairs of valid rows.

    Each is the correlation of the two rows of its pairs, about zero: from -1 to 1.
    """
    products, earlier, later = np.zeros((3, lags, residuals[0].shape[1]))
    for residual, mask in zip(residuals, valid, strict=True):
        kept = np.where(mask, residual, 0.0)
        for lag in range(min(lags, len(kept))):
            end = len(kept) - lag
            products[lag] += (kept[lag:] * kept[:end]).sum(axis=0)
            earlier[lag] += (kept[:end] ** 2 * mask[lag:]).sum(axis=0)
            later[lag] += (kept[lag:] ** 2 * mask[:end]).sum(axis=0)
    return products / np.maximum(np.sqrt(earlier * later), 1e-30)


def residual_memory(identification: Identification) -> float:
    """Return the mean autocorrelation of the residual of the joint where it is highest.

    Over lags from twice to eight times the period of the torque's low-pass: behind its memory.
    """
    run = identification.runs[0]
    first = max(1, math.ceil(2.0 / (run.conditioning.torque_cutoff_hz * float(np.diff(run.t[:2])[0])
                                    )))
    correlation = autocorrelation(identification.estimate.residuals,
                                  [run.valid for run in identification.runs], 4 * first)
    return float(correlation[first:].mean(axis=0).max())


def identification_json(identification: Identification, machine: Robot | Axis,
                        logs: Sequence[Log]) -> dict[str, Any]:
    """Return `identification.json`."""
    estimate, offsets = identification.estimate, identification.offsets
    return plain({
        'schema': 'par4/identification/1',
        'parameters': {
            name: {'value': parameter.value, 'std': parameter.std,
                   'relative_std': _relatives(parameter), 'unit': unit_on(machine, parameter.unit)}
            for name, parameter in identification.parameters.items()},
        'condition_number': estimate.condition_number, 'residual_rms': estimate.rms,
        'relative_error': estimate.relative_error,
        'data': {'rows': estimate.rows, 'bags': data_of_logs(logs)},
        'estimator': {
            **estimator_json(identification), 'in_words': estimator_in_words(identification),
            'textbook_std': {str(label): std for label, std in
                             zip(estimate.labels, estimate.textbook_std, strict=True)}},
        'offsets': {} if offsets is None else {OFFSET.name: {
            'value': offsets.value, 'std': offsets.std, 'unit': unit_on(machine, offsets.unit)}},
        'causes': [entry.effect for entry in identification.causes]})


def relative_deviations(parameters: Mapping[str, Parameter]) -> dict[str, float]:
    """Return the relative deviation of each parameter.

    Those of gravity on a turning axis are the parts of one vector: either may be zero, which is
    then known as well as the other.
    """
    relative = {name: _relative(parameter) for name, parameter in parameters.items()}
    parts = [name for name in GRAVITY if name in parameters]
    size = math.hypot(*(parameters[name].number for name in parts))
    if size > 0.0:
        relative |= {name: float(np.max(np.asarray(parameters[name].std, dtype=float))) / size
                     for name in parts}
    return relative


def _relative(parameter: Parameter) -> float:
    """Return the relative deviation, the largest one where each joint has its own."""
    return float(np.max(_relatives(parameter)))


def _relatives(parameter: Parameter) -> np.ndarray | float:
    """Return the relative deviation, one a joint where each has its own."""
    value, std = np.abs(parameter.value), np.asarray(parameter.std)
    return np.divide(std, value, out=np.full(value.shape, math.inf), where=value > 0.0)
