"""Node parameters declared from a frozen dataclass: typed, described, range-checked, read-only."""

from __future__ import annotations

import dataclasses
import difflib
import inspect
import math
import os
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from par4_kinematics.errors import InputError
from par4_kinematics.files import read_yaml
from par4_kinematics.paths import at_home

if TYPE_CHECKING:  # help is told without loading ROS
    from rcl_interfaces.msg import ParameterDescriptor
    from rclpy.node import Node


@dataclasses.dataclass(frozen=True)
class NodeParameters:
    """The parameters of a node, a dataclass whose docstring says what the node does.

    Attributes:
        NAME: of the node.
        EXAMPLE: ROS arguments with which it does something else than by default, for its help.
    """

    NAME: ClassVar[str]
    EXAMPLE: ClassVar[str]


Parameters = TypeVar('Parameters', bound=NodeParameters)

_OF_ROS = {'use_sim_time': 'whether time is that published on /clock',
           'start_type_description_service': 'whether the types of messages are told'}
"""What the parameters that every node has mean; each is true or false."""
_LARGEST = 2 ** 53
"""Bound of a whole number without one: up to it every one is a double too."""
ALIKE = 0.65
"""Likeness of two names, of 0 to 1, from which on one is taken for the other misspelt. The names of
two nodes are less alike."""
ALIKE_NODES = 0.8
"""The same of names of nodes."""
ALIKE_OVERRIDES = 0.9
"""The same of overrides of a quality of service, most of whose name is that of any other."""
POLICIES = ('history', 'depth', 'reliability')
"""What can be overridden of a topic of the nodes (`QoSOverridingOptions.with_default_policies`)."""
_OF_QOS = 'qos_overrides.'
_WORDS = {str: 'a string', float: 'a number', int: 'a whole number', bool: 'true or false'}


def parameter(default: Any, description: str, lowest: float = -math.inf,
              highest: float = math.inf, choices: tuple[str, ...] = ()) -> Any:
    """Return a dataclass field that is a node parameter of the type of `default`."""
    return dataclasses.field(default=default, metadata={
        'description': description, 'lowest': lowest, 'highest': highest, 'choices': choices})


def declare(node: Node, parameters: type[Parameters]) -> Parameters:
    """Declare the fields of the dataclass on `node` and return the values the user gave them.

    The node must have been made with `automatically_declare_parameters_from_overrides`, so that
    names that it does not know are noticed.

    Raises:
        InputError: a value of another type, out of range or not among the choices; or a name that
            is misspelt or was given to this node alone, which else would have its default.
    """
    fields = dataclasses.fields(parameters)
    given = {name: node.get_parameter(name).value for name in node.get_parameters_by_prefix('')}
    unknown = sorted(name for name in given
                     if name not in {field.name for field in fields}
                     and name not in _OF_ROS and not name.startswith(_OF_QOS))
    names = [field.name for field in fields]
    mistaken = _mistaken(node, unknown, names, ALIKE)
    if mistaken:
        raise InputError(f'parameter {", ".join(mistaken)}: unknown; known are {", ".join(names)}')
    values = {}
    for field in fields:
        value = _checked(field, given.get(field.name, field.default))
        if field.name in given:
            node.undeclare_parameter(field.name)
        node.declare_parameter(field.name, value, _descriptor(field), ignore_override=True)
        values[field.name] = value
    return parameters(**values)


def tell_unknown_overrides(node: Node) -> None:
    """Tell of overrides of a quality of service (`qos_overrides.*`) that nothing here takes.

    Call it when the node has its topics.
    """
    sides = sorted({f'{_OF_QOS}{own.topic_name}.{side}' for side, all_own in (
        ('publisher', node.publishers), ('subscription', node.subscriptions)) for own in all_own})
    known = [f'{side}.{policy}' for side in sides for policy in POLICIES]
    given = node.get_parameters_by_prefix(_OF_QOS.rstrip('.'))
    mistaken = _mistaken(node, sorted({f'{_OF_QOS}{name}' for name in given} - {*known}), known,
                         ALIKE_OVERRIDES)
    if mistaken:
        node.get_logger().warning(f'unknown parameter {", ".join(mistaken)} ignored; known are '
                                  f'{", ".join(sides)} with {", ".join(POLICIES)}')


