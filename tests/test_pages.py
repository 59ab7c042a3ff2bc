"""The tutorials do what they say: their code runs, their commands exist, the effects have pages."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from importlib import import_module
from importlib.metadata import entry_points
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from textwrap import dedent

import click
import numpy as np
import pytest

from executables import NODES, TOOLS
from par4_dynamics import build_model, read_model, read_model_file
from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.effects.guide import GUIDES
from par4_dynamics.model_file import EffectEntry
from par4_dynamics.parameters import Parameter
from par4_identification.commands.inspect import inspect
from par4_kinematics.errors import InputError
from par4_kinematics.limits import limits_not_given
from par4_kinematics.motion_file import RECIPES, named_motion, write_motion
from par4_kinematics.robot import Axis, Robot, read_machine
from par4_sim.cell.cell import COMPOSITIONS
from robots import REFERENCE

DOCS = Path(__file__).parents[1] / 'docs'
TUTORIALS = ('first_ten_minutes', 'one_axis', 'your_own_robot', 'fault_step_by_step',
             'effect_of_your_own', 'cluster')


def blocks(page: str, language: str) -> list[str]:
    """Return the blocks of code of a page."""
    found = re.findall(r'^ *```(\w*)\n(.*?)^ *```$', (DOCS / f'{page}.md').read_text(),
                       re.DOTALL | re.MULTILINE)
    return [dedent(code) for own, code in found if own == language]


def told_by(page: str, capsys: pytest.CaptureFixture[str]) -> tuple[dict, list[str]]:
    """Run the Python of a page in this folder and return its names and what it printed."""
    scope: dict = {}
    for code in blocks(page, 'python'):
        exec(compile(code, page, 'exec'), scope)
    return scope, capsys.readouterr().out.splitlines()


def command_of(name: str) -> click.Command:
    """Return the command line of an executable."""
    module = import_module(TOOLS[name])
    return next(item for item in vars(module).values() if isinstance(item, click.Command))


def expect_known_options(line: str) -> None:
    """Fail where a command line has an option that the command does not know."""
    name, *words = shlex.split(line, comments=True)
    command = inspect if '--inspect' in words else command_of(name)
    known = {option for parameter in command.params for option in parameter.opts}
    assert {word for word in words if word.startswith('--')} <= known, line


def test_a_robot_of_ones_own(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scope, lines = told_by('your_own_robot', capsys)
    assert isinstance(scope['robot'], Robot)
    assert lines[1] == 'corners within the limits: True'
    assert 1.0 < float(lines[2].rpartition(' ')[2]) < 20.0
    assert 1.0 < float(lines[3].rpartition(' ')[2]) < scope['robot'].drives.torque_limit
    # the measurement of this very robot as the page says it, but with less to compute
    quicker = {'par4_excite': ['--starts', '1'], 'par4_identify': ['--no-report']}
    commands, = blocks('your_own_robot', '')
    for line in commands.splitlines():
        name, *words = shlex.split(line)
        command_of(name).main(words + quicker.get(name, []), standalone_mode=False)
    assert Path('identified/model.yaml').is_file()


LIMITLESS = """\
schema: par4/robot/1
name: mine
geometry: {arm_length: 0.375, forearm_length: 0.825, base_radius: 0.275, platform_radius: 0.06,
           platform_bar_length: 0.1}
