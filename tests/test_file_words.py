"""What a YAML file that cannot be used is told: its own keys and lines, in this project's words."""

from __future__ import annotations

import json
import re
from copy import deepcopy

import pytest

from par4_dynamics.model_from_file import read_model
from par4_kinematics.errors import Par4Error
from par4_kinematics.files import write_yaml
from par4_kinematics.motion_file import MOTION_SCHEMA, read_motion
from par4_kinematics.robot import read_machine
from robots import REFERENCE

ROBOT = json.loads(REFERENCE.model_dump_json(by_alias=True, exclude_none=True))
MODEL = {
    'schema': 'par4/model/1', 'rigid_body': 'paper', 'torque_limit': 150.0,
    'parameters': {'actuator_inertia': {'value': 0.113, 'std': 0.001, 'unit': 'kg m2'}},
    'effects': [{'effect': 'torque_offset', 'joints': [0, 1], 'parameters': {
        'offset': {'value': 0.1, 'unit': 'N m'}}}]}
MOTION = {'schema': MOTION_SCHEMA, 'recipe': {
    'kind': 'waypoints', 'poses': [[0.0, 0.0, -0.7, 0.0], [0.1, 0.0, -0.7, 0.0]], 'speed': 1.0,
    'acceleration': 10.0}}
READ = {'robot.yaml': read_machine, 'model.yaml': lambda path: read_model(path, REFERENCE),
        'motion.yaml': lambda path: read_motion(path, REFERENCE)}
FOREIGN = re.compile(r'\b((?i:input|field|required|valid|instance|dict|dictionary|tuple|int|str|'
                     r'string|integer|sequence|\w*error|pars\w+|pydantic|ruamel|stream|token|'
                     r'scalar|node)|None|NoneType)\b')
"""Words of the libraries that read YAML and of Python."""


def refused(folder, name, content):
    (folder / name).unlink(missing_ok=True)
    if isinstance(content, str):
        (folder / name).write_text(content)
    else:
        write_yaml(folder / name, content)
    with pytest.raises(Par4Error) as error:
        READ[name](folder / name)
    line = str(error.value)
    assert line.startswith(str(folder / name))
    return line.removeprefix(str(folder / name)).removeprefix(': ')


def changed(content, place, value):
    """Return nested content with the value at keys and indices `place` replaced."""
    content = below = deepcopy(content)
    for key in place[:-1]:
        below = below[key]
    below[place[-1]] = value
    return content


@pytest.mark.parametrize(('place', 'value', 'words'), [
    (('geometry', 'arm_length'), '0.375 m',
     "geometry.arm_length: expected a number without quotes or unit (found '0.375 m')"),
    (('geometry', 'arm_length'), None,
     'geometry.arm_length: expected a number without quotes or unit (found nothing)'),
    (('geometry', 'arm_length'), {'a': 1},
     "geometry.arm_length: expected a number without quotes or unit (found {'a': 1})"),
    (('geometry', 'arm_length'), -0.375,
     'geometry.arm_length: expected more than 0 (found -0.375)'),
    (('drives', 'gain'), [12.7, 12.7], 'drives.gain: expected 4 values (found [12.7, 12.7])'),
    (('drives', 'gain'), [12.7] * 5,
     'drives.gain: expected 4 values (found [12.7, 12.7, 12.7, 12.7, 12.7])'),
    (('drives', 'gain'), 12.7, 'drives.gain: expected a list (found 12.7)'),
    (('drives', 'encoder_counts'), 1.5, 'drives.encoder_counts: expected a whole number (found '),
    (('name',), 5, 'name: expected text in quotes (found 5)'),
    (('geometry',), 5, 'geometry: expected keys with values (found 5)'),
    (('bodies', 'rod_mas'), 0.04, 'bodies.rod_mas: no such key, did you mean rod_mass? (found '),
    (('bodies', 'x'), 0.04, 'bodies.x: no such key; known are rod_mass, bar_mass, theta_inertia, '
                            'tool_mass (found 0.04)')])
def test_a_key_is_told_what_is_expected_and_what_was_found(tmp_path, place, value, words):
    line = refused(tmp_path, 'robot.yaml', changed(ROBOT, place, value))
    assert line.startswith(words)
    assert line.endswith('; see docs/robot_file.md')


