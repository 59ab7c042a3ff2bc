"""Estimators: each recovers what broke the others, and says what it is worth."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from measured import DWELL, excitation, log_of_model
from scipy.signal import lfilter

from par4_dynamics.base_terms import base_columns, base_terms
from par4_dynamics.model_from_file import build_model, read_model
from par4_identification.commands.identify import identify_bags
from par4_identification.estimators.consistent import Constraint, consistent
from par4_identification.estimators.covariance import long_run_covariance
from par4_identification.estimators.instrumental import instrumental
from par4_identification.estimators.names import ESTIMATORS
from par4_identification.estimators.ordinary import ordinary
from par4_identification.estimators.problem import (
    Label,
    Series,
    per_output,
    problem_of,
    with_offsets,
)
from par4_identification.estimators.robust import robust
from par4_identification.estimators.weighted import weighted
from par4_identification.fitting.identification import Fitting, identify, identify_runs
from par4_identification.fitting.physical import physical_constraints
from par4_identification.fitting.simulated import simulated_log
from par4_identification.logs.log import Reference
from par4_identification.reports.outcome.estimator import (
    IN_WORDS,
    estimator_in_words,
    estimator_remarks,
)
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.errors import InputError
from par4_kinematics.motion_file import named_motion
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import build_simulation
from robots import REFERENCE, model_with

TABLE_1 = read_model('table1', REFERENCE)
TRUE = np.array([TABLE_1.values[name][0] for name in TABLE_1.values])
CHI = np.array((1.0, -2.0, 0.5))


def coloured(random, shape, memory=0.7):
    """Return first order noise of unit variance along the first axis."""
    white = random.standard_normal((shape[0] + 50, *shape[1:]))
    return np.sqrt(1.0 - memory ** 2) * lfilter([1.0], [1.0, -memory], white, axis=0)[50:]


def rows_of(random, rows=800, outputs=2, sizes=(0.1, 0.1)):
    """Return columns (rows, J, 3), coloured noise (rows, J) of these sizes and valid rows."""
    columns = coloured(random, (rows, outputs, 3), 0.8)
    return columns, coloured(random, (rows, outputs)) * sizes, random.random((rows, outputs)) > 0.1


def synthetic(seed=0, **options):
    """Return a problem with the values CHI."""
    columns, noise, valid = rows_of(np.random.default_rng(seed), **options)
    return problem_of([Series(columns @ CHI + noise, columns, valid)], 'abc', ('m', 's', 'kg'))


def positive(problem):
    """Return that no value is negative."""
    return [Constraint(str(label), row) for label, row in zip(problem.labels, np.eye(problem.size))]


IDEAL = REFERENCE.model_copy(update={
    'drives': REFERENCE.drives.model_copy(update={'encoder_counts': 0})})
WRONG = replace(TABLE_1, values={
    name: value * factor for (name, value), factor in
    zip(TABLE_1.values.items(), (1.05, 0.95, 1.05, 1.0, 0.97, 1.03))})


@cache
def log_of_table_1(robot, seed):
    """Return a log of a robot that obeys TABLE 1; made once."""
    return log_of_model(robot, TABLE_1, seed=seed)


def noisy_log(seed, position_noise, robot=REFERENCE):
    """Return a log whose recorded positions are noisy, with the reference that it followed."""
    log, motion = log_of_table_1(robot, seed), excitation('reference', 10.0, seed)
    random = np.random.default_rng(seed)
    return replace(
        log, q=log.q + position_noise * random.standard_normal(log.q.shape),
        reference=Reference(DWELL + motion.t, motion.q, motion.qd, motion.qdd))


def problem_of_log(log, simulated=None):
    """Return the problem of a log, and the columns of the simulated one at the same rows."""
    run, = runs_of_log(log, REFERENCE)
    terms, valid, instruments = base_terms(run.state), run.valid, None
    if simulated is not None:
        other, = runs_of_log(simulated, REFERENCE)
        valid, instruments = valid & other.valid, other.rows(base_columns(other.state))
    series = Series(run.tau, run.rows(base_columns(run.state)), valid)
    return problem_of([series], [term.name for term in terms], [term.unit for term in terms]
                      ), instruments


def test_ordinary_is_the_textbook():
    """Against numpy's own solution; the residual is orthogonal to the columns."""
    problem = synthetic()
    part, = problem.series
    rows, target = part.columns[part.valid], part.target[part.valid]
    estimate = ordinary(problem)
    values, square, _, singular = np.linalg.lstsq(rows, target)
    np.testing.assert_allclose(estimate.values, values, rtol=1e-10)
    covariance = square[0] / (len(rows) - 3) * np.linalg.inv(rows.T @ rows)
    np.testing.assert_allclose(estimate.textbook_std, np.sqrt(np.diag(covariance)), rtol=1e-10)
    assert estimate.condition_number == pytest.approx(singular[0] / singular[-1])
    np.testing.assert_allclose(rows.T @ estimate.residuals[0][part.valid], 0.0, atol=1e-9)
    np.testing.assert_allclose(estimate.relative_std, estimate.std / np.abs(values))


