"""Build the site of the documentation: `make site` writes build/site, and a dead link is an error.

The pages of `docs/` are taken as they are. To them come the pages of the repository's root, a page
for each effect with its picture, and a page for what each package names as public.
"""

from __future__ import annotations

import importlib
import inspect
import re
import shutil
import sys
from pathlib import Path

from sphinx.cmd.build import build_main

from effect_pages import page, picture, searched
from par4_dynamics import CATALOGUE

HERE = Path(__file__).parent
ROOT = HERE.parent
STAGE, SITE = ROOT / 'build' / 'site_source', ROOT / 'build' / 'site'
PACKAGES = ('par4_kinematics', 'par4_dynamics', 'par4_sim', 'par4_identification')
OF_ROOT = {'README.md': 'index.md', 'CONTRIBUTING.md': 'CONTRIBUTING.md',
           'CHANGELOG.md': 'CHANGELOG.md'}
LINKED = ('examples/axes/README.md', 'examples/driver/driver.py', 'examples/emps/README.md',
          'src/par4_sim/rviz/par4.rviz', 'LICENSE')
"""Files that pages link to; the site has them as text."""
SECTIONS = {
    'Tutorials': ('first_ten_minutes', 'one_axis', 'your_own_robot', 'fault_step_by_step',
                  'effect_of_your_own', 'cluster'),
    'Guides': ('identification', 'diagnosis', 'changes', 'trend', 'setup', 'measured', 'tracking',
               'hardware', 'workstation'),
    'Reference': ('glossary', 'effects', 'api', 'model', 'interface', 'result_files', 'robot_file',
                  'model_file', 'motion_file', *(f'reference/{package}' for package in PACKAGES)),
    'Development': ('architecture', 'CONTRIBUTING', 'dependencies', 'benchmarks', 'blind_study',
                    'ablation', 'setup_study', 'CHANGELOG'),
}


def stage() -> None:
    """Write the source of the site."""
    shutil.rmtree(STAGE, ignore_errors=True)
    shutil.copytree(ROOT / 'docs', STAGE)
    for source, target in OF_ROOT.items():
        shutil.copy(ROOT / source, STAGE / target)
    for source in LINKED:
        target = STAGE / 'sources' / f'{Path(source).name}.txt'
        target.parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / source, target)
    for folder in ('effects', 'reference'):
        (STAGE / folder).mkdir()
    for name, effect in CATALOGUE.items():
        (STAGE / 'effects' / f'{name}.md').write_text(page(effect), encoding='utf-8')
    for name, effect in searched().items():
        (STAGE / 'effects' / f'{name}.svg').write_bytes(picture(effect))
    for package in PACKAGES:
        (STAGE / 'reference' / f'{package}.md').write_text(reference(package), encoding='utf-8')
    for path in STAGE.rglob('*.md'):
        path.write_text(of_site(path.read_text(encoding='utf-8'), path.relative_to(STAGE)),
                        encoding='utf-8')


def of_site(text: str, place: Path) -> str:
    """Return a page with links as they are on the site, and with the contents behind it."""
    for source in LINKED:
        text = re.sub(rf'\]\((?:\.\./)?{re.escape(source)}\)',
                      f'](sources/{Path(source).name}.txt)', text)
    if str(place) in OF_ROOT.values():
        text = re.sub(r'\]\(docs/([^)]*)\)', r'](\1)', text)
    if str(place) == 'index.md':
        text += ''.join(_contents(title, pages) for title, pages in SECTIONS.items())
    if str(place) == 'effects.md':
        text = re.sub(r'^\| `(\w+)` \|', r'| [`\1`](effects/\1.md) |', text, flags=re.MULTILINE)
        text += _contents('', [f'effects/{name}' for name in CATALOGUE])
    return re.sub(r'\]\(\.\./(CONTRIBUTING|CHANGELOG)\.md\)', r'](\1.md)', text)


def _contents(title: str, pages: list[str] | tuple[str, ...]) -> str:
    caption = f':caption: {title}\n' if title else ''
    return f'\n```{{toctree}}\n:hidden:\n{caption}\n' + '\n'.join(pages) + '\n```\n'


def reference(package: str) -> str:
    """Return the page of what a package names as public."""
    door = importlib.import_module(package)
    first, _, _ = (door.__doc__ or '').partition('\n')
    lines = [f'# {package}', '', f'{first} Public is what `{package}` names in its `__init__`.', '']
    for name in sorted(door.__all__):
        item = getattr(door, name)
        lines += [f'## {name}', '']
        if inspect.isclass(item) or inspect.isfunction(item):
            kind = 'class' if inspect.isclass(item) else 'function'
            options = '\n   :members:' if kind == 'class' else ''
            lines += ['```{eval-rst}',
                      f'.. auto{kind}:: {item.__module__}.{item.__qualname__}{options}', '```', '']
        else:
            lines += [f'A value: {len(item)} effects by name.' if isinstance(item, dict)
                      else f'`{item!r}`', '']
    return '\n'.join(lines)


if __name__ == '__main__':
    stage()
    sys.exit(build_main(['-q', '-W', '--keep-going', '-b', 'html', '-c', str(HERE), str(STAGE),
                         str(SITE)]))
