"""Launch descriptions of the compositions of `cell.py`, for `ros2 launch`."""

from __future__ import annotations

import difflib
import signal
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    LogInfo,
    OpaqueFunction,
    Shutdown,
)
from launch.events import matches_action
from launch.events.process import ProcessExited, SignalProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from par4_kinematics.ros.parameters import ALIKE
from par4_kinematics.runner import run_by_this_process
from par4_sim.cell.cell import COMPOSITIONS, WITHIN_NAMESPACE, Argument, NodePart, Session, Value
from par4_sim.cell.running_cell import executable_path

VIEW = Argument('rviz', False, 'show the robot in RViz, with tf:=true')


def launch_description(name: str, view: Path | None = None) -> LaunchDescription:
    """Return the launch description of a composition.

    Args:
        name: of the composition.
        view: file of RViz, with which the argument `rviz` shows the robot.
    """
    composition = COMPOSITIONS[name]
    arguments = (*composition.arguments, *(() if view is None else (VIEW,)))

    def actions(context: LaunchContext) -> Sequence[Any]:
        texts = {argument.name: LaunchConfiguration(argument.name).perform(context)
                 for argument in composition.arguments}
        shown = view is not None and VIEW.value(
            LaunchConfiguration(VIEW.name).perform(context)) is True
        session = composition.session({**texts, 'tf': 'true'} if shown else texts)
        # first, because its packages may be missing: then nothing has started yet
        return [*_misspelt(context.launch_configurations, [one.name for one in arguments]),
                *([_rviz(view, session)] if shown else ()),
                *_Launched(session).nodes()]

    return LaunchDescription([
        *(DeclareLaunchArgument(argument.name, default_value=argument.written,
                                description=argument.description,
                                choices=list(argument.allowed) or None)
          for argument in arguments),
        OpaqueFunction(function=actions)])


def _misspelt(given: Iterable[str], known: Sequence[str]) -> list[LogInfo]:
    """Tell of arguments that are nearly one of the known: `ros2 launch` takes any name.

    Others may belong to a launch file that includes this one.
    """
    meant = {name: difflib.get_close_matches(name, known, 1, ALIKE)
             for name in given if name not in known}
    return [LogInfo(msg=f'argument {name} is unknown and ignored; did you mean {near[0]}?')
            for name, near in meant.items() if near]


class _Launched:
    """The nodes of a session as actions, and what happens when one of them ends."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._actions = [self._node(part) for part in session.nodes]
        self._playing = True
        self._ending = False
        self._running = len(self._actions)

    def nodes(self) -> list[Node]:
        """Return the actions that start the nodes."""
        return self._actions

    def _node(self, part: NodePart) -> Node:
        def ended(event: ProcessExited, _context: LaunchContext) -> list[Any]:
            self._running -= 1
            if self._ending:  # each Shutdown would interrupt all once more
                return []
            if part is self._session.player and event.returncode == 0:
                return self._played()
            if event.returncode != 0:
                return self._failure(part.executable, event.returncode)
            if self._playing:
                self._ending = True
                return [Shutdown(reason=f'{part.executable} has ended')]
            return self._afterwards()

        return Node(package=part.package, executable=part.executable, output='screen',
                    namespace=self._session.namespace or None,
                    parameters=[{name: _as_told(value)
                                 for name, value in part.parameters.items() if value != ''}],
                    remappings=[*self._session.remappings, *part.remappings], on_exit=ended,
                    additional_env=run_by_this_process({}))

    def _failure(self, executable: str, code: int) -> list[Any]:
        """Return what ends the launch with exit code 1: an action that raises.

        A shutdown alone ends with 0, without a word of the reason. What fails while all end is
        told by the launch itself.
        """
        def fail(_context: LaunchContext) -> None:
            raise RuntimeError(f'{executable} has ended with exit code {code}, so all are ended; '
                               f'what it said stands above')

        self._ending = True
        return [OpaqueFunction(function=fail)]

    def _played(self) -> list[Any]:
        """Return what ends the other nodes, so that a recorder completes its bag."""
        self._playing = False
        if self._session.then is None:
            self._ending = True
            return [Shutdown(reason='the motion has been played')]
        return [EmitEvent(event=SignalProcess(signal_number=signal.SIGINT,
                                              process_matcher=matches_action(action)))
                for part, action in zip(self._session.nodes, self._actions, strict=True)
                if part is not self._session.player]

    def _afterwards(self) -> list[Any]:
        """Return the tool that follows, once all nodes have ended."""
        if self._running > 0 or self._session.then is None:
            return []
        tool = self._session.then

        def ended(event: ProcessExited, _context: LaunchContext) -> list[Any]:
            if event.returncode != 0:
                return self._failure(tool.executable, event.returncode)
            return [Shutdown(reason=f'{tool.executable} has ended')]

        return [ExecuteProcess(cmd=[executable_path(tool), *tool.arguments], output='screen',
                               on_exit=ended)]


def _as_told(value: Value) -> Any:
    """Return the value of a parameter; a text, which `launch` would read as YAML, stays a text."""
    return ParameterValue(value, value_type=str) if isinstance(value, str) else value


def _rviz(view: Path | None, session: Session) -> Node:
    """Return RViz."""
    return Node(package='rviz2', executable='rviz2', arguments=['-d', str(view)],
                parameters=[{'use_sim_time': True}], namespace=session.namespace or None,
                remappings=[*session.remappings, *WITHIN_NAMESPACE])