drives: {gain: [12.7, 12.7, 12.7, 12.7]}
limits: {joint_speed: 14.0, workspace: {radius: 0.4}}
"""
TOLD = ('limits that the file of robot mine leaves out are those of the reference robot: '
        'drives.torque_limit 200, limits.joint_position [-1, 1.6], limits.workspace.z [-0.9, '
        '-0.55], limits.workspace.theta 0.7854; write your own into it, see docs/robot_file.md')


@pytest.mark.usefixtures('unrendered')
@pytest.mark.parametrize('line', [
    'par4_simulate adept --rate 100 --output out',
    'par4_push --force 50 --output out',
    'par4_excite --duration 4 --starts 1 --harmonics 2 --output out.yaml',
    'par4_track adept --jerk 30000 --output out',
    'par4_fastest adept --jerk 30000 --timing own --output out'])
def test_limits_that_a_robot_file_leaves_out_are_told(tmp_path, monkeypatch, capsys, line):
    monkeypatch.chdir(tmp_path)
    Path('robot.yaml').write_text(LIMITLESS)
    name, *words = line.split()
    command_of(name).main([*words, '--robot', 'robot.yaml'], standalone_mode=False)
    assert capsys.readouterr().out.splitlines()[-1] == TOLD


def test_nothing_is_told_of_limits_that_are_all_given():
    assert limits_not_given(REFERENCE) == ()


def test_robot_files_of_the_page_are_read(tmp_path):
    machines = []
    for text in blocks('robot_file', 'yaml'):
        path = tmp_path / 'robot.yaml'
        path.write_text(text)
        machines.append(read_machine(path))
    par4, turning, sliding = machines
    assert par4 == REFERENCE
    assert isinstance(turning, Axis)
    assert isinstance(sliding, Axis)
    assert (turning.kind, sliding.kind) == ('revolute', 'linear')


def test_model_files_of_the_page_are_read(tmp_path):
    slide = Axis(schema='par4/axis/1', name='slide', joint='slide', kind='linear', gain=1.0)
    path = tmp_path / 'model.yaml'
    models = []
    for text, machine in zip(blocks('model_file', 'yaml'), (REFERENCE, REFERENCE, slide),
                             strict=True):
        path.write_text(text)
        models.append(read_model(path, machine))
    assert models[0].rigid_body == 'full'
    assert [active.effect.name for active in models[1].effects] == ['cogging']
    path.write_text('{schema: par4/model/1, parameter: {}}')
    with pytest.raises(InputError, match=r'parameter: no such key.*see docs/model_file\.md$'):
        read_model(path, slide)


def test_motion_files_of_the_page_are_read(tmp_path):
    *recipes, samples = blocks('motion_file', 'yaml')
    assert len(recipes) == len(RECIPES)
    for text in (*recipes, samples):
        (tmp_path / 'asked.yaml').write_text(text)
        motion = named_motion(tmp_path / 'asked.yaml', REFERENCE)
        write_motion(tmp_path / 'motion.yaml', motion, 'platform')  # the samples of the last one


@pytest.mark.parametrize('text', [
    '{schema: par4/motion/2}', '{schema: par4/motion/1}',
    '{schema: par4/motion/1, recipe: {kind: circle, raduis: 0.1}}',
    '{schema: par4/motion/1, recipe: {kind: square}}'])
def test_a_motion_file_that_is_refused_names_the_page_with_its_keys(tmp_path, text):
    path = tmp_path / 'motion.yaml'
    path.write_text(text)
    with pytest.raises(InputError, match=r'see docs/motion_file\.md$'):
        named_motion(path, REFERENCE)


@pytest.mark.parametrize(('text', 'told'), [
    ('schema: par4/robot/2', 'expected schema par4/robot/1 or par4/axis/1'),
    ('- a list', 'expected a mapping'),
    ('{schema: par4/axis/1, name: a, joint: a, kind: revolute, gain: 1.0, geer_ratio: 3.0}',
     'geer_ratio: no such key, did you mean gear_ratio? (found 3.0)'),
    ('{schema: par4/robot/1, name: a}', 'geometry: the key is missing')])
def test_a_robot_file_that_is_refused_names_the_page_with_its_keys(tmp_path, text, told):
    path = tmp_path / 'robot.yaml'
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        read_machine(path)
    assert told in str(refused.value)
    page = str(refused.value).rpartition('; see ')[2]
    assert page == 'docs/robot_file.md'
    assert (DOCS.parent / page).is_file()


def test_a_fault_step_by_step(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scope, lines = told_by('fault_step_by_step', capsys)
    rms = scope['found'].estimate.rms
    assert rms[2] > 5.0 * np.delete(rms, 2).max()
    assert lines[1].startswith('strongest order: 24 ')
    assert lines[2] == 'explained cogging on joints (2,)'
    assert abs(scope['cause'].parameters['amplitude'].value[0] - 0.6) < 0.05
    assert lines[4].endswith('twins: ()')


OF_ANOTHER_LOG = 'fast_bag'
"""In a command of the page that has no files."""


@pytest.mark.usefixtures('unrendered')
def test_a_fault_on_one_axis(tmp_path, monkeypatch, capsys):
    """From the CSV to the cause by the commands of the page, which say what the page says."""
    monkeypatch.chdir(tmp_path)
    told_by('one_axis', capsys)
    quicker = {'par4_identify': ['--no-report'], 'par4_diagnose': ['--no-report']}
    for line in (line for block in blocks('one_axis', '') for line in block.splitlines()):
        name, *words = shlex.split(line)
        if '--inspect' in words:
            inspect.main(words, standalone_mode=False)
        elif OF_ANOTHER_LOG not in words:
            command_of(name).main(words + quicker.get(name, []), standalone_mode=False)
    said = ' '.join(capsys.readouterr().out.split())
    assert 'cogging torque of 2 orders (0.12 N m with 14 periods a turn, 0.018 N m with 28' in said
    # another processor may round the last digits of the others otherwise
    for told in (line for block in blocks('one_axis', 'text') for line in block.splitlines()):
        assert without_numbers(told) in without_numbers(said)
    assert 'diagnose: yes, ' in said


def without_numbers(text: str) -> str:
    """Return a text with `#` for each number."""
    return re.sub(r'\d+(\.\d+)?', '#', text)


def test_an_effect_of_ones_own(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    _, lines = told_by('effect_of_your_own', capsys)
    assert lines == ["explained [('brake_drag', (1,))]"]


@pytest.mark.parametrize('page', TUTORIALS)
def test_commands_of_a_tutorial_are_there_with_these_options(page):
    lines = [line for block in blocks(page, '') for line in block.splitlines()
             if line.startswith('par4_')]
    assert lines or page == 'effect_of_your_own'
    for line in lines:
        expect_known_options(line)


def commands(page: str) -> list[str]:
    """Return the command lines of a page that begin with an executable, without comments."""
    return [line.partition(' #')[0] for block in blocks(page, '') for line in block.splitlines()
            if line.split(' ')[0] in {*TOOLS, *NODES}]


@pytest.mark.parametrize('page', ['../README', 'hardware'])
def test_commands_of_a_page_have_parameters_that_are_there(page, monkeypatch, capsys, tmp_path):
    nodes = 0
    monkeypatch.chdir(tmp_path)
    for file in ('robot.yaml', 'identified/model.yaml'):  # made by hand and by commands before
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).touch()
    for line in commands(page):
        name, *words = shlex.split(line)
        if name == 'par4_cell':
            composition, *given = words
            COMPOSITIONS[composition].session(dict(word.split(':=') for word in given))
        elif name in TOOLS:
            expect_known_options(line)
        else:
            monkeypatch.setattr(sys, 'argv', [name, '--help'])
            entry, = entry_points(group='console_scripts', name=name)
            assert entry.load()() == 0
            known = re.findall(r'^  (\w+):=', capsys.readouterr().out, re.MULTILINE)
            assert words[0] == '--ros-args'
            assert set(words[1::2]) == {'-p'}
            assert {word.partition(':=')[0] for word in words[2::2]} <= {*known, 'use_sim_time'}
            nodes += 1
    assert nodes >= 4


def test_the_slow_circle_of_the_page_is_slow(tmp_path):
    text, = blocks('hardware', 'yaml')
    (tmp_path / 'slow.yaml').write_text(text)
    slow = REFERENCE.model_copy(update={
        'limits': REFERENCE.limits.model_copy(update={'joint_speed': 0.5})})
    assert named_motion(tmp_path / 'slow.yaml', slow).duration > 3.0


@pytest.mark.parametrize('name', sorted(TOOLS))
def test_the_example_in_help_has_options_that_exist(name):
    example = (command_of(name).epilog or '').partition('Example:\n')[2].replace('\\\n', ' ')
    assert example.split()[0] == name
    expect_known_options(example)


def test_help_loads_no_library_of_the_work():
    told = subprocess.run([sys.executable, '-c', """