@pytest.mark.parametrize('estimator', [ordinary, weighted, robust])
def test_deviations_hold_for_coloured_correlated_residuals(estimator):
    """z-scores over many data sets have unit spread; the textbook's deviations are too small."""
    scores, textbook = [], []
    for seed in range(120):
        random = np.random.default_rng(seed)
        columns, noise, valid = rows_of(random, 900, sizes=(0.1, 0.2))
        shared = 0.1 * coloured(random, (900, 1))  # as encoder noise is, through the mass matrix
        parts = [Series(columns[rows] @ CHI + (noise + shared)[rows], columns[rows], valid[rows])
                 for rows in (slice(0, 500), slice(500, None))]
        estimate = estimator(problem_of(parts, 'abc', ('m', 's', 'kg')))
        scores.append((estimate.values - CHI) / estimate.std)
        textbook.append((estimate.values - CHI) / estimate.textbook_std)
    assert 0.85 < np.std(scores) < 1.2
    assert np.std(textbook) > 1.3
    assert abs(np.mean(scores)) < 0.25


def test_an_output_with_large_noise_weighs_little():
    errors = {estimator: np.array([estimator(synthetic(seed, sizes=(0.01, 1.0))).values - CHI
                                   for seed in range(20)])
              for estimator in (ordinary, weighted)}
    assert np.std(errors[weighted]) < 0.05 * np.std(errors[ordinary])


def test_outliers_do_not_move_robust():
    """A tenth of the targets far off to one side: least squares follows, robust does not."""
    for seed in range(5):
        problem, random = synthetic(seed), np.random.default_rng(100 + seed)
        part, = problem.series
        # outliers that imitate a larger first value
        hit = random.random(part.target.shape) < 0.1
        wrong = replace(part, target=part.target + hit * 20.0 * np.sign(part.columns[..., 0]))
        clean, soiled = robust(problem), robust(replace(problem, series=(wrong,)))
        assert np.abs((weighted(replace(problem, series=(wrong,))).values - CHI)[0]) > 0.5
        assert np.all(np.abs(soiled.values - clean.values) < 2.0 * clean.std)
        assert np.all(np.abs(soiled.values - CHI) < 4.0 * soiled.std)
        # what does not count is what was hit
        assert np.all(soiled.weights[0][hit & part.valid] == 0.0)
        assert soiled.rejected == pytest.approx((hit & part.valid).sum() / part.valid.sum(),
                                                abs=0.005)
        assert clean.rejected < 0.005


def test_robust_is_nearly_as_good_as_least_squares_without_outliers():
    errors = {estimator: np.array([estimator(synthetic(seed)).values - CHI for seed in range(60)])
              for estimator in (weighted, robust)}
    assert np.std(errors[robust]) < 1.15 * np.std(errors[weighted])


