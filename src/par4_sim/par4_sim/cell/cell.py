"""What runs together in a cell: the one table behind `par4_cell` and the launch files.

A composition turns its arguments into a `Session`: nodes that run side by side and, where a motion
is played, what comes after it. Nothing here starts a process and nothing knows ROS;
`running_cell.py` runs a session by itself, `ros/launched.py` hands it to `ros2 launch`.
"""

from __future__ import annotations

import os.path
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from par4_kinematics.errors import InputError
from par4_kinematics.paths import at_home, refuse_unwritable
from par4_sim.choices import FIDELITIES, LOOKED_AHEAD, POSITION_LAWS, PREDICTIVE, STEP

CLOCK = '/clock'
"""Topic `par4_kinematics.interface.CLOCK`, whose module loads more than a table needs."""

Value = str | int | float | bool

PUBLISHER = 'robot_state_publisher'
"""Executable and package of ROS."""
FRAMES_HZ = 31.0
"""Of robot_state_publisher: with a shorter period than that of the passive joints in joint_states,
it takes each message with them whole, and arms and rods are drawn at the same time."""
WITHIN_NAMESPACE = (('/tf', 'tf'), ('/tf_static', 'tf_static'))
"""Remappings with which robots in namespaces, whose frames have the same names, do not mix them."""

_NAME = re.compile(r'[A-Za-z_]\w*(/[A-Za-z_]\w*)*', re.ASCII)
"""Names of topics and namespaces, without the slashes around them."""


@dataclass(frozen=True)
class Argument:
    """An argument of a composition; its default has its type.

    Attributes:
        name: of the argument.
        default: value that it has if it is not given.
        description: what it means.
        choices: texts that may be given; any if there are none.
        refuse: raises an InputError for a text that names no file; None where it names none.
    """

    name: str
    default: Value
    description: str
    choices: tuple[str, ...] = ()
    refuse: Callable[[str], object] | None = None

    @property
    def written(self) -> str:
        """The default as it is written on a command line."""
        return str(self.default).lower() if isinstance(self.default, bool) else str(self.default)

    @property
    def allowed(self) -> tuple[str, ...]:
        """What may be given; nothing where every text or number may."""
        return ('true', 'false') if isinstance(self.default, bool) else self.choices

    def value(self, text: str) -> Value:
        """Return what a text means.

        Raises:
            InputError: it is empty where the default is not, not among the choices, no file where
                one is named, or not a number where one is expected.
        """
        if not text and self.written:
            raise InputError(f'argument {self.name}: found an empty text; leave it out for '
                             f'{self.written}. It means: {self.description}')
        if self.allowed and text not in self.allowed:
            raise InputError(f'argument {self.name}: {text!r} asked; known are '
                             f'{", ".join(self.allowed)}')
        if isinstance(self.default, bool):
            return text == 'true'
        if self.refuse is not None and text:
            try:
                self.refuse(at_home(text))
            except InputError as error:
                raise InputError(f'argument {self.name}: {error}') from None
        try:
            return type(self.default)(at_home(text))
        except ValueError:
            kind = 'a whole number' if isinstance(self.default, int) else 'a number'
            raise InputError(f'argument {self.name}: expected {kind}, found {text!r}; it means: '
                             f'{self.description}') from None


@dataclass(frozen=True)
class NodePart:
    """A node with its parameters, and with remappings of its own."""

    package: str
    executable: str
    parameters: Mapping[str, Value]
    remappings: tuple[tuple[str, str], ...] = ()

    @property
    def of_ros(self) -> bool:
        """Whether it is none of this project's nodes."""
        return not self.package.startswith('par4_')


@dataclass(frozen=True)
class ToolPart:
    """An offline tool with its arguments."""

    package: str
    executable: str
    arguments: tuple[str, ...]


@dataclass(frozen=True)
class Session:
    """What runs.

    Attributes:
        nodes: run side by side; when one ends, all end.
        player: the one of them that plays a motion: when it has played, all end and that is well.
        then: runs after that.
        namespace: of all nodes, without slashes around it; empty = none.
        remappings: of topics, for all nodes.
    """

    nodes: tuple[NodePart, ...]
    player: NodePart | None = None
    then: ToolPart | None = None
    namespace: str = ''
    remappings: tuple[tuple[str, str], ...] = ()


def _robot_file(text: str) -> None:
    from par4_kinematics.files import resolve_builtin  # slow to load, and often not needed

    resolve_builtin(text, 'par4_kinematics')


def _model_file(text: str) -> None:
    from par4_kinematics.files import resolve_builtin

    resolve_builtin(text, 'par4_dynamics')


