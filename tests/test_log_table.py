"""Columns out of the files that loggers write, in the forms in which they write them."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.io import savemat

from par4_identification.logs.log_table import read_columns
from par4_kinematics.errors import InputError

T = np.array((0.0, 0.1, 0.2, 0.3))
Q = np.array((1.5, -2.25, 3e-3, 4.0))
TAU = np.array((-7.0, 8.0, 9.5, 0.25))
ROWS = list(zip(T, Q, TAU))
SHORT = [[f'{number:g}' for number in row] for row in ROWS]


def text(mark, rows=ROWS):
    return '\n'.join(mark.join(map(str, row)) for row in rows) + '\n'


CSV = {
    'commas': 't,joint angle,tau\n' + text(','),
    'spaces': 't joint_angle tau\n' + text('  '),
    'tabs': 't\tjoint angle\ttau\n' + text('\t'),
    'semicolons': 't;joint angle;tau\r\n' + text('; ').replace('\n', '\r\n'),
    'decimal commas': 't;joint angle;tau\n' + text(';').replace('.', ','),
    'quoted decimal commas between commas': 't,joint angle,tau\n' + '\n'.join(
        ','.join(f'"{cell}"' if ',' in cell else cell for cell in line.split(';'))
        for line in text(';').replace('.', ',').splitlines()) + '\n',
    'spaces and decimal commas': 't joint_angle tau\n' + text('  ').replace('.', ','),
    'spaces, decimal commas and whole numbers': 't joint_angle tau\n' + text(
        ' ', SHORT).replace('.', ','),
    'spaces, decimal commas and words': 'mode t joint_angle tau\n' + text(' ', [
        ('auto', *row) for row in ROWS]).replace('.', ','),
    'commas and spaces': 't,joint angle,tau\n' + text(', '),
    'spaces before commas': 't ,joint angle ,tau\n' + text(' ,', SHORT),
    'as numpy writes it': '# t,joint angle,tau\n' + text(','),
    'comments': '% logger 3.1\n# made on Monday, at noon\n\n"t","joint angle","tau"\n' + text(','),
    'a byte order mark': '\ufefft,joint angle,tau\n' + text(','),
    'words in a column': 'mode,t,joint angle,tau\n' + text(',', [
        ('auto', *row) for row in ROWS]),
    'a row of units': 't,joint angle,tau\ns,rad,N m\n' + text(','),
    'a row of empty units': 't,joint angle,tau\n[s],,\n' + text(','),
    'a comma behind each row of data': 't,joint angle,tau\n' + text(',').replace('\n', ',\n'),
    'a comma behind the header': 't,joint angle,tau,\n' + text(','),
    'commas behind a title': 'rate,1000,\n,,\nt,joint angle,tau\n' + text(','),
    'settings of a logger': 'Recorder 3000\nOperator Jane Doe\nChannels 3\n\n'
                            't,joint angle,tau\n' + text(','),
    'bare numbers above': '500\n3\n1 2 3\nt;joint angle;tau\n' + text(';'),
    'two settings alike': 'Rate 500\nGain 2\nt\tjoint angle\ttau\n' + text('\t'),
    'a header with a number': 't,joint angle,tau,7\n' + text(',', [(*row, 1) for row in ROWS]),
    'comments between': 't,joint angle,tau\n' + text(',').replace('\n', '\n# tick\n', 1),
}


@pytest.mark.parametrize('form', CSV)
def test_a_csv_in_any_usual_form(form, tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text(CSV[form], encoding='utf-8', newline='')
    name = 'joint_angle' if 'joint_angle' in CSV[form] else 'joint angle'
    found = read_columns(path, ('tau', 't', name))
    for column, expected in zip(('tau', 't', name), (TAU, T, Q), strict=True):
        np.testing.assert_array_equal(found[column], expected)
    shift = CSV[form].startswith('mode')
    np.testing.assert_array_equal(read_columns(path, (str(2 + shift),))[str(2 + shift)], Q)


def test_a_csv_without_header_is_read_by_numbers_and_empty_cells_are_unknown(tmp_path):
    path = tmp_path / 'log.txt'
    path.write_text('0.0,1.0\n0.1,\n0.2,nan\n0.3,4.0', encoding='utf-8')
    np.testing.assert_array_equal(read_columns(path, ('2',))['2'], (1.0, np.nan, np.nan, 4.0))
    with pytest.raises(InputError, match="no column 'q'; there are 2 without names, counted from"):
        read_columns(path, ('q',))


@pytest.mark.parametrize('missing', ['#N/A', '#n/a', ' #N/A', '"#N/A"', 'N/A', 'nan', ''])
@pytest.mark.parametrize('place', [0, 1, 2])
def test_a_spreadsheet_s_mark_of_a_missing_value_is_no_comment(place, missing, tmp_path):
    """The line was cut there: it had "2 of 3 columns"."""
    path = tmp_path / 'log.csv'
    row = [missing if place == column else str(column) for column in range(3)]
    path.write_text(f'# t,q,tau\n{",".join(row)}\n1,2,3\n# tick, tock\n{",".join(row)}\n4,5,6\n')
    expected = [np.nan if place == column else column for column in range(3)]
    found = read_columns(path, ('t', 'q', 'tau'))
    np.testing.assert_array_equal(np.transpose(list(found.values())),
                                  (expected, (1, 2, 3), expected, (4, 5, 6)))


def test_a_comment_may_stand_behind_a_number(tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text('t,q\n1,2\n3,4 # tick, tock\n5,6\n')
    np.testing.assert_array_equal(read_columns(path, ('q',))['q'], (2.0, 4.0, 6.0))


@pytest.mark.parametrize('header', ['', 't,q,u,tau\n', 't,q,u,tau\ns,rad,V,N m\n'])
@pytest.mark.parametrize(('first', 'time'), [
    ('2,,,', 2.0), ('2,nan,NA,', 2.0), (',,,', np.nan), ('nan,nan,nan,nan', np.nan)])
@pytest.mark.parametrize('comment', ['', '# 2,3,4,5\n', '% 2,3,4,5\n'])
def test_rows_that_begin_empty_are_data(comment, header, first, time, tmp_path):
    """One of them was taken for the header, and those before it were lost."""
    path = tmp_path / 'log.csv'
    path.write_text(f'{comment}{header}{first}\n{first}\n3,1.5,4,7\n4,,,8\n', encoding='utf-8')
    times = (time, time, 3.0, 4.0)
    found = read_columns(path, ('1', '4'))
    np.testing.assert_array_equal(found['1'], times)
    np.testing.assert_array_equal(found['4'], (np.nan, np.nan, 7.0, 8.0))
    if header:
        np.testing.assert_array_equal(read_columns(path, ('t',))['t'], times)
    else:
        with pytest.raises(InputError, match='without names'):
            read_columns(path, ('t',))


@pytest.mark.parametrize('mark', ['T', ' '])
@pytest.mark.parametrize('zone', ['', 'Z', '+00:00'])
def test_dates_are_seconds_since_1970(mark, zone, tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text('t,q\n' + ''.join(
        f'2026-01-01{mark}00:00:{t:06.3f}{zone},{q}\n' for t, q in zip(T, Q)) + ',7\n')
    found = read_columns(path, ('t', 'q'), dates={'t': 'iso'})
    np.testing.assert_allclose(found['t'][:-1], 1767225600.0 + T, rtol=0.0, atol=1e-6)
    assert np.isnan(found['t'][-1])
    np.testing.assert_array_equal(found['q'], (*Q, 7.0))
    with pytest.raises(InputError, match='no number but a date or a time of day: give the time in '
                                         '--columns the unit iso, as in time=1:iso'):
        read_columns(path, ('t', 'q'))
    with pytest.raises(InputError, match=r"column q: '1.5' is no time as iso has it, such as 2026"):
        read_columns(path, ('q',), dates={'q': 'iso'})


@pytest.mark.parametrize(('unit', 'cell', 'expected'), [
    ('dmy', '01.02.2026 00:00:01.25', 1769904001.25),
    ('dmy', '1/2/2026 0:00:01,25', 1769904001.25),
    ('dmy', '01-02-2026, 12:00:01.25 AM', 1769904001.25),
    ('mdy', '02/01/2026 12:30:00 PM', 1769904000.0 + 12.5 * 3600.0),
    ('mdy', '2/1/2026 1:00:00.5 pm', 1769904000.5 + 13.0 * 3600.0),
    ('clock', '23:59:59.999', 86399.999),
    ('clock', '59:59,5', 3599.5),
    ('clock', '100:00:00', 360000.0),
])
def test_dates_and_times_of_day_are_seconds(unit, cell, expected, tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text('t;q\n' + f'{cell};1\n' * 3)
    found = read_columns(path, ('t', 'q'), dates={'t': unit})
    np.testing.assert_allclose(found['t'], expected, rtol=0.0, atol=1e-6)
    with pytest.raises(InputError, match=rf'give the time in --columns the unit [a-z ]*{unit}'):
        read_columns(path, ('t', 'q'))


@pytest.mark.parametrize(('unit', 'cell'), [
    ('dmy', '01/31/2026 00:00:01'), ('mdy', '31/01/2026 00:00:01'), ('dmy', '01.02.2026'),
    ('dmy', '01.02.2026 10:30'), ('mdy', '01/31/2026 24:00:00'),
    ('clock', '12:60:01'), ('clock', '13:00:00 PM'), ('clock', '0:00:01 AM'), ('clock', '12')])
def test_what_is_no_such_time_is_refused(unit, cell, tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text('t;q\n' + f'{cell};1\n' * 3)
    with pytest.raises(InputError, match=f'line 2, column t: .* is no time as {unit} has it, such'):
        read_columns(path, ('t', 'q'), dates={'t': unit})


def test_dates_are_of_csv_files(tmp_path):
    np.savez(tmp_path / 'log.npz', t=T, q=Q)
    with pytest.raises(InputError, match='are for CSV files; give the time as numbers'):
        read_columns(tmp_path / 'log.npz', ('t', 'q'), dates={'t': 'iso'})


def test_the_line_at_which_a_table_seems_to_begin_is_told(tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text('a 1\nb 2\n' * 20 + 't,q,u\n' + text(','))
    with pytest.raises(InputError, match='in the table that begins at line 1; if it begins'):
        read_columns(path, ('t',))


@pytest.mark.parametrize(('rows', 'numbers'), [
    ('0;1\n1;2,5\n', (1.0, 2.5)), ('0;1\n1;2.5\n', (1.0, 2.5)), ('0;1\n1;2\n', (1.0, 2.0)),
    ('a,b;1\nc.d;2,5\n', (1.0, 2.5)), ('0\t1\n1\t,5e1\n', (1.0, 5.0))])
def test_a_decimal_comma_may_come_late(rows, numbers, tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text(rows, encoding='utf-8')
    np.testing.assert_array_equal(read_columns(path, ('2',))['2'], numbers)


@pytest.mark.parametrize('separator', [', ', ',', ' ', '\t'])
def test_a_semicolon_may_end_the_rows_of_a_matrix(separator, tmp_path):
    """It was taken for what parts the cells, and no line held numbers."""
    path = tmp_path / 'log.csv'
    path.write_text('% from a motor\n' + ''.join(
        separator.join(map(repr, row)) + ';\n' for row in zip(T.tolist(), Q.tolist())),
        encoding='utf-8')
    np.testing.assert_array_equal(read_columns(path, ('2',))['2'], Q)


def test_commas_among_points_are_no_decimal_commas(tmp_path):
    """They part thousands."""
    path = tmp_path / 'log.csv'
    path.write_text('0.5;1,000\n1.5;2,000\n', encoding='utf-8')
    with pytest.raises(InputError, match='1,000'):
        read_columns(path, ('2',))


@pytest.mark.parametrize(('table', 'words'), [
    # a count of 1.234 was read as one and a bit among counts of 999
    ('0,5;999\n1,5;1.234\n', "line 2, column 2: '1.234' is no number with a decimal comma, as "
                              'others of the file have; points between thousands are not read'),
    ('t;q\n0.0 s;1.5 deg\n0.1 s;1.6 deg\n', "no line of it holds numbers, such as '0.1 s;1.6 deg'; "
                                            'give a CSV whose cells are numbers without units')])
def test_cells_that_are_no_numbers_are_told(table, words, tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text(table, encoding='utf-8')
    with pytest.raises(InputError, match=re.escape(words)):
        read_columns(path, ('2',))


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'cp1252', 'utf-16'])
def test_a_csv_has_the_encoding_in_which_programs_write_it(encoding, tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text('Zeit;Winkel [°];Moment [N·m]\n' + ''.join(
        f'{t};{q};{tau}\n'.replace('.', ',') for t, q, tau in zip(T, Q, TAU)), encoding=encoding)
    columns = read_columns(path, ('Winkel [°]', 'Moment [N·m]'))
    np.testing.assert_array_equal(columns['Winkel [°]'], Q)
    np.testing.assert_array_equal(columns['Moment [N·m]'], TAU)


@pytest.mark.parametrize('turned', [False, True])
def test_an_archive_is_read_by_its_arrays_or_by_a_table(turned, tmp_path):
    path, table = tmp_path / 'log.npz', np.stack((T, Q, TAU, T)[:3])
    np.savez(path, t=T, q=Q[:, None], gain=2.0, run=table.T if turned else table, words='none')
    np.testing.assert_array_equal(read_columns(path, ('q', 't'))['q'], Q)
    np.testing.assert_array_equal(read_columns(path, ('3',), 'run')['3'], TAU)
    alone = tmp_path / 'alone.npz'
    np.savez(alone, run=table)
    np.testing.assert_array_equal(read_columns(alone, ('2',))['2'], Q)


def test_arrays_with_several_numbers_a_sample_are_read_side_by_side(tmp_path):
    """So do most programs write the joints of a robot."""
    path = tmp_path / 'log.npz'
    np.savez(path, t=T, q=np.stack((TAU, Q), axis=1), effort=np.stack((Q, TAU)))
    columns = read_columns(path, ('t', 'q[2]', 'effort[2]'))
    np.testing.assert_array_equal(columns['t'], T)
    np.testing.assert_array_equal(columns['q[2]'], Q)
    np.testing.assert_array_equal(columns['effort[2]'], TAU)


def test_a_matlab_file_is_an_archive(tmp_path):
    path = tmp_path / 'log.mat'
    savemat(path, {'t': T, 'q': Q[:, None], 'runs': np.stack((T, Q, TAU), axis=1)})
    np.testing.assert_array_equal(read_columns(path, ('q',))['q'], Q)
    np.testing.assert_array_equal(read_columns(path, ('3',), 'runs')['3'], TAU)


def test_objects_of_matlab_are_said_to_be_unread_without_a_warning(tmp_path, capfd):
    """scipy warns of their names; the warning stood above the line of the error."""
    once, twice = tmp_path / 'once.mat', tmp_path / 'log.mat'
    savemat(once, {'log': {'t': T, 'q': Q}})
    twice.write_bytes(once.read_bytes() + once.read_bytes()[128:])  # a name that comes twice
    with pytest.raises(InputError, match=r"no array 't' with one number a sample; there are none; "
                                         r'structs, cells and objects of MATLAB, such as a time'):
        read_columns(twice, ('t',))
    assert capfd.readouterr().err == ''


def test_a_matlab_file_of_hdf5_is_said_to_be_one(tmp_path):
    path = tmp_path / 'log.mat'
    path.write_bytes(b'MATLAB 7.3 MAT-file'.ljust(124) + b'\x00\x02IM' + bytes(400))
    with pytest.raises(InputError, match=r"a MATLAB 7.3 file, which is not read; in MATLAB load it "
                                         r"and save it with save\('log.mat', '-v7'\)"):
        read_columns(path, ('t',))


@pytest.mark.parametrize('delimiter', [' ', ';'])
def test_a_table_that_lies_on_its_side_is_turned(delimiter, tmp_path):
    """As numpy.savetxt leaves an array with a row a quantity; it was read as three samples."""
    path, t = tmp_path / 'log.txt', 0.01 * np.arange(500)
    np.savetxt(path, np.stack((t, np.sin(t), np.cos(t))), delimiter=delimiter)
    columns = read_columns(path, ('3', '1'))
    np.testing.assert_array_equal(columns['3'], np.cos(t))
    np.testing.assert_array_equal(columns['1'], t)
    with pytest.raises(InputError, match="no column '4'; there are 3 without names, counted from 1"
                                         ', as they stand in rows'):
        read_columns(path, ('4',))
    path.write_text(path.read_text(encoding='utf-8').rsplit(delimiter, 1)[0], encoding='utf-8')
    with pytest.raises(InputError, match='there are 499 .* in the table that begins at line 3'):
        read_columns(path, ('500',))


def files(folder):
    """Return a folder with files that cannot be read as asked."""
    (folder / 'log.csv').write_text(CSV['commas'], encoding='utf-8')
    (folder / 'twice.csv').write_text('q,q\n1,2\n', encoding='utf-8')
    (folder / 'words.csv').write_text('t,q\n1,2\n2,high\n', encoding='utf-8')
    (folder / 'short.csv').write_text('t,q\n1,2\n\n# gap\n2\n', encoding='utf-8')
    (folder / 'prose.csv').write_text('nothing to see here\n', encoding='utf-8')
    (folder / 'bytes.csv').write_bytes(b'\x89PNG\r\n\x1a\n\x00\x00' * 9)
    (folder / 'marked.csv').write_bytes(b'\xff\xfe\x00\x01' * 9)
    (folder / 'fake.npz').write_text('t,q\n1,2\n', encoding='utf-8')
    (folder / 'fake.mat').write_text('t,q\n1,2\n', encoding='utf-8')
    np.savez(folder / 'log.npz', t=T, q=Q[:2], one=np.eye(4), two=np.eye(4))
    np.savez(folder / 'objects.npz', t=np.array([{}], dtype=object))


@pytest.mark.parametrize(('name', 'wanted', 'array', 'words'), [
    ('none.csv', ('1',), None, 'no such file'),
    ('log.csv', ('q',), None, "no column 'q'; there are 3: t, joint angle, tau"),
    ('log.csv', ('0',), None, "no column '0'"),
    ('log.csv', ('4',), None, "no column '4'"),
    ('log.csv', ('1',), 'run', '--array run is for .npz and .mat files'),
    ('twice.csv', ('q',), None, "2 columns are named 'q'; give the number of one, 1 or 2"),
    ('words.csv', ('q',), None, "words.csv: line 3, column q: 'high' is no number; mend the file"),
    ('words.csv', ('2', 't'), None, "line 3, column 2: 'high' is no number"),
    ('short.csv', ('q',), None, 'short.csv: line 5 has 1 of 2 columns; mend the file'),
    ('prose.csv', ('q',), None, 'no line of it holds numbers'),
    ('bytes.csv', ('q',), None, 'cannot be read as text .it holds bytes that are no text.; give'),
    ('.', ('q',), None, 'is a folder; give a CSV'),
    ('marked.csv', ('q',), None, 'no line of it holds numbers'),
    ('fake.npz', ('q',), None, 'cannot be read'),
    ('fake.mat', ('q',), None, 'cannot be read'),
    ('objects.npz', ('t',), None, 'cannot be read'),
    ('log.npz', ('t', 'q'), None, 'differ in length: t 4, q 2'),
    ('log.npz', ('speed',), None, "no array 'speed'.*there are t, q; of those with several "
                                   r'.one, two. give one, such as one\[1\]'),
    ('log.npz', ('one[5]',), None, "no column '5'; there are 4 without names"),
    ('log.npz', ('t[1]',), None, r"no array 't\[1\]' with one number a sample"),
    ('log.npz', ('1',), 'three', "no table 'three'; there are one, two"),
    ('log.npz', ('5',), 'one', "no column '5'; there are 4 without names"),
])
def test_what_cannot_be_read_is_refused_in_one_line(name, wanted, array, words, tmp_path):
    files(tmp_path)
    with pytest.raises(InputError, match=words) as caught:
        read_columns(tmp_path / name, wanted, array)
    assert '\n' not in str(caught.value)
    assert name in str(caught.value)


@pytest.mark.parametrize('lines', [
    'param{0},{0},{0}.5\n', '{0},{0},{0}\nmode {0},auto,A\n', 'Kp,{0},V/rad\n'])
def test_thirty_lines_above_a_table_that_have_its_number_of_cells_are_not_it(lines, tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text(''.join(lines.format(number) for number in range(30))
                    + 't,joint angle,tau\ns,rad,N m\n' + 30 * text(','))
    found = read_columns(path, ('joint angle', 't'))
    np.testing.assert_array_equal(found['joint angle'], np.tile(Q, 30))
    np.testing.assert_array_equal(found['t'], np.tile(T, 30))


def test_settings_alike_are_not_the_table_that_is_given_by_numbers(tmp_path):
    path = tmp_path / 'log.csv'
    path.write_text(''.join(f'param{number},{number},2\n' for number in range(30)) + 30 * text(','))
    np.testing.assert_array_equal(read_columns(path, ('2', '1'))['2'], np.tile(Q, 30))