def test_spikes_in_the_torque_of_a_robot_do_not_move_robust():
    log, random = log_of_table_1(REFERENCE, 2), np.random.default_rng(2)
    hit = random.random(log.tau.shape) < 0.002
    spiked = replace(log, tau=log.tau + 100.0 * hit * np.sign(np.gradient(log.q, axis=0)))
    problem, _ = problem_of_log(spiked)
    least, estimate = weighted(problem), robust(problem)
    assert np.abs(least.values / TRUE - 1.0).max() > 0.02
    np.testing.assert_allclose(estimate.values, TRUE, rtol=0.005)


def errors_in_variables(seed, noise, loop=0.0, rows=1500):
    """Return a problem whose columns are noisy, fed back by `loop` into y, and clean instruments.
    """
    random = np.random.default_rng(seed)
    clean, error, valid = rows_of(random, rows)
    disturbed = noise * coloured(random, clean.shape)
    target = clean @ CHI + error + loop * disturbed.sum(axis=-1)
    measured = clean + disturbed
    # what a simulation with other values makes of the motion: alike, not the same
    other = clean + 0.3 * lfilter([0.5], [1.0, -0.5], clean, axis=0)
    return problem_of([Series(target, measured, valid)], 'abc', ('m', 's', 'kg')), [other]


def test_noise_in_the_regressor_biases_least_squares_and_not_instruments():
    scores = []
    for seed in range(40):
        estimate = instrumental(*errors_in_variables(seed, 0.3, loop=-0.5))
        scores.append((estimate.values - CHI) / estimate.std)
        assert np.abs(estimate.least_squares.values / CHI - 1.0).max() > 0.05
        assert estimate.bias.p_value < 1e-3
        np.testing.assert_array_less(
            3.0, np.abs(estimate.least_squares.values - CHI).max() / estimate.least_squares.std)
    assert np.abs(np.mean(scores)) < 0.3
    assert 0.85 < np.std(scores) < 1.25


def test_no_bias_no_accusation():
    """With a clean regressor and coloured residuals the test rejects as often as it says."""
    p_values = [instrumental(*errors_in_variables(seed, 0.0)).bias.p_value for seed in range(200)]
    assert 0.01 <= np.mean(np.array(p_values) < 0.05) <= 0.11
    assert np.mean(np.array(p_values) < 0.5) == pytest.approx(0.5, abs=0.12)


def test_instruments_that_say_nothing_are_refused():
    problem, _ = errors_in_variables(0, 0.1)
    strange = np.random.default_rng(9).standard_normal(problem.series[0].columns.shape)
    with pytest.raises(InputError, match='hardly move like the measured regressor'):
        instrumental(problem, [strange])
    with pytest.raises(InputError, match='at the same rows'):
        instrumental(problem, [strange[1:]])


def test_noisy_encoders_of_a_robot():
    """Least squares underrates the masses of a robot with noisy positions; instruments do not."""
    least, free = [], []
    for seed in range(4):
        log = noisy_log(seed, 6e-4)
        problem, columns = problem_of_log(log, simulated_log(log, REFERENCE, WRONG))
        estimate = instrumental(problem, [columns])
        least.append(estimate.least_squares.values / TRUE - 1.0)
        free.append((estimate.values - TRUE) / estimate.std)
        assert estimate.bias.p_value < 1e-3
        assert estimate.bias.difference[1] < 0.0
        assert estimate.relevance > 0.9
    assert np.mean(least, axis=0)[1] < -0.01
    assert np.mean(least, axis=0)[2] < -0.01
    assert np.abs(free).max() < 4.0


def test_ideal_encoders_are_not_accused():
    for seed in range(3):
        log = noisy_log(seed, 0.0, IDEAL)
        problem, columns = problem_of_log(log, simulated_log(log, REFERENCE, WRONG))
        assert instrumental(problem, [columns]).bias.p_value > 0.01


