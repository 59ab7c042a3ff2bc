"""Paths that lead nowhere: links in a loop, devices; and numbers at the end of what there is."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from test_commands import run

from par4_identification.commands import diagnose, identify, repair, trend, validate
from par4_identification.excitation.path_optimisation import criterion
from par4_identification.jobs.identify import payload_masses
from par4_identification.jobs.repair import beside
from par4_kinematics.adept import adept_motion
from par4_kinematics.errors import InputError
from par4_kinematics.files import write_text
from par4_sim.cell.cell import COMPOSITIONS
from par4_sim.commands import push, simulate, track
from robots import REFERENCE

NOWHERE = 'too many levels of symbolic links'


@pytest.fixture
def loop(tmp_path, monkeypatch):
    """Be in a folder in which `loop` is a link that leads to itself."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'loop').symlink_to('loop')
    yield
    assert [file.name for file in tmp_path.iterdir()] == ['loop']


READ = '--robot reference --output out'


@pytest.mark.parametrize(('command', 'words', 'said'), [
    (identify, f'loop {READ}', 'loop: no such bag'),
    (validate, f'loop --model table1 {READ}', 'loop: no such bag'),
    (diagnose, f'loop {READ}', 'loop: no such bag'),
    (diagnose, f'loop other --holdout third {READ}', 'loop: no such bag'),
    (trend, f'loop {READ}', 'loop: no such bag'),
    (identify, f'other --payload loop=1 {READ}', '--payload loop=1: expected'),
    (identify, f'other --unknown-payload loop {READ}', 'expected one of the bags given'),
    (identify, f'/dev/null {READ}', '/dev/null: not a rosbag2'),
    *((command, f'{words} --output {place}', f'{place}: {refused} ({NOWHERE}); give another')
      for place in ('loop', 'loop/new') for command, words, refused in (
          (track, 'adept', 'results cannot be written there'),
          (identify, 'other --robot reference', 'results cannot be written there'),
          (simulate, 'adept', 'cannot be written')))])
@pytest.mark.usefixtures('loop')
def test_a_path_that_leads_nowhere_is_told_in_a_line(command, words, said):
    done = run(command, *words.split())
    assert done.code == 2
    assert said in done.err
    assert done.err.startswith('error: ')
    assert done.err.count('\n') == 1


@pytest.mark.usefixtures('loop')
def test_nothing_is_written_along_a_loop():
    with pytest.raises(InputError, match=NOWHERE):
        write_text('loop/new', 'text')
    with pytest.raises(InputError, match=NOWHERE):
        COMPOSITIONS['identification'].session({'output': 'loop'})


@pytest.mark.parametrize('mass', ['1e300', '1001', 'inf', 'nan', '-1'])
def test_a_payload_that_no_robot_carries_is_refused(mass):
    with pytest.raises(InputError, match='expected BAG=KG with a mass of 0 to 1000 kg'):
        payload_masses([f'bag={mass}'], ['bag'])


def test_a_path_that_tells_nothing_has_a_poor_criterion_and_no_warning():
    """Of a singular matrix rounding makes an eigenvalue of any sign."""
    same = np.ones((3, 3)) + 1e-16 * np.diag([0.0, -1.0, 1.0])
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        poor, slope = criterion(same)
    assert poor > criterion(np.eye(3))[0] + 5.0
    assert np.isfinite(slope).all()


def test_what_tiny_limits_give_is_told_in_a_few_digits():
    with pytest.raises(InputError) as refused:
        adept_motion(REFERENCE, jerk=1e-300)
    assert 'these limits give 4.274e+100 s (corners fully blended) to' in str(refused.value)


@pytest.mark.parametrize(('bag', 'mended'), [
    ('run_0.5', 'run_0.5_repaired'), ('run_0.5/', 'run_0.5_repaired'),
    ('run_0.5/part.mcap', 'run_0.5/part_repaired'), ('.', '../here_repaired'),
    ('run_0.5/..', '../here_repaired'), ('..', '../../{}_repaired'), ('/', '/_repaired')])
def test_a_bag_is_mended_beside_itself(tmp_path, monkeypatch, bag, mended):
    """Also one whose name has a dot, or in whose folder the command is called."""
    here = tmp_path / 'here'
    (here / 'run_0.5').mkdir(parents=True)
    (here / 'run_0.5' / 'part.mcap').touch()
    monkeypatch.chdir(here)
    assert beside(Path(bag)).resolve() == Path(mended.format(tmp_path.name)).resolve()


def test_the_bag_in_which_one_stands_is_mended_without_a_traceback(tmp_path, monkeypatch):
    (tmp_path / 'bag').mkdir()
    monkeypatch.chdir(tmp_path / 'bag')
    done = run(repair, '--repair', '.')
    assert done.code == 2
    assert done.err.startswith('error: .: ')
    assert done.err.count('\n') == 1


def test_pushes_are_not_written_into_the_folder_in_which_one_stands(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(push, '--robot', 'reference', '--output', '.')
    assert done.code == 2
    assert done.err == 'error: .: exists already; give another path or remove it\n'
    assert not list(tmp_path.iterdir())