def test_keys_of_entries_of_lists_and_mappings_are_known(tmp_path):
    line = refused(tmp_path, 'model.yaml', changed(MODEL, ('effects', 0, 'joint'), 1))
    assert line.startswith('effects.0.joint: no such key, did you mean joints? (found 1)')
    line = refused(tmp_path, 'model.yaml',
                   changed(MODEL, ('parameters', 'actuator_inertia', 'valu'), 1))
    assert 'parameters.actuator_inertia.valu: no such key, did you mean value?' in line


@pytest.mark.parametrize(('text', 'words'), [
    ('a: *x', 'not YAML in line 1: *x stands for nothing; put text that begins with * in quotes '
              "(found 'a: *x')"),
    ('a: 1\nb: [1, 2\n', 'not YAML in line 2: a bracket is not closed by ]; close it (found '),
    ('a: [1, 2\nb: 3\n', 'not YAML in line 2: a comma or ] is missing before this; add it (found '),
    ('a: {\n', 'not YAML in line 1: a bracket is not closed'),
    ('a: b: c', 'not YAML in line 1: a colon where no key can be; check the indentation'),
    ('a:\n  b: 1\n c: 2\n', 'not YAML in line 3: this does not continue what is above'),
    ('a:\n\tb: 1\n', 'not YAML in line 2: a tab; indent with spaces'),
    ('a: 1\na: 2\n', 'not YAML in line 2: the key a is there twice; keep one of them'),
    ('a: 1\nb: "x\n', 'not YAML in line 2: a quote is not closed; close it'),
    ('a: @x', 'not YAML in line 1: no value can begin with @; put the text in quotes'),
    ('a: !!python/object 1', 'not YAML in line 1: the tag !!python/object is not known; leave it'),
    ('a: 1\n---\nb: 2\n', 'not YAML in line 2: a second document begins; keep one in a file'),
    ('a: 1\nb: \x07\n', 'not YAML in line 2: a character that is no text; remove it'),
    ('a: 2024-13-45', 'a date or a value with a tag (!!) in it is not understood; mend it'),
    ('', 'expected a mapping with `schema: par4/robot/1`, found nothing'),
    ('schema: ]', 'not YAML in line 1: a value is missing before this; give it')])
def test_what_is_not_yaml_is_told_by_its_line(tmp_path, text, words):
    assert refused(tmp_path, 'robot.yaml', text).startswith(words)


@pytest.mark.parametrize('mark', ['*', '&', '!', '%', '@', '`', '|', '>', '"', "'", '[', ']', '{',
                                  '}', ',', ':', ': ', '? ', '- ', '\t', '\x00', '<<: 3', '--- ',
                                  '!!set [', '!<tag', '|9x', '"\\q"', '*a : &a', '<<'])
def test_no_words_of_the_reader_of_yaml_are_told_wherever_it_stumbles(tmp_path, mark):
    lines = ['schema: par4/robot/1', 'name: a', 'drives: {gain: [1.0, 2.0]}']
    for number in range(len(lines)):
        for where in (0, len(lines[number]), lines[number].index(':') + 2):
            line = lines[number][:where] + mark + lines[number][where:]
            told = refused(tmp_path, 'robot.yaml', '\n'.join(
                [*lines[:number], line, *lines[number + 1:]]))
            assert not FOREIGN.search(re.sub(r'\(found .*', '', told)), told


def test_what_is_no_text_is_told_by_its_first_byte(tmp_path):
    (tmp_path / 'robot.yaml').write_bytes('name: Müller'.encode('latin-1'))
    with pytest.raises(Par4Error) as error:
        read_machine(tmp_path / 'robot.yaml')
    assert str(error.value).endswith('expected text in UTF-8, found byte 252 at 7; save it as '
                                     'UTF-8')


def places(content, above=()):
    """Yield the keys and indices of every value of nested content."""
    pairs = (content.items() if isinstance(content, dict) else
             enumerate(content) if isinstance(content, list) else ())
    for key, value in pairs:
        yield (*above, key)
        yield from places(value, (*above, key))


@pytest.mark.parametrize(('name', 'content'), [
    ('robot.yaml', ROBOT), ('model.yaml', MODEL), ('motion.yaml', MOTION)])
@pytest.mark.parametrize('value', ['"', [], {}, [[1.0]], True, -1e300, float('nan'), None],
                         ids=repr)
def test_no_words_of_libraries_are_told_whatever_stands_in_the_place_of_a_value(
        tmp_path, name, content, value):
    told = 0
    for place in places(content):
        try:
            line = refused(tmp_path, name, changed(content, place, value))
        except pytest.fail.Exception:  # the value is fine there
            continue
        told += 1
        assert not FOREIGN.search(line), line
    assert told > 3