def test_instruments_that_are_the_columns_are_least_squares():
    problem, _ = errors_in_variables(1, 0.3)
    estimate = instrumental(problem, [problem.series[0].columns])
    np.testing.assert_allclose(estimate.values, weighted(problem).values, rtol=1e-9)
    np.testing.assert_allclose(estimate.std, weighted(problem).std, rtol=1e-6)
    assert estimate.bias.p_value == 1.0
    assert estimate.relevance == pytest.approx(1.0)


def test_simulated_motion_is_the_motion():
    """The machine's own model along its reference gives its own positions, wherever it begins."""
    log = noisy_log(3, 0.0, IDEAL)
    simulated = simulated_log(log, REFERENCE, TABLE_1)
    np.testing.assert_allclose(simulated.q, log.q, atol=1e-9)
    np.testing.assert_array_equal(simulated.tau, log.tau)
    begun = 5000
    late = replace(log, q=log.q[begun:], tau=log.tau[begun:], t=log.t[begun:] - log.t[begun],
                   segments=(slice(0, len(log.t) - begun),),
                   reference=replace(log.reference, t=log.reference.t - log.t[begun]))
    moved = simulated_log(late, REFERENCE, TABLE_1)
    np.testing.assert_allclose(moved.q, simulated.q[begun:], atol=1e-4)


def test_simulated_motion_needs_a_reference():
    log = noisy_log(3, 0.0)
    with pytest.raises(InputError, match='record the topic reference'):
        simulated_log(replace(log, reference=None), REFERENCE, TABLE_1)
    holes = replace(log.reference, qd=np.full_like(log.reference.qd, np.nan))
    with pytest.raises(InputError, match='some are missing'):
        simulated_log(replace(log, reference=holes), REFERENCE, TABLE_1)
    elsewhere = replace(log.reference, t=log.reference.t + 1e3)
    with pytest.raises(InputError, match='record both on one clock'):
        simulated_log(replace(log, reference=elsewhere), REFERENCE, TABLE_1)


def test_consistent_is_least_squares_where_physics_is_content():
    problem, _ = problem_of_log(log_of_table_1(REFERENCE, 4))
    estimate = consistent(problem, physical_constraints(problem.labels, REFERENCE, 'paper'))
    least = weighted(problem)
    np.testing.assert_array_equal(estimate.values, least.values)
    np.testing.assert_allclose(estimate.covariance, least.covariance, rtol=1e-6)
    assert estimate.active == ()
    assert estimate.rise == 0.0


def test_consistent_is_the_minimum_under_its_constraints():
    """Kuhn and Tucker: the gradient pushes against active constraints alone, and outwards."""
    problem = synthetic(sizes=(0.3, 0.3))
    estimate = consistent(problem, positive(problem))
    assert estimate.active == ('b',)
    assert estimate.values[1] == 0.0
    assert estimate.std[1] == pytest.approx(0.0, abs=1e-9)
    assert np.all(estimate.values >= 0.0)
    part, = problem.series
    weight = part.valid / estimate.least_squares.rms ** 2
    gradient = -np.einsum('mjp,mj->p', part.columns, estimate.residuals[0] * weight)
    size = np.abs(np.einsum('mjp,mj->p', np.abs(part.columns), np.abs(part.target) * weight))
    assert gradient[1] > 0.01 * size[1]
    # the weights are those before the last round's residual: equal to a percent
    np.testing.assert_allclose(gradient[[0, 2]], 0.0, atol=1e-3 * size.max())
    assert estimate.rise > 0.1
    # the others are those of a problem that never had the second column
    without = [0, 2]
    less = problem_of([Series(part.target, part.columns[..., without], part.valid)], 'ac',
                      ('m', 'kg'))
    np.testing.assert_allclose(estimate.values[without], weighted(less).values, rtol=0.05)


