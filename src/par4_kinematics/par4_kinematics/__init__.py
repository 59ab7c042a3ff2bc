"""Kinematics, motions, files and contract of the Par4 parallel robot.

    >>> from par4_kinematics import forward_kinematics, inverse_kinematics, read_robot
    >>> robot = read_robot('reference')
    >>> q = inverse_kinematics(robot.geometry, [0.1, 0.0, -0.7, 0.2])
    >>> x = forward_kinematics(robot.geometry, q)

What is named here is public; it is loaded when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submod_attrs={
    'errors': ['InputError', 'Par4Error', 'UnreachableError'],
    'geometry': ['Geometry'],
    'interface': ['AMPLIFIER_VOLTAGE', 'FEEDFORWARD_TORQUE', 'JOINT_STATES', 'REFERENCE',
                  'START_DELAY'],
    'limits': ['check_torque', 'limits_not_given'],
    'motion': ['Motion'],
    'motion_file': ['named_motion', 'read_motion', 'write_motion'],
    'position': ['forward_kinematics', 'inverse_kinematics'],
    'robot': ['JOINT_NAMES', 'Axis', 'Robot', 'read_machine', 'read_robot'],
    'stamps': ['SECOND'],
    'velocity': ['condition_number', 'jacobian'],
    'workspace': ['home_pose', 'inside', 'reachable'],
})
