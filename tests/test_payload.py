"""An unknown payload: its mass, and the half plate that carries it, from two bags."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest
from measured import log_of_model
from test_commands import run, simulated

from par4_dynamics.model_from_file import read_model
from par4_identification.commands import identify
from par4_identification.gains.unknown_payload import WeighedPayload, payload_of_runs
from par4_identification.reports.outcome.payload import payload_json, payload_remark
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis
from robots import OTHER, REFERENCE, model_with, other_model

MODELS = {'reference': (REFERENCE, read_model('table1', REFERENCE)),
          'other': (OTHER, other_model())}
ERRORS = (0.03, -0.05, 0.08, -0.02)


@cache
def runs_of(name: str, bag: str, seed: int, mass: float = 0.0, half: float = 1.0,
            wrong_gains: bool = False, duration: float = 10.0, noise: float = 0.05):
    robot, model = MODELS[name]
    if wrong_gains:
        model = model_with(model, 'drive_gain_error', relative=ERRORS)
    if mass:
        model = model_with(model, 'payload', mass=mass, half=half)
    return tuple(runs_of_log(log_of_model(robot, model, seed=seed, name=bag, duration=duration,
                                          noise=noise), robot))


def found(name, *, bare=1, seed=2, **options):
    robot, _ = MODELS[name]
    shared = {key: options[key] for key in ('wrong_gains', 'duration', 'noise') if key in options}
    return payload_of_runs((*runs_of(name, 'bare', bare, **shared),
                            *runs_of(name, 'loaded', seed, **options)), ['loaded'], robot)


@pytest.mark.parametrize('name', sorted(MODELS))
@pytest.mark.parametrize('half', [1, 2])
@pytest.mark.parametrize('mass', [0.2, 0.7, 2.0])
def test_mass_and_half_come_back(name, half, mass):
    payload = found(name, mass=mass, half=float(half))
    assert payload.half == half
    assert payload.confidence > 0.999
    assert payload.mass == pytest.approx(mass, rel=0.005)
    assert abs(payload.mass - mass) < max(3.0 * payload.std, 0.003 * mass)
    assert payload.std < 0.005 * mass


@pytest.mark.parametrize('half', [1, 2])
def test_wrong_gains_widen_the_mass_and_leave_the_half(half):
    payload = found('reference', mass=0.7, half=float(half), wrong_gains=True)
    assert payload.half == half
    assert abs(payload.mass - 0.7) < 3.0 * payload.std
    assert 0.005 < payload.std / 0.7 < 0.1


def test_no_payload_is_no_payload():
    payload = found('reference')
    assert not payload.is_seen
    assert payload.half is None
    assert abs(payload.mass) < 0.002
    assert 'no payload that shows' in payload_remark(payload, ['loaded']).text


def test_swapped_bags_give_a_negative_mass():
    payload = payload_of_runs((*runs_of('reference', 'bare', 1),
                               *runs_of('reference', 'loaded', 2, mass=0.7)), ['bare'], REFERENCE)
    assert payload.mass == pytest.approx(-0.7, rel=0.005)
    remark = payload_remark(payload, ['bare'])
    assert not remark.good
    assert 'less than the other bags' in remark.text


def test_bags_that_drown_in_noise_do_not_tell_the_half():
    payload = found('reference', mass=0.03, duration=4.0, noise=25.0)
    assert payload.half is None
    assert payload_json(payload, ['loaded'])['half'] is None


def payload(first, second, std_1=0.01, std_2=0.01, correlation=0.0):
    shared = correlation * std_1 * std_2
    return WeighedPayload(np.array((first, second)), np.array(((std_1 ** 2, shared),
                                                               (shared, std_2 ** 2))))


def test_mass_and_likelihood_are_those_of_the_constrained_fit():
    """Leaving a half out: least squares of what was found against (M, 0) and (0, M)."""
    one = payload(0.5, 0.03, 0.02, 0.05, 0.8)
    weight = np.linalg.inv(one.covariance)
    cost = []
    for half, unit in enumerate(np.eye(2)):
        mass = unit @ weight @ one.halves / (unit @ weight @ unit)
        left = one.halves - mass * unit
        cost.append(0.5 * left @ weight @ left)
        assert one.on_one[half] == pytest.approx(mass)
    assert one.log_likelihood_ratio == pytest.approx(cost[1] - cost[0])
    assert one.std == pytest.approx(1.0 / np.sqrt(weight[0, 0]))


def test_what_neither_half_carries_alone_is_said_to_be_on_both():
    both = payload(0.3, 0.4)
    assert both.on_both
    assert both.half is None
    assert both.mass == pytest.approx(0.7)
    assert both.std == pytest.approx(0.01 * np.sqrt(2.0))
    assert 'on both half plates' in payload_remark(both, ['a', 'b']).text
    assert not payload(0.5, 0.02).on_both


def test_halves_that_correlate_are_not_told_apart():
    """The sum is sure, the difference is not."""
    blurred = payload(0.26, 0.24, 1.0, 1.0, -0.9999)
    assert blurred.is_seen
    assert blurred.half is None
    assert blurred.confidence < 0.9
    assert 'does not tell which half plate' in payload_remark(blurred, ['loaded']).text


@pytest.mark.parametrize('loaded', [(), ('bare', 'loaded'), ('none',)])
def test_bags_with_and_without_are_needed(loaded):
    runs = (*runs_of('reference', 'bare', 1), *runs_of('reference', 'loaded', 2))
    with pytest.raises(InputError, match='give bags with and without it'):
        payload_of_runs(runs, loaded, REFERENCE)


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp('loads')
    bare = MODELS['reference'][1]
    return {name: simulated(folder, name, model, seed, 6.0) for seed, (name, model) in enumerate({
        'bare': bare, 'tool': model_with(bare, 'payload', mass=0.5, half=1.0),
        'other': model_with(bare, 'payload', mass=0.7, half=2.0)}.items())}


def identified(folder, *arguments):
    done = run(identify, *arguments, '--robot', 'reference', '--output', folder, '--no-report')
    assert done.code == 0, done.err
    content = json.loads((folder / 'identification.json').read_text(encoding='utf-8'))
    return done, content


def test_the_command_tells_gains_by_a_known_payload(bags, tmp_path):
    done, content = identified(tmp_path, bags['bare'], bags['tool'], '--payload',
                               f'{bags["tool"]}=0.5')
    assert 'those of the robot file are right within' in done.out
    np.testing.assert_allclose(content['drive_gain']['value'], REFERENCE.drives.gain, rtol=0.005)
    assert content['parameters']['platform_mass_1']['value'] == pytest.approx(0.8043, rel=0.01)
    done, content = identified(tmp_path, bags['tool'], '--payload', f'{bags["tool"]}=0.5')
    assert 'every bag carries the same payload' in done.out
    assert 'drive_gain' not in content


def test_the_command_weighs_an_unknown_payload(bags, tmp_path):
    done, content = identified(tmp_path, bags['bare'], bags['other'], '--unknown-payload',
                               bags['other'])
    assert "on half plate 2 (D')" in done.out
    assert content['payload']['half'] == 2
    assert content['payload']['mass']['value'] == pytest.approx(0.7, rel=0.01)
    # the loaded bag has no part in the parameters
    assert content['parameters']['platform_mass_2']['value'] == pytest.approx(0.8594, rel=0.01)


def test_bags_with_the_payload_pass_the_same_filters(bags, tmp_path, monkeypatch):
    seen = []

    def weighed(runs, *arguments):
        seen.extend(runs)
        return payload_of_runs(runs, *arguments)

    monkeypatch.setattr('par4_identification.reports.outcome.loads.payload_of_runs', weighed)
    identified(tmp_path, bags['bare'], bags['other'], '--unknown-payload', bags['other'],
               '--cutoff', '20')
    assert {run.name for run in seen} == {str(bags['bare']), str(bags['other'])}
    assert {run.conditioning.torque_cutoff_hz for run in seen} == {20.0}


@pytest.mark.parametrize(('options', 'message'), [
    (('--payload', 'none=1'), 'one of the bags given'),
    (('--payload', '{tool}=-1'), 'a mass of 0 to 1000 kg'),
    (('--payload', '{tool}'), 'expected BAG=KG'),
    (('--payload', '{tool}=1', '--payload', '{tool}/=2'), 'found 1 kg for that bag already; give'),
    (('--unknown-payload', 'none'), 'expected one of the bags given'),
    (('--unknown-payload', '{bare}', '--unknown-payload', '{tool}'), 'every bag carries it'),
    (('--unknown-payload', '{tool}', '--payload', '{bare}=1'), 'a mass is known or asked for')])
def test_payloads_that_make_no_sense_are_one_line(bags, tmp_path, options, message):
    done = run(identify, bags['bare'], bags['tool'], '--robot', 'reference', '--output', tmp_path,
               *(option.format(**bags) for option in options))
    assert done.code == 2
    assert message in done.err
    assert done.err.count('\n') == 1


def test_an_axis_carries_no_payload():
    axis = Axis(schema='par4/axis/1', name='slide', joint='slide', kind='linear', gain=35.0)
    with pytest.raises(InputError, match='no platform to carry it'):
        payload_of_runs(runs_of('reference', 'bare', 1), ['bare'], axis)
