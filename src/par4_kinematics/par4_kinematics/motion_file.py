"""`motion.yaml`: a recipe from which the samples follow, or samples in a CSV file beside it."""

from __future__ import annotations

import hashlib
import inspect
import itertools
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar, Final, Literal, get_type_hints

import numpy as np
from pydantic import Field, create_model, model_validator

from par4_kinematics.adept import adept_motion
from par4_kinematics.circle import circle_motion
from par4_kinematics.errors import InputError, Par4Error, quoted
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.files import (
    FileModel,
    expect_schema,
    parse,
    read_yaml,
    why_no_text,
    written_atomically,
    yaml_text,
)
from par4_kinematics.motion import (
    JOINT_COLUMNS,
    PLATFORM_COLUMNS,
    Motion,
    check_limits,
    motion_of_joints,
    motion_of_platform,
    waypoints_motion,
)
from par4_kinematics.online import online_motion
from par4_kinematics.paths import instead_of_file
from par4_kinematics.robot import Robot

MOTION_SCHEMA: Final = 'par4/motion/1'
PAGE = 'docs/motion_file.md'
"""Of the documentation: the keys of every recipe."""
COLUMNS = {'joint': JOINT_COLUMNS, 'platform': PLATFORM_COLUMNS}
RECIPES: dict[str, Callable[..., Motion]] = {
    'adept': adept_motion, 'excitation': excitation_motion, 'circle': circle_motion,
    'waypoints': waypoints_motion, 'online': online_motion}
"""What a recipe of each kind calls; its keys are the arguments of the function but the robot."""
NAMED_MOTIONS = ('adept', 'excitation', 'circle')
REPEATED = {'adept': 'cycles', 'circle': 'turns'}
"""Named motions that repeat themselves, and the argument that says how often."""

LARGEST = 1e12
"""Largest time, position, speed or acceleration in SI units; the squares of larger ones may
overflow."""
SHORTEST_PERIOD = 1e-9
"""Seconds from sample to sample; stamps resolve no less."""
TIME_TOLERANCE = 0.01
"""Part of a period by which a time may differ from even spacing."""
SPEED_TOLERANCE = 0.1
"""Part of a column's highest speed by which the speed may differ from the derivative of the
position."""
ACCELERATION_TOLERANCE = 0.3
"""Part of a column's rms acceleration by which the acceleration may differ, in rms, from the
derivative of the speed: accelerations may jump between samples."""
ROUNDING = 1e-6
"""Rounding of a position or speed in a file that is let pass, SI units."""


class MotionFile(FileModel):
    """The content of `motion.yaml`: either `recipe`, or `frame` and `samples`."""

    page: ClassVar[str] = PAGE
    schema_name: Literal['par4/motion/1'] = Field(MOTION_SCHEMA, alias='schema')
    recipe: dict[str, Any] | None = None
    frame: Literal['joint', 'platform'] | None = None
    samples: str | None = None

    @model_validator(mode='after')
    def _one_form(self) -> MotionFile:
        given = tuple(name for name in ('recipe', 'frame', 'samples')
                      if getattr(self, name) is not None)
        if given not in (('recipe',), ('frame', 'samples')):
            raise ValueError(f'expected either recipe, or frame and samples, found '
                             f'{" and ".join(given) or "none of them"}')
        if self.samples is not None and Path(self.samples).name != self.samples:
            raise ValueError(f'samples must name a file beside this one, found {self.samples!r}')
        return self


class Recipe(FileModel):
    """Base of the schemas of recipes."""

    page: ClassVar[str] = PAGE


def recipe_model(kind: str) -> type[Recipe]:
    """Return the schema of a kind of recipe: its function's arguments, types and defaults."""
    function = RECIPES[kind]
    types = get_type_hints(function)
    fields: dict[str, Any] = {
        name: (types[name], ... if argument.default is argument.empty else argument.default)
        for name, argument in inspect.signature(function).parameters.items() if name != 'robot'}
    return create_model(f'{kind.capitalize()}Recipe', __base__=Recipe,
                        **{'kind': (Literal[kind], ...), **fields})


