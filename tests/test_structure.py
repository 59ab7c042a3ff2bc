"""The structure that CONTRIBUTING.md promises: who may import whom, and one home a library."""

from __future__ import annotations

import ast
import inspect
import re
import runpy
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
from functools import cache
from pathlib import Path

import pytest

from par4_dynamics import model_keys
from par4_dynamics.base_terms import TERMS
from par4_dynamics.effects import catalogue
from par4_dynamics.model_file import ModelFile
from par4_kinematics import interface, motion_recipes, robot_file
from par4_kinematics.motion_file import RECIPES

ROOT = Path(__file__).parents[1]
CHAIN = ('par4_kinematics', 'par4_dynamics', 'par4_sim', 'par4_identification')
HOMES = {
    'rosbags': ('par4_sim/bags/bag_writer.py', 'par4_identification/logs/bag.py'),
    'matplotlib': ('par4_sim/report/drawing.py',),
    'pybullet': ('par4_sim/plants/engine.py',),
    'jinja2': ('par4_sim/report/page.py',),
}
MESSAGES = ('rclpy', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'rosgraph_msgs',
            'sensor_msgs', 'std_msgs', 'std_srvs', 'trajectory_msgs', 'rcl_interfaces')
ROOMS = {
    'par4_sim': ('machines', 'description', 'plants', 'drives', 'bags', 'closed_loop', 'pictures',
                 'report', 'tracking', 'cell', 'jobs', 'commands', 'ros'),
    'par4_identification': (
        'logs', 'signals', 'estimators', 'fitting', 'gains', 'excitation', 'diagnosis/evidence',
        'diagnosis/search', 'diagnosis/nominal', 'diagnosis/verdict', 'diagnosis',
        'diagnosis/experiment', 'setup_check', 'changes', 'confrontation', 'trend',
        'reports/outcome', 'inspection', 'reports', 'jobs', 'commands', 'ros')}
"""Of packages; each may import from those in front of it."""
ROOMLESS = ('__init__.py', 'choices.py')
"""The door of a package, and names that all of its rooms use."""
SOURCES = sorted(path for package in CHAIN
                 for path in (ROOT / 'src' / package / package).rglob('*.py'))


def inner(path: Path) -> Path:
    """Return the path below src/<package>/, which begins with the package."""
    return path.relative_to(ROOT / 'src').relative_to(path.relative_to(ROOT / 'src').parts[0])


@cache
def imported(path: Path) -> frozenset[str]:
    """Return the modules that a file imports anywhere."""
    names = set()
    for item in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(item, ast.Import):
            names |= {alias.name for alias in item.names}
        elif isinstance(item, ast.ImportFrom):
            names.add(item.module)
    return frozenset(names)


def test_there_are_sources():
    assert len(SOURCES) > 50


@pytest.mark.parametrize('path', SOURCES, ids=lambda path: str(inner(path)))
def test_imports(path):
    place = inner(path)
    package = place.parts[0]
    tops = {name.split('.')[0] for name in imported(path)}
    later = set(CHAIN[CHAIN.index(package) + 1:])
    assert not tops & later, 'imports go only towards kinematics'
    for library, homes in HOMES.items():
        assert library not in tops or str(place) in homes, f'{library} lives in {homes}'
    if place.parts[1] != 'ros':
        assert not tops & set(MESSAGES), 'ROS lives under <package>/ros'
        assert not any('.ros.' in name for name in imported(path)), 'nothing below knows the nodes'
    if place.parts[1] != 'commands':
        assert 'click' not in tops, 'command lines live under <package>/commands'


def room(package: str, place: tuple[str, ...]) -> str:
    """Return the innermost room of a place below a package."""
    inside = [name for name in ROOMS[package]
              if place[:len(name.split('/'))] == tuple(name.split('/'))]
    assert inside, f'{"/".join(place)} stands in no room; tests/test_structure.py lists them'
    return max(inside, key=len)


@pytest.mark.parametrize('path', [path for path in SOURCES if inner(path).parts[0] in ROOMS],
                         ids=lambda path: str(inner(path)))
def test_rooms(path):
    package, *place = inner(path).parts
    if len(place) == 1:
        assert place[0] in ROOMLESS
        return
    rooms = ROOMS[package]
    own = rooms.index(room(package, tuple(place[:-1])))
    for name in imported(path):
        if name.startswith(f'{package}.') and f'{name.partition(".")[2]}.py' not in ROOMLESS:
            other = room(package, tuple(name.split('.')[1:]))
            assert rooms.index(other) <= own, f'{rooms[own]} stands below {other}'


