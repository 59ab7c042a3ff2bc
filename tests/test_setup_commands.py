"""What the commands say of mistakes of the setup: first, on the terminal, the page and in JSON."""

from __future__ import annotations

import json

import mistakes
import numpy as np
import pytest
from test_commands import checked_page, run, simulated

from par4_dynamics.model import read_model
from par4_identification.commands import diagnose, identify, validate
from par4_identification.logs.read_log import read_log
from par4_sim.bag import BagWriter, read_bag
from robots import REFERENCE

FIRST = 'Before anything else: '


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return a bag in which the plugs of the amplifiers of joints 1 and 2 are exchanged."""
    folder = tmp_path_factory.mktemp('setup')
    right = read_bag(simulated(folder, 'right', read_model('table1', REFERENCE), 5))
    with BagWriter(folder / 'exchanged') as writer:
        for topic, joints in right.joints.items():
            order = [0, 2, 1, 3] if topic == 'amplifier_voltage' else [0, 1, 2, 3]
            names = list(REFERENCE.joint_names)
            position, effort = (joints.select(part, names) for part in (
                joints.position, joints.effort))
            for row, stamp in enumerate(joints.stamp):
                writer.write_joint_state(
                    f'/{topic}', int(stamp), names,
                    () if np.isnan(position[row]).any() else position[row],
                    effort=() if np.isnan(effort[row]).any() else effort[row][order],
                    received=int(joints.received[row]))
    return folder / 'exchanged'


def said_first(done, folder, kind: str, result: str) -> dict:
    """Return the first finding of a command that said it first everywhere."""
    assert done.code == 0, done.err
    assert done.out.startswith(FIRST)
    finding = json.loads((folder / result).read_text())['setup'][0]
    assert finding['finding'] == kind
    assert finding['evidence'] in ' '.join(done.out.split())
    return finding


def test_identification_says_exchanged_plugs_first_and_goes_on(bag, tmp_path):
    done = run(identify, bag, '--robot', 'reference', '--output', tmp_path, '--compare-true',
               'table1')
    finding = said_first(done, tmp_path, 'joints_exchanged', 'identification.json')
    assert finding['joints'] == [1, 2]
    assert 'torques' in finding['evidence']
    assert 'wiring' in finding['mend']
    inertia = json.loads((tmp_path / 'identification.json').read_text())['parameters'][
        'actuator_inertia']
    assert inertia['value'] == pytest.approx(0.113, rel=0.01)
    assert FIRST in checked_page(tmp_path / 'report.html', 1).text


def test_validation_says_it_too(bag, tmp_path):
    done = run(validate, bag, '--model', 'table1', '--robot', 'reference', '--output', tmp_path)
    said_first(done, tmp_path, 'joints_exchanged', 'validation.json')
    assert 'The model holds' in done.out


def test_diagnosis_says_it_too_and_finds_a_clean_machine(bag, tmp_path):
    done = run(diagnose, bag, '--robot', 'reference', '--output', tmp_path, '--no-simulate')
    said_first(done, tmp_path, 'joints_exchanged', 'diagnosis.json')
    assert 'The diagnosis went on with this mended' in ' '.join(done.out.split())
    assert json.loads((tmp_path / 'diagnosis.json').read_text())['verdict'] == 'clean'


def test_useless_data_are_unusable_with_the_finding_as_reason(bag, tmp_path, monkeypatch):
    monkeypatch.setattr(diagnose, 'read_log', lambda *arguments: mistakes.standing(
        read_log(*arguments)))
    done = run(diagnose, bag, '--robot', 'reference', '--output', tmp_path)
    finding = said_first(done, tmp_path, 'not_moving', 'diagnosis.json')
    content = json.loads((tmp_path / 'diagnosis.json').read_text())
    assert content['verdict'] == 'unusable_data'
    assert content['causes'] == []
    assert finding['evidence'] in content['reasons'][0]


def test_stamps_in_milliseconds_end_in_no_error(bag, tmp_path, monkeypatch):
    monkeypatch.setattr(validate, 'read_log', lambda *arguments: mistakes.in_milliseconds(
        read_log(*arguments)))
    done = run(validate, bag, '--model', 'table1', '--robot', 'reference', '--output', tmp_path)
    said_first(done, tmp_path, 'wrong_unit', 'validation.json')