def _motion(text: str) -> None:
    from par4_kinematics.motion_file import refuse_no_motion

    refuse_no_motion(text)


ROBOT = (
    Argument('robot_file', 'reference', 'robot.yaml or built-in name', refuse=_robot_file),
    Argument('namespace', '', 'of all nodes and topics; without one they have none'),
)
SIMULATED = (
    Argument('clock', '', f'topic of the simulated time; without one {CLOCK}, in a namespace '
                          f'NAMESPACE{CLOCK}'),
    Argument('machine', 'table1_full', 'model.yaml of the machine as it truly is',
             refuse=_model_file),
    Argument('fidelity', 'fast', 'how exactly the mechanism is simulated', FIDELITIES),
    Argument('physics_step', STEP, 'of the physics and the drives, s; larger is faster and less '
                                   'exact'),
    Argument('publish_rate_hz', 1000.0, 'samples a second of simulated time, Hz'),
    Argument('real_time_factor', 1.0, 'simulated seconds a second; 0 = as fast as it can'),
    Argument('controller', POSITION_LAWS[0], 'of the simulated drives', POSITION_LAWS),
    Argument('noise', 0.0, 'of the recorded torque, N m rms'),
    Argument('seed', 0, 'of the noise, and of an excitation'),
    Argument('window', False, 'show the robot in a window of pybullet'),
)
FRAMES = (
    Argument('tf', False, f'publish the frames of all links on /tf, in a namespace NAMESPACE/tf, '
                          f'by {PUBLISHER} of an installed ROS'),
)
FED_FORWARD = (
    Argument('model', 'table1', 'model.yaml of the feedforward, and of a controller that needs '
                                'one', refuse=_model_file),
)
OPTIONAL = (
    Argument('motion', '', 'adept, excitation, circle or a motion.yaml; without one none is '
                           'played', refuse=_motion),
    Argument('duration', 0.0, 's of a named motion; 0 = its own'),
    Argument('record', '', 'bag to write; without one nothing is recorded'),
)
PLAYED = (
    Argument('motion', 'excitation', 'adept, excitation, circle or a motion.yaml', refuse=_motion),
    Argument('duration', 0.0, 's of a named motion; 0 = its own'),
    Argument('record', 'recording', 'bag to write'),
)
IDENTIFIED = (
    Argument('rigid_body', 'paper', 'equation (20), or with rods and bars distributed',
             ('paper', 'full')),
    Argument('output', 'identified', 'folder for the results of par4_identify'),
)
OWN_ROBOT = (Argument('simulated', True, 'simulate the robot; false where a real one is there'),)


@dataclass(frozen=True)
class Composition:
    """Parts that run together, by name.

    Attributes:
        summary: what it is, in a sentence.
        arguments: it takes.
        build: the session of their values.
    """

    summary: str
    arguments: tuple[Argument, ...]
    build: Callable[[Mapping[str, Value]], Session]

    def session(self, given: Mapping[str, str]) -> Session:
        """Return what runs with these texts as arguments; the others have their defaults.

        Raises:
            InputError: an unknown argument, or a value that it does not take.
        """
        known = {argument.name: argument for argument in self.arguments}
        unknown = [name for name in given if name not in known]
        if unknown:
            raise InputError(f'argument {unknown[0]}: unknown; known are {", ".join(known)}')
        return self.build({name: argument.value(given[name]) if name in given else argument.default
                           for name, argument in known.items()})


def _simulation(asked: Mapping[str, Value], **further: Value) -> NodePart:
    return NodePart('par4_sim', 'par4_simulation', {
        'robot_file': asked['robot_file'], 'model_file': asked['machine'],
        'fidelity': asked['fidelity'], 'physics_step': asked['physics_step'],
        'publish_rate_hz': asked['publish_rate_hz'],
        'real_time_factor': asked['real_time_factor'], 'torque_noise': asked['noise'],
        'seed': asked['seed'], 'window': asked['window'], 'controller': asked['controller'],
        **({'controller_model': asked['model']} if 'model' in asked else {}), **further})


def _refuse_no_name(argument: str, name: str) -> None:
    """Refuse what ROS takes for no name of a topic or a namespace.

    Raises:
        InputError: says what a name consists of.
    """
    if name.strip('/') and not _NAME.fullmatch(name.strip('/')):
        raise InputError(f'argument {argument}: {name!r} is no name of ROS; give parts of letters, '
                         f'digits and _, none of which begins with a digit, and / between them')


