"""What an engineer wants to know of each effect besides its law: physics, remedy, usual size.

The pages of effects are made from this and from the catalogue (`make site`).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Guide:
    """An effect as an engineer meets it.

    Attributes:
        physics: where it comes from, in sentences.
        remedy: what to look at and to do at the machine.
        usual: a usual size, parameter -> value as `model.yaml` has it: one number, one a joint, or
            the numbers of a vector. Pictures show it.
    """

    physics: str
    remedy: str
    usual: dict[str, float | tuple[float, ...]]


GUIDES: dict[str, Guide] = {
    'torque_offset': Guide(
        'The current sensor or the analogue input of an amplifier has a zero error, or something '
        'pulls at the joint with the same torque in every pose.',
        'Switch the power stage off and read the recorded torque: what is left is the zero error. '
        'Zero the amplifier. If the reading is zero, look for what pulls.',
        {'offset': (0.5, -0.3, 0.4, 0.2)}),
    'stribeck': Guide(
        'At low speed a lubricated contact has no full film of oil. Friction is highest when '
        'motion begins and falls until the film carries.',
        'Look at lubricant and seals. Warm the machine up before tests. For feedforward at low '
        'speed take the extended model.',
        {'stribeck_torque': 0.9, 'stribeck_velocity': 0.12}),
    'cogging': Guide(
        'The magnets of a motor are drawn to the slots of its stator, and the teeth of a gear '
        'mesh one after the other. Both make torque that returns a whole number of times a turn, '
        'whatever the load.',
        'Compare the number of periods with slots, pole pairs and teeth times the gear ratio. '
        'Compensate it by a table of torque over position; of a gear check the mesh.',
        {'amplitude': 0.6, 'periods': 24.0, 'phase': (0.0, 1.0, 2.0, 3.0)}),
    'distributed_rods': Guide(
        'Equation (20) puts the mass of rods and bars at their ends. The mass of a real rod lies '
        'along it, so that it has less inertia about its own middle than two half masses.',
        'Nothing is wrong with the machine. Identify with `--rigid-body full` and the masses of '
        'rods and bars in the robot file.',
        {'rod_mass': 0.05, 'bar_mass': 0.1}),
    'payload': Guide(
        'The tool carries something that the model does not know, at D or at the other half '
        'plate.',
        'Look at the gripper. Weigh what it holds, and give it with `--payload`; where it is '
        'unknown, `--unknown-payload` weighs it.',
        {'mass': 0.3}),
    'theta_inertia': Guide(
        'Belt, pulleys and tool turn with theta and need torque when theta accelerates.',
        'Compare with the inertia of the tool in the drawing, multiplied by the square of the '
        'rotation amplification. Enter `theta_inertia` in the robot file.',
        {'inertia': 0.005}),
    'theta_friction': Guide(
        'Belt and pulleys that turn the tool rub.',
        'Take the tool off and turn the pulley by hand. Look at the tension of the belt and at '
        'the bearings of the pulleys.',
        {'coulomb': 0.2, 'viscous': 0.02}),
    'passive_joint_friction': Guide(
        'The ball joints at the ends of the rods rub. Their friction acts through the mechanism, '
        'so that its torque at the motors depends on the pose.',
        'Move each rod by hand. Clean and grease ball joints, and check the springs that hold '
        'them.',
        {'coulomb': 0.05, 'viscous': 0.01}),
    'base_tilt': Guide(
        'The base does not hang level, so that gravity has a part along x or y.',
        'Put a spirit level on the base. Level it, or describe the tilt in the frame of the '
        'robot.',
        {'about_x': 0.02, 'about_y': -0.01}),
    'external_force': Guide(
        'Something pulls or pushes the platform with a force that does not change with its pose.',
        'Look for what touches the platform: a hose, a balancer, a guide.',
        {'x': 3.0, 'y': 0.0, 'z': -4.0}),
    'cable_spring': Guide(
        'A cable or hose runs to the platform and bends like a spring. It pulls harder the '
        'farther the platform is from where the cable hangs free.',
        'Unhook the cable and record again. Give it more slack, or lead it from above.',
        {'stiffness': 40.0, 'anchor': (0.1, 0.0, -0.6)}),
    'position_torque': Guide(
        'A spring, a cable, a counterweight or a cam loads the axis by where it stands, whichever '
        'way it goes.',
        'Move the axis slowly by hand through its range and feel where it pulls. Unhook what is '
        'attached to it and record again.',
        {'coefficients': (0.0, 0.4, 0.1), 'range': (-1.0, 1.0)}),
    'platform_drag': Guide(
        'Air, a bellows or a fluid resists the motion of the platform.',
        'Record again without cover or bellows. Compare the quadratic part with the area of the '
        'platform.',
        {'viscous': 3.0, 'quadratic': 1.0}),
    'encoder_offset': Guide(
        'The zero of an encoder is not where the robot file says. All poses are then slightly '
        'wrong, and so is gravity.',
        'Bring the arms against their stops or into a gauge, and set the zeros anew.',
        {'offset': (0.005, -0.003, 0.004, 0.0)}),
    'encoder_eccentricity': Guide(
        'The disc of an encoder does not turn about its middle, so that the reading runs ahead '
        'and behind once a turn.',
        'Measure the run-out of the disc. Mount it anew, or take an encoder with two heads.',
        {'amplitude': 0.003, 'phase': 0.5}),
    'geometry_error': Guide(
        'Arms, rods or plates are longer or shorter than the robot file says. The mechanism then '
        'moves otherwise than the model believes.',
        'Measure the dimension that was named. Correct the robot file, or look for the part that '
        'was exchanged.',
        {'arm_length': 0.003, 'forearm_length': -0.003}),
    'leg_length_error': Guide(
        'The arm or the rods of one leg are longer or shorter than those of the others, so that '
        'the platform is not where the joints say.',
        'Measure arm and rods of the leg that was named. Write what a calibration finds into the '
        'robot file as `arm_length_errors` and `forearm_length_errors`.',
        {'arm_length': (0.002, 0.0, 0.0, 0.0), 'forearm_length': (0.0, 0.0, -0.002, 0.0)}),
    'coulomb_asymmetry': Guide(
        'Dry friction differs between the directions, for example of a worn or preloaded gear.',
        'Turn the joint by hand both ways. Look at preload and seals.',
        {'asymmetry': (0.3, -0.2, 0.2, 0.3)}),
    'viscous_asymmetry': Guide(
        'Friction grows with speed by another slope in each direction, for example where a '
        'lubricant is driven towards one side.',
        'Look at gear, lubricant and seals of the joint that was named.',
        {'asymmetry': (0.15, -0.1, 0.1, 0.2)}),
    'nonlinear_viscous': Guide(
        'Friction does not grow in proportion to speed: a thick film of oil shears thin, a '
        'turbulent one grows with the square.',
        'Nothing has to be wrong. Take the extended model for feedforward, and a lubricant for '
        'the temperature at hand.',
        {'quadratic': 0.1}),
    'load_dependent_friction': Guide(
        'Friction of gears grows with the torque that they transmit.',
        'Compare with the efficiency in the data sheet of the gear. A value that grows over '
        'months says that the gear wears.',
        {'coefficient': 0.05}),
    'friction_drift': Guide(
        'A machine warms up, its lubricant gets thin, and friction falls.',
        'Warm the machine up before recording, or record for longer than the time constant.',
        {'drop': 0.3, 'time_constant': 8.0}),
    'presliding': Guide(
        'Before friction breaks away, contacts bend like springs. Around each reversal friction '
        'grows over a small distance instead of jumping.',
        'Nothing has to be wrong. It matters for feedforward of small motions; take the extended '
        'model.',
        {'distance': 0.002}),
    'joint_friction_difference': Guide(
        'One joint rubs more than the others: another lubricant, a tight bearing, wear.',
        'Compare the joints by hand. Look at bearing, seal and lubricant of the one that was '
        'named.',
        {'coulomb': (0.6, 0.0, 0.0, -0.6), 'viscous': (0.2, 0.0, 0.0, -0.2)}),
    'joint_inertia_difference': Guide(
        'One motor or gear has another inertia: another type was mounted, or a coupling was '
        'added.',
        'Read the type plates of motors and gears.',
        {'inertia': (0.01, 0.0, 0.0, -0.01)}),
    'arm_mass_offset': Guide(
        'The centre of mass of an arm is beside the line from its axis to its end.',
        'Look for what is fixed to the arm: a sensor, a cable, a screw.',
        {'first_moment': (0.05, 0.0, 0.03, 0.0)}),
    'arm_weight_difference': Guide(
        'One arm is heavier or lighter than the others.',
        'Look for what is fixed to the arm: a sensor, a cable, a clamp.',
        {'first_moment': (0.05, 0.0, 0.0, -0.03)}),
    'drive_gain_error': Guide(
        'The amplifier delivers more or less torque a volt than the robot file says.',
        'Measure the gain: `par4_drive_gain` does so from pushes on a force sensor, '
        '`par4_identify --payload` from a known payload.',
        {'relative': (0.05, 0.0, -0.04, 0.0)}),
    'torque_ripple': Guide(
        'The torque constant of a motor changes with the angle of its rotor, so that the ripple '
        'grows with the torque.',
        'Compare the number of periods with the pole pairs. Check the commutation angle and the '
        'current sensors of the phases.',
        {'relative': 0.05, 'periods': 12.0, 'phase': 0.7}),
    'actuator_lag': Guide(
        'The current loop of an amplifier follows its command with a lag.',
        'Compare with the band width of the current loop. Tune it, or lead the feedforward.',
        {'time_constant': 0.002}),
    'time_offset': Guide(
        'Torque and positions carry stamps of different instants, for example because one of '
        'them is buffered. A first-order low pass of the logged torque or current, with the delay '
        'as its time constant, looks the same.',
        'Stamp both when they are measured, in the same cycle, and log the torque without a '
        'filter. Correct the recorded time by the delay that was found.',
        {'delay': 0.003}),
    'torque_saturation': Guide(
        'The drive reaches the limit of its current and delivers less than was asked for.',
        'Ask for less acceleration, or raise the limit if motor and gear bear it.',
        {'limit': 9.0}),
    'elastic_transmission': Guide(
        'Gear and coupling twist under load, so that the arm is not where the encoder on the '
        'motor says.',
        'Clamp the motor, push the arm, and measure the angle. Tighten couplings.',
        {'stiffness': 20000.0}),
    'backlash': Guide(
        'Between the flanks of gear teeth is a gap. The load lies on one side of it, and strikes '
        'over to the other where the transmitted torque changes its sign.',
        'Hold the motor and rock the arm. Adjust or exchange the gear.',
        {'gap': 0.004}),
    'quantization': Guide(
        'A converter has too few bits, so that the recorded signal moves in steps.',
        'Look at the range of the converter, and use all of it.',
        {'step': 0.2}),
}
"""By name, in the order of the catalogue."""
