"""The offline tools as users meet them: files, sentences, exit codes."""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import resource
import shutil
import subprocess
import sys
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import click
import numpy as np
import pytest
from browser import PHONE, WIDE, check_in_browser
from measured import log_of_model
from report_pages import Page, checked_page

from executables import TOOLS
from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.effects.effect import EffectParameter
from par4_dynamics.model_file import read_model_file
from par4_dynamics.model_from_file import build_model, read_model
from par4_dynamics.parameters import Parameter
from par4_identification.commands import diagnose, identify, validate
from par4_identification.diagnosis.evidence.holdout import Gain
from par4_identification.diagnosis.evidence.unnamed import KINDS
from par4_identification.diagnosis.verdict.answer import Cause, Diagnosis, Holdout, Remaining
from par4_identification.diagnosis.verdict.floor import noise_floor
from par4_identification.diagnosis.verdict.judgement import UnnamedCause
from par4_identification.diagnosis.verdict.unrelated import Line, Unrelated
from par4_identification.fitting.identification import identify as fit_parameters
from par4_identification.logs.bag_hash import bag_sha256
from par4_identification.logs.read_log import read_log
from par4_identification.reports.cause_cells import parameter_cells
from par4_identification.reports.names import Names
from par4_identification.reports.outcome.causes import phrase_of_cause
from par4_identification.reports.outcome.diagnosis import diagnosis_json, outcome_of_diagnosis
from par4_identification.reports.outcome.identification import (
    autocorrelation,
    outcome_of_identification,
    relative_deviations,
    residual_memory,
)
from par4_identification.reports.residual_plots import (
    residual_over_motion,
    residual_statistics,
    signature,
)
from par4_identification.reports.time_plots import residual_over_time
from par4_identification.ros.record_parameters import RecordParameters
from par4_kinematics.errors import InputError
from par4_kinematics.files import write_text, write_yaml, written_atomically
from par4_kinematics.interface import COUNTS
from par4_kinematics.motion_file import named_motion, write_motion
from par4_kinematics.robot import JOINT_NAMES, Axis
from par4_kinematics.ros.start import start_node
from par4_sim.bags.bag_writer import BagWriter
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import build_simulation
from par4_sim.commands import entry, simulate, track
from par4_sim.commands.entry import run as run_command
from par4_sim.commands.numbers import Numbers
from par4_sim.report.results import plain, write_results
from par4_sim.report.terminal import say
from par4_sim.report.words import listed, number, percent, typeset, with_std
from robots import REFERENCE, model_with

TABLE_1 = read_model('table1', REFERENCE)
FULL = read_model('table1_full', REFERENCE)
ADEPT = named_motion('adept', REFERENCE)
COGGING = model_with(TABLE_1, 'cogging', amplitude=0.61, periods=22.0, phase=(0.3, 1.0, 2.0, -1.0))
AXIS = Axis(schema='par4/axis/1', name='slide', joint='slide', kind='linear', gain=35.0)