def _session(asked: Mapping[str, Value], nodes: tuple[NodePart, ...],
             player: NodePart | None = None, then: ToolPart | None = None,
             simulated: bool = True) -> Session:
    for name in ('namespace', 'clock'):
        _refuse_no_name(name, str(asked[name]))
    space = str(asked['namespace']).strip('/')
    clock = str(asked['clock']) or (f'/{space}{CLOCK}' if space else CLOCK)
    remappings = ((CLOCK, clock),) if simulated and clock != CLOCK else ()
    return Session(nodes, player, then, space, remappings)


def _frames(asked: Mapping[str, Value]) -> tuple[NodePart, ...]:
    """Return robot_state_publisher, whose own description goes nowhere, if it is asked for."""
    if asked['tf'] is not True:
        return ()
    from par4_kinematics.robot import read_robot
    from par4_sim.description.robot_description import complete_description

    return (NodePart(PUBLISHER, PUBLISHER, {
        'robot_description': complete_description(read_robot(str(asked['robot_file']))),
        'publish_frequency': FRAMES_HZ, 'use_sim_time': True},
        (*WITHIN_NAMESPACE, ('robot_description', '~/robot_description'))),)


def _only_simulation(asked: Mapping[str, Value]) -> Session:
    return _session(asked, (*_frames(asked), _simulation(asked)))


def _cell(asked: Mapping[str, Value]) -> Session:
    pose = NodePart('par4_kinematics', 'par4_kinematics',
                    {'robot_file': asked['robot_file'], 'use_sim_time': True})
    session = _moved(asked, simulated=True, beside=(pose,))
    return replace(session, nodes=(*_frames(asked), *session.nodes))


def _recording(asked: Mapping[str, Value]) -> Session:
    return _moved(asked, simulated=asked['simulated'] is True)


def _identification(asked: Mapping[str, Value]) -> Session:
    bag, results = (str(asked[name]) for name in ('record', 'output'))
    if os.path.abspath(bag) == os.path.abspath(results):
        raise InputError(f'argument output: {results} is the bag of the argument record; give '
                         f'another folder')
    refuse_unwritable(Path(results), 'the argument output')
    tool = ToolPart('par4_identification', 'par4_identify', (
        bag, '--robot', str(asked['robot_file']), '--rigid-body', str(asked['rigid_body']),
        '--output', results))
    return _moved(asked, simulated=asked['simulated'] is True, then=tool)


FEEDFORWARD_TIMEOUT = 2.0
"""Seconds that a simulated drive waits for the torque of a motion that begins."""


def _moved(asked: Mapping[str, Value], simulated: bool, beside: tuple[NodePart, ...] = (),
           then: ToolPart | None = None) -> Session:
    """Return a robot with feedforward, and with a recorder and a motion where they are asked."""
    common = {'robot_file': asked['robot_file'], 'use_sim_time': simulated}
    nodes = [NodePart('par4_dynamics', 'par4_feedforward',
                      {**common, 'model_file': asked['model'],
                       'torque_factor': LOOKED_AHEAD if asked['controller'] == PREDICTIVE else 1.0
                       }), *beside]
    if asked['record']:
        nodes.append(NodePart('par4_identification', 'par4_record',
                              {'output': asked['record'], 'use_sim_time': simulated}))
    player = None
    if asked['motion']:
        # robot, feedforward and recorder take references: none may miss the beginning
        player = NodePart('par4_kinematics', 'par4_motion', {
            **common, 'motion': asked['motion'], 'duration': asked['duration'],
            'seed': asked['seed'], 'listeners': 3 if asked['record'] else 2})
        nodes.append(player)
    if simulated:
        nodes.insert(0, _simulation(asked, feedforward_timeout=FEEDFORWARD_TIMEOUT)
                     if player else _simulation(asked))
    return _session(asked, tuple(nodes), player, then, simulated)


COMPOSITIONS = {
    'simulation': Composition('The simulated robot alone.', ROBOT + SIMULATED + FRAMES,
                              _only_simulation),
    'cell': Composition(
        'Simulated robot, feedforward and platform pose; a motion and a recorder where asked.',
        ROBOT + SIMULATED + FRAMES + FED_FORWARD + OPTIONAL, _cell),
    'recording': Composition(
        'A motion is played with feedforward and recorded, on a simulated or a real robot.',
        ROBOT + OWN_ROBOT + SIMULATED + FED_FORWARD + PLAYED, _recording),
    'identification': Composition(
        'A recording, from which par4_identify then identifies a model.',
        ROBOT + OWN_ROBOT + SIMULATED + FED_FORWARD + PLAYED + IDENTIFIED, _identification),
}