def test_deviations_hold_beside_an_active_constraint():
    """The second value is truly zero: where it is held there, the others have z-scores of unit
    spread.
    """
    scores = []
    for seed in range(150):
        columns, noise, valid = rows_of(np.random.default_rng(seed))
        problem = problem_of([Series(columns @ (1.0, 0.0, 0.5) + noise, columns, valid)], 'abc',
                             'abc')
        estimate = consistent(problem, positive(problem))
        if estimate.active:
            assert estimate.active == ('b',)
            scores.append((estimate.values - (1.0, 0.0, 0.5))[[0, 2]] / estimate.std[[0, 2]])
    assert 50 < len(scores) < 100
    assert 0.85 < np.std(scores) < 1.2
    assert abs(np.mean(scores)) < 0.25


def test_a_light_half_plate_stays_positive():
    """Near-singular data of a platform without mass of its own: least squares goes below zero."""
    light = replace(TABLE_1, values={**TABLE_1.values, 'platform_mass_1': np.full(4, 0.002)})
    negative = 0
    for seed in range(6):
        log = log_of_model(REFERENCE, light, seed=seed, noise=5.0, duration=4.0)
        problem, _ = problem_of_log(log)
        constraints = physical_constraints(problem.labels, REFERENCE, 'paper')
        estimate = consistent(problem, constraints)
        free = estimate.least_squares.values[1]
        negative += free < 0.0
        assert (estimate.active == ('platform_mass_1',)) == (free < 0.0)
        assert np.all(estimate.values[[0, 1, 2, 4, 5]] >= 0.0)
        assert 0.0 <= estimate.rise < 0.01
    assert negative > 0


def test_full_mechanism_keeps_its_bodies_positive():
    labels = problem_of_log(log_of_table_1(REFERENCE, 4))[0].labels
    lower = {item.name: item.lower
             for item in physical_constraints(labels, REFERENCE, 'full')}
    rod, bar = REFERENCE.bodies.rod_mass, REFERENCE.bodies.bar_mass
    assert lower == {
        'motor_and_arm_inertia': pytest.approx(rod * REFERENCE.geometry.arm_length ** 2),
        'half_plate_1_mass': bar + 2.0 * rod, 'half_plate_2_mass': bar + 2.0 * rod,
        'coulomb_friction': 0.0, 'viscous_friction': 0.0}


def test_full_mechanism_counts_the_arm_of_each_leg():
    geometry = REFERENCE.geometry.model_copy(update={'arm_length_errors': (0.0, 0.02, 0.0, -0.01)})
    robot = REFERENCE.model_copy(update={'geometry': geometry})
    labels = [Label('actuator_inertia', 'kg m2'),
              *(Label('actuator_inertia', 'kg m2', leg) for leg in range(4))]
    shared, *own = (item.lower for item in physical_constraints(labels, robot, 'full'))
    needed = REFERENCE.bodies.rod_mass * np.array(geometry.arm_lengths) ** 2
    assert own == pytest.approx(needed.tolist())
    assert shared == max(needed)


@pytest.mark.parametrize('per_joint', [False, True])
def test_what_is_held_at_its_bounds_can_be_built(per_joint):
    """Rods that weigh more than the data say: all bounds of the bodies hold the values."""
    robot = REFERENCE.model_copy(update={
        'geometry': REFERENCE.geometry.model_copy(
            update={'arm_length_errors': (0.0, 0.02, 0.0, -0.01)}),
        'bodies': REFERENCE.bodies.model_copy(update={'rod_mass': 0.95})})
    found = identify([log_of_table_1(REFERENCE, 4)], robot, 'full',
                     fitting=Fitting('consistent', per_joint=per_joint))
    needed = 0.95 * np.array(robot.geometry.arm_lengths) ** 2
    assert np.array_equal(found.parameters['actuator_inertia'].value,
                          needed if per_joint else max(needed))
    model = build_model(robot, found.model_file({}))
    assert model.lumped_bodies().platform_mass_1 == robot.bodies.bar_mass + 2.0 * 0.95