def run(module, *arguments) -> SimpleNamespace:
    """Run an executable of `module` in this process."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, 'argv', ['tool', *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            module.main()
    return SimpleNamespace(code=stop.value.code, out=out.getvalue(), err=err.getvalue())


@pytest.mark.parametrize('module', [identify, validate, diagnose])
def test_every_command_tells_its_version(module):
    for _ in range(2):
        told = run(module, '--version')
        assert told.code == 0
        assert told.out.split() == [f'par4_{module.__name__.split(".")[-1]},', 'version',
                                    version('par4_identification')]


def options_of_numbers():
    """Return module and option of every option of every command that takes numbers."""
    found = []
    for module in (*TOOLS.values(), 'par4_identification.commands.inspect'):
        command = next(item for item in vars(import_module(module)).values()
                       if isinstance(item, click.Command))
        for option in command.params:
            kinds = option.type.types if isinstance(option.type, click.Tuple) else [option.type]
            if isinstance(option, click.Option) and isinstance(kinds[0], (
                    click.types.FloatParamType, click.types.IntParamType, Numbers)):
                found.append((module, option))
            else:
                assert not is_number(option.default), f'{option.name}: give it a type of numbers'
    return found


def is_number(value):
    """Return whether a default is a number, or the text of one."""
    if isinstance(value, str):
        return value.replace('.', '').isdecimal()
    return isinstance(value, float | int) and not isinstance(value, bool)


@pytest.mark.parametrize(('module', 'option'), options_of_numbers(), ids=lambda item: getattr(
    item, 'name', item))
@pytest.mark.parametrize('text', ['nan', 'inf', '-inf', '1e999', '1e13'])
def test_no_option_takes_what_is_no_number_of_a_machine(module, option, text):
    words = [text] if option.nargs == 1 else ['1', text]
    done = run(import_module(module), option.opts[0], *words)
    assert done.code == 2
    assert done.err.startswith('error: ')
    assert done.err.count('\n') == 1
    assert option.opts[0] in done.err, done.err


def test_every_command_has_its_numbers_looked_at():
    found = options_of_numbers()
    assert len(found) > 50
    assert {option.name for _, option in found} >= {
        'duration', 'torque_noise', 'seed', 'between', 'counts_per_turn', 'cutoff'}
    for _, option in found:
        plain = (click.types.FloatParamType, click.FloatRange, click.types.IntParamType,
                 click.IntRange)
        assert type(option.type) not in plain, f'{option.name}: par4_sim/commands/numbers.py'


@pytest.mark.parametrize(('options', 'words'), [
    *((option, f"{option[0]}: expected a whole number of 0 or more, found '{option[1]}'; see par4_")
      for option in (('--seed', '-1'), ('--motion-seed', '-1'), ('--seed', '1.5'),
                     ('--seed', '1e3'), ('--seed', '\N{MINUS SIGN}1'))),
    *((option, f'--date: expected a date as 2026-03-31 or 2026-03-31T14:30:00, from 1970 to 2037, '
               f"which a stamp holds, found '{option[1]}'; see par4_simulate --help")
      for option in (('--date', '1969-12-31'), ('--date', '2038-01-01'), ('--date', 'monday'))),
    (('--rate', '0'), "--rate: expected a number of 1 or more, found '0'; see par4_sim"),
    (('--duration', 'ten'), "--duration: expected a number of 0.1 or more, found 'ten'; see par4_"),
    (('--noise-time', 'inf'), '--noise-time: expected a number of 0 or more, finite and at most '
                              "1e+12, found 'inf'; see par4_simulate --help"),
    (('--fidelity', 'best'), "--fidelity: 'best' is not one of 'accurate', 'fast', 'exact'; see")])
def test_a_simulation_refuses_seeds_and_dates_that_there_are_not(options, words, tmp_path):
    done = run(simulate, 'circle', '--output', tmp_path / 'bag', *options)
    assert done.code == 2
    assert words in done.err
    assert not (tmp_path / 'bag').exists()


@pytest.mark.parametrize(('command', 'words', 'said'), [
    (simulate, 'adept --output a --seed 1 --seed 2', '--seed: given twice'),
    (simulate, 'adept --output=a --seed 1 --output=b', '--output: given twice'),
    (identify, 'bag --output a --robot reference --report --no-report', '--no-report: given twice'),
    (diagnose, 'a --output a --robot reference --holdout b c --holdout b', '--holdout b: given'),
    (track, 'adept --output a --controller loops --controller=loops', '--controller loops: given')])
def test_an_option_given_twice_is_refused(command, words, said):
    done = run(command, *words.split())
    assert done.code == 2
    assert done.err.startswith(f'error: {said}')
    assert '; give it once; see par4_' in done.err


def test_an_option_of_several_values_may_be_given_again():
    with mock.patch.object(track.track, 'callback') as called:
        assert run(track, 'adept', '--output', 'a', '--controller', 'loops', '--controller',
                   'predictive').code == 0
    assert called.call_args.kwargs['controller'] == ('loops', 'predictive')


@pytest.mark.parametrize(('motion', 'options', 'words'), [
    ('mine.yaml', ('--duration', '7', '--motion-seed', '0'),
     '--duration, --motion-seed: found the motion file mine.yaml, which is played as it is; leave '
     'them away or change the file'),
    ('adept', ('--duration', '7', '--motion-seed', '3'),
     '--motion-seed: for the motion excitation, found motion adept; leave it away')])
def test_a_simulation_refuses_options_that_its_motion_would_ignore(
        motion, options, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_motion('mine.yaml', named_motion('circle', REFERENCE))
    done = run(simulate, motion, '--output', 'bag', *options)
    assert done.code != 0
    assert words in done.err
    assert not (tmp_path / 'bag').exists()


def test_a_simulation_is_closed_also_where_its_bag_cannot_be_written(tmp_path):
    simulation = mock.Mock()
    with pytest.raises(InputError, match='exists already'):
        simulate_to_bag(simulation, named_motion('circle', REFERENCE), REFERENCE, tmp_path)
    simulation.close.assert_called_once_with()


def simulated(folder: Path, name: str, model, seed: int, duration: float = 6.0) -> Path:
    motion = named_motion('excitation', REFERENCE, duration, seed)
    simulation = build_simulation(REFERENCE, model, 'exact', 1e-3, seed, torque_noise=0.1)
    simulate_to_bag(simulation, motion, REFERENCE, folder / name)
    return folder / name


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp('bags')
    rest = folder / 'rest'
    simulation = build_simulation(REFERENCE, TABLE_1, 'exact', 1e-3, 0, torque_noise=0.1)
    with BagWriter(rest) as bag:
        for _ in range(2500):
            sample = simulation.next_sample()
            bag.write_joint_state('/joint_states', sample.time_ns, JOINT_NAMES, sample.q,
                                  effort=sample.effort)
    return SimpleNamespace(
        plain=simulated(folder, 'plain', TABLE_1, 1), other=simulated(folder, 'other', TABLE_1, 2),
        cogging=simulated(folder, 'cogging', COGGING, 3),
        cogging_too=simulated(folder, 'cogging_too', COGGING, 4, 4.0), rest=rest)


@pytest.fixture(scope='module')
def identified(bags, tmp_path_factory):
    folder = tmp_path_factory.mktemp('identified') / 'new' / 'folder'
    done = run(identify, bags.plain, '--robot', 'reference', '--output', folder,
               '--compare-true', 'table1')
    assert done.code == 0, done.err
    return SimpleNamespace(folder=folder, **vars(done))


@pytest.fixture(scope='module')
def diagnosed(bags, tmp_path_factory):
    folder = tmp_path_factory.mktemp('diagnosed')
    done = run(diagnose, bags.cogging, '--holdout', bags.cogging_too, '--robot', 'reference',
               '--output', folder)
    assert done.code == 0, done.err
    return SimpleNamespace(folder=folder, **vars(done))


# par4_identify


def test_identification_json_has_the_keys_of_the_contract(identified, bags):
    content = json.loads((identified.folder / 'identification.json').read_text())
    assert list(content) == ['schema', 'parameters', 'condition_number', 'residual_rms',
                             'relative_error', 'data', 'estimator', 'offsets', 'causes',
                             'setup']
    assert content['schema'] == 'par4/identification/1'
    for parameter in content['parameters'].values():
        assert list(parameter) == ['value', 'std', 'relative_std', 'unit']
        assert parameter['relative_std'] == pytest.approx(parameter['std'] / parameter['value'])
    assert len(content['residual_rms']) == 4
    bag = content['data']['bags'][0]
    assert bag['samples'] == len(read_log(bags.plain, REFERENCE).t)
    assert bag['position']['not_finite'] == 0


def test_identified_model_is_read_back_and_is_the_machine(identified):
    content = json.loads((identified.folder / 'identification.json').read_text())
    model_file = read_model_file(identified.folder / 'model.yaml')
    build_model(REFERENCE, model_file)
    for name, parameter in model_file.parameters.items():
        true = TABLE_1.values[name][0]
        assert parameter.value == pytest.approx(true, abs=5.0 * parameter.std, rel=1e-3)
        assert parameter.value == content['parameters'][name]['value']
        assert parameter.unit == content['parameters'][name]['unit']


def test_provenance_names_versions_date_and_the_bag_by_its_hash(identified, bags):
    provenance = read_model_file(identified.folder / 'model.yaml').provenance
    lines = [f'{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n'
             for file in sorted(bags.plain.iterdir())]
    assert provenance['bags'] == [{
        'path': str(bags.plain), 'sha256': hashlib.sha256(''.join(lines).encode()).hexdigest()}]
    assert provenance['versions']['numpy'] == np.__version__
    assert provenance['date'].endswith('+00:00')
    assert provenance['options'] == {
        'rigid_body': 'paper', 'estimator': 'weighted', 'low_speed': 0.05,
        'position_cutoff_hz': 160.0, 'torque_cutoff_hz': 40.0, 'row_rate_hz': 100.0}


def test_terminal_shows_table_1_within_80_columns(identified):
    assert identified.err == ''
    rows = {line.split('  ')[0].strip(): line for line in identified.out.splitlines()
            if ' ± ' in line}
    assert list(rows) == ['actuator inertia', 'platform mass 1', 'platform mass 2', 'arm gravity',
                          'Coulomb friction', 'viscous friction']
    assert max(map(len, rows.values())) <= 80
    assert rows['actuator inertia'].split()[2:4] == ['0.113', '0.113']
    assert '…' not in identified.out
    assert 'the model can be trusted' in identified.out


def test_identification_report_stands_alone(identified):
    page = checked_page(identified.folder / 'report.html', 3)
    for window in (WIDE, PHONE):
        check_in_browser(identified.folder / 'report.html', 3, 4, window)
    assert 'the model can be trusted' in page.text
    assert identified.out.splitlines()[-2] in page.text
    assert '0.8043' in page.text


def test_a_known_payload_is_taken_out_of_the_mass_of_its_half_plate(identified, bags, tmp_path):
    done = run(identify, bags.plain, '--robot', 'reference', '--output', tmp_path, '--no-report',
               '--payload', f'{bags.plain}=0.1')
    assert done.code == 0, done.err
    without = read_model_file(identified.folder / 'model.yaml').parameters
    loaded = read_model_file(tmp_path / 'model.yaml').parameters
    for name, parameter in without.items():
        change = -0.1 if name == 'platform_mass_1' else 0.0
        assert loaded[name].value - parameter.value == pytest.approx(change, abs=1e-9)


@pytest.fixture(scope='module')
def fits(bags):
    """Return the log, the identification and its noise floor of a plain and a cogging machine."""
    found = {}
    for name in ('plain', 'cogging'):
        log = read_log(getattr(bags, name), REFERENCE)
        fit = fit_parameters([log], REFERENCE)
        model = build_model(REFERENCE, fit.model_file({}))
        found[name] = log, fit, noise_floor(fit.runs, model)
    return found


@pytest.mark.parametrize(('name', 'changes', 'standing', 'said', 'advised'), [
    ('plain', {}, 'good', 'the model can be trusted', 'par4_validate'),
    ('cogging', {}, 'fair', 'does something that the model lacks', 'par4_diagnose'),
    ('plain', {'condition_number': 5000.0}, 'bad', 'do not use', 'richer motion'),
    ('plain', {'condition_number': 500.0}, 'fair', 'what weakens it', 'richer motion'),
    ('plain', {'relative_error': 0.5}, 'bad', 'do not use', ''),
    ('plain', {'covariance': np.diag((0, 0, 0, 0.3, 0, 0)) ** 2}, 'bad',
     'arm gravity is not determined', 'slow sweeps'),
    ('plain', {'rms': np.array((0.045, 0.045, 0.09, 0.045))}, 'fair', 'what weakens it',
     'mechanics of joint 2'),
])
def test_trust_follows_from_excitation_precision_and_residual(fits, name, changes, standing, said,
                                                              advised):
    log, fit, floor = fits[name]
    fit = replace(fit, estimate=replace(fit.estimate, **changes))
    outcome = outcome_of_identification(fit, floor, REFERENCE, [log])
    assert outcome.standing == standing
    assert said in outcome.sentence
    assert any(advised in step for step in outcome.advice)


def test_the_terminal_says_the_reservations_and_what_to_do(bags, tmp_path):
    done = run(identify, bags.cogging, '--robot', 'reference', '--output', tmp_path / 'odd',
               '--no-report')
    assert 'does something that the model lacks.\n- ' in done.out
    assert 'Run par4_diagnose on these bags' in done.out


def described(fit, log):
    """Return the outcome of a fit whose noise floor is its residual."""
    return outcome_of_identification(fit, fit.estimate.rms, REFERENCE, [log])


@pytest.mark.parametrize(('name', 'machine', 'noise', 'standing', 'said', 'advised'), [
    ('lumped', TABLE_1, 0.1, 'good', 'No bias from lumping rods and bars', ''),
    ('distributed', FULL, 0.1, 'fair', 'which biases platform mass 2 by -0.0', '--rigid-body full'),
    ('drowned', FULL, 5.0, 'fair', 'does not tell whether', 'less noise'),
    ('sunk', FULL, 30.0, 'bad', 'biases no value by more than 0.', 'slow sweeps'),
])
def test_bias_is_told_from_what_the_residual_shows(name, machine, noise, standing, said, advised):
    log = log_of_model(REFERENCE, machine, seed=1, noise=noise, name=name)
    log = replace(log, accounts=SimpleNamespace(findings=lambda: [], duration=11.0))
    outcome = described(fit_parameters([log], REFERENCE), log)
    assert outcome.standing == standing
    assert any(said in remark.text for remark in outcome.remarks)
    assert any(advised in step for step in outcome.advice)
    assert any('noise of the positions' in step for step in outcome.advice)
    full = described(fit_parameters([log], REFERENCE, 'full'), log)
    assert not any('lumps' in remark.text or 'umping' in remark.text for remark in full.remarks)


def test_every_reservation_says_what_to_do_next(fits):
    """Weak excitation, no precision, no sign, a residual above the floor, one joint worse."""
    log, fit, floor = fits['cogging']
    poor = replace(fit.estimate, condition_number=500.0, covariance=np.diag(
        np.square(fit.estimate.values)), rms=fit.estimate.rms * (1.0, 1.0, 1.0, 4.0))
    outcome = outcome_of_identification(replace(fit, estimate=poor), floor, REFERENCE, [log])
    troubles = [remark for remark in outcome.remarks if not remark.good]
    assert len(troubles) >= 6
    assert all(remark.advice for remark in troubles)
    assert outcome.standing == 'bad'


def test_only_a_residual_that_is_not_noise_remembers_itself(fits):
    assert residual_memory(fits['plain'][1]) < 0.1
    assert residual_memory(fits['cogging'][1]) > 0.2


def test_autocorrelation_of_a_decaying_series_decays_and_joins_nothing():
    random = np.random.default_rng(0)
    values = np.zeros((200_000, 1))
    noise = random.normal(size=len(values))
    for row in range(1, len(values)):
        values[row] = 0.8 * values[row - 1] + noise[row]
    parts = np.split(values, 4)
    valid = [random.uniform(size=part.shape) > 0.3 for part in parts]
    correlation = autocorrelation(parts, valid, 5)[:, 0]
    np.testing.assert_allclose(correlation, 0.8 ** np.arange(5), atol=0.03)
    single = [np.ones((1, 1))] * 9
    apart = autocorrelation(single, [part > 0.0 for part in single], 3)
    np.testing.assert_array_equal(apart[:, 0], [1.0, 0.0, 0.0])
    place = np.arange(200)[:, None] % 5  # large ones in pairs, small ones alone
    large = np.select([place == 4, (place == 1) | (place == 2)], [0.1, 10.0])
    assert autocorrelation([large], [large > 0.0], 2)[1, 0] == pytest.approx(1.0)


# par4_validate


def test_validation_of_a_good_model_on_another_bag(identified, bags, tmp_path):
    done = run(validate, bags.other, '--model', identified.folder / 'model.yaml', '--robot',
               'reference', '--output', tmp_path)
    assert done.code == 0, done.err
    content = json.loads((tmp_path / 'validation.json').read_text())
    assert list(content) == ['schema', 'rms', 'relative_error', 'r2', 'overall',
                             'without_standstill', 'data', 'setup']
    for errors in (content, content['without_standstill']):
        assert [len(errors[name]) for name in ('rms', 'relative_error', 'r2')] == [4, 4, 4]
        total = errors['overall']
        assert min(errors['rms']) <= total['rms'] <= max(errors['rms'])
        assert min(errors['relative_error']) <= total['relative_error'] <= max(
            errors['relative_error'])
        assert total['relative_error'] ** 2 >= 1.0 - total['r2'] - 1e-2
    assert content['without_standstill']['overall']['relative_error'] < 0.01
    page = checked_page(tmp_path / 'report.html', 2)
    check_in_browser(tmp_path / 'report.html', 2, traces=4)
    assert 'The model holds.' in page.text


@pytest.mark.usefixtures('unrendered')
def test_validation_on_the_bag_of_the_identification_is_called_by_its_name(identified, bags,
                                                                          tmp_path):
    done = run(validate, bags.plain, '--model', identified.folder / 'model.yaml', '--robot',
               'reference', '--output', tmp_path)
    assert 'this bag took part in making the model' in done.out
    assert 'this is no cross-validation' in Page(tmp_path / 'report.html').text


def test_validation_of_a_machine_at_rest_says_so(bags, tmp_path):
    done = run(validate, bags.rest, '--model', 'table1', '--robot', 'reference', '--output',
               tmp_path)
    assert done.code == 0, done.err
    content = json.loads((tmp_path / 'validation.json').read_text())
    assert content['without_standstill']['rms'] == [None] * 4
    assert min(content['rms']) > 0.0
    assert 'no joint moves' in checked_page(tmp_path / 'report.html', 1).text


# par4_diagnose


def test_diagnosis_json_has_the_keys_of_the_contract(diagnosed):
    content = json.loads((diagnosed.folder / 'diagnosis.json').read_text())
    assert list(content) == ['schema', 'verdict', 'causes', 'unnamed', 'holdout', 'remaining',
                             'next_experiment', 'extended_model', 'setup', 'simulation']
    assert list(content['holdout']) == ['baseline_rms', 'extended_rms', 'noise_floor_rms',
                                        'explained_fraction', 'explained_fraction_ci']
    assert list(content['remaining']) == ['significant', 'looks_like', 'wandering_rms',
                                          'correlation_time', 'lines', 'bursts']
    assert list(content['causes'][0]) == [
        'effect', 'joints', 'parameters', 'indistinguishable_from', 'visible_fraction', 'p_value',
        'margin', 'rival']
    assert content['verdict'] == 'explained'
    assert content['causes'][0]['effect'] == 'cogging'
    assert content['causes'][0]['parameters']['amplitude']['value'] == pytest.approx(
        [0.61] * 4, rel=0.05)
    assert content['next_experiment'] is None
    assert content['extended_model'] == 'extended_model.yaml'
    simulation = content['simulation']
    assert simulation['followed'] == 'reference'
    for quantity in ('torque', 'motion'):
        assert min(simulation[quantity]['baseline_rms']) > 1.5 * max(
            simulation[quantity]['extended_rms'])
    assert min(simulation['tracking']['baseline_rms']) > 1.5 * max(
        simulation['tracking']['extended_rms'])


NAMES = 'parameters', 'textbook_std'
"""Keys of results behind which the names of parameters stand as keys."""


def keys_of(content):
    """Return the keys in some content, but for what was read of each bag."""
    if isinstance(content, list):
        return set().union(*map(keys_of, content))
    if not isinstance(content, dict):
        return set()
    inner = [list(value.values()) if name in NAMES else value
             for name, value in content.items() if name != 'bags']
    return set(content) | keys_of(inner)


@pytest.mark.parametrize('name', ['identification', 'diagnosis', 'validation'])
def test_every_key_of_a_result_is_on_its_page(name, identified, diagnosed, bags, tmp_path):
    folder = {'identification': identified.folder, 'diagnosis': diagnosed.folder}.get(name)
    if folder is None:
        folder = tmp_path / 'validated'
        done = run(validate, bags.plain, '--model', identified.folder / 'model.yaml', '--robot',
                   'reference', '--output', folder, '--no-report')
        assert done.code == 0, done.err
    content = json.loads((folder / f'{name}.json').read_text())
    page = (Path(__file__).parents[1] / 'docs/result_files.md').read_text()
    assert [key for key in sorted(keys_of(content)) if f'`{key}`' not in page] == []


def test_extended_model_is_a_model_with_the_cause(diagnosed):
    model = read_model(diagnosed.folder / 'extended_model.yaml', REFERENCE)
    assert [active.effect.name for active in model.effects] == ['cogging']
    np.testing.assert_allclose(model.effects[0].values['phase'], (0.3, 1.0, 2.0, -1.0), atol=0.05)
    provenance = read_model_file(diagnosed.folder / 'extended_model.yaml').provenance
    assert [Path(bag['path']).name for bag in provenance['bags']] == ['cogging', 'cogging_too']


def test_diagnosis_report_says_it_in_one_sentence(diagnosed):
    page = checked_page(diagnosed.folder / 'report.html', 7)
    check_in_browser(diagnosed.folder / 'report.html', 7, traces=4)
    headings = ('Measured against simulated', 'Evidence', 'What could not be told apart',
                'What the base parameters had swallowed', 'What remains')
    places = [page.text.index(f' {heading}') for heading in headings]
    assert places == sorted(places)
    assert '0.61 N m of cogging torque with 22 periods a turn on all joints' in page.text
    assert diagnosed.out.splitlines()[0].removeprefix('explained: ') in page.text
    for heading in ('What could not be told apart', 'What the base parameters had swallowed',
                    'What remains', 'Looked at and rejected', 'What was read'):
        assert heading in page.text


def test_data_at_rest_are_unusable_and_leave_no_extended_model(bags, tmp_path):
    (tmp_path / 'extended_model.yaml').write_text('of an earlier run')
    (tmp_path / 'notes.txt').write_text('mine')
    done = run(diagnose, bags.rest, '--robot', 'reference', '--output', tmp_path)
    assert done.code == 0, done.err
    content = json.loads((tmp_path / 'diagnosis.json').read_text())
    assert content['verdict'] == 'unusable_data'
    assert content['causes'] == []
    assert content['reasons']
    assert content['extended_model'] is None
    assert sorted(file.name for file in tmp_path.iterdir()) == [
        'diagnosis.json', 'notes.txt', 'report.html']
    assert 'cannot carry a diagnosis' in checked_page(tmp_path / 'report.html', 1).text


@pytest.mark.parametrize('words', [
    ['A', 'B', '--holdout', 'C', 'D', '--robot', 'R', '--output', 'O'],
    ['A', 'B', '--holdout', 'C', '--holdout', 'D', '--robot', 'R', '--output', 'O'],
    ['--holdout', 'C', 'D', '--robot', 'R', '--output', 'O', 'A', 'B'],
    ['A', '--holdout=C', 'D', '--output', 'O', '--robot', 'R', 'B'],
    ['--robot', 'R', '--output', 'O', '--holdout', 'C', 'D', '--', 'A', 'B'],
])
def test_holdout_takes_one_bag_or_several(words):
    context = diagnose.diagnose_bags.make_context('par4_diagnose', words)
    assert context.params['bags'] == ('A', 'B')
    assert context.params['holdout'] == ('C', 'D')
    assert context.params['robot'] == 'R'


@pytest.mark.parametrize(('words', 'said'), [
    ('--holdout B A', '--holdout took B A, as it takes all up to the next option; give the bags to '
                      'diagnose first, as in par4_diagnose A --holdout B;'),
    ('--before C --holdout=B A', '--holdout took B A, as'),
    ('--before A', 'as in par4_diagnose A --before OTHER_BAG;'),
    ('', "Missing argument 'BAG...';")])
def test_bags_that_an_option_took_are_told(words, said):
    """It said that BAG is missing, with two bags on the line."""
    done = run(diagnose, *words.split(), '--robot', 'reference', '--output', 'x')
    assert done.code == 2
    line, = done.err.splitlines()
    assert said in line


# bad input

BAD_INPUT = {
    'missing bag': (identify, '{folder}/nope', 'no such bag'),
    'no bag': (identify, '', 'BAG'),
    'wrong robot': (identify, '{plain} --robot {folder}/wrong.yaml', 'schema'),
    'output in a file': (identify, '{plain} --output {folder}/a_file/results', 'another folder'),
    'bag twice': (identify, '{plain} {plain}', 'given twice'),
    'payload of another bag': (identify, '{plain} --payload nope=1', 'BAG=KG'),
    'payload without number': (identify, '{plain} --payload {plain}=x', 'BAG=KG'),
    'nothing to identify': (identify, '{rest}', 'record a longer motion'),
    'wrong namespace': (validate, '{plain} --model table1 --namespace /left', '/left'),
    'wrong model': (validate, '{plain} --model {folder}/wrong.yaml', 'schema'),
    'held out and fitted': (diagnose, '{plain} --holdout {plain}', 'given twice'),
    'a copy held out': (diagnose, '{plain} --holdout {folder}/copy', 'same readings as'),
    'a copy fitted': (identify, '{plain} {folder}/copy', 'same readings as'),
    'folder as robot': (identify, '{plain} --robot {folder}', 'is a folder, and not a built-in'),
    'folder as model': (validate, '{plain} --model {folder}', 'is a folder, and not a built-in'),
    'option for a value': (diagnose, '{plain} --holdout --robot reference',
                           '--holdout: found the option --robot in place of its value'),
    'option with a value for one': (validate, '{plain} --model --namespace=left',
                                    '--model: found the option --namespace in place'),
    'empty value': (identify, '{plain} --robot=', '--robot: found an empty text'),
    'model of an axis': (diagnose, '{plain} --model {folder}/axis_model.yaml',
                         'missing parameters'),
}


@pytest.mark.parametrize('case', BAD_INPUT)
def test_bad_input_is_one_line_and_leaves_good_results_alone(case, bags, tmp_path):
    inputs = {'wrong.yaml': 'schema: par4/motion/1\n', 'a_file': '', 'axis_model.yaml': (
        'schema: par4/model/1\nparameters: {actuator_inertia: {value: 1.0}}\n')}
    results = {name: f'good {name}' for name in (
        'model.yaml', 'identification.json', 'validation.json', 'diagnosis.json',
        'extended_model.yaml', 'report.html')}
    for name, text in {**inputs, **results}.items():
        (tmp_path / name).write_text(text)
    module, words, expected = BAD_INPUT[case]
    shutil.copytree(bags.plain, tmp_path / 'copy')
    given = words.format(folder=tmp_path, **vars(bags)).split()
    defaults = [word for name, value in (('--robot', 'reference'), ('--output', str(tmp_path)))
                if name not in given for word in (name, value)]
    done = run(module, *defaults, *given)
    lines = done.err.splitlines()
    assert done.code == 2
    assert len(lines) == 1
    assert lines[0].startswith('error: ')
    assert expected in lines[0]
    assert done.out == ''
    assert {file.name: file.read_text() for file in tmp_path.iterdir() if file.is_file()} == {
        **inputs, **results}


@pytest.mark.parametrize(('words', 'told'), [
    (('bag', '--robot', 'reference', '--output', ''), '--output: found an empty text'),
    (('', '--robot', 'reference', '--output', 'out'), 'argument: found an empty text'),
    (('nope', '--robot', 'reference', '--output', 'out', '--namespace', ''), 'nope: no such bag')])
def test_a_shell_variable_that_is_not_set_is_no_path(words, told, tmp_path, monkeypatch):
    """An empty path would be the folder that the shell is in."""
    monkeypatch.chdir(tmp_path)
    done = run(identify, *words)
    assert done.code == 2
    line, = done.err.splitlines()
    assert told in line
    assert os.listdir() == []


def test_a_shell_in_a_folder_that_has_been_removed_is_told(tmp_path, monkeypatch):
    (tmp_path / 'gone').mkdir()
    monkeypatch.chdir(tmp_path / 'gone')
    (tmp_path / 'gone').rmdir()
    done = run(identify, 'bag', '--robot', 'reference', '--output', 'out')
    monkeypatch.chdir(tmp_path)
    assert done.code == 2
    assert done.err == (
        'error: the folder that the shell is in has been removed; change to another one\n')


def test_kernels_that_can_be_kept_nowhere_are_told(monkeypatch):
    no_place = mock.Mock(side_effect=RuntimeError(
        "cannot cache function 'f': no locator available for file 'f.py'"))
    with monkeypatch.context() as patch:
        patch.setattr(identify.identify_bags, 'callback', no_place)
        done = run(identify, 'bag', '--robot', 'reference', '--output', 'out')
    assert done.code == 2
    assert done.err.startswith('error: compiled kernels can be kept neither beside the packages')
    out = io.StringIO()
    with monkeypatch.context() as patch, redirect_stderr(out):
        patch.setattr(sys, 'argv', ['par4_record'])
        patch.setattr('par4_kinematics.ros.start.import_module', no_place)
        assert start_node('par4_identification.ros.record_node', RecordParameters) == 2
    assert out.getvalue() == done.err


def test_the_plot_library_does_not_talk_of_its_cache():
    done = subprocess.run([sys.executable, '-c', 'import par4_sim.report.drawing'],
                          capture_output=True, text=True, check=True,
                          env={**os.environ, 'MPLCONFIGDIR': '/proc/nowhere'})
    assert done.stderr == ''


def test_a_table_is_printed_where_its_characters_cannot_be(bags, tmp_path):
    done = subprocess.run(
        [sys.executable, '-m', 'par4_identification.commands.identify', bags.plain,
         '--robot', 'reference', '--output', tmp_path / 'out', '--no-report'],
        capture_output=True, text=True, check=False,
        env={**os.environ, 'PYTHONIOENCODING': 'ascii'})
    assert done.returncode == 0
    assert done.stderr == ''
    assert re.search(r'actuator inertia.*\d \? +\d', done.stdout)


@pytest.mark.parametrize('name', ['identify', 'validate', 'diagnose'])
def test_an_executable_of_its_own_process_says_one_line(name, tmp_path):
    done = subprocess.run(
        [sys.executable, '-m', f'par4_identification.commands.{name}', tmp_path / 'nope',
         '--robot', 'reference', '--output', tmp_path / 'out',
         *(['--model', 'table1'] if name == 'validate' else [])],
        capture_output=True, text=True, check=False,
        env={**os.environ, 'MPLCONFIGDIR': '/proc/nowhere'})
    assert done.returncode == 2
    assert done.stdout == ''
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith('error: ')
    assert not (tmp_path / 'out').exists()


def test_results_appear_together_or_not_at_all(tmp_path):
    for name in ('a.json', 'b.html', 'c.yaml'):
        (tmp_path / name).write_text('old')
    with pytest.raises(ValueError, match='JSON'):
        write_results(tmp_path, {'b.html': 'new', 'a.json': {'value': float('nan')},
                                 'c.yaml': None})
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {
        'a.json': 'old', 'b.html': 'old', 'c.yaml': 'old'}
    write_results(tmp_path, {'b.html': 'new', 'a.json': {'value': 1}, 'c.yaml': None})
    assert {file.name for file in tmp_path.iterdir()} == {'a.json', 'b.html'}
    assert (tmp_path / 'b.html').read_text() == 'new'


# a single axis


@pytest.fixture(scope='module')
def axis(tmp_path_factory):
    """Return a folder with the robot file and two bags of a linear axis of 95 kg."""
    folder = tmp_path_factory.mktemp('axis')
    (folder / 'axis.yaml').write_text(
        'schema: par4/axis/1\nname: slide\njoint: slide\nkind: linear\ngain: 35.0\n')
    rate = 2.0 * np.pi * np.array((0.31, 0.83, 1.7))
    size = np.array((0.08, 0.03, 0.012))
    t = np.arange(0.0, 12.0, 1e-3)[:, None]
    for seed in (0, 1):
        random = np.random.default_rng(seed)
        angle = rate * t + random.uniform(0.0, 2.0 * np.pi, 3)
        q, qd, qdd = ((size * part).sum(axis=1) for part in (
            np.sin(angle), rate * np.cos(angle), -rate ** 2 * np.sin(angle)))
        force = 95.0 * qdd + 20.0 * np.sign(qd) + 200.0 * qd + random.normal(size=len(t))
        with BagWriter(folder / f'bag{seed}') as bag:
            for index in range(len(t)):
                stamp = 1_000_000_000 + index * 1_000_000
                bag.write_joint_state('/joint_states', stamp, ['slide'], [q[index]])
                bag.write_joint_state('/amplifier_voltage', stamp, ['slide'],
                                      effort=[force[index] / 35.0])
    return folder


def test_an_axis_is_identified_in_its_own_units(axis, tmp_path):
    done = run(identify, axis / 'bag0', axis / 'bag1', '--robot', axis / 'axis.yaml', '--output',
               tmp_path)
    assert done.code == 0, done.err
    content = json.loads((tmp_path / 'identification.json').read_text())
    found = {name: (parameter['value'], parameter['unit'])
             for name, parameter in content['parameters'].items()}
    assert found['actuator_inertia'] == (pytest.approx(95.0, rel=0.01), 'kg')
    assert found['coulomb_friction'] == (pytest.approx(20.0, rel=0.03), 'N')
    assert found['viscous_friction'] == (pytest.approx(200.0, rel=0.03), 'N s/m')
    assert len(content['residual_rms']) == 1
    model_file = read_model_file(tmp_path / 'model.yaml')
    assert {name: parameter.unit for name, parameter in model_file.parameters.items()} == {
        name: unit for name, (_, unit) in found.items()}
    page = checked_page(tmp_path / 'report.html', 3)
    assert 'Measured and calculated force' in page.text
    assert 'its relative std' not in page.text
    assert 'paper' not in done.out


def test_an_axis_is_validated_and_diagnosed(axis, tmp_path):
    model = tmp_path / 'model.yaml'
    model.write_text(
        'schema: par4/model/1\nparameters: {actuator_inertia: {value: 95.0}, '
        'coulomb_friction: {value: 20.0}, viscous_friction: {value: 200.0}}\n'
        'provenance: {by: hand, bags: [somewhere, {path: else, sha256: 12}], options: {}}\n')
    done = run(validate, axis / 'bag0', '--model', model, '--robot', axis / 'axis.yaml',
               '--output', tmp_path / 'validation')
    assert done.code == 0, done.err
    content = json.loads((tmp_path / 'validation' / 'validation.json').read_text())
    assert len(content['rms']) == 1
    assert content['rms'] == [pytest.approx(content['overall']['rms'])]
    checked_page(tmp_path / 'validation' / 'report.html', 2)
    done = run(diagnose, axis / 'bag0', axis / 'bag1', '--robot', axis / 'axis.yaml', '--output',
               tmp_path / 'diagnosis')
    assert done.code == 0, done.err
    content = json.loads((tmp_path / 'diagnosis' / 'diagnosis.json').read_text())
    assert content['verdict'] == 'clean'
    assert len(content['holdout']['baseline_rms']) == 1
    assert 'down to its noise' in checked_page(tmp_path / 'diagnosis' / 'report.html', 2).text


def test_a_joint_without_rows_is_drawn_as_one_at_rest():
    names = Names(('joint 0', 'joint 1'), 'torque', 'N m', 'rad/s')
    random = np.random.default_rng(0)
    rows, floor = [random.normal(size=300), np.empty(0)], np.ones(2)
    views = [('speed, rad/s', [random.normal(size=300), np.empty(0)])]
    correlation = np.zeros((5, 2))
    for image in (residual_statistics(rows, floor, correlation, np.array((300, 0)), 0.01, names),
                  residual_over_motion(views, rows, floor, names),
                  signature(views[0][1], 'speed, rad/s', rows, rows, rows, names.joints, names),
                  residual_over_time(np.arange(2.0), np.ones((2, 2)), None, np.ones((2, 2), bool),
                                     floor, names)):
        assert image.startswith('data:image/svg+xml;base64,')


# sentences


def cause(name: str, joints=(0, 1, 2, 3), twins=(), **parameters) -> Cause:
    units = {parameter.name: parameter.unit for parameter in CATALOGUE[name].parameters}
    values = {key: Parameter(value=value, std=value if np.isscalar(value) else tuple(
        abs(part) for part in value), unit=units[key]) for key, value in parameters.items()}
    for parameter in CATALOGUE[name].parameters:
        if parameter.name not in values and isinstance(parameter.default, float):
            values[parameter.name] = Parameter(value=parameter.default, std=0.0,
                                               unit=parameter.unit)
    return Cause(CATALOGUE[name], tuple(joints), values, tuple(twins), 0.9, 1e-9,
                 812.4, None, Gain(0.5, 0.4, 0.6))


PHRASES = {kind.name: kind.phrase for kind in KINDS}


def diagnosis(verdict: str, causes=(), kind=None, nearest=None, wandering=0.0, lines=(),
              bursts=()) -> Diagnosis:
    unnamed = () if kind is None else (
        UnnamedCause(kind, PHRASES[kind], (1,), 0.31, 0.05, 812.0),)
    alone = Unrelated(np.full(4, wandering), 0.05 if wandering else 0.0, tuple(lines),
                      tuple(bursts))
    remaining = Remaining(1.1, alone, nearest and CATALOGUE[nearest])
    holdout = Holdout((), (), (), np.full(4, 0.52), np.full(4, 0.11), np.full(4, 0.1), 0.99,
                      (0.98, 0.995))
    return Diagnosis(verdict, tuple(causes), unnamed, (), holdout, remaining, {}, {}, None, (),
                     None, ())


def worse(told: Diagnosis) -> Diagnosis:
    """Return a diagnosis whose names make the error on held-out rows larger."""
    return replace(told, holdout=replace(told.holdout, extended_rms=np.full(4, 0.75)))


STRIBECK = cause('stribeck', (1, 3), ('cogging',), stribeck_torque=(1.2, 1.2),
                 stribeck_velocity=(0.12, 0.12))
COGS = cause('cogging', amplitude=(0.61, 0.61, 0.6, 0.62), periods=22.0, phase=(0.1,) * 4)


@pytest.mark.parametrize(('given', 'standing', 'parts'), [
    (diagnosis('clean'), 'good', ('down to its noise', '0.52 N m', '0.10 N m')),
    (diagnosis('explained', [COGS]), 'good', (
        'The machine has 0.61 N m of cogging torque with 22 periods a turn on all joints; with it '
        "the model's error on data it has not seen falls from 0.52 N m to 0.11 N m, the noise "
        'floor being 0.10 N m.',)),
    (worse(diagnosis('partly_explained', [COGS], 'speed')), 'fair', (
        "the model's error on data it has not seen rises from 0.52 N m to 0.75 N m",)),
    (diagnosis('explained', [STRIBECK]), 'fair', (
        '1.2 N m of Stribeck friction with velocity 0.12 rad/s (or cogging) on joints 1 and 3; '
        'with it',)),
    (diagnosis('partly_explained', [COGS, STRIBECK], 'speed'), 'fair', (
        'on all joints and 1.2 N m', 'with them', 'without a name: a function of joint speed.')),
    (diagnosis('unknown', kind='time'), 'fair', ('no cause in the library', 'a drift')),
    (diagnosis('clean', wandering=0.3), 'good', ('noise that wanders',)),
    (diagnosis('unknown', lines=[Line(12.34, np.full(4, 0.2))]), 'fair', (
        'a disturbance of 12.3 Hz that follows nothing in the motion',)),
    (diagnosis('unknown', bursts=[(1.5, 2.0)]), 'fair', ('an error that is larger for a while from '
                                                         '1.50 s on',)),
    (diagnosis('unknown', nearest='stribeck'), 'fair', (
        'looks like Stribeck friction, which does not pass as a cause.',)),
])
def test_each_verdict_has_its_sentence(given, standing, parts):
    outcome = outcome_of_diagnosis(given, REFERENCE)
    assert outcome.standing == standing
    assert all(part in outcome.sentence for part in parts), outcome.sentence
    assert outcome.sentence.endswith('.')
    json.dumps(diagnosis_json(given, REFERENCE), allow_nan=False)


@pytest.mark.parametrize(('torque', 'standing'), [(52.0, 'good'), (1.3, 'fair')])
def test_a_clean_model_beside_loud_noise_is_told_to_hide_what_is_smaller(torque, standing):
    given = diagnosis('clean')
    run = SimpleNamespace(tau=np.full((10, 4), torque), valid=np.ones((10, 4), dtype=bool))
    loud = replace(given, holdout=replace(given.holdout, runs=(run,)))
    outcome = outcome_of_diagnosis(loud, REFERENCE)
    assert outcome.standing == standing
    assert ('that is 40 % of the torque' in outcome.sentence) == (standing == 'fair')


@pytest.mark.parametrize(('kind', 'taken_off'), [(None, ''), (
    'time', ', with what has no name taken off,')])
def test_what_is_left_is_told_with_what_was_taken_off(kind, taken_off):
    outcome = outcome_of_diagnosis(diagnosis('unknown', kind=kind), REFERENCE)
    left = f'What is left{taken_off} is 1.1 times the noise floor.'
    assert left in [remark.text for remark in outcome.remarks]


def test_that_small_effects_are_not_excluded_speaks_neither_for_a_clean_machine_nor_against_it():
    outcome = outcome_of_diagnosis(diagnosis('clean'), REFERENCE)
    remark, = (remark for remark in outcome.remarks if 'not excluded' in remark.text)
    assert (remark.mark, outcome.standing) == ('plain', 'good')


def test_noise_that_wanders_may_be_play_in_a_joint():
    outcome = outcome_of_diagnosis(diagnosis('clean', wandering=0.3), REFERENCE)
    remark, = (remark for remark in outcome.remarks if 'noise that wanders' in remark.text)
    assert remark.mark == 'plain'
    assert 'Play in a joint leaves the same.' in remark.text
    assert remark.advice in outcome.advice


def test_what_is_left_is_never_told_to_be_less_than_the_noise_floor():
    """The floor that a report gives is at most what is left."""
    given = diagnosis('explained', [COGS])
    quiet = replace(given, remaining=replace(given.remaining, floor_excess=0.87))
    told = [remark.text for remark in outcome_of_diagnosis(quiet, REFERENCE).remarks]
    assert 'What is left is no more than the noise floor.' in told


def test_fitted_recordings_that_leave_far_more_than_those_held_out_are_told():
    alike = outcome_of_diagnosis(replace(diagnosis('explained', [COGS]), fitted_rms=0.3),
                                 REFERENCE)
    unlike = outcome_of_diagnosis(replace(diagnosis('explained', [COGS]), fitted_rms=9.6),
                                  REFERENCE)
    assert (alike.standing, unlike.standing) == ('good', 'fair')
    assert 'fitted recordings leave 9.6 N m, those held out 0.11 N m' in ' '.join(
        remark.text for remark in unlike.remarks)
    left = diagnosis_json(replace(diagnosis('partly_explained', [COGS]), fitted_rms=9.6),
                          REFERENCE)['remaining']
    assert left['significant']
    assert left['looks_like'] == 'something that acts in the fitted recordings alone'


def test_a_report_gives_numbers_of_the_machine_one_cell_and_those_of_joints_their_own():
    cable = cause('cable_spring', stiffness=(40.0, 20.0, 1.0), anchor=(0.1, 0.2, 0.0))
    found = parameter_cells(cable, 'stiffness', REFERENCE)
    assert found['common']
    # none of these is told from zero; a shape has a value all the same
    assert found['cells'] == ['0 ± 40, 0 ± 20, 0 ± 1.0']
    assert parameter_cells(STRIBECK, 'stribeck_torque', REFERENCE)['cells'] == [
        '', '0 ± 1.2', '', '0 ± 1.2']
    cable.parameters['stiffness'] = cable.parameters['stiffness'].model_copy(
        update={'std': (4.0, 12.0, 0.4)})
    assert parameter_cells(cable, 'stiffness', REFERENCE)['cells'] == [
        '40.0 ± 4.0, 0 ± 12, 1.00 ± 0.40']
    assert parameter_cells(COGS, 'periods', REFERENCE)['cells'] == ['22 ± 22']


def test_twins_are_told_with_what_to_do():
    outcome = outcome_of_diagnosis(diagnosis('explained', [STRIBECK]), REFERENCE)
    assert any('Stribeck friction cannot be told from cogging' in remark.text
               for remark in outcome.remarks)
    assert any('payload' in step for step in outcome.advice)
    assert diagnosis_json(diagnosis('explained', [STRIBECK]), REFERENCE)['causes'][0][
        'indistinguishable_from'] == ['cogging']


def test_sizes_that_differ_or_are_parts_of_a_whole_or_shares():
    offset = cause('torque_offset', offset=(-0.3, 0.1, 0.2, 0.52))
    assert phrase_of_cause(offset, REFERENCE) == (
        '-0.30 to 0.52 N m of constant torque offset on all joints')
    single = cause('torque_offset', (0,), offset=(-3.2,))
    assert phrase_of_cause(single, AXIS) == '-3.2 N of constant force offset'
    force = SimpleNamespace(
        name='external_force', phrase='external force', by_sign=None, parameters=tuple(
            EffectParameter(name, 'N', 'machine') for name in 'xyz'))
    values = {name: Parameter(value=value, unit='N') for name, value in zip('xyz', (1, -2, 0.5))}
    pull = SimpleNamespace(effect=force, joints=(0, 1, 2, 3), parameters=values, twins=())
    assert phrase_of_cause(pull, REFERENCE) == 'external force (x 1.0 N, y -2.0 N, z 0.50 N)'
    told = {name: parameter.model_copy(update={'std': std}) for (name, parameter), std in zip(
        values.items(), (0.1, 0.2, 0.4))}
    pull.parameters = told
    assert phrase_of_cause(pull, REFERENCE) == 'external force (x 1.0 N, y -2.0 N)'
    gain = SimpleNamespace(
        name='drive_gain_error', phrase='drive gain error', by_sign=None,
        parameters=(EffectParameter('relative', '1', 'joint'),))
    assert phrase_of_cause(SimpleNamespace(effect=gain, joints=(2,), parameters={
        'relative': Parameter(value=(0.03,), unit='1')}, twins=()), REFERENCE) == (
            '3.0 % of drive gain error on joint 2')


def test_a_series_is_told_by_the_torque_that_it_reaches():
    """Its terms are no torques: 2 u - 1.5 P_2(u) goes from -3.5 to 1.19 in -1 to 1."""
    spring = cause('position_torque', (0,), coefficients=(0.0, 2.0, -1.5), range=(0.0, 1.57))
    assert phrase_of_cause(spring, AXIS) == '-3.5 to 1.2 N of force that follows the position'


def test_gravity_along_one_axis_is_known_along_both():
    """A part of zero is as certain as the other."""
    found = relative_deviations({
        'gravity_sine': Parameter(value=25.0, std=0.05), 'viscous_friction': Parameter(
            value=2.0, std=0.1), 'gravity_cosine': Parameter(value=-0.02, std=0.03)})
    assert found == pytest.approx({'gravity_sine': 0.002, 'viscous_friction': 0.05,
                                   'gravity_cosine': 0.0012}, rel=1e-3)


def test_numbers_keep_their_digits():
    random = np.random.default_rng(5)
    for value in random.choice((-1, 1), 200) * 10.0 ** random.uniform(-9, 9, 200):
        for digits in (2, 3, 4):
            assert float(number(value, digits)) == pytest.approx(
                value, rel=0.5001 * 10.0 ** (1 - digits))
        std = abs(value) * 10.0 ** random.uniform(-4, 0)
        text, std_text = with_std(value, std)
        assert float(std_text) == pytest.approx(std, rel=0.06)
        assert float(text) == pytest.approx(value, abs=std)
    assert with_std(0.11304, 0.000523) == ('0.11304', '0.00052')
    assert number(0.0999, 2) == '0.10'
    assert number(1234.0, 2) == '1200'
    assert percent(0.99856) == '99.9 %'
    assert percent(float('inf')) == 'n/a'
    assert typeset('N s2/m2') == 'N s²/m²'
    assert listed(['a', 'b', 'c']) == 'a, b and c'
    assert listed(['a']) == 'a'


def test_plain_content_is_json_whatever_it_holds():
    content = plain({1: np.array([[1.0, np.nan], [np.inf, 2.0]]), 'b': (np.int64(3), np.True_)})
    assert json.loads(json.dumps(content, allow_nan=False)) == {
        '1': [[1.0, None], [None, 2.0]], 'b': [3, True]}


def test_the_hash_of_a_bag_follows_its_content_not_its_place(tmp_path):
    for place in ('here', 'there'):
        (tmp_path / place).mkdir()
        (tmp_path / place / 'data.mcap').write_bytes(b'data')
    assert bag_sha256(tmp_path / 'here') == bag_sha256(tmp_path / 'there')
    (tmp_path / 'there' / 'data.mcap').write_bytes(b'dato')
    assert bag_sha256(tmp_path / 'here') != bag_sha256(tmp_path / 'there')
    assert bag_sha256(tmp_path / 'here' / 'data.mcap') == hashlib.sha256(b'data').hexdigest()


@pytest.mark.parametrize('there', [False, True])
@pytest.mark.parametrize('folder', [False, True])
@pytest.mark.parametrize('link', ['link', 'links/link', 'links/../link'])
def test_what_is_written_to_a_link_goes_where_it_leads(link, folder, there, tmp_path):
    (tmp_path / 'links').mkdir()
    path, target = tmp_path / link, tmp_path / 'elsewhere' / 'results'
    os.makedirs(target if there and folder else target.parent)
    if there:
        write_text(target / 'a' if folder else target, 'old')
    path.symlink_to(os.path.relpath(target, os.path.realpath(path.parent)))
    if folder:
        write_results(path, {'a': 'new'})
    else:
        write_text(path, 'new')
    assert path.is_symlink()
    assert (target / 'a' if folder else target).read_text() == 'new'
    assert sorted(item.name for item in tmp_path.rglob('.*')) == []


def test_a_folder_behind_a_link_is_replaced_or_stays(tmp_path):
    target, link = tmp_path / 'target', tmp_path / 'link'
    target.mkdir()
    (target / 'old').touch()
    link.symlink_to('target')
    with pytest.raises(ValueError, match='midway'), written_atomically(link) as scratch:
        scratch.mkdir()
        raise ValueError('midway')
    assert os.listdir(target) == ['old']
    with written_atomically(link) as scratch:
        scratch.mkdir()
        (scratch / 'new').touch()
    assert link.is_symlink()
    assert os.listdir(target) == ['new']
    assert sorted(os.listdir(tmp_path)) == ['link', 'target']


def test_a_bag_that_another_command_has_made_meanwhile_stays(tmp_path):
    bag = tmp_path / 'bag'

    def progress(_share):
        bag.mkdir(exist_ok=True)
        (bag / 'other').touch()

    with pytest.raises(InputError, match='bag: exists already'):
        simulate_to_bag(build_simulation(REFERENCE, TABLE_1, 'exact'), ADEPT, REFERENCE, bag,
                        progress=progress)
    assert os.listdir(tmp_path) == ['bag']
    assert os.listdir(bag) == ['other']


@contextmanager
def small_files(size=10_000):
    """Let no file of this process grow beyond `size` bytes, as on a disk that is nearly full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_names_the_file_that_was_asked_for_and_leaves_nothing(tmp_path):
    big = 'x' * 20_000
    for path, write in (
            ('new/report.html', lambda: write_results(tmp_path / 'new', {'a': 'b',
                                                                         'report.html': big})),
            ('new/text', lambda: write_text(tmp_path / 'new' / 'text', big)),
            ('new/robot.yaml', lambda: write_yaml(tmp_path / 'new' / 'robot.yaml', {'a': big})),
            ('new/motion.csv', lambda: write_motion(tmp_path / 'new' / 'motion.yaml', ADEPT,
                                                    'joint')),
            ('new/bag', lambda: simulate_to_bag(build_simulation(REFERENCE, TABLE_1, 'exact'),
                                                ADEPT, REFERENCE, tmp_path / 'new' / 'bag'))):
        with small_files(), pytest.raises(InputError) as refused:
            write()
        assert str(refused.value) == (f'{tmp_path / path}: cannot be written (file too large); '
                                      f'free space')
        assert os.listdir(tmp_path) == []