import sys
from importlib import import_module
import click
for place in sys.argv[1:]:
    module = import_module(place)
    command = next(item for item in vars(module).values() if isinstance(item, click.Command))
    try:
        command.main(['--help'])
    except SystemExit as ended:
        assert ended.code == 0, place
    heavy = {'dask', 'jinja2', 'matplotlib', 'numba', 'pybullet', 'pydantic', 'rosbags', 'scipy',
             'toppra'} & set(sys.modules)
    assert not heavy, (place, heavy)
""", *TOOLS.values()], capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    assert told.stdout.count('Example:') == len(TOOLS)


def test_nodes_tell_help_and_version_without_ros():
    told = subprocess.run([sys.executable, '-c', """
import sys
from importlib.metadata import entry_points, version
for name in sys.argv[1:]:
    entry, = entry_points(group='console_scripts', name=name)
    for option in ('--version', '--help'):
        sys.argv = [f'/somewhere/{name}', option]
        assert entry.load()() == 0
    package = entry.module.removesuffix('_start')
    print(f'expected: {name}, version {version(package)}')
    heavy = {'rclpy', 'numba', 'scipy', 'pybullet', 'rosbags'} & set(sys.modules)
    assert not heavy, (name, heavy)
""", *NODES], capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    lines = told.stdout.splitlines()
    for name in NODES:
        assert f'{name} --ros-args -p NAME:=VALUE ...' in lines
        assert f'{name}, version' in told.stdout
    assert {line.partition(': ')[2] for line in lines if line.startswith('expected')} <= set(lines)
    assert lines.count('Example:') == len(NODES) == 6


def test_every_effect_has_a_guide_with_values_that_it_takes():
    assert list(GUIDES) == list(CATALOGUE)
    table = read_model_file('table1')
    for name, guide in GUIDES.items():
        units = {parameter.name: parameter.unit for parameter in CATALOGUE[name].parameters}
        entry = EffectEntry(effect=name, parameters={
            parameter: Parameter(value=value, unit=units[parameter])
            for parameter, value in guide.usual.items()})
        model = build_model(REFERENCE, table.model_copy(update={'effects': (entry,)}))
        values = model.effects[0].values
        still = {parameter: np.zeros_like(value) for parameter, value in values.items()}
        assert CATALOGUE[name].implausible(values, still, model.values) is None, name
        for words in (guide.physics, guide.remedy):
            assert words.endswith('.'), name
            assert words[0].isupper(), name


def prose(text: str) -> list[str]:
    """Return the lines of a page that are neither code, tables, headings nor pictures."""
    text = re.sub(r'^ *```.*?^ *```$', '', text, flags=re.DOTALL | re.MULTILINE)
    return [line for line in text.splitlines()
            if not re.match(r'\||#|!\[| {4}', line) and ' ' in line.strip()]


PAGES = pytest.mark.parametrize('page', [
    path.relative_to(DOCS.parent) for folder in ('.', 'docs', 'examples/*', 'src/*')
    for path in sorted(DOCS.parent.glob(f'{folder}/*.md'))], ids=str)


@PAGES
def test_commands_give_parameters_and_names_after_ros_args(page):
    """A node refuses them anywhere else."""
    text = (DOCS.parent / page).read_text(encoding='utf-8').replace('\\\n', ' ')
    fence = re.compile(r'^ *```.*?^ *```$', re.DOTALL | re.MULTILINE)
    code = [*'\n'.join(fence.findall(text)).splitlines(),
            *(part.replace('\n', ' ') for part in re.findall('`([^`]+)`', fence.sub('', text)))]
    given = [line for line in code if re.search(r'(^| )-[pr] \S+:=', line)]
    assert not [line for line in given if '--ros-args' not in re.split(r' ?-[pr] ', line)[0]]


@PAGES
def test_prose_is_wrapped_at_a_hundred_columns(page):
    text = (DOCS.parent / page).read_text(encoding='utf-8')
    assert not [line for line in prose(text) if len(line) > 100]


def test_long_prose_is_seen():
    text = f'```\n{"x y" * 50}\n```\n| {"x y" * 50} |\n{"prose " * 20}\n'
    assert [len(line) for line in prose(text)] == [120]


@pytest.fixture(scope='module')
def effect_pages():
    """Return what writes the pages of the effects for the site."""
    spec = spec_from_file_location('effect_pages', DOCS.parent / 'site' / 'effect_pages.py')
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize('name', CATALOGUE)
def test_every_effect_has_a_page_on_the_site(effect_pages, name, monkeypatch):
    monkeypatch.setattr(effect_pages, '_confused', lambda _: ['nothing'])  # which takes long
    page = effect_pages.page(CATALOGUE[name])
    assert page.startswith('# ')
    assert GUIDES[name].remedy in page
    assert ('is taken to turn with the motor' in page) == (
        name in ('elastic_transmission', 'backlash'))