def _checked_recipe(recipe: Mapping[str, Any], source: str) -> FileModel:
    kind = recipe.get('kind')
    if not isinstance(kind, str) or kind not in RECIPES:
        raise InputError(f'{source}: expected a recipe of kind {", ".join(RECIPES)}, found '
                         f'{quoted(kind)}; see {PAGE}')
    return parse(dict(recipe), recipe_model(kind), f'{source}: recipe {kind}')


def motion_of_recipe(recipe: Mapping[str, Any], robot: Robot, source: str = 'recipe') -> Motion:
    """Return the motion of a recipe {kind, arguments}; `source` names it in errors.

    Raises:
        InputError: unknown kind or argument, or a value out of range.
        UnreachableError: a pose that a leg cannot reach.
    """
    arguments = dict(_checked_recipe(recipe, source))
    with _source_in_errors(source):
        return _finite(lambda: RECIPES[arguments.pop('kind')](robot, **arguments))


def _finite(build: Callable[[], Motion]) -> Motion:
    """Return the motion that is built, without a word of numbers too large on the way.

    Raises:
        InputError: they make it infinite.
    """
    with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
        motion = build()
    if not all(np.isfinite(part).all() for part in (motion.t, motion.q, motion.qd, motion.qdd,
                                                    motion.x, motion.xd, motion.xdd)):
        raise InputError('its numbers are so large that the motion is not finite; give SI units')
    return motion


@contextmanager
def _source_in_errors(source: str) -> Iterator[None]:
    try:
        yield
    except Par4Error as error:
        raise type(error)(f'{source}: {error}') from error


def write_motion(path: str | Path, motion: Motion, frame: str = 'joint', maker: str = '') -> None:
    """Write a motion as `motion.yaml` and a CSV of the same stem beside it; both files or neither.

    Args:
        path: of the YAML file.
        motion: what to write.
        frame: whether the samples are written as 'joint' or as 'platform' motion.
        maker: the tool whose result it is, by which `is_untouched` knows the files again.

    Raises:
        InputError: the path has the name of the CSV, or a file cannot be written.
    """
    path = Path(path)
    table = path.with_suffix('.csv')
    if path.suffix.lower() == table.suffix:
        raise InputError(f'{path}: expected a name that ends in .yaml; the samples go into a .csv '
                         f'beside it')
    parts = ((motion.q, motion.qd, motion.qdd) if frame == 'joint' else
             (motion.x, motion.xd, motion.xdd))
    rows = np.column_stack((motion.t, *parts)).tolist()
    lines = (','.join(map(repr, row)) for row in rows)  # repr: shortest that reads back equal
    # Both are complete before either replaces an old one.
    with written_atomically(path) as scratch, written_atomically(table) as scratch_table:
        scratch_table.write_text('\n'.join((','.join(('t', *COLUMNS[frame])), *lines, '')),
                                 encoding='utf-8')
        content = yaml_text({'schema': MOTION_SCHEMA, 'frame': frame, 'samples': table.name}
                            ).encode()
        mark = _mark(maker, content, scratch_table.read_bytes()) if maker else b''
        scratch.write_bytes(mark + content)


def _mark(maker: str, content: bytes, table: bytes) -> bytes:
    """Return the comment line by which a tool knows the files of its motion again."""
    digest = hashlib.sha256(content + table).hexdigest()[:32]
    return f'# {maker} may replace this motion while it is unchanged: {digest}\n'.encode()


def is_untouched(path: Path, maker: str) -> bool:
    """Return whether a `motion.yaml` and its CSV are as `write_motion` left them for a tool."""
    try:
        mark, newline, content = path.read_bytes().partition(b'\n')
        return mark + newline == _mark(maker, content, path.with_suffix('.csv').read_bytes())
    except OSError:  # one of them is gone, or is no file
        return False


