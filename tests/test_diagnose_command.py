"""par4_diagnose as users meet it: the next experiment and its bag, the order of the report, errors.
"""

from __future__ import annotations

import json
import shutil
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from report_pages import Page, checked_page
from test_commands import run
from test_next_experiment import circles

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.model_file import EffectEntry, read_model_file, write_model_file
from par4_dynamics.model_from_file import read_model
from par4_dynamics.parameters import Parameter
from par4_identification.commands import diagnose
from par4_identification.confrontation.confrontation import confront_diagnosis
from par4_identification.diagnosis import diagnosis
from par4_identification.diagnosis.diagnosis import LIBRARY
from par4_identification.diagnosis.experiment.next_experiment import WANTED
from par4_identification.jobs import diagnose as jobs
from par4_identification.reports import diagnosis_report
from par4_identification.reports.outcome.causes import phrase_of_cause
from par4_kinematics.files import write_yaml
from par4_kinematics.motion_file import named_motion
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.workspace import home_pose
from par4_sim.bags.bag_writer import BagWriter
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import build_simulation
from par4_sim.commands import simulate
from par4_sim.report.results import plain
from par4_sim.report.words import number
from robots import REFERENCE

TRUTH, TWIN = 'theta_friction', 'passive_joint_friction'
"""Alike on narrow circles, not on wide and fast motion."""
NOISE = 0.3
"""N m"""
CIRCLES = {'narrow': ((0.1, 1.0), (0.05, 1.0)), 'held_out': ((0.07, 1.2), (0.09, 1.0))}
"""Radius, m, and speed, m/s."""
FILES = ('diagnosis.json', 'extended_model.yaml', 'motion.csv', 'motion.yaml', 'report.html')


@pytest.fixture(scope='module')
def machine(tmp_path_factory):
    """Return the model.yaml of a machine with the hidden effect, and bags of it."""
    folder = tmp_path_factory.mktemp('machine')
    model_file = read_model_file('table1')
    effect = EffectEntry(effect=TRUTH, joints=(0, 1, 2, 3), parameters={
        'coulomb': Parameter(value=0.0, unit='N m'),
        'viscous': Parameter(value=0.05, unit='N m s/rad')})
    write_model_file(folder / 'machine.yaml', model_file.model_copy(update={'effects': (effect,)}))
    model = read_model(folder / 'machine.yaml', REFERENCE)
    for seed, (name, sizes) in enumerate(CIRCLES.items()):
        simulation = build_simulation(REFERENCE, model, 'exact', seed=seed, torque_noise=NOISE)
        simulate_to_bag(simulation, circles(*sizes), REFERENCE, folder / name)
    home = inverse_kinematics(REFERENCE.geometry, home_pose(REFERENCE))
    with BagWriter(folder / 'rest') as bag:
        for index in range(2000):
            bag.write_joint_state('/joint_states', 1_000_000 * (index + 1), JOINT_NAMES, home,
                                  effort=np.ones(4))
    with BagWriter(folder / 'slide') as bag:
        for index in range(2000):
            bag.write_joint_state('/joint_states', 1_000_000 * (index + 1), ['slide'], [0.0],
                                  effort=[1.0])
    return folder


@pytest.fixture(scope='module')
def first(machine, tmp_path_factory):
    """Return what the first diagnosis leaves.

    The machine was simulated by the exact plant; so is its model: the engine, which users get,
    takes 20 times as long. `test_commands` has a diagnosis with that.
    """
    folder, kept = tmp_path_factory.mktemp('first'), {}

    def keeping(work):
        def done_and_kept(*arguments, **options):
            kept[work.__name__] = work(*arguments, **options)
            return kept[work.__name__]
        return done_and_kept

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jobs, 'confront_diagnosis', partial(confront_diagnosis, fidelity='exact'))
        for work in (jobs.diagnose, jobs.next_experiment):
            patch.setattr(jobs, work.__name__, keeping(work))
        done = run(diagnose, machine / 'narrow', '--holdout', machine / 'held_out', '--robot',
                   'reference', '--output', folder)
    assert done.code == 0, done.err
    return SimpleNamespace(folder=folder, content=read_json(folder),
                           page=Page(folder / 'report.html'), kept=kept, **vars(done))


@pytest.fixture
def again(first, tmp_path):
    """Return a copy of the first results, with a file of the user's beside them."""
    folder = tmp_path / 'results'
    shutil.copytree(first.folder, folder)
    (folder / 'notes.txt').write_text('mine')
    return folder


@pytest.fixture
def same_diagnosis(first, monkeypatch):
    """Let a diagnosis of the same bags come out as the first, for tests of what is made of it."""
    for name, result in first.kept.items():
        monkeypatch.setattr(jobs, name, lambda *_, result=result, **__: result)


