"""The commit that docs/effect_of_your_own.md shows puts an effect into the catalogue."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / 'docs' / 'effect_of_your_own.md'
TESTS = {'test_joint_effects.py', 'test_machine_effects.py', 'test_hiders.py', 'test_hidden.py',
         'test_pages.py'}
TOUCHED = ('brake_drag or has_an_example or has_a_guide or has_a_hider or every_hider '
           'or all_effects_at_once or same_list_of_distinct_tasks')


def make_changes(root: Path) -> None:
    """Change files below a folder as the page shows."""
    shown = re.findall(r'^```diff\n(.*?)^```$', PAGE.read_text(encoding='utf-8'),
                       re.DOTALL | re.MULTILINE)
    for change in re.split(r'^--- ', ''.join(shown), flags=re.MULTILINE)[1:]:
        (old, new), *hunks = (part.splitlines() for part in re.split(r'^@@\n', change, flags=re.M))
        path = root / new.removeprefix('+++ b/')
        assert path.exists() == (old != '/dev/null'), path
        text = '\n' + (path.read_text(encoding='utf-8') if path.exists() else '')
        for hunk in hunks:
            assert {line[:1] for line in hunk} <= set(' +-')
            before, after = ('\n' + ''.join(f'{line[1:]}\n' for line in hunk if line[0] != other)
                             for other in '+-')
            assert text.count(before) == 1, f'{path.name} has other lines now than{before}'
            text = text.replace(before, after)
        path.write_text(text[1:], encoding='utf-8')


def test_the_commit_of_the_page_passes_the_tests_that_it_touches(tmp_path):
    for name in ('src', 'tests', 'docs', 'site', 'pyproject.toml'):
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
        copy(ROOT / name, tmp_path / name)
    make_changes(tmp_path)
    places = os.pathsep.join(map(str, sorted((tmp_path / 'src').glob('par4_*'))))
    told = subprocess.run(
        [sys.executable, '-m', 'pytest', '-n0', '-q', '-p', 'no:cacheprovider', '-k', TOUCHED,
         *(f'tests/{name}' for name in sorted(TESTS))],
        cwd=tmp_path, env={**os.environ, 'PYTHONPATH': places}, capture_output=True, text=True,
        check=False)
    assert told.returncode == 0, told.stdout + told.stderr