def free_motion_path(path: Path, maker: str) -> Path:
    """Return where a tool may write its motion without loss: the path, or it with a number.

    There is nothing, or an earlier motion of the tool that nobody has changed.
    """
    for number in itertools.count(1):
        place = path if number == 1 else path.with_stem(f'{path.stem}_{number}')
        if is_untouched(place, maker) or not any(
                map(os.path.lexists, (place, place.with_suffix('.csv')))):
            return place
    raise AssertionError('numbers do not end')


def read_motion(path: str | Path, robot: Robot) -> Motion:
    """Return the motion of a `motion.yaml` for a robot; limits are not checked.

    Raises:
        InputError: not found, not YAML, wrong schema, or samples that `read_samples` refuses.
        UnreachableError: a sample that the mechanism cannot take.
    """
    path = Path(path)
    content = read_yaml(path)
    expect_schema(content, (MOTION_SCHEMA,), str(path), PAGE)
    motion_file = parse(content, MotionFile, str(path))
    if motion_file.recipe is not None:
        return motion_of_recipe(motion_file.recipe, robot, str(path))
    if motion_file.samples is None or motion_file.frame is None:
        raise InputError(f'{path}: expected either recipe, or frame and samples')
    table = path.parent / motion_file.samples
    t, columns = read_samples(table, motion_file.frame)
    build = motion_of_joints if motion_file.frame == 'joint' else motion_of_platform
    with _source_in_errors(str(table)):
        return _finite(lambda: build(path.stem, robot.geometry, t, *np.split(columns, 3, axis=1)))