@pytest.fixture
def small_library(monkeypatch):
    """Let only frictions be named, for speed."""
    names = (TRUTH, TWIN, 'stribeck', 'viscous_asymmetry')
    monkeypatch.setattr(diagnosis, 'LIBRARY', {name: LIBRARY[name] for name in names})


def read_json(folder: Path) -> dict:
    return json.loads((folder / 'diagnosis.json').read_text())


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


# the next experiment


def test_twins_get_a_motion_that_par4_motion_plays(first):
    cause, = first.content['causes']
    assert {cause['effect'], *cause['indistinguishable_from']} == {TRUTH, TWIN}
    proposed = first.content['next_experiment']
    assert [set(pair) for pair in proposed['separates']] == [{TRUTH, TWIN}]
    assert proposed['expected_separation'] >= WANTED
    assert names_in(first.folder) == list(FILES)

    motion = named_motion(first.folder / proposed['motion'], REFERENCE)  # refuses what no robot can
    home = inverse_kinematics(REFERENCE.geometry, home_pose(REFERENCE))
    np.testing.assert_allclose(motion.q[[0, -1]], [home, home], atol=2e-3)
    np.testing.assert_allclose(motion.qd[[0, -1]], 0.0, atol=1e-6)

    twins = first.page.place('What could not be told apart')
    assert f'Play {proposed["motion"]} (' in first.page.words[twins]
    assert f', {motion.duration:.0f} s)' in first.page.words[twins]
    assert f'by {number(proposed["expected_separation"], 2)} (' in first.page.words[twins]
    assert first.page.pictures[twins] == ['The proposed motion over time']
    assert f'Play {proposed["motion"]} (' in first.page.words[first.page.place('What to do next')]


@pytest.mark.usefixtures('small_library', 'unrendered')
def test_the_bag_of_that_motion_decides_and_replaces_what_the_first_run_left(
        first, again, machine, tmp_path):
    played = run(simulate, again / 'motion.yaml', '--model', machine / 'machine.yaml', '--seed', 7,
                 '--torque-noise', NOISE, '--output', tmp_path / 'new')
    assert played.code == 0, played.err
    done = run(diagnose, machine / 'narrow', tmp_path / 'new', '--holdout', machine / 'held_out',
               '--robot', 'reference', '--output', again, '--no-simulate')
    assert done.code == 0, done.err
    content = read_json(again)
    cause, = content['causes']
    assert cause['effect'] == TRUTH
    assert cause['indistinguishable_from'] == []
    assert content['next_experiment'] is None
    assert names_in(again) == ['diagnosis.json', 'extended_model.yaml', 'notes.txt', 'report.html']
    before, after = (read_model_file(folder / 'extended_model.yaml')
                     for folder in (first.folder, again))
    assert [Path(bag['path']).name for bag in after.provenance['bags']] == [
        'narrow', 'new', 'held_out']
    (old,), (new,) = before.effects, after.effects
    assert (new.effect, new.parameters['viscous'].value) == (
        TRUTH, pytest.approx(0.05, rel=0.05))
    # the machine has no Coulomb friction of theta, and what it might have is in the deviations
    for entry in (old, new):
        for name, true in (('coulomb', 0.0), ('viscous', 0.05)):
            told = entry.parameters[name]
            assert abs(told.value - true) < 2.0 * told.std
        assert entry.parameters['coulomb'].value == 0.0
    assert {name: parameter.std for name, parameter in new.parameters.items()} == {
        name: value['std'] for name, value in cause['parameters'].items()}
    page = Page(again / 'report.html')
    assert 'motion.yaml' not in ' '.join(page.words)
    assert page.headings[page.place('What could not')] == 'What could not be told apart'


@pytest.mark.usefixtures('unrendered')
def test_unusable_data_leave_nothing_of_an_earlier_run(again, machine):
    done = run(diagnose, machine / 'rest', '--robot', 'reference', '--output', again)
    assert done.code == 0, done.err
    content = read_json(again)
    assert (content['verdict'], content['causes']) == ('unusable_data', [])
    assert content['extended_model'] is content['next_experiment'] is None
    assert names_in(again) == ['diagnosis.json', 'notes.txt', 'report.html']
    shown = (again / 'report.html').read_text(encoding='utf-8')
    assert 'motion.yaml' not in shown
    assert 'extended_model.yaml' not in shown


@pytest.mark.usefixtures('unrendered')
def test_a_motion_that_no_diagnosis_proposed_stays(machine, tmp_path):
    own = {'motion.yaml': 'designed here', 'motion.csv': 'a log of my own'}
    for name, text in own.items():
        (tmp_path / name).write_text(text)
    for _ in range(2):  # the second finds a diagnosis without a proposal
        done = run(diagnose, machine / 'rest', '--robot', 'reference', '--output', tmp_path)
        assert done.code == 0, done.err
        assert {name: (tmp_path / name).read_text() for name in own} == own