def test_a_folder_that_takes_no_files_is_named_as_it_was_given(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_text('file', 'mine')
    bag = build_simulation(REFERENCE, TABLE_1, 'exact')
    for write in (lambda path: write_text(path, ''), lambda path: write_results(path.parent, {
            path.name: ''}), lambda path: simulate_to_bag(bag, ADEPT, REFERENCE, path)):
        with pytest.raises(InputError) as refused:
            write(Path('file/new/bag'))
        assert str(refused.value) == ('file/new/bag: cannot be written (not a directory); give '
                                      'another path')

        def refuse(prefix, dir):
            raise OSError(30, 'Read-only file system', f'{dir}/{prefix}123')

        with monkeypatch.context() as read_only, pytest.raises(InputError) as refused:
            read_only.setattr('tempfile.mkdtemp', refuse)
            write(Path('new/bag'))
        assert str(refused.value) == ('new/bag: cannot be written (read-only file system); give '
                                      'another path')
        assert os.listdir() == ['file']
    assert Path('file').read_text() == 'mine'


def test_an_error_of_something_else_is_not_blamed_on_the_output(tmp_path):
    with pytest.raises(FileNotFoundError), written_atomically(tmp_path / 'new' / 'text'):
        (tmp_path / 'elsewhere').read_text()
    assert os.listdir(tmp_path) == []


def test_what_a_simulation_counts_is_explained(tmp_path):
    simulation = build_simulation(REFERENCE, TABLE_1, 'exact')
    assert simulation.counts.keys() <= COUNTS.keys()
    simulation.close()
    write_yaml(tmp_path / 'weak.yaml', {**REFERENCE.model_dump(by_alias=True, exclude_none=True),
                                        'drives': {'gain': [12.7] * 4, 'torque_limit': 20.0}})
    done = run(simulate, 'adept', '--robot', tmp_path / 'weak.yaml', '--output',
               tmp_path / 'bag')
    assert done.code == 0
    assert re.search(r'saturated_commands \d+ \(torques that the drives wanted and cut to their '
                     r'torque_limit, counted', ' '.join(done.out.split()))
    assert '`saturated_commands` | torques that the drives wanted' in (
        Path(__file__).parents[1] / 'docs' / 'interface.md').read_text()


def test_the_help_of_payloads_says_what_a_bag_without_one_is_for():
    help_text = run(identify, '--help').out
    assert 'par4_identify bare loaded --payload loaded=0.5' in help_text
    assert 'par4_identify bare loaded --unknown-payload loaded' in help_text


def test_a_terminal_breaks_sentences_between_words_and_never_a_path(capsys, monkeypatch):
    monkeypatch.setenv('FORCE_COLOR', '1')  # as a terminal
    monkeypatch.setenv('COLUMNS', '30')
    say(*['a sentence of many [bold] words'] * 2)
    say('results and report: ' + '/a/long/path' * 5, whole=True)
    first, second, *again, path = capsys.readouterr().out.splitlines()
    assert [first.rstrip(), second] == ['a sentence of many [bold]', 'words']
    assert [again[0].rstrip(), again[1]] == [first.rstrip(), second]
    assert path.endswith('/a/long/path' * 5)
    monkeypatch.delenv('FORCE_COLOR')
    say('a sentence of many [bold] words')
    assert capsys.readouterr().out == 'a sentence of many [bold] words\n'


def test_too_much_data_is_said_in_a_line(capsys, monkeypatch):
    monkeypatch.setattr(sys, 'argv', ['par4_greedy'])

    @click.command('par4_greedy')
    def greedy() -> None:
        raise MemoryError

    with pytest.raises(SystemExit) as ended:
        run_command(greedy)
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith('error: ')
    assert said.count('\n') == 1
    assert 'shorter bags' in said


@pytest.mark.parametrize(('given', 'meant'), [
    ('--output=~/bag', '--output={}/bag'), ('~/bag', '~/bag'), ('a=~/b', 'a=~/b'),
    ('--columns=x~/y', '--columns=x~/y')])
def test_a_path_at_home_behind_an_option_is_meant_as_in_a_shell(monkeypatch, given, meant):
    """Shells expand `~` at the beginning of a word only; a folder of that name was made."""
    monkeypatch.setenv('HOME', '/home/ann')
    assert entry._at_home(given) == meant.format('/home/ann')
