"""The doors of the packages: what they name exists, and the page about them runs."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from axes import Motor, axis, recorded, there_and_back

from par4_identification import diagnose, identify
from par4_identification.diagnosis.diagnosis import CONDITIONING
from par4_identification.signals.scales import conditioning_for
from par4_kinematics.errors import InputError

ROOT = Path(__file__).parents[1]
PAGE = ROOT / 'docs' / 'api.md'
PACKAGES = ('par4_kinematics', 'par4_dynamics', 'par4_sim', 'par4_identification')


@pytest.mark.parametrize('package', PACKAGES)
def test_what_a_package_names_is_there_and_documented(package):
    door = importlib.import_module(package)
    assert door.__all__
    for name in door.__all__:
        item = getattr(door, name)
        assert item.__doc__
    assert door.__doc__.count('>>>') >= 2


@pytest.mark.parametrize('package', PACKAGES)
def test_the_page_lists_what_a_package_names(package):
    rows = re.findall(rf'^\| `{package}` \| (.*) \|$', PAGE.read_text(), re.MULTILINE)
    listed = [name for row in rows for name in re.findall(r'`(\w+)`', row)]
    assert sorted(listed) == sorted(importlib.import_module(package).__all__)


@pytest.mark.parametrize('path', sorted(path.relative_to(ROOT) for folder in (
    'examples', 'demo', 'site') for path in ROOT.glob(f'{folder}/**/*.py')), ids=str)
def test_what_a_package_names_is_taken_from_it(path):
    """Examples are copied: what is named may not be taken from where it happens to stand."""
    for item in ast.walk(ast.parse((ROOT / path).read_text(encoding='utf-8'))):
        if isinstance(item, ast.ImportFrom) and item.module.startswith('par4_'):
            package, _, inside = item.module.partition('.')
            door = importlib.import_module(package).__all__
            assert not inside or not {name.name for name in item.names} & set(door), item.module


@pytest.mark.parametrize('package', PACKAGES)
def test_a_door_is_quick(package):
    """Nothing is loaded before it is used."""
    told = subprocess.run(
        [sys.executable, '-c', f'import sys, {package}; print("numpy" in sys.modules)'],
        capture_output=True, text=True, check=True)
    assert told.stdout.split() == ['False']


@pytest.mark.parametrize('page', sorted(PAGE.parent.glob('*.md')), ids=lambda page: page.stem)
def test_pages_show_only_what_is_public(page):
    """A reader may copy them: what no package names may move."""
    shown = '\n'.join(re.findall(r'```python\n(.*?)```', page.read_text(), re.DOTALL))
    assert not re.findall(r'^(?:from|import) par4_\w+\.[\w.]+', shown, re.MULTILINE)


def test_the_page_runs_and_names_the_effect_of_its_own(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scope = {}
    for code in re.findall(r'```python\n(.*?)```', PAGE.read_text(), re.DOTALL):
        exec(compile(code, str(PAGE), 'exec'), scope)
    parameter, verdict, causes, estimates, followed = capsys.readouterr().out.splitlines()
    value, std = map(float, parameter.split())
    assert abs(value - scope['machine'].values['coulomb_friction'][0]) < 5.0 * std + 0.02
    assert verdict == 'clean'
    assert causes == "[('brake_drag', (1,))]"
    told = dict(item.split() for item in ast.literal_eval(estimates))
    assert told.keys() == scope['machine'].values.keys()
    for name, value in scope['machine'].values.items():
        assert float(told[name]) == pytest.approx(value[0], abs=0.05)
    assert followed == 'True'


@pytest.fixture(scope='module')
def log():
    """Return the log of a motor that turns there and back."""
    return recorded(Motor(4.7e-6, 0.002, 1e-5), there_and_back, 24.0, 500.0)


@pytest.mark.parametrize('work', [identify, diagnose])
def test_logs_of_which_nothing_can_be_told_are_refused_in_a_line(work, log):
    torn = log.tau.copy()
    torn[7] = np.nan
    for logs, words in (([], 'no log is given'), ([log, log], 'two logs have this name'),
                        ([replace(log, tau=torn)], '1 of 12000 torques are no numbers'),
                        ([replace(log, q=torn)], '1 of 12000 positions are no numbers'),
                        ([replace(log, tau=0.0 * log.tau)], 'joint 0 never changes')):
        with pytest.raises(InputError, match=words):
            work(logs, axis())


def test_the_last_of_several_logs_is_held_out(log):
    """Whatever its name."""
    found = diagnose([replace(log, name='a'), replace(log, name='b')], axis())
    assert {run.name for run in found.fit_runs} == {'a'}
    assert {run.name for run in found.holdout.runs} == {'b'}


def test_an_axis_is_diagnosed_by_filters_that_suit_its_logs(log):
    suited = conditioning_for([log], axis(), CONDITIONING)
    assert suited != CONDITIONING
    assert {run.conditioning for run in diagnose([log], axis(), library={}).fit_runs} == {suited}