@pytest.mark.usefixtures('same_diagnosis', 'unrendered')
def test_a_proposed_motion_is_written_beside_the_users_own(again, machine):
    own = {'motion.csv': 'a log of my own', 'motion_2.yaml': 'designed here'}
    for name, text in own.items():
        (again / name).write_text(text)
    own['motion.yaml'] = (again / 'motion.yaml').read_text()  # is no proposal without its samples
    done = run(diagnose, machine / 'narrow', '--holdout', machine / 'held_out', '--robot',
               'reference', '--output', again, '--no-simulate')
    assert done.code == 0, done.err
    assert read_json(again)['next_experiment']['motion'] == 'motion_3.yaml'
    words = ' '.join(Page(again / 'report.html').words)
    assert 'Play motion_3.yaml (' in words
    assert 'The proposed motion, motion_3.yaml: ' in words
    assert named_motion(again / 'motion_3.yaml', REFERENCE).duration > 0.0
    done = run(diagnose, machine / 'rest', '--robot', 'reference', '--output', again)
    assert done.code == 0, done.err
    assert {name: (again / name).read_text() for name in own} == own
    assert names_in(again) == sorted({'diagnosis.json', 'notes.txt', 'report.html', *own})


@pytest.mark.usefixtures('same_diagnosis', 'unrendered')
def test_limits_of_a_proposed_motion_that_no_file_gives_are_told(again, machine, tmp_path):
    content = REFERENCE.model_dump(by_alias=True)
    del content['limits'], content['drives']['torque_limit']
    write_yaml(tmp_path / 'robot.yaml', plain(content))
    asked = (machine / 'narrow', '--holdout', machine / 'held_out', '--output', again,
             '--no-simulate', '--robot')
    *_, last = run(diagnose, *asked, tmp_path / 'robot.yaml').out.splitlines()
    assert last.startswith('limits that the file of robot reference leaves out')
    assert 'limits that' not in run(diagnose, *asked, 'reference').out