def tell_files_of_others(node: Node) -> None:
    """Warn of parameter files on the command line none of whose parts is for this node.

    Where a part has nearly its name, that is said; files for other nodes may be given to all.
    """
    name = node.get_name()
    for path, parts in _parameter_files():
        if any(part.rpartition('/')[2] == name or '*' in part for part in parts):
            continue
        meant = difflib.get_close_matches(name, [part.rpartition('/')[2] for part in parts], 1,
                                          ALIKE_NODES)
        node.get_logger().warning(
            f'{path}: no part of it is for {name}, all are ignored; it is for '
            f'{", ".join(parts) or "no node"}'
            + (f' (is {name} meant by {meant[0]}?)' if meant else ''))


def _parameter_files() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield each parameter file on the command line with its parts, by the names of nodes."""
    for option, path in zip(sys.argv, sys.argv[1:]):
        if option != '--params-file':
            continue
        try:
            content = read_yaml(path)
        except InputError:  # which ROS itself has understood
            continue
        yield path, ({str(part): told for part, told in content.items()}
                     if isinstance(content, dict) else {})


def _mistaken(node: Node, unknown: Sequence[str], known: Sequence[str], alike: float) -> list[str]:
    """Return the names that are misspelt or were given to this node alone; note all others.

    A parameter file may be one for several nodes, and then holds names of the others. A name is
    misspelt if its likeness to a known one is `alike` or more; which one is meant is told with it.
    """
    meant = {name: difflib.get_close_matches(name, known, 1, alike) for name in unknown}
    of_others = [name for name in unknown if not meant[name] and not _given_alone(node, name)]
    if of_others:
        node.get_logger().info(f'no parameters of this node, ignored: {", ".join(of_others)}')
    return [f'{name} (did you mean {meant[name][0]}?)' if meant[name] else name
            for name in unknown if name not in of_others]


def _given_alone(node: Node, name: str) -> bool:
    """Return whether this node alone is given a parameter.

    So it is as `-p NAME:=VALUE` or `-p NODE:NAME:=VALUE`, and in the part of a parameter file that
    has the name of the node.
    """
    given = (argument.partition(':=') for argument in sys.argv)
    if any(mark and left.rpartition(':')[2] == name for left, mark, _ in given):
        return True
    return any(part.rpartition('/')[2] == node.get_name() and isinstance(told, dict)
               and name in (told.get('ros__parameters') or ())
               for _, parts in _parameter_files() for part, told in parts.items())


def _checked(field: dataclasses.Field[Any], value: Any) -> Any:
    wanted = type(field.default)
    if wanted is float and type(value) is int:
        value = float(value)
    _check_type(field.name, value, wanted, field.metadata['description'])
    if wanted is str:
        value = at_home(value)
    if wanted in (int, float):
        lowest, highest = _range(field)
        if value in (math.inf, -math.inf):
            raise InputError(f'parameter {field.name}: {value} is no number that a machine has; '
                             f'give a finite one')
        if not lowest <= value <= highest:
            raise InputError(f'parameter {field.name}: {value} is outside {lowest:.16g} to '
                             f'{highest:.16g}; give a value within')
    choices = field.metadata['choices']
    if choices and value not in choices:
        raise InputError(f'parameter {field.name}: {value!r} asked; known are '
                         f'{", ".join(choices)}')
    return value


def _check_type(name: str, value: Any, wanted: type, meaning: str) -> None:
    if type(value) is not wanted:
        raise InputError(f'parameter {name}: expected {_WORDS[wanted]}, found {value!r}; it '
                         f'means: {meaning}')


def _range(field: dataclasses.Field[Any]) -> tuple[float, float]:
    """Return the lowest and the highest value of a number."""
    lowest, highest = field.metadata['lowest'], field.metadata['highest']
    if type(field.default) is int:
        return max(lowest, -_LARGEST), min(highest, _LARGEST)
    return lowest, highest


def check_those_of_ros(given: Mapping[str, Any]) -> None:
    """Look at those of the values given, by name, that every node has.

    Raises:
        InputError: one is neither true nor false.
    """
    for name in given.keys() & _OF_ROS.keys():
        _check_type(name, given[name], bool, _OF_ROS[name])


def page(parameters: type[NodeParameters]) -> str:
    """Return the help of a node: how it is started, what it does, what it can be told."""
    name = parameters.NAME
    return (f'{name} --ros-args -p NAME:=VALUE ...\n'
            f'{name} --config  prints a parameter file with the defaults\n\n'
            f'{inspect.cleandoc(parameters.__doc__ or "")}\n\n'
            f'Parameters, with their defaults:\n{usage(parameters)}\n\n'
            f'Example:\n  {name} --ros-args {parameters.EXAMPLE}')


def answered(parameters: type[NodeParameters], arguments: list[str]) -> bool:
    """Print help or the parameter file if these arguments ask for it; return whether they do."""
    if {'-h', '--help'} & {*arguments}:
        tell(page(parameters) + '\n')
        return True
    if '--config' in arguments:
        tell(config(parameters.NAME, parameters))
        return True
    return False


def tell(text: str) -> None:
    """Print a text, which a reader that has gone need not take.

    Raises:
        SystemExit: with 2 where the disk does not take it.
    """
    try:
        print(text, end='', flush=True)
    except OSError as error:
        # else Python tries it once more as it ends
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            print(f'error: standard output: {error.strerror}; free space', file=sys.stderr)
            raise SystemExit(2) from None


def usage(parameters: type[NodeParameters]) -> str:
    """Return one line for each parameter: name, default, description, choices or range."""
    return '\n'.join(f'  {field.name}:={_written(field.default)}  '
                     f'{field.metadata["description"]}{_bounds(field)}'
                     for field in dataclasses.fields(parameters))


def config(node: str, parameters: type[NodeParameters]) -> str:
    """Return a parameter file (YAML) of a node with the defaults, for --params-file."""
    lines = [f'# Parameters of {node}, with their defaults: --ros-args --params-file THIS_FILE',
             '/**:', '  ros__parameters:']
    for field in dataclasses.fields(parameters):
        bounds = _bounds(field).strip()
        lines += [f'    # {line}' for line in textwrap.wrap(
            f'{field.metadata["description"]} {bounds}'.strip(), 94)]
        lines.append(f'    {field.name}: {_written(field.default)}')
    return '\n'.join(lines) + '\n'


def _written(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _bounds(field: dataclasses.Field[Any]) -> str:
    if field.metadata['choices']:
        return f' (one of {", ".join(field.metadata["choices"])})'
    bounds = [f'{word} {bound:g}' for word, bound in (
        ('at least', field.metadata['lowest']), ('at most', field.metadata['highest']))
        if type(field.default) in (int, float) and math.isfinite(bound)]
    return f' ({", ".join(bounds)})' if bounds else ''


def _descriptor(field: dataclasses.Field[Any]) -> ParameterDescriptor:
    from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

    descriptor = ParameterDescriptor(description=field.metadata['description'], read_only=True)
    choices = field.metadata['choices']
    if choices:
        descriptor.additional_constraints = f'one of {", ".join(choices)}'
    if type(field.default) in (int, float):
        lowest, highest = _range(field)
        if type(field.default) is float:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=lowest, to_value=highest)]
        else:
            descriptor.integer_range = [
                IntegerRange(from_value=int(lowest), to_value=int(highest))]
    return descriptor
