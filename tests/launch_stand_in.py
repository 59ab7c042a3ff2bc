"""What the launch files use of `launch` and `launch_ros`, which PyPI does not have.

Actions only keep what they were given. Which of them run when is the business of `ros2 launch`;
what they are, and what follows when a process ends, is that of the launch files.
"""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest


class Action:
    """Keeps what it was given."""

    def __init__(self, *given: Any, **named: Any) -> None:
        self.given, self.named = given, named

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__['named'][name]
        except KeyError:
            raise AttributeError(name) from None


class LaunchConfiguration(Action):
    """The text of an argument, which the context holds."""

    def perform(self, context: Any) -> str:
        """Return it."""
        return context.launch_configurations[self.given[0]]


class ParameterValue(Action):
    """The value of a parameter, and its type."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ParameterValue) and vars(self) == vars(other)


MODULES = {
    'launch': ('LaunchContext', 'LaunchDescription'),
    'launch.actions': ('DeclareLaunchArgument', 'EmitEvent', 'ExecuteProcess', 'LogInfo',
                       'OpaqueFunction', 'Shutdown'),
    'launch.events': ('matches_action',),
    'launch.events.process': ('ProcessExited', 'SignalProcess'),
    'launch.substitutions': (),
    'launch_ros': (),
    'launch_ros.actions': ('Node',),
    'launch_ros.parameter_descriptions': (),
}


def install(patch: pytest.MonkeyPatch) -> None:
    """Make the modules importable as long as the patch lasts."""
    for name, classes in MODULES.items():
        module = ModuleType(name)
        for kind in classes:
            setattr(module, kind, type(kind, (Action,), {}))
        patch.setitem(sys.modules, name, module)
    sys.modules['launch.substitutions'].LaunchConfiguration = LaunchConfiguration
    sys.modules['launch_ros.parameter_descriptions'].ParameterValue = ParameterValue
    patch.delitem(sys.modules, 'par4_sim.ros.launched', raising=False)


def started(description: Any, **arguments: str) -> list[Any]:
    """Return the actions that a description gives with these arguments."""
    *declared, opaque = description.given[0]
    texts = {argument.given[0]: argument.default_value for argument in declared} | arguments
    return list(opaque.function(SimpleNamespace(launch_configurations=texts)))


def kinds(actions: list[Any]) -> list[str]:
    """Return the names of the classes of actions."""
    return [type(action).__name__ for action in actions]