@pytest.mark.parametrize('package', ROOMS)
def test_every_room_is_described(package):
    page = (ROOT / 'docs' / 'architecture.md').read_text(encoding='utf-8')
    page = page.partition(f'## Rooms of {package}\n')[2].partition('\n## ')[0]
    for name in ROOMS[package]:
        assert f'| `{name}/` |' in page, name
        door = ROOT / 'src' / package / package / name / '__init__.py'
        assert ast.get_docstring(ast.parse(door.read_text(encoding='utf-8'))), door


@pytest.mark.parametrize('path', [path for path in SOURCES if inner(path).parts[1] == 'commands'],
                         ids=lambda path: str(inner(path)))
def test_a_command_line_is_read_before_its_work_is_loaded(path):
    top = ast.Module(body=[item for item in ast.parse(path.read_text(encoding='utf-8')).body
                           if isinstance(item, ast.Import | ast.ImportFrom)], type_ignores=[])
    names = {item.module if isinstance(item, ast.ImportFrom) else item.names[0].name
             for item in top.body}
    assert not [name for name in names if '.jobs.' in name], 'import the job where it is called'
    loads = [item for item in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
             if isinstance(item, ast.With) and ast.unparse(item.items[0]) == 'loading()']
    loaded = [inside for load in loads for inside in load.body]
    for item in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(item, ast.ImportFrom) and '.jobs' in item.module:
            assert ast.dump(item) in map(ast.dump, loaded), 'load the job in a block `loading()`'


@pytest.mark.parametrize('package', CHAIN)
def test_an_executable_answers_signals_before_it_loads_anything(package):
    folder = ROOT / 'src' / package
    setup = (folder / 'setup.py').read_text(encoding='utf-8')
    functions = set(re.findall(r"'par4_\w+ = (\S+)'", setup))
    start = ast.parse((folder / f'{package}_start.py').read_text(encoding='utf-8'))
    imports = [item for item in start.body if isinstance(item, ast.Import | ast.ImportFrom)]
    assert [item.module for item in imports] == ['par4_start']
    written = [item for item in start.body if isinstance(item, ast.FunctionDef)]
    assert {f'{package}_start:{item.name}' for item in written} == functions
    for item in written:
        first = item.body[1]
        if isinstance(first, ast.If):  # a node or a tool
            assert ast.unparse(first.test).startswith('asked_for(')
            assert ast.unparse(first.body[0]).startswith('with Tool():')
            first = item.body[2]
        assert ast.unparse(first).startswith(('node_starts()', 'with Tool():'))
    assert imported(folder.parent / CHAIN[0] / 'par4_start.py') == {'os', 'signal', 'sys', 'types'}


@pytest.mark.parametrize('library', sorted(HOMES))
def test_each_library_is_at_home(library):
    for home in HOMES[library]:
        path = ROOT / 'src' / home.split('/')[0] / home
        assert library in {name.split('.')[0] for name in imported(path)}


@pytest.mark.parametrize(('text', 'home'), [
    ('1_000_000_000', 'par4_kinematics/stamps.py'),
    ('[:1].upper() +', 'par4_sim/report/words.py'),
    ('soft_wrap', 'par4_sim/report/terminal.py'),
    ("'--repair'", 'par4_sim/choices.py'),
    ('par4_record {', 'par4_sim/choices.py')])
def test_what_many_need_has_one_home(text, home):
    assert [str(inner(path)) for path in SOURCES
            if text in path.read_text(encoding='utf-8')] == [home]


def test_executables_of_the_contract_are_installed():
    for package, executable, _ in interface.EXECUTABLES:
        setup = (ROOT / 'src' / package / 'setup.py').read_text(encoding='utf-8')
        assert f"'{executable} = " in setup, executable


def test_interface_document_is_the_table():
    written = (ROOT / 'docs' / 'interface.md').read_text(encoding='utf-8')
    assert written == interface.markdown(), 'run make docs'


def test_effects_document_is_the_catalogue():
    written = (ROOT / 'docs' / 'effects.md').read_text(encoding='utf-8')
    assert written == catalogue.markdown(), 'run make docs'


def test_robot_file_document_is_the_schema():
    for schema, words in ((robot_file.Robot, robot_file.ROBOT_KEYS),
                          (robot_file.Axis, robot_file.AXIS_KEYS)):
        assert [key for key, _ in robot_file.leaves(schema)] == list(words)
    written = (ROOT / 'docs' / 'robot_file.md').read_text(encoding='utf-8')
    assert written == robot_file.markdown(), 'run make docs'


def test_model_file_document_is_the_schema():
    fields = ModelFile.model_fields
    assert [field.alias or name for name, field in fields.items()] == list(model_keys.KEYS)
    assert list(TERMS) == list(model_keys.WORDS)
    written = (ROOT / 'docs' / 'model_file.md').read_text(encoding='utf-8')
    assert written == model_keys.markdown(), 'run make docs'


