"""Searches on logs of planned motions with effects in their torque."""

from __future__ import annotations

from measured import excitation
from planned import evidence_of, log_of, state_of_motion

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.model_from_file import read_model
from par4_identification.diagnosis.evidence.dithered import Dithered
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.evidence.unnamed import Kinds
from par4_identification.diagnosis.search.candidates import Candidates
from par4_identification.diagnosis.search.first_look import first_look
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.search.swing import swing_in
from robots import REFERENCE, model_with

MODEL = read_model('table1', REFERENCE)
EVERY = (0, 1, 2, 3)
OFFSET = (0.3, -0.2, 0.25, 0.15)
TILT = {'about_x': 0.02, 'about_y': -0.015}
LOADED = ('load_dependent_friction', {'coefficient': 0.02})
DRIFT = {'drop': 0.5, 'time_constant': 4.0}
GAIN = {'relative': (0.05, -0.03, 0.02, -0.04)}
BELT = {'coulomb': 0.05, 'viscous': 0.01}
COGGING = {'amplitude': 0.3, 'periods': 31.0, 'phase': (0.0, 1.0, 2.0, 3.0)}
PRICE = 2.0 * Rules().price
"""Twice the log-likelihood that a damping ratio or a motor share must be worth."""


def log_with(*effects, seed=1, duration=12.0, beside=None):
    """Return the log of the reference robot that has effects, each a name and its values.

    `beside` is a torque (n, 4), N m, of the motion's state that no effect of the library is.
    """
    model = MODEL
    for name, values in effects:
        model = model_with(model, name, **values)
    motion = excitation('reference', duration, 900 + seed)
    state = state_of_motion(REFERENCE, motion)
    torque = model.torque(state) + (0.0 if beside is None else beside(state))
    return log_of(REFERENCE, motion.t, motion.q, torque, seed)


def search_of(*effects, library=(), beside=None, rules=None):
    """Return a search on logs with effects, whose library has some names only."""
    evidence, heldout = (
        evidence_of(log_with(*effects, seed=seed, duration=duration, beside=beside), REFERENCE,
                    MODEL)
        for seed, duration in ((1, 12.0), (2, 8.0)))
    return search_on(evidence, heldout, library, rules)


def search_on(evidence, heldout, library=(), rules=None):
    rules = rules or Rules()
    effects = {name: CATALOGUE[name] for name in library}
    return Search(Candidates(effects, evidence, rules), Pool(evidence, heldout), rules, Dithered(),
                  Kinds(evidence.observations))


def springs_in(projection, known=(), price=PRICE):
    """Return the transmissions that twist; None where a first look promises too little."""
    look = first_look(projection)
    if look.squares <= 2.0 * Rules().evidence:
        return None
    return swing_in(projection, look, price, known)


def cause(name, joints=EVERY, **shape):
    return Hypothesis(CATALOGUE[name], shape, joints)


def names(model):
    return [item.effect.name for item in model]
