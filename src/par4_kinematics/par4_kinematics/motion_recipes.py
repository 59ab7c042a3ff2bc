"""The keys of `motion.yaml` in words; `python -m par4_kinematics.motion_recipes` prints their page.

The keys of a recipe are the arguments of the function that makes it, and its docstring says what
they are.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable

from par4_kinematics.interface import table
from par4_kinematics.motion_file import COLUMNS, NAMED_MOTIONS, RECIPES, recipe_model
from par4_kinematics.robot_file import default_of, leaves, type_of

RETURN = 'Return '
"""How a docstring begins."""
EXAMPLES = {
    'adept': '{kind: adept, speed: 4.0, acceleration: 100.0, jerk: 20000.0, cycles: 10}',
    'excitation': '{kind: excitation, duration: 20.0, seed: 3}',
    'circle': '{kind: circle, radius: 0.05, speed: 0.1}',
    'waypoints': '{kind: waypoints, poses: [[0, 0, -0.78, 0], [0.1, 0, -0.75, 0.3]], dwell: 0.2}',
    'online': '{kind: online, start: [0, 0, -0.78, 0], targets: [[0.2, 0.1, 0, -0.78, 0]]}'}
"""A recipe of each kind, as it stands in a `motion.yaml`."""


def meanings(function: Callable[..., object]) -> dict[tuple[str, ...], str]:
    """Return what arguments of a function are, as the section `Args` of its docstring says.

    Arguments that it explains together stand together.
    """
    _, _, section = inspect.getdoc(function).partition('Args:\n')  # type: ignore[union-attr]
    section, _, _ = section.partition('\n\n')
    found = {}
    for entry in re.split(r'\n(?= {4}\w)', section):
        names, _, text = entry.strip().partition(': ')
        found[tuple(names.split(', '))] = ' '.join(text.split()).rstrip('.').replace(
            'None', '`null`')
    return found


def _recipe(kind: str) -> str:
    function = RECIPES[kind]
    first, _, _ = inspect.getdoc(function).partition('\n')  # type: ignore[union-attr]
    fields = dict(leaves(recipe_model(kind)))
    rows = [(', '.join(f'`{name}`' for name in names), type_of(fields[names[0]].annotation),
             ', '.join(default_of(fields[name]) for name in names), meaning)
            for names, meaning in meanings(function).items() if names != ('robot',)]
    return f"""### `{kind}`

{first[len(RETURN)].upper()}{first[len(RETURN) + 1:]}

{table(('key', 'type', 'default', 'what'), rows)}

```yaml
schema: par4/motion/1
recipe: {EXAMPLES[kind]}
```
"""


def markdown() -> str:
    """Return `docs/motion_file.md`."""
    names = [f'`{name}`' for name in NAMED_MOTIONS]
    headers = [(f'`{frame}`', f'`{",".join(("t", *columns))}`')
               for frame, columns in COLUMNS.items()]
    return f"""# The motion file

Generated from `par4_kinematics/motion_recipes.py` and the functions that make motions, by
`make docs`; do not edit.

Wherever a command or a node takes a motion, it takes one of the names {', '.join(names[:-1])} and
{names[-1]}, or the path of a `motion.yaml`. Such a file holds a recipe or samples. A motion that
leaves the limits of the robot is refused before anything moves. Numbers are in SI units and
radians; poses are x, y, z, theta of D in `base` ([conventions](model.md#conventions)).

## A recipe

`kind` says what is made, and the other keys how. Keys that are left out have their default, which
is `null` where `-` stands.

{chr(10).join(map(_recipe, RECIPES))}
## Samples

`frame` is `joint` or `platform`, and `samples` names a CSV beside the file:

```yaml
schema: par4/motion/1
frame: platform
samples: motion.csv
```

The CSV has one of two headers. Times begin at 0 and are even; speeds and accelerations must be the
derivatives of the positions. `par4_excite` and `par4_fastest` write such files.

{table(('`frame`', 'header'), headers)}
"""


if __name__ == '__main__':
    print(markdown(), end='')
