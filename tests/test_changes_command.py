"""par4_diagnose with the model that was right, and with bags of the machine as it was."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from browser import check_in_browser
from report_pages import checked_page
from test_commands import run

from par4_dynamics.model_file import ModelFile, read_model_file
from par4_dynamics.model_from_file import build_model
from par4_identification.commands import diagnose, identify
from par4_identification.diagnosis import diagnosis
from par4_identification.diagnosis.diagnosis import LIBRARY
from par4_identification.jobs import diagnose as jobs
from par4_identification.jobs import recorded as recordings
from par4_identification.jobs.diagnosis_request import DiagnosisRequest
from par4_identification.logs.bag_hash import bag_sha256
from par4_identification.setup_check.finding import SetupCheck
from par4_identification.signals.conditioning import Conditioning
from par4_kinematics.errors import InputError
from par4_kinematics.excitation import excitation_motion
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import build_simulation
from robots import REFERENCE

PAYLOAD, COULOMB = 0.61, 0.4


def changed(model_file: ModelFile, **values) -> ModelFile:
    """Return a model with other base parameters."""
    return model_file.model_copy(update={'parameters': {
        **model_file.parameters, **{name: model_file.parameters[name].model_copy(
            update={'value': value, 'std': None}) for name, value in values.items()}}})


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Return bags of TABLE 1's machine as it was, with a payload, and with that and friction."""
    folder = tmp_path_factory.mktemp('changed')
    table = read_model_file('table1')
    mass, dry = (table.parameters[name].value for name in ('platform_mass_1', 'coulomb_friction'))
    machines = {
        'before': table, 'same': table, 'loaded': changed(table, platform_mass_1=mass + PAYLOAD),
        'rubbing': changed(table, platform_mass_1=mass + PAYLOAD,
                           coulomb_friction=(dry, dry, dry + COULOMB, dry))}
    for seed, (name, model_file) in enumerate(machines.items()):
        simulation = build_simulation(REFERENCE, build_model(REFERENCE, model_file), 'exact',
                                      seed=seed, torque_noise=0.1)
        simulate_to_bag(simulation, excitation_motion(REFERENCE, 7.0, seed), REFERENCE,
                        folder / name)
    done = run(identify, folder / 'before', '--robot', 'reference', '--no-report', '--output',
               folder / 'model')
    assert done.code == 0, done.err
    return folder


@pytest.fixture(autouse=True)
def small_library(monkeypatch):
    """Let few effects be named, for speed; those that readings tell too are among them."""
    names = ('joint_friction_difference', 'drive_gain_error', 'stribeck', 'nonlinear_viscous')
    monkeypatch.setattr(diagnosis, 'LIBRARY', {name: LIBRARY[name] for name in names})


def diagnosed(output, *words):
    """Return the outcome and diagnosis.json of a diagnosis."""
    done = run(diagnose, *words, '--robot', 'reference', '--no-simulate', '--output', output)
    assert done.code == 0, done.err
    return done, json.loads((output / 'diagnosis.json').read_text(encoding='utf-8'))


@pytest.mark.usefixtures('unrendered')
def test_recordings_of_a_machine_that_changed_between_them(bags, tmp_path):
    """Fitted as those of one machine they leave a torque that follows nothing known."""
    done, content = diagnosed(tmp_path / 'out', bags / 'before', bags / 'loaded', '--holdout',
                              bags / 'same')
    entry, = content['between_logs']
    assert entry['log'] == str(bags / 'loaded')
    assert entry['other'] in (str(bags / 'before'), str(bags / 'same'))
    assert entry['reading'] == 'a payload of 0.61 kg at half plate 1'
    assert entry['size'] == pytest.approx(PAYLOAD, abs=4.0 * entry['std'])
    assert content['verdict'] == 'explained'
    assert content['causes'] == []
    assert 'The machine changed between the recordings' in done.out
    page = checked_page(tmp_path / 'out' / 'report.html', 1)
    assert 'How the recordings differ' in page.text


@pytest.mark.usefixtures('unrendered')
def test_recordings_of_one_machine_do_not_differ(bags, tmp_path):
    done, content = diagnosed(tmp_path / 'out', bags / 'before', '--holdout', bags / 'same')
    assert 'between_logs' not in content
    assert content['verdict'] == 'clean'
    assert 'changed between' not in done.out


def test_a_payload_is_named_and_not_clean(bags, tmp_path):
    done, content = diagnosed(tmp_path / 'out', bags / 'loaded', '--model',
                              bags / 'model' / 'model.yaml')
    change, = content['changes']
    assert {'parameter', 'before', 'after', 'std', 'p_value', 'reading'} <= change.keys()
    assert change['parameter'] == 'platform_mass_1'
    assert change['reading'] == 'a payload of 0.61 kg at half plate 1'
    assert change['after'] - change['before'] == pytest.approx(PAYLOAD, abs=4.0 * change['std'])
    assert change['p_value'] < 1e-9
    assert change['margin'] > 100.0
    assert content['verdict'] == 'explained'
    payload, = content['causes']
    assert payload['effect'] == 'payload'
    assert payload['parameters']['half']['value'] == 1.0
    holdout = content['holdout']
    assert min(holdout['given_rms']) > 5.0 * max(holdout['baseline_rms'])
    rows = [line for line in done.out.splitlines() if line.startswith('held-out error')]
    assert len(rows) == 3
    assert 'a payload of 0.61 kg at half plate 1' in done.out
    page = checked_page(tmp_path / 'out' / 'report.html', 4)
    check_in_browser(tmp_path / 'out' / 'report.html', 4, traces=4)
    assert 'model as it stands' in page.text
    assert 'a payload of 0.61 kg at half plate 1' in page.text


