"""A torque that lags and one that is stamped late are told apart by their second order in time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hidden.scenario import Task, record_scenario
from hidden.study import diagnosis_of
from planned import evidence_of, log_of
from short_scenarios import short_scenario

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_platform
from par4_identification.diagnosis.evidence.dithered import DRAWS, Dithered, dithered
from par4_identification.diagnosis.evidence.evidence import gather
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import with_nominal
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.evidence.unnamed import Kinds
from par4_identification.diagnosis.evidence.whitener import flat_whitener
from par4_identification.diagnosis.search.candidates import Candidates
from par4_identification.diagnosis.search.lag_or_delay import obeys
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.verdict.judgement import judge
from par4_kinematics.workspace import home_pose
from robots import OTHER, REFERENCE, other_model, without_coulomb

ROBOTS = {'reference': (REFERENCE, read_model('table1', REFERENCE)),
          'other': (OTHER, other_model())}
EVERY = (0, 1, 2, 3)
PERIOD = 1e-3
TIME = 4e-3
"""s; some ms is what amplifiers lag and recorders miss."""


def waves(robot, t):
    """Return the state at times t of a motion of many frequencies, all known in closed form."""
    size = np.array((0.05, 0.05, 0.04, 0.3))
    x, xd, xdd = (np.tile(part, (len(t), 1)) for part in (home_pose(robot), np.zeros(4),
                                                          np.zeros(4)))
    random = np.random.default_rng(4)
    for frequency in (0.3, 0.9, 1.7, 3.1, 5.3, 7.9):
        rate = 2.0 * np.pi * frequency * random.uniform(0.9, 1.1, 4)
        angle = rate * t[:, None] + random.uniform(0.0, 2.0 * np.pi, 4)
        own = size * random.uniform(0.5, 1.0, 4) / (1.0 + frequency ** 1.5)
        x += own * np.sin(angle)
        xd += own * rate * np.cos(angle)
        xdd -= own * rate ** 2 * np.sin(angle)
    return state_of_platform(robot.geometry, t, x, xd, xdd)


def asked(robot, model, t, law, time):
    """Return the torque recorded at t: that of `time` earlier, or what a lag asks for."""
    if law == 'time_offset':
        return model.torque(waves(robot, t - time))
    step = 1e-4  # asked = delivered + T d(delivered)/dt
    rate = (model.torque(waves(robot, t + step)) - model.torque(waves(robot, t - step))) / (
        2.0 * step)
    return model.torque(waves(robot, t)) + time * rate


class Case:
    """A record of a torque at another time, its rows and what counts make of its motion."""

    def __init__(self, which, law, time=TIME, counts=None, noise=0.05, seed=3):
        robot, model = ROBOTS[which]
        if counts is not None:
            robot = robot.model_copy(update={
                'drives': robot.drives.model_copy(update={'encoder_counts': counts})})
        model, t = without_coulomb(model), np.arange(0.0, 8.0, PERIOD)
        turn = 2.0 * np.pi / robot.drives.encoder_counts
        q = turn * np.round(waves(robot, t).q / turn)
        log = log_of(robot, t, q, asked(robot, model, t, law, time), seed, noise)
        evidence = evidence_of(log, robot, model, noise)
        self.projection = project(evidence, [])
        self.dithered = dithered(evidence.observations).with_nominal(model)

    def hypothesis(self, name):
        """Return an effect with the time that fits, and that time."""
        effect = CATALOGUE[name]
        hypothesis = Hypothesis(effect, {}, EVERY)
        if effect.expanded:
            hypothesis = replace(hypothesis, shape={'expanded_at': 0.0})
            for _ in range(4):
                time = float(self.projection.estimate(hypothesis.effect, hypothesis.shape)[0])
                hypothesis = replace(hypothesis, shape={'expanded_at': time})
        return hypothesis, float(self.projection.estimate(hypothesis.effect, hypothesis.shape)[0])

    def obeys(self, name, against=None):
        """Return whether the record has the second order of that effect."""
        return obeys(against or self.dithered, self.projection, *self.hypothesis(name))


OTHER_LAW = {'actuator_lag': 'time_offset', 'time_offset': 'actuator_lag'}


@pytest.mark.parametrize('which', ROBOTS)
@pytest.mark.parametrize(('law', 'time'), [
    ('actuator_lag', TIME), ('time_offset', TIME), ('time_offset', -TIME)])
def test_only_the_true_law_is_obeyed(which, law, time):
    case, other = Case(which, law, time), OTHER_LAW[law]
    # to first order both fit, the other with the opposite sign
    assert case.hypothesis(law)[1] == pytest.approx(time, rel=0.02)
    assert case.hypothesis(other)[1] == pytest.approx(-time, rel=0.05)
    assert case.obeys(law)
    assert not case.obeys(other)


@pytest.mark.parametrize('seed', [1, 2, 3])
@pytest.mark.parametrize('law', OTHER_LAW)
def test_what_encoder_counts_do_to_the_columns_is_taken_out(law, seed):
    """Without it errors of the torque's rates pass for a second order that is not there."""
    case = Case('reference', law, 0.5 * TIME, counts=40_000, seed=seed)
    unmoved = Dithered((case.projection.evidence.observations,) * DRAWS)
    assert case.obeys(law)
    assert not case.obeys(OTHER_LAW[law])
    assert not case.obeys(law, unmoved)


