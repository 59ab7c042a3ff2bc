"""The process of a node: ROS arguments, signals, a proper end, the exit code."""

from __future__ import annotations

import gc
import math
import os
import re
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.logging import set_logger_level
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from par4_kinematics.errors import InputError, Par4Error, one_line
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.ros.parameters import answered, tell_files_of_others, tell_unknown_overrides

PATIENCE = 3.0
"""Seconds that a node has to end in before another signal interrupts it."""
LAST_DOMAIN = 232
"""The ports of further domains would be beyond 65535 (DDSI-RTPS 2.5, 9.6.2)."""


_PARSED = re.compile(r"Couldn't parse ([a-z ]+): '(.*)'\. Error: (.*?)(?:, at /|$)", re.DOTALL)
"""How ROS says which argument it does not understand, and why."""
_NAMES = 'names have letters, digits and _, and do not begin with a digit'
_TO_GIVE = {
    'params file': 'give a parameter file as --config prints it',
    'parameter override rule': f'give -p NAME:=VALUE with a value; {_NAMES}',
    'remap rule': f'give -r FROM:=TO; {_NAMES}',
    'log level': 'give --log-level debug, info, warn, error or fatal'}
"""Kind of argument, as ROS has it -> what to give."""

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Which end a node."""


class Interrupted(KeyboardInterrupt):
    """A second signal has interrupted a node that did not end."""


def _prepare_environment() -> None:
    # other machines' robots are met on purpose only
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    home = os.environ.get('HOME')
    if not (home and os.access(home, os.W_OK)) and not {'ROS_LOG_DIR', 'ROS_HOME'} & {*os.environ}:
        os.environ['ROS_LOG_DIR'] = str(Path(tempfile.gettempdir()) / 'par4_log')


def _outside_of_ros(arguments: list[str]) -> list[str]:
    """Return the arguments that stand outside of `--ros-args ... --`."""
    outside, of_ros = [], False
    for argument in arguments:
        if of_ros:
            of_ros = argument != '--'
        elif argument == '--ros-args':
            of_ros = True
        else:
            outside.append(argument)
    return outside


def _initialise(arguments: list[str]) -> None:
    strange = _outside_of_ros(arguments[1:])
    if strange:  # NAME:=VALUE too, which rcl would take for another name of a topic
        raise InputError(f'unknown argument {strange[0]}; parameters are given as --ros-args '
                         f'-p NAME:=VALUE, see --help')
    domain = os.environ.get('ROS_DOMAIN_ID', '').strip() or '0'
    if not (domain.isdecimal() and int(domain) <= LAST_DOMAIN):
        raise InputError(f'ROS_DOMAIN_ID: {domain} found; set a whole number from 0 to '
                         f'{LAST_DOMAIN}')
    set_logger_level('rcl', LoggingSeverity.FATAL)  # it says less of a fault than the error does
    try:
        # with rclpy's own handlers the context is gone before the node can end its work
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # rclpy names no public class for bad ROS arguments
        raise InputError(_fault_of_ros(str(error))) from error
    finally:
        set_logger_level('rcl', LoggingSeverity.UNSET)


def _fault_of_ros(text: str) -> str:
    """Return what is wrong with ROS arguments, and what to give, of what ROS says."""
    found = _PARSED.search(text)
    if found is None:
        return f'ROS arguments: {text}; give them as --ros-args -p NAME:=VALUE'
    kind, given, why = found.groups()
    why = f'ROS says "{why}"; ' if kind == 'params file' else ''
    return f'ROS arguments: {given!r} is not understood; {why}{_TO_GIVE.get(kind, "see --help")}'


@contextmanager
def _running(node_class: type[Par4Node]) -> Iterator[Par4Node]:
    """Yield a node that SIGINT, SIGTERM and SIGHUP finish, as soon as it has started.

    A terminal and `ros2 launch` both send SIGINT on one Ctrl-C: the second one means nothing more.
    SIGHUP comes of a terminal that is closed; `nohup` lets it be ignored.
    """
    node = None
    asked_at = math.inf

    def end(_signal: int, _frame: Any) -> None:
        nonlocal asked_at
        if time.monotonic() - asked_at > PATIENCE:
            raise Interrupted
        if asked_at == math.inf:
            asked_at = time.monotonic()
            if node is not None:
                node.end()

    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN or number != signal.SIGHUP:
            signal.signal(number, end)
    try:
        _initialise(sys.argv)
        node = node_class()
        tell_unknown_overrides(node)
        tell_files_of_others(node)
        if asked_at < math.inf:
            node.end()
        gc.freeze()  # what is loaded stays: a full collection of it would stop the node for 0.1 s
        yield node
    finally:
        with ExitStack() as ending:  # each step is taken even if one before it fails
            # while Python ends it has no handlers any more: a second Ctrl-C would kill it, and
            # `ros2 launch`, which sends several, would call a node dead that has ended well
            for number in SIGNALS:
                ending.callback(signal.signal, number, signal.SIG_IGN)
            ending.callback(try_shutdown)
            if node is not None:
                node.finished = True
                ending.callback(node.destroy_node)
                ending.callback(node.close)


def run(node_class: type[Par4Node]) -> int:
    """Run a node until it is finished, SIGINT, SIGTERM or SIGHUP; return the exit code.

    `--help` and `--config` only print. 0 is a proper end, 2 bad input: one line `error: ...` on
    stderr. A second signal interrupts a node that does not end; the code is then 130, as what it
    was writing may be incomplete.
    """
    if answered(node_class.PARAMETERS, sys.argv[1:]):
        return 0
    _prepare_environment()
    try:
        with _running(node_class) as node:
            node.work()
    except Interrupted:
        return 130
    except KeyboardInterrupt:
        pass  # before there was a node
    except (Par4Error, NameValidationException) as error:
        print(f'error: {one_line(str(error))}', file=sys.stderr)
        return 2
    return 0