@pytest.mark.usefixtures('unrendered')
def test_bags_before_tell_two_changes(bags, tmp_path):
    _, content = diagnosed(tmp_path / 'out', bags / 'rubbing', '--before', bags / 'before',
                           bags / 'same')
    readings = {item['parameter']: item for item in content['changes']}
    assert readings.keys() == {'platform_mass_1', 'coulomb_friction[2]'}
    friction = readings['coulomb_friction[2]']
    assert friction['after'] - friction['before'] == pytest.approx(
        COULOMB, abs=4.0 * friction['std'])
    assert friction['reading'].startswith('Coulomb friction of joint 2 up by 0.4')


@pytest.mark.usefixtures('unrendered')
def test_the_same_machine_has_not_changed(bags, tmp_path):
    done, content = diagnosed(tmp_path / 'out', bags / 'same', '--model',
                              bags / 'model' / 'model.yaml')
    assert content['changes'] == []
    assert content['verdict'] == 'clean'
    assert content['causes'] == []
    assert 'this has changed' not in done.out


@pytest.mark.usefixtures('unrendered')
def test_nothing_changed_since_a_model_of_the_very_recordings(bags, tmp_path):
    """What moved the parameters of that model was there when it was identified."""
    model = tmp_path / 'model.yaml'
    content = yaml.safe_load((bags / 'model' / 'model.yaml').read_text(encoding='utf-8'))
    content['provenance']['bags'][0]['sha256'] = bag_sha256(bags / 'loaded')
    model.write_text(yaml.safe_dump(content), encoding='utf-8')
    done, content = diagnosed(tmp_path / 'out', bags / 'loaded', '--model', model)
    assert content['changes'] == []
    assert content['causes'] == []
    assert content['verdict'] == 'clean'
    assert min(content['holdout']['given_rms']) > 5.0 * max(content['holdout']['baseline_rms'])
    assert 'this has changed' not in done.out
    assert done.out.splitlines()[-2].endswith(
        'is not told, as it was identified from recordings that are fitted here.')


@pytest.mark.usefixtures('unrendered')
def test_bags_before_of_the_same_machine_are_told_to_show_no_change(bags, tmp_path):
    done, content = diagnosed(tmp_path / 'out', bags / 'same', '--before', bags / 'before')
    assert content['changes'] == []
    assert done.out.splitlines()[-2].endswith(
        'before no base parameter has changed beyond chance.')


@pytest.mark.usefixtures('unrendered')
def test_a_change_that_cannot_be_told_is_said(bags, tmp_path, monkeypatch):
    def refused(*_):
        raise InputError('the bags do not fit')

    monkeypatch.setattr(jobs, 'changes_between', refused)
    done, _ = diagnosed(tmp_path / 'out', bags / 'same', '--before', bags / 'before')
    assert done.out.startswith('What has changed could not be told: the bags do not fit.')


def test_before_takes_one_bag_or_several():
    words = ['A', '--before', 'B', 'C', '--holdout', 'D', '--robot', 'R', '--output', 'O']
    context = diagnose.diagnose_bags.make_context('par4_diagnose', words)
    assert context.params['before'] == ('B', 'C')
    assert context.params['holdout'] == ('D',)
    assert context.params['bags'] == ('A',)


def test_a_bag_both_before_and_now(bags, tmp_path):
    done = run(diagnose, bags / 'same', '--before', bags / 'same', '--robot', 'reference',
               '--output', tmp_path)
    assert done.code == 2
    assert 'given twice' in done.err


def test_filters_of_all_bags_are_those_of_mended_ones(monkeypatch):
    """In degrees the steps of an encoder look finer than they are."""
    own, before = (SimpleNamespace(name=name, mended=False) for name in ('own', 'before'))
    table, fitted = read_model_file('table1'), []

    def mended(logs, machine, _known=None):
        return SetupCheck((), tuple(SimpleNamespace(
            name=log.name, mended=True, accounts=None) for log in logs),
                          machine)

    def chosen(logs, *_):
        return Conditioning(torque_cutoff_hz=16.0 if all(log.mended for log in logs) else 40.0)

    def fit(logs, _machine, _baseline, conditioning):
        fitted.append(([log.mended for log in logs], conditioning.torque_cutoff_hz))
        return table

    for name, stand_in in (('read_bags', lambda *_: [own, before]), ('check_setup', mended),
                           ('conditioning_for', chosen), ('model_of_bags', fit)):
        monkeypatch.setattr(recordings, name, stand_in)
    asked = DiagnosisRequest(('own',), (), ('before',), 'reference', None, Path('out'), None, None,
                             None, None, False, False)
    measured = recordings.recorded(asked, REFERENCE, None, lambda _: None)
    assert measured.conditioning.torque_cutoff_hz == 16.0
    assert fitted[-1] == ([True], 16.0)
