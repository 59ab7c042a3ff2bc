"""Joints exchanged, signs reversed: which reading belongs to which joint, counted which way.

Joint i of the machine is read as joint P(i), times a sign, for positions and torques each. Given
the positions, all orders and signs of the torques cost nothing: the moments W_i^T tau_j of every
pair are computed once, and a hypothesis adds four of them. Orders and signs of the positions move
the platform, so each of them needs its own W. Renaming all joints by a mirror image of the
mechanism changes nothing but the names of the half plates; of such equals the smallest change of
the setup is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from par4_identification.setup_check.equations import (
    Equations,
    Stretch,
    equations_of,
    is_physical,
)
from par4_identification.setup_check.finding import Finding
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import Geometry
from par4_kinematics.position import closes
from par4_sim.report.words import listed, percent

SUSPICIOUS = 0.07
"""|residual| / |torque| in motion below which no plug can be wrong."""
FEWER = 0.45
"""Most of that error that another wiring may leave."""
UPSIDE_DOWN = 0.4
"""Most of the unexplained share of the torque that counting all angles the other way may leave, if
it explains the motion hardly better: gravity tells up from down, and the motion does not."""
LARGEST_ERROR = 0.35
"""Error in motion of a wiring that is believed."""
ALIKE = 1.3
"""Ratio of errors within which two wirings explain alike, so that the smaller change is told."""
VISIBLE = 0.01
"""Difference of what two wirings explain that tells them apart in words."""
ROWS = 800
"""Rows on which orders and signs of the positions are tried."""
PROBED = 40
"""Samples on which it is first tried whether the mechanism closes."""
MOST_OPEN = 0.02
"""Share of samples that may not close with the right wiring."""


@dataclass(frozen=True)
class Plugs:
    """How readings are plugged: joint i is what was read as joint order[i], times signs[i]."""

    order: tuple[int, ...]
    signs: tuple[int, ...]


@dataclass(frozen=True)
class Wiring:
    """What is read as what."""

    positions: Plugs
    torques: Plugs

    @property
    def changes(self) -> int:
        """Number of readings that change their joint or sign; a common sign counts as one."""
        return sum(sum(place != index for index, place in enumerate(plugs.order))
                   + (1 if set(plugs.signs) == {-1} else plugs.signs.count(-1))
                   for plugs in (self.positions, self.torques))


@dataclass(frozen=True)
class Judged:
    """A wiring and its error in motion."""

    wiring: Wiring
    error: float


def right_wiring(joints: int) -> Wiring:
    """Return the wiring in which everything is in its place."""
    plain = Plugs(tuple(range(joints)), (1,) * joints)
    return Wiring(plain, plain)


def believed_wiring(stretches: Sequence[Stretch], geometry: Geometry | None,
                    now: Equations | None) -> Wiring | None:
    """Return the wiring that explains the data decisively better than the present one, or None.

    Args:
        stretches: of the logs.
        geometry: dimensions; None for a single axis.
        now: rows of the present wiring; None where the mechanism does not close with it.
    """
    joints = stretches[0].q.shape[1]
    fit = None if now is None else now.fit()
    if fit is not None and fit.physical and fit.error < SUSPICIOUS:
        return None
    present = 1.0 if fit is None or not fit.physical else fit.error
    samples = sum(len(part.t) for part in stretches)
    thin = [part.thinned(max(1, samples // ROWS)) for part in stretches]
    judged = []
    for positions in _wirings_of_positions(joints):
        turned = [part.rewired(positions.order, positions.signs) for part in thin]
        if geometry is not None and not _may_close(turned, geometry):
            continue
        try:
            rows = equations_of(turned, geometry, filtered=False)
        except UnreachableError:
            continue
        judged += [Judged(Wiring(positions, torques), error)
                   for torques, error in _wirings_of_torques(rows)]
    if not judged:
        return None
    least = min(item.error for item in judged)
    chosen = min((item for item in judged if item.error <= ALIKE * least),
                 key=lambda item: (item.wiring.changes, item.error))
    if chosen.wiring == right_wiring(joints):
        return None
    try:
        positions = chosen.wiring.positions
        full = equations_of([part.rewired(positions.order, positions.signs)
                             for part in stretches], geometry)
    except UnreachableError:
        return None
    torques = chosen.wiring.torques
    torque = np.asarray(torques.signs) * full.tau[:, list(torques.order)]
    fit = full.fit(torque)
    if not fit.physical or fit.error > LARGEST_ERROR:
        return None
    decisive = fit.error < FEWER * present or (
        now is not None and fit.error < present
        and 1.0 - full.explained(torque) < UPSIDE_DOWN * (1.0 - now.explained()))
    return chosen.wiring if decisive else None


def _wirings_of_positions(joints: int) -> Iterator[Plugs]:
    """Yield orders and signs of positions: one joint turned over, all, or two exchanged.

    A plug in a wrong socket exchanges two joints; three or four in a ring are tried too. Signs and
    orders together are not: nobody makes both mistakes at once, and the torques' may join them.
    """
    plain, straight = tuple(range(joints)), (1,) * joints
    yield Plugs(plain, straight)
    for signs in product((1, -1), repeat=joints):
        if -1 in signs:
            yield Plugs(plain, signs)
    for order in permutations(range(joints)):
        if order != plain:
            yield Plugs(order, straight)


def _may_close(stretches: Sequence[Stretch], geometry: Geometry) -> bool:
    """Return whether the mechanism closes with some of the samples."""
    q = np.concatenate([part.q for part in stretches])
    probes = q[::max(1, len(q) // PROBED)]
    return bool(np.mean(~closes(geometry, probes)) <= MOST_OPEN)


def _wirings_of_torques(rows: Equations) -> list[tuple[Plugs, float]]:
    """Return every order and sign of the torques that gives a machine, with its error."""
    joints = rows.tau.shape[1]
    targets = [rows.without_slack(rows.tau, joint) for joint in range(joints)]
    moments = np.array([columns.T @ target for columns, target in
                        zip(rows.moving_columns, targets)])  # (J, p, J): [i, :, j]
    powers = np.array([np.sum(target ** 2, axis=0) for target in targets])
    found = []
    inverse = np.linalg.pinv(rows.information, rcond=1e-10, hermitian=True)
    for order in permutations(range(joints)):
        own = moments[range(joints), :, order]
        power = float(powers[range(joints), order].sum())
        for signs in product((1, -1), repeat=joints):
            moment = np.asarray(signs) @ own
            left = power - moment @ inverse @ moment
            error = float(np.sqrt(max(left, 0.0) / max(power, 1e-30)))
            if is_physical(inverse @ moment):
                found.append((Plugs(order, signs), error))
    return found


def wiring_findings(wiring: Wiring, before: float | None, after: float, physical: bool,
                    of_axis: bool) -> list[Finding]:
    """Return what a wiring says, as findings.

    Args:
        wiring: that is believed.
        before, after: shares of the torque's squares that the rigid bodies explain; None where the
            mechanism does not close.
        physical: whether it takes no negative mass, inertia or friction to explain the former.
        of_axis: whether the machine is a single axis, whose positive angles may be either way.
    """
    if before is None:
        so_far = 'while so far the mechanism does not even close'
    elif physical or before < after - VISIBLE:
        so_far = f'instead of {percent(max(before, 0.0), 3)}'
    else:
        so_far = 'which so far only negative masses or friction do'
    gain = f'the rigid bodies explain {percent(max(after, 0.0), 3)} of the torque {so_far}'
    found = []
    exchanged = {name: tuple(joint for joint, place in enumerate(plugs.order) if place != joint)
                 for name, plugs in _named(wiring)}
    if any(exchanged.values()):
        what = ' and '.join(name for name, joints in exchanged.items() if joints)
        joints = tuple(sorted({joint for own in exchanged.values() for joint in own}))
        verb = 'exchanged' if len(joints) == 2 else 'in a wrong order'
        found.append(Finding(
            'joints_exchanged', joints, None,
            f'the {what} of joints {listed([str(joint) for joint in joints])} are {verb}; put '
            f'right, {gain}',
            'Correct the wiring, or the order of the names in the messages that carry the '
            f'{what}: ' + '; '.join(
                f'{name} named {", ".join(str(place) for place in plugs.order)} belong to '
                f'joints {", ".join(str(joint) for joint in range(len(plugs.order)))}'
                for name, plugs in _named(wiring) if exchanged[name]) + '.', True))
    turned = {name: tuple(joint for joint, sign in enumerate(plugs.signs) if sign < 0)
              for name, plugs in _named(wiring)}
    if any(turned.values()):
        same = wiring.positions.signs == wiring.torques.signs
        what = 'position and torque' if same else ' and '.join(
            name.removesuffix('s') for name, joints in turned.items() if joints)
        joints = tuple(sorted({joint for own in turned.values() for joint in own}))
        whose = ('all joints' if 1 < len(joints) == len(wiring.positions.order) else
                 f'joint{"s" if len(joints) > 1 else ""} '
                 f'{listed([str(joint) for joint in joints])}')
        found.append(Finding(
            'sign_reversed', joints, None,
            f'the {what} of {whose} {"have" if same else "has"} the wrong sign; turned over, '
            f'{gain}',
            f'Turn the sign of the {what} of {whose} over where the log is made; par4_bag does so '
            'where --columns has a minus before the unit, such as torque=2:-1Nm; '
            + ('' if of_axis else 'angles count downwards, ')
            + 'a positive torque drives a joint towards larger angles.', True))
    return found


def _named(wiring: Wiring) -> tuple[tuple[str, Plugs], ...]:
    return ('positions', wiring.positions), ('torques', wiring.torques)
