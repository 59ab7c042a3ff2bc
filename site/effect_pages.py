"""The pages of the effects: law, physics, a picture, what it is confused with, what to do.

Words come from the catalogue and its guide. Pictures and confusions are computed along the built-in
excitation of the reference robot, from the same effects that identification and diagnosis use.
"""

from __future__ import annotations

import inspect
import io
import re
from functools import cache

import numpy as np
from matplotlib.figure import Figure

from par4_dynamics import (
    CATALOGUE,
    Effect,
    EffectEntry,
    Model,
    Parameter,
    State,
    base_columns,
    build_model,
    read_model_file,
    state_of_joints,
)
from par4_dynamics.effects.catalogue import meaning_of
from par4_dynamics.effects.guide import GUIDES
from par4_kinematics import Robot, named_motion, read_robot

SECONDS, EVERY = 16.0, 10
"""Of the excitation, and samples from row to row."""
UNSEEN = 0.02
"""Part (rms) of a torque that is left beside the base parameters below which it is not seen."""
LEAST_SHARE = 0.5
"""Part of the visible torque that another effect must be able to make to be a confusion."""
MOST = 5
"""Confusions that are named."""
CURVE, POINTS = '#b3541e', 4000


@cache
def robot() -> Robot:
    """Return the machine of all pictures."""
    return read_robot('reference')


@cache
def motion() -> State:
    """Return the motion of all pictures."""
    path = named_motion('excitation', robot(), duration=SECONDS)
    return state_of_joints(robot().geometry, *(part[::EVERY] for part in (
        path.t, path.q, path.qd, path.qdd)))


def model_with(effect: Effect) -> Model:
    """Return the model of TABLE 1 with an effect of its usual size."""
    units = {parameter.name: parameter.unit for parameter in effect.parameters}
    parameters = {name: Parameter(value=value, unit=units[name])
                  for name, value in GUIDES[effect.name].usual.items()}
    content = read_model_file('table1').model_copy(update={
        'effects': (EffectEntry(effect=effect.name, parameters=parameters),)})
    return build_model(robot(), content)


@cache
def known() -> State:
    """Return the motion with the nominal torque of TABLE 1."""
    model = build_model(robot(), read_model_file('table1'))
    return State(**{**{name: getattr(motion(), name) for name in (
        't', 'q', 'qd', 'qdd', 'geometry', 'x', 'xd', 'xdd')}, 'nominal': model.nominal(motion())})


def torque_of(effect: Effect) -> np.ndarray:
    """Return the torque (n, 4), N m, of an effect of its usual size."""
    return model_with(effect).effects[0].torque(known())


@cache
def _base() -> np.ndarray:
    """Return an orthonormal base of what the base parameters can make, (4 n, p)."""
    columns = base_columns(known())
    return np.linalg.qr(columns.reshape(-1, columns.shape[-1]))[0]


def _visible(columns: np.ndarray) -> np.ndarray:
    """Return columns (4 n, k) without what the base parameters can make of them."""
    return columns - _base() @ (_base().T @ columns)


@cache
def searched() -> dict[str, Effect]:
    """Return the effects that add torque to a motion."""
    return {name: effect for name, effect in CATALOGUE.items()
            if name not in ('quantization', 'torque_saturation')}


@cache
def confusions() -> dict[str, list[tuple[str, float]]]:
    """Return for each effect which others can make how much of its visible torque.

    That is the share of squares that the other effect explains at its best shape, on all joints,
    beside the base parameters, along the excitation. Noise is left out, so that a share says what
    this motion can tell apart at best.
    """
    names = list(searched())
    torques = _visible(np.column_stack([torque_of(searched()[name]).ravel() for name in names]))
    squares = np.maximum((torques ** 2).sum(axis=0), 1e-30)
    shares = {name: np.zeros(len(names)) for name in names}
    for other, effect in searched().items():
        for shape in effect.shapes(known()):
            columns = effect.columns(known(), shape)
            if effect.shared:
                stacked = columns.reshape(-1, columns.shape[-1])
            else:
                stacked = np.einsum('njk,ji->njik', columns, np.eye(4)).reshape(
                    4 * len(columns), -1)
            made = np.linalg.qr(_visible(stacked))[0].T @ torques
            shares[other] = np.maximum(shares[other], (made ** 2).sum(axis=0) / squares)
    return {name: sorted(((other, float(shares[other][index])) for other in names
                          if other != name and shares[other][index] > LEAST_SHARE),
                         key=lambda pair: -pair[1])[:MOST]
            for index, name in enumerate(names)}


