"""Which columns of a logger's files are which quantity, in which unit.

What a column means is said by whoever has the file, as `QUANTITY=COLUMN:UNIT`; nothing is guessed.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, fields
from itertools import combinations

import numpy as np

from par4_identification.logs.log_table import of_table
from par4_identification.logs.units import UNITS, Unit, plain_unit, unit_named
from par4_kinematics.errors import InputError

EXAMPLE = 'time=1:ms position=angle:deg torque=current:A'
MOST_COLUMNS = 1000
"""In a span of columns."""
MISSING = {
    'counts_per_turn': 'the counts of the encoder for one turn of the joint, behind its gear; of a '
                       'slide give the way of a count instead, such as position=2:0.5um',
    'motor_gain': 'the torque at the joint per ampere, N m/A (on a slide N/A), that of the '
                  'nameplate times the gear ratio; or write it into the robot file as motor_gain',
    'rated_torque': 'the rated torque at the joint, N m (on a slide N), that of the nameplate '
                    'times the gear ratio; or write it into the robot file as rated_torque; where '
                    'nobody knows it, 100 gives torques in percent'}
"""What a number of the machine is, where it is missing."""
WORDS = ('turn',)
"""Units that names of columns have in another meaning."""
LONGEST_NUMBER = 9
"""Digits of the number of a column."""


@dataclass(frozen=True)
class Choice:
    """Which columns are a quantity.

    Attributes:
        quantity: time, position, velocity, torque or voltage.
        columns: names or numbers, one a joint; one for time.
        unit: its name.
    """

    quantity: str
    columns: tuple[str, ...]
    unit: str

    @property
    def meaning(self) -> Unit:
        """What the unit is."""
        return unit_named(self.quantity, self.unit)

    @property
    def in_steps(self) -> bool:
        """Whether the unit is so many of a usual one, as of the steps that a drive counts."""
        return self.meaning.factor != UNITS[self.quantity][plain_unit(self.unit)].factor


@dataclass(frozen=True)
class Scales:
    """Numbers of the machine that some units need, one for all joints or one a joint.

    Attributes:
        counts_per_turn: of the joint, behind its gear.
        motor_gain: torque at the joint per ampere, N m/A or N/A, (24) with a current for a voltage.
        rated_torque: of which torques are a share, at the joint, N m or N.
    """

    counts_per_turn: tuple[float, ...] = ()
    motor_gain: tuple[float, ...] = ()
    rated_torque: tuple[float, ...] = ()


def chosen_columns(text: str) -> dict[str, Choice]:
    """Return what `QUANTITY=COLUMN[,COLUMN...]:UNIT ...` says, by quantity.

    A column is a name or a number counted from 1, `2-5` the numbers 2 to 5, `q[2-5]` those of the
    array q of an archive; names with spaces are quoted.

    Raises:
        InputError: another form, an unknown quantity or unit, no position, neither torque nor
            voltage, numbers of columns that differ, or a column that is two quantities.
    """
    entries = re.sub(rf',\s*(?=(?:{"|".join(UNITS)})=)', ' ', text)  # parted by commas, too
    try:
        words = shlex.split(entries)
    except ValueError as error:
        raise InputError(f'--columns {text!r}: {error}; close the quotes') from None
    choices: dict[str, Choice] = {}
    for word in words:
        quantity, equals, rest = word.partition('=')
        columns, colon, unit = rest.rpartition(':')
        if not equals or not colon or not columns or not unit:
            raise InputError(f'--columns: {word!r} is not QUANTITY=COLUMN:UNIT; write for example '
                             f"'{EXAMPLE}', a name with spaces as torque='motor current':A")
        unit_named(quantity, unit)
        if quantity in choices:
            raise InputError(f'--columns: {quantity} is given twice; part the columns of several '
                             f'joints by commas')
        choices[quantity] = Choice(quantity, _expanded(columns), unit)
    motion = motion_choice(choices)
    if not {'torque', 'voltage'} & set(choices):
        raise _incomplete(choices)
    joints = len(motion.columns)
    for quantity, choice in choices.items():
        wanted = 1 if quantity == 'time' else joints
        if len(choice.columns) != wanted:
            alike = '' if quantity == 'time' else f', as {motion.quantity} has'
            raise InputError(f'--columns: {quantity} has {len(choice.columns)} columns, expected '
                             f'{wanted}{alike}')
    for one, other in combinations(choices.values(), 2):
        common = [name for name in one.columns if name in other.columns]
        if common:
            raise InputError(f'--columns: {common[0]} is {one.quantity} and {other.quantity}; a '
                             f'column is one of them, give the other its own')
    kinds = {choice.meaning.kind for choice in choices.values()} - {None}
    if len(kinds) > 1:
        units = ', '.join(f'{choice.quantity} in {choice.unit}' for choice in choices.values()
                          if choice.meaning.kind)
        raise InputError(f'--columns: {units}; a joint turns or slides, not both')
    return choices


def motion_choice(choices: dict[str, Choice]) -> Choice:
    """Return what tells the motion: the position or, of a single axis without one, its velocity.

    Raises:
        InputError: there is neither.
    """
    if 'position' in choices:
        return choices['position']
    if 'velocity' in choices and len(choices['velocity'].columns) == 1:
        return choices['velocity']
    raise _incomplete(choices)


def named_otherwise(choices: dict[str, Choice]) -> list[str]:
    """Return a line for each column whose name says another unit than it is read in.

    Single letters say none, the m in `pos_m` may be the motor, unless they stand in brackets.
    """
    lines = []
    for choice in choices.values():
        units = UNITS[choice.quantity]
        for column in choice.columns:
            words = re.findall(r'[A-Za-z]+(?:/[A-Za-z]+)?', column)
            said = [word for word in words
                    if word in units and len(word) > 1 and word not in WORDS]
            said += [plain_unit(text) for text in re.findall(r'[\[(]([^\[\]()]+)[\])]', column)
                     if plain_unit(text) in units]
            if said and plain_unit(choice.unit) not in said and not (
                    choice.in_steps and units[said[-1]].scale == 'counts_per_turn'):
                written = f"'{column}'" if ' ' in column else column
                lines.append(f'{choice.quantity}: column {column!r} is read in {choice.unit}, its '
                             f'name says {said[-1]}; if it is right, give {choice.quantity}='
                             f'{written}:{said[-1]}')
    return lines


def _incomplete(choices: dict[str, Choice]) -> InputError:
    return InputError(f"--columns: found {', '.join(choices) or 'nothing'}; needed are position "
                      f"and torque or voltage (of a single axis without a position its velocity), "
                      f"for example '{EXAMPLE}'")


def _expanded(columns: str) -> tuple[str, ...]:
    names: list[str] = []
    for part in columns.split(','):
        table, number = of_table(part.strip())
        span = re.fullmatch(r'(\d+)-(\d+)', number or part.strip())
        if span is None:
            names.append(part.strip())
            continue
        first, last = (int(number[-LONGEST_NUMBER:]) for number in span.groups())
        if not 0 <= last - first < MOST_COLUMNS or max(map(len, span.groups())) > LONGEST_NUMBER:
            raise InputError(f'--columns: {part.strip()!r} is no span of 1 to {MOST_COLUMNS} '
                             f'columns; write it as FIRST-LAST')
        names += [f'{table}[{number}]' if table else str(number)
                  for number in range(first, last + 1)]
    return tuple(names)


def refuse_unused(scales: Scales, choices: dict[str, Choice]) -> None:
    """Refuse scales that no unit of the choices needs.

    Raises:
        InputError: a scale that is given for nothing.
    """
    needed = {choice.meaning.scale for choice in choices.values()}
    for field in fields(scales):
        if getattr(scales, field.name) and field.name not in needed:
            units = ' or '.join(name for known in UNITS.values() for name, unit in known.items()
                                if unit.scale == field.name)
            found = ', '.join(f'{choice.quantity} in {choice.unit}' for choice in choices.values())
            raise InputError(f'--{field.name.replace("_", "-")} is for {units}, found {found}; '
                             f'mend --columns or leave it out')


def si_factors(choice: Choice, scales: Scales, joints: int) -> np.ndarray:
    """Return SI units per unit of each joint, (J,).

    Raises:
        InputError: a scale that is missing, or not one number a joint.
    """
    unit = choice.meaning
    if unit.scale is None:
        return np.full(1 if choice.quantity == 'time' else joints, unit.factor)
    given = getattr(scales, unit.scale)
    option = '--' + unit.scale.replace('_', '-')
    if not given:
        raise InputError(f'{choice.quantity} in {choice.unit}: give {option}, '
                         f'{MISSING[unit.scale]}')
    if len(given) not in (1, joints):
        raise InputError(f'{choice.quantity} in {choice.unit}: {option} has {len(given)} numbers, '
                         f'give one' + (f' or {joints}' if joints > 1 else ''))
    scale = np.broadcast_to(np.array(given), (joints,))
    return unit.factor / scale if unit.scale == 'counts_per_turn' else unit.factor * scale
