"""The doors of the packages: what they name exists, and the page about them runs."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / 'docs' / 'api.md'
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
    parameter, verdict, causes = capsys.readouterr().out.splitlines()
    value, std = map(float, parameter.split())
    assert abs(value - scope['machine'].values['coulomb_friction'][0]) < 5.0 * std + 0.02
    assert verdict == 'clean'
    assert causes == "[('brake_drag', (1,))]"