@pytest.mark.usefixtures('same_diagnosis')
def test_stopped_while_the_report_is_drawn_nothing_has_changed(again, machine, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(diagnosis_report, 'report_of_diagnosis', stopped)
    (again / 'motion.yaml').write_text('of an earlier run')
    before = contents(again)
    done = run(diagnose, machine / 'narrow', '--holdout', machine / 'held_out', '--robot',
               'reference', '--output', again, '--no-simulate')
    assert done.code == 130
    assert contents(again) == before


# the report


def test_the_report_has_its_parts_in_the_order_of_the_contract(first):
    page = first.page
    checked_page(first.folder / 'report.html', 8)
    sentence = first.out.splitlines()[0].removeprefix(f'{first.content["verdict"]}: ')
    assert page.headings[0] == sentence
    parts = [page.place(beginning) for beginning in (
        'Measured against simulated', 'Evidence', 'What could not be told apart, and which motion',
        'What the base parameters had swallowed', 'What remains')]
    assert parts == sorted(parts)
    simulated, evidence, *_, swallowed, remains = parts
    assert page.headings[1:simulated] == ['Insights', 'What to do next']
    assert [picture.startswith('Measured and simulated') and picture.endswith('before and after')
            for picture in page.pictures[simulated]] == [True, True]  # of torque and of motion
    signatures = [place for place, pictures in enumerate(page.pictures) for picture in pictures
                  if 'with the curve of the cause' in picture]
    assert signatures == [evidence - 1]
    assert 'rotation theta' in page.headings[evidence - 1]
    for term in ('actuator inertia', 'platform mass 1', 'viscous friction'):
        assert term in page.words[swallowed]
    assert page.pictures[swallowed] == ['Base parameters before and after']
    assert page.pictures[remains] == ['Residual over position, speed, acceleration and time']


@pytest.mark.parametrize(('coulomb', 'viscous', 'phrase'), [
    ((0.5, 0.01), (0.05, 0.01), '0.50 N m of friction of the rotation theta with viscous 0.050 N m '
                                's/rad'),
    ((-0.01, 0.01), (0.05, 0.01), 'friction of the rotation theta with viscous 0.050 N m s/rad'),
    ((0.5, 0.01), (0.01, 0.01), '0.50 N m of friction of the rotation theta'),
    ((0.01, 0.01), (0.01, 0.01), '0.010 N m of friction of the rotation theta with viscous 0.010 '
                                 'N m s/rad'),
])
def test_a_size_that_may_be_none_is_not_said_beside_one_that_is_not(coulomb, viscous, phrase):
    effect = CATALOGUE[TRUTH]
    sizes = dict(zip(('coulomb', 'viscous'), (coulomb, viscous), strict=True))
    cause = SimpleNamespace(effect=effect, joints=(0, 1, 2, 3), twins=(), parameters={
        item.name: Parameter(value=sizes[item.name][0], std=sizes[item.name][1], unit=item.unit)
        for item in effect.parameters})
    assert phrase_of_cause(cause, REFERENCE) == phrase


@pytest.mark.parametrize(('delay', 'phrase'), [
    (0.0041, 'torque recorded 0.0041 s late against the positions'),
    (-0.0041, 'torque recorded 0.0041 s early against the positions')])
def test_stamps_that_are_wrong_are_told_as_late_or_early(delay, phrase):
    cause = SimpleNamespace(effect=CATALOGUE['time_offset'], joints=(0, 1, 2, 3), twins=(),
                            parameters={'delay': Parameter(value=delay, std=1e-4, unit='s')})
    assert phrase_of_cause(cause, REFERENCE) == phrase


# bad input

BAD_INPUT = {
    'missing bag': ('{machine}/nope --robot reference', 'no such bag'),
    'missing held-out bag': ('{machine}/narrow --holdout {machine}/nope --robot reference',
                             'no such bag'),
    'missing robot': ('{machine}/narrow --robot {folder}/nope.yaml', 'nope.yaml'),
    'robot of one joint': ('{machine}/narrow --robot {folder}/slide.yaml', 'slide'),
    'bag of one joint': ('{machine}/slide --robot reference', 'arm_joint_0'),
    'three gains': ('{machine}/narrow --robot {folder}/three.yaml', 'gain'),
    'model of one joint': ('{machine}/narrow --robot reference --model {folder}/slide_model.yaml',
                           'missing parameters'),
}


@pytest.mark.parametrize('case', BAD_INPUT)
def test_bad_input_is_one_line_and_leaves_earlier_results_alone(case, again, machine, tmp_path):
    (tmp_path / 'slide.yaml').write_text(
        'schema: par4/axis/1\nname: slide\njoint: slide\nkind: linear\ngain: 35.0\n')
    three = REFERENCE.model_dump(by_alias=True, mode='json')
    three['drives']['gain'] = three['drives']['gain'][:3]
    (tmp_path / 'three.yaml').write_text(json.dumps(three))
    (tmp_path / 'slide_model.yaml').write_text(
        'schema: par4/model/1\nparameters: {actuator_inertia: {value: 1.0}}\n')
    words, expected = BAD_INPUT[case]
    words = words.format(machine=machine, folder=tmp_path).split()
    before = contents(again)
    assert expected in refusal(*words, '--output', again)
    assert contents(again) == before
    refusal(*words, '--output', tmp_path / 'new')
    assert not (tmp_path / 'new').exists()


@pytest.mark.parametrize('place', ['a_file', 'a_file/below', '/proc/results', 'link'])
def test_a_folder_that_cannot_be_written_is_refused_before_any_bag_is_read(place, tmp_path):
    (tmp_path / 'a_file').write_text('mine')
    (tmp_path / 'link').symlink_to('/proc/results')
    line = refusal(tmp_path / 'no_bag', '--robot', 'reference', '--output', tmp_path / place)
    assert 'results cannot be written there' in line
    (tmp_path / 'link').unlink()
    assert contents(tmp_path) == {'a_file': b'mine'}


def test_no_results_are_written_into_a_bag(tmp_path):
    (tmp_path / 'metadata.yaml').write_text('mine')
    assert 'is a bag' in refusal(tmp_path, '--robot', 'reference', '--output', tmp_path)
    assert contents(tmp_path) == {'metadata.yaml': b'mine'}


def refusal(*words) -> str:
    """Return the one line that a run refuses with."""
    done = run(diagnose, *words)
    assert done.code == 2
    assert done.out == ''
    line, = done.err.splitlines()
    assert line.startswith('error: ')
    return line


def test_the_motion_of_the_paper_again_and_again_tells_no_ripple(tmp_path):
    """Its torque jumps; what the times of readings make of that comes again with every cycle.

    The machine has its mass along rods and bars, and nothing else that (20) lacks.
    """
    done = run(simulate, 'adept', '--duration', 10, '--feedforward', 'table1',
               '--torque-noise', 0.05, '--output', tmp_path / 'cycles')
    assert not done.code, done.err
    done = run(diagnose, tmp_path / 'cycles', '--robot', 'reference', '--output',
               tmp_path / 'found', '--no-report', '--no-simulate')
    assert not done.code, done.err
    found = json.loads((tmp_path / 'found' / 'diagnosis.json').read_text(encoding='utf-8'))
    assert [cause['effect'] for cause in found['causes']] == ['distributed_rods']