def visible_part(effect: Effect) -> float:
    """Return the part (rms) of an effect's torque that the base parameters cannot make."""
    torque = torque_of(effect).reshape(-1, 1)
    return float(np.linalg.norm(_visible(torque)) / np.linalg.norm(torque))


def picture(effect: Effect) -> bytes:
    """Return the torque of an effect on joint 0 over what it depends on, and over time, as SVG."""
    state, torque = known(), torque_of(effect)[:, 0]
    view = effect.signature(state)
    figure = Figure((8.0, 2.6), layout='constrained')
    over, beside = figure.subplots(1, 2, sharey=True)
    abscissa = np.asarray(view.abscissa)
    over.plot(abscissa[:POINTS, 0], torque[:POINTS], '.', color=CURVE, markersize=2.5)
    over.set_xlabel(view.label)
    over.set_ylabel('torque of joint 0, N m')
    beside.plot(state.t, torque, color=CURVE, linewidth=0.8)
    beside.set_xlabel('time, s')
    for axis in (over, beside):
        axis.grid(alpha=0.3)
    stream = io.BytesIO()
    figure.savefig(stream, format='svg', metadata={'Date': None})
    return stream.getvalue()


def page(effect: Effect) -> str:
    """Return the page of an effect in Markdown."""
    guide = GUIDES[effect.name]
    law, _, more = inspect.cleandoc(effect.__doc__ or '').partition('\n')
    rows = '\n'.join(f'| `{item.name}` | {meaning_of(item)} |' for item in effect.parameters)
    assumed = effect.assumes({item.name: np.asarray(item.default) for item in effect.parameters
                              if item.default is not None})
    lines = [f'# {effect.phrase[0].upper()}{effect.phrase[1:]}', '',
             f'`{effect.name}` in `model.yaml` and `diagnosis.json`.', '',
             '## Where it comes from', '', guide.physics, '',
             '## Its law', '', '```text', law, '```', '',
             *([more.strip(), ''] if more.strip() else []),
             '| parameter | unit and number |', '|---|---|', rows, '',
             *([assumed, ''] if assumed else [])]
    if effect.name in searched():
        usual = ', '.join(f'`{name}` {_shown(value)}' for name, value in guide.usual.items())
        lines += ['## What it looks like', '',
                  f'![torque of {effect.phrase}]({effect.name}.svg)', '',
                  f'Its torque on joint 0 of the reference robot along the built-in excitation, '
                  f'with {usual}.', '']
        lines += ['## What it is confused with', '', *_confused(effect)]
    else:
        lines += ['## In a diagnosis', '', 'It adds no torque to a motion, so that a diagnosis '
                  'does not search for it. A simulated machine may have it.', '']
    lines += ['## What to do at the machine', '', guide.remedy, '']
    return '\n'.join(lines)


def _confused(effect: Effect) -> list[str]:
    seen = visible_part(effect)
    if seen < UNSEEN:
        return ['The base parameters can make all of its torque: an identification takes it for '
                'part of them. It shows where the base parameters are known from before: '
                '[what has changed](../changes.md).', '']
    told = (f'The base parameters leave {100.0 * seen:.0f} % (rms) of its torque to be seen along '
            f'the built-in excitation.')
    found = confusions()[effect.name]
    if not found:
        return [f'{told} No other effect of the catalogue can make {LEAST_SHARE:.0%} of the '
                f'squares of that.', '']
    return [f'{told} These effects can make so much of the squares of that:', '',
            '| effect | part |', '|---|---|',
            *(f'| [{CATALOGUE[other].phrase}]({other}.md) | {100.0 * share:.0f} % |'
              for other, share in found), '',
            'Another motion may tell them apart: '
            '[the next experiment](../diagnosis.md#the-next-experiment).', '']


def _shown(value: float | tuple[float, ...]) -> str:
    return (re.sub(r'\s+', ' ', str(value)) if isinstance(value, tuple) else f'{value:g}')