def test_motion_file_document_is_that_of_the_functions():
    written = (ROOT / 'docs' / 'motion_file.md').read_text(encoding='utf-8')
    assert written == motion_recipes.markdown(), 'run make docs'
    for kind, function in RECIPES.items():
        told = [name for names in motion_recipes.meanings(function) for name in names]
        assert sorted(told) == sorted(inspect.signature(function).parameters), kind


def test_every_dependency_is_pinned_and_explained():
    lines = [line for name in ('requirements.txt', 'requirements-site.txt')
             for line in (ROOT / name).read_text(encoding='utf-8').splitlines()]
    pins = [line for line in lines if line and not line.startswith('#')]
    explained = (ROOT / 'docs' / 'dependencies.md').read_text(encoding='utf-8')
    for pin in pins:
        assert '==' in pin
        assert f'| `{pin.split("==")[0].split("[")[0]}` |' in explained, pin


ROSDEP = {'matplotlib': 'python3-matplotlib', 'pybullet': 'python3-pybullet-pip',
          'rosbags': 'python3-rosbags-pip', 'toppra': 'python3-toppra-pip',
          **{name: f'python3-{name}' for name in (
              'click', 'jinja2', 'numba', 'numpy', 'pydantic', 'rich', 'scipy')},
          'ruamel': 'python3-ruamel.yaml'}
"""Library -> key of rosdep, as of rosdistro in 2026."""
KEYLESS = {'backports': 'backports.zstd', 'daqp': 'daqp', 'dask': 'dask',
           'distributed': 'distributed', 'lazy_loader': 'lazy-loader', 'lz4': 'lz4',
           'markupsafe': 'markupsafe', 'ruckig': 'ruckig', 'threadpoolctl': 'threadpoolctl'}
"""Library -> name of its distribution, for which rosdep has no key."""


@pytest.mark.parametrize('package', CHAIN)
def test_the_manifest_declares_every_library(package):
    folder = ROOT / 'src' / package
    manifest = ElementTree.parse(folder / 'package.xml').getroot()
    declared = {item.text for item in manifest if item.tag.endswith('depend')}
    written = (folder / 'package.xml').read_text(encoding='utf-8')
    setup = (folder / 'setup.py').read_text(encoding='utf-8')
    used = {name.split('.')[0] for path in [*folder.rglob('*.py')] if path.name != 'setup.py'
            for name in imported(path)} - set(sys.stdlib_module_names) - {
                package, 'llvmlite'}  # which numba is made on
    if 'par4_start' in used:  # which stands beside the first package
        used = used - {'par4_start'} | {CHAIN[0]} - {package}
    for library in used:
        if library in (*CHAIN, *MESSAGES, 'control_msgs', 'launch', 'launch_ros'):
            assert library in declared, library
        elif library in ROSDEP:
            assert ROSDEP[library] in declared, library
        else:
            name = KEYLESS[library]
            assert name in written, f'{name}: name it beside the libraries without key'
        if library in KEYLESS or library in ROSDEP:
            assert f"'{KEYLESS.get(library, library)}" in setup, library
    assert manifest.find('export/build_type').text == 'ament_python'


def test_all_packages_name_the_publisher_and_a_setup_file_repeats_nothing():
    """`make docs` writes what `publisher.toml` says."""
    with_publisher = runpy.run_path(str(ROOT / 'site' / 'manifests.py'))['with_publisher']
    told = tomllib.loads((ROOT / 'publisher.toml').read_text(encoding='utf-8'))
    for package in CHAIN:
        folder = ROOT / 'src' / package
        written = (folder / 'package.xml').read_text(encoding='utf-8')
        assert with_publisher(written) == written, 'run make docs'
        manifest = ElementTree.fromstring(written)
        assert manifest.find('maintainer').get('email') == told['email']
        assert manifest.find('maintainer').text == told['maintainer']
        assert (manifest.findtext('url') or '') == told['url']
        setup = (folder / 'setup.py').read_text(encoding='utf-8')
        assert told['maintainer'] not in setup
        assert 'url=manifest' in setup
    with_url = with_publisher(written).replace('</license>\n', '</license>\n  <url>old</url>\n')
    assert with_publisher(with_url) == written
    with pytest.raises(ValueError, match='one behind the other'):
        with_publisher('<package/>')
    if told['email'].endswith('.example'):
        contributing = (ROOT / 'CONTRIBUTING.md').read_text(encoding='utf-8')
        assert 'publisher.toml' in contributing, 'say that nobody is reached by it'