def read_samples(path: str | Path, frame: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the times (n,) and columns (n, 12) of a CSV of samples; see `COLUMNS`.

    Raises:
        InputError: not found, another header, cells that are not finite numbers, times that do
            not start at 0 or are not even, or columns that are not each other's derivatives.
    """
    path = Path(path)
    try:
        header, _, body = path.read_text(encoding='utf-8-sig').partition('\n')
    except FileNotFoundError:
        raise InputError(f'{path}: no such file; the samples of a motion lie beside its '
                         f'YAML file') from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f'{path}: cannot be read as text ({why_no_text(error)}); give the '
                         f'samples as a CSV') from error
    names = ('t', *COLUMNS[frame])
    found = tuple(cell.strip() for cell in header.split(','))
    if found != names:
        raise InputError(f'{path}: expected the header {",".join(names)} of frame {frame}, found '
                         f'{header.strip()[:120]!r}')
    rows = [line.split(',') for line in body.splitlines() if line.strip()]
    for number, row in enumerate(rows, start=1):
        if len(row) != len(names):
            raise InputError(f'{path}: sample {number} has {len(row)} cells, expected '
                             f'{len(names)}; mend or cut the file there')
    if len(rows) < 2:
        raise InputError(f'{path}: {len(rows)} samples, at least 2 are needed')
    try:
        values = np.array(rows, dtype=float)
    except ValueError as error:
        raise InputError(f'{path}: {error}; every cell must be a number') from error
    absurd = ~(np.abs(values) <= LARGEST)
    if absurd.any():
        row, column = np.argwhere(absurd)[0]
        raise InputError(f'{path}: {names[column]} of sample {row + 1} is '
                         f'{values[row, column]}; every cell must be a finite number, of no more '
                         f'than {LARGEST:g} in SI units')
    t = _even_times(path, values[:, 0])
    _check_derivatives(path, names, t, values)
    return t, values[:, 1:]


def _even_times(path: Path, t: np.ndarray) -> np.ndarray:
    """Return the times without the rounding of the file."""
    period = t[-1] / (len(t) - 1)
    even = np.arange(len(t)) * period
    off = np.abs(t - even)
    if 0.0 < period < SHORTEST_PERIOD:
        raise InputError(f'{path}: samples are {period:.3g} s apart, at least '
                         f'{SHORTEST_PERIOD:g} s is expected; give times in seconds')
    if not (period > 0 and off.max() <= TIME_TOLERANCE * period):
        row = int(np.argmax(off))
        raise InputError(f'{path}: t of sample {row + 1} is {t[row]:.6g} s, even spacing from 0 to '
                         f'{t[-1]:.6g} s would give {even[row]:.6g} s; resample the motion evenly')
    return even


def _check_derivatives(path: Path, names: tuple[str, ...], t: np.ndarray, values: np.ndarray
                       ) -> None:
    """Refuse speeds and accelerations that are not derivatives, by the trapezoidal rule."""
    period = t[1]
    position, speed, acceleration = np.split(values[:, 1:], 3, axis=1)
    position_names, speed_names, acceleration_names = np.split(np.array(names[1:]), 3)
    rounding = 4.0 * ROUNDING / period
    slope = np.diff(position, axis=0) / period
    excess = (np.abs(slope - 0.5 * (speed[1:] + speed[:-1]))
              - SPEED_TOLERANCE * np.abs(speed).max(axis=0) - rounding)
    row, column = map(int, np.unravel_index(np.argmax(excess), excess.shape))
    if excess[row, column] > 0.0:
        raise InputError(
            f'{path}: {speed_names[column]} is not the derivative of {position_names[column]} at '
            f'{t[row]:.4g} s ({speed[row, column]:.4g}, the positions give '
            f'{slope[row, column]:.4g}); correct the columns, or sample more finely')
    difference = np.diff(speed, axis=0) / period - 0.5 * (acceleration[1:] + acceleration[:-1])
    excess = (_rms(difference) - ACCELERATION_TOLERANCE * _rms(acceleration) - rounding)
    column = int(np.argmax(excess))
    if excess[column] > 0.0:
        raise InputError(
            f'{path}: {acceleration_names[column]} is not the derivative of {speed_names[column]} '
            f'(rms {_rms(acceleration)[column]:.4g}, rms difference '
            f'{_rms(difference)[column]:.4g}); correct the columns, or sample more finely')


def _rms(columns: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(columns ** 2, axis=0))


def named_motion(name_or_path: str | Path, robot: Robot, duration: float | None = None,
                 seed: int = 0, period: float = 1e-3) -> Motion:
    """Return the motion of a name (adept, excitation, circle) or of a file, within robot's limits.

    Args:
        name_or_path: one of `NAMED_MOTIONS`, or the path of a `motion.yaml`; that motion is not
            changed.
        robot: the machine.
        duration: of a named motion, s; None for the motion's own. Adept and circle are repeated
            as often as fits, at least once.
        seed: of the excitation.
        period: seconds between the samples of a named motion; a file has its own.

    Raises:
        InputError: neither a name nor a file, a bad file, or limits of the robot not kept.
        UnreachableError: a sample that the mechanism cannot take.
    """
    name = str(name_or_path)
    if name == 'excitation':
        own = {} if duration is None else {'duration': duration}
        motion = excitation_motion(robot, seed=seed, period=period, **own)
    elif name in REPEATED:
        often = {} if duration is None else {
            REPEATED[name]: repeats_within(name, robot, duration, period)}
        motion = RECIPES[name](robot, period=period, **often)
    else:
        refuse_no_motion(name)
        motion = read_motion(name, robot)
    check_limits(motion, robot)
    return motion


def refuse_no_motion(name_or_path: str, names: tuple[str, ...] = NAMED_MOTIONS) -> None:
    """Refuse what is neither one of the names nor a file.

    Raises:
        InputError: says so, and what may be given.
    """
    if name_or_path not in names and not Path(name_or_path).is_file():
        raise InputError(f'motion {name_or_path}: {instead_of_file(name_or_path)}, and not a name ('
                         f'{", ".join(names)}); give one of these or the path of a file')


def repeats_within(name: str, robot: Robot, duration: float, period: float = 1e-3) -> int:
    """Return how often one of `REPEATED` fits into a duration, s, at least once.

    Args:
        name: of the motion.
        robot: the machine.
        duration: s.
        period: seconds between the samples.
    """
    once, twice = (RECIPES[name](robot, period=period, **{REPEATED[name]: count}).duration
                   for count in (1, 2))
    return max(1, 1 + int((duration - once) / (twice - once) + 1e-9))