@pytest.mark.parametrize('seed', [1, 2, 3])
@pytest.mark.parametrize('law', OTHER_LAW)
def test_what_noise_hides_is_held_against_nobody(law, seed):
    case = Case('reference', law, 0.25e-3, noise=0.5, seed=seed)
    assert case.obeys(law)
    assert case.obeys(OTHER_LAW[law])


@pytest.mark.parametrize(('counts', 'twins'), [(20_000, ('actuator_lag',)), (None, ())])
def test_laws_that_counts_hide_are_twins_whatever_the_first_order_prefers(counts, twins):
    """What counts do to the columns speaks for one of the laws by hundreds or thousands."""
    case, heldout = (Case('reference', 'time_offset', -1.5e-3, counts, seed=seed)
                     for seed in (3, 4))
    names = ('actuator_lag', 'time_offset')
    laws = [case.hypothesis(name)[0] for name in names]
    gains = [case.projection.gain(law.effect, law.shape) for law in laws]
    assert abs(gains[1] - gains[0]) > 10.0 * Rules().twin
    evidence = case.projection.evidence
    search = Search(Candidates({name: CATALOGUE[name] for name in names}, evidence, Rules()),
                    Pool(evidence, heldout.projection.evidence), Rules(), case.dithered,
                    Kinds(evidence.observations))
    offset = case.hypothesis('time_offset')[0]
    assert judge(search, offset, (offset,)).twins == twins


def test_a_lag_of_a_torque_that_is_nothing_breaks_no_law():
    """Base parameters that all come out negative are none; the equations were singular then."""
    observations = Case('reference', 'actuator_lag').projection.evidence.observations
    model = ROBOTS['reference'][1]
    nothing = replace(model, values={name: np.full(4, 1e-190) for name in model.values})
    rows = with_nominal(observations, nothing)
    projection = project(gather(rows, flat_whitener(rows, np.ones(4))), [])
    with np.errstate(invalid='raise', divide='raise'):
        assert obeys(dithered(rows).with_nominal(nothing), projection,
                     Hypothesis(CATALOGUE['actuator_lag'], {}, EVERY), TIME)


def test_nothing_is_held_against_anybody_where_counts_are_not_known():
    case = Case('reference', 'actuator_lag')
    assert case.obeys('time_offset', Dithered())
    observations = case.projection.evidence.observations
    assert len(dithered(observations).draws) == DRAWS
    unknown = replace(observations, runs=tuple(
        replace(run, counts=0) for run in observations.runs))
    assert dithered(unknown).draws == ()


def test_draws_are_seeded_and_move_by_the_noise_of_a_count():
    """Uniform over a count before the positions' filter, which lets its band of it through."""
    observations = Case('reference', 'actuator_lag').projection.evidence.observations
    one, again, another = (dithered(observations, seed) for seed in (1, 1, 2))
    count = 2.0 * np.pi / REFERENCE.drives.encoder_counts
    conditioning = observations.runs[0].conditioning
    expected = count / np.sqrt(12.0) * np.sqrt(2.0 * conditioning.position_cutoff_hz * PERIOD)
    for draw, same, different in zip(one.draws, again.draws, another.draws):
        change = draw.runs[0].state.q - observations.runs[0].state.q
        assert np.std(change) == pytest.approx(expected, rel=0.1)
        np.testing.assert_array_equal(draw.runs[0].state.q, same.runs[0].state.q)
        assert np.any(draw.runs[0].state.q != different.runs[0].state.q)


@pytest.mark.parametrize(('effect', 'seed', 'parameter'), [
    ('actuator_lag', 30043, 'time_constant'), ('time_offset', 30039, 'delay')])
def test_the_diagnosis_names_the_true_law(effect, seed, parameter):
    scenario = short_scenario(Task('single', seed, effect, False))
    diagnosis = diagnosis_of(scenario, *record_scenario(scenario))
    assert [cause.effect.name for cause in diagnosis.causes] == [effect]
    assert diagnosis.causes[0].twins == ()
    assert diagnosis.verdict == 'explained'
    found = diagnosis.causes[0].parameters[parameter].value
    assert found == pytest.approx(float(scenario.hidden[0][1][parameter]), rel=0.02)