def test_constraints_that_contradict_each_other_are_refused():
    problem = synthetic()
    row = np.eye(3)[0]
    with pytest.raises(InputError, match='no values meet the constraints'):
        consistent(problem, [Constraint('least', row, 2.0), Constraint('most', -row, -1.0)])


def test_values_of_each_output_and_offsets_come_back():
    columns, noise, valid = rows_of(np.random.default_rng(5))
    own, offset = np.array(((1.0, -2.0, 0.5), (1.0, 3.0, 0.5))), np.array((0.7, -0.4))
    target = np.einsum('mjp,jp->mj', columns, own) + offset + noise
    shared = problem_of([Series(target, columns, valid)], 'abc', ('m', 's', 'kg'))
    problem = with_offsets(per_output(shared, {'b'}), 'offset', 'N m')
    assert [str(label) for label in problem.labels] == ['a', 'b[0]', 'b[1]', 'c', 'offset[0]',
                                                        'offset[1]']
    assert problem.labels[2].unit == 's'
    for estimator in (ordinary, weighted, robust):
        estimate = estimator(problem)
        assert np.all(np.abs(estimate.values - (1.0, -2.0, 3.0, 0.5, 0.7, -0.4))
                      < 4.0 * estimate.std)
    with pytest.raises(InputError, match='no column x; there are a, b, c'):
        per_output(shared, {'x'})
    with pytest.raises(InputError, match='3 columns with 2 names'):
        problem_of([Series(target, columns, valid)], 'ab', 'abc')


def test_per_output_of_everything_is_a_problem_an_output():
    problem = synthetic(6)
    part, = problem.series
    together = ordinary(per_output(problem, 'abc')).values.reshape(3, 2)
    for output in range(2):
        alone = problem_of([Series(part.target[:, [output]], part.columns[:, [output]],
                                   part.valid[:, [output]])], 'abc', 'abc')
        np.testing.assert_allclose(together[:, output], ordinary(alone).values, rtol=1e-9)


JOINTS = {'actuator_inertia': (0.113, 0.12, 0.105, 0.118), 'arm_gravity': (1.3, 1.5, 1.1, 1.4),
          'coulomb_friction': (2.4, 1.9, 3.0, 2.2), 'viscous_friction': (2.0, 2.3, 1.7, 2.1)}
OFFSETS = (0.4, -0.3, 0.2, -0.5)


@pytest.fixture(scope='module')
def unequal():
    """Return the model of a machine of unequal joints, and a log of it with its reference."""
    model = model_with(replace(TABLE_1, values={
        **TABLE_1.values, **{name: np.array(value) for name, value in JOINTS.items()}}),
        'torque_offset', offset=OFFSETS)
    log, motion = log_of_model(REFERENCE, model, seed=7), excitation('reference', 10.0, 7)
    return model, replace(log, reference=Reference(DWELL + motion.t, motion.q, motion.qd,
                                                   motion.qdd))


@pytest.mark.parametrize('estimator', ESTIMATORS)
def test_every_estimator_finds_values_of_each_joint_and_offsets(estimator, unequal):
    """A machine of unequal joints comes back, and the model that is written says its torque."""
    true, log = unequal
    found = identify([log], REFERENCE, fitting=Fitting(estimator, per_joint=True, offsets=True))
    for name, value in {**true.values, 'torque_offset': OFFSETS}.items():
        parameter = found.offsets if name == 'torque_offset' else found.parameters[name]
        value = value if isinstance(parameter.value, tuple) else np.mean(value)
        np.testing.assert_allclose(parameter.value, value, rtol=1e-3,
                                   atol=4.5 * np.max(parameter.std), err_msg=name)
    assert found.estimate.condition_number > found.excitation
    model, state = build_model(REFERENCE, found.model_file({})), found.runs[0].state
    residual = found.runs[0].tau - found.runs[0].rows(model.torque(state))
    np.testing.assert_allclose(residual, found.estimate.residuals[0], atol=1e-9)


def test_values_of_each_joint_tell_which_one_is_impossible():
    driving = replace(TABLE_1, values={**TABLE_1.values, 'viscous_friction': np.array(
        (2.0, 2.0, -0.5, 2.0))})
    log = log_of_table_1(REFERENCE, 7)
    run, = runs_of_log(log, REFERENCE)
    target = run.rows(driving.torque(run.state))
    found = identify_runs([run], [target], [run.rows(base_columns(run.state))], 'paper',
                          Fitting(per_joint=True))
    with pytest.raises(InputError, match='viscous_friction of joint 2 identified as -0.5'):
        found.model_file({})


def test_executable_says_whether_least_squares_is_biased(tmp_path):
    """A bag with noisy positions; instruments come back to the machine, the file says why."""
    motion = named_motion('excitation', REFERENCE, 8.0, 0)
    simulation = build_simulation(REFERENCE, TABLE_1, 'exact', position_noise=8e-4)
    simulate_to_bag(simulation, motion, REFERENCE, tmp_path / 'bag')
    for estimator in ('instrumental', 'consistent'):
        identify_bags.main(
            [str(tmp_path / 'bag'), '--robot', 'reference', '--estimator', estimator, '--output',
             str(tmp_path / estimator), '--no-report'], standalone_mode=False)
    content, plain = (json.loads((tmp_path / name / 'identification.json').read_text())
                      for name in ('instrumental', 'consistent'))
    said = content['estimator']
    assert said['name'] == 'instrumental'
    assert said['bias_of_least_squares']['material'] is True
    assert said['bias_of_least_squares']['p_value'] < 1e-3
    assert said['bias_of_least_squares']['difference']['platform_mass_1'] == pytest.approx(
        plain['parameters']['platform_mass_1']['value']
        - content['parameters']['platform_mass_1']['value'], rel=0.2)
    for name, parameter in content['parameters'].items():
        assert abs(parameter['value'] - TABLE_1.values[name][0]) < 4.0 * parameter['std']
    assert plain['estimator']['active_constraints'] == []


def test_report_says_what_the_estimator_found():
    log = noisy_log(0, 6e-4)
    for estimator, said in (('instrumental', 'Least squares is biased: .*platform mass 1 by -0.0'),
                            ('robust', 'of the rows contradict the others'),
                            ('consistent', 'Physics changes nothing')):
        found = identify([log], REFERENCE, fitting=Fitting(estimator))
        remark, = estimator_remarks(found, REFERENCE)
        assert re.search(said, remark.text)
        assert IN_WORDS[estimator] in estimator_in_words(found)
    assert estimator_remarks(identify([log], REFERENCE), REFERENCE) == ()
    exact = noisy_log(0, 0.0)
    remark, = estimator_remarks(identify([exact], REFERENCE, fitting=Fitting('instrumental')),
                                REFERENCE)
    assert remark.good


def test_long_run_covariance_of_first_order_noise():
    """Var(sum) / n of an autoregression of unit variance is (1 + a) / (1 - a)."""
    series = [coloured(np.random.default_rng(seed), (2000, 1), 0.6) for seed in range(20)]
    assert long_run_covariance(series)[0, 0] / 40000 == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize('estimator', [ordinary, weighted, robust])
def test_data_that_say_nothing_are_refused(estimator):
    problem = synthetic()
    part, = problem.series
    few = replace(part, valid=part.valid & (np.arange(len(part.valid)) < 5)[:, None])
    with pytest.raises(InputError, match='usable rows for 3 parameters'):
        estimator(replace(problem, series=(few,)))
    blind = replace(part, columns=part.columns * (1.0, 0.0, 1.0))
    with pytest.raises(InputError, match='b does not show in the data'):
        estimator(replace(problem, series=(blind,)))
    twice = replace(part, columns=part.columns[..., [0, 1, 1]])
    with pytest.raises(InputError, match='does not tell the parameters apart'):
        estimator(replace(problem, series=(twice,)))
