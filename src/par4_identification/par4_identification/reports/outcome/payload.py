"""An unknown payload in words and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from par4_identification.gains.unknown_payload import WeighedPayload
from par4_sim.report.outcome import Remark
from par4_sim.report.results import plain
from par4_sim.report.words import listed, number, with_std

_PLACES = {1: 'half plate 1 (D, the tool)', 2: "half plate 2 (D')"}


def payload_remark(payload: WeighedPayload, bags: Sequence[str]) -> Remark:
    """Return what the bags with an unknown payload carry."""
    carry = f'{listed(list(bags))} {"carries" if len(bags) == 1 else "carry"}'
    mass = f'{" ± ".join(with_std(payload.mass, payload.std))} kg'
    if not payload.is_seen:
        return Remark(True, f'{carry} no payload that shows: {mass}.')
    if payload.mass < 0.0:
        return Remark(False, f'{carry} {mass}: less than the other bags.',
                      'Check which bags were recorded with the payload.')
    if payload.on_both:
        halves = listed([f'{" ± ".join(with_std(float(value), math.sqrt(variance)))} kg on '
                         f'{_PLACES[half]}' for half, value, variance in zip(
                             (1, 2), payload.halves, payload.covariance.diagonal(), strict=True)])
        return Remark(False, f'{carry} {mass} on both half plates, {halves}; or something else '
                             f'changed between the bags.')
    if payload.half is None:
        return Remark(False, f'{carry} {mass}; the motion does not tell which half plate (half '
                             f'{payload.likelier_half} with probability '
                             f'{number(payload.confidence, 2)}).',
                      'Record both bags with faster and longer motions that turn theta.')
    chance = 1.0 - payload.confidence
    return Remark(True, f'{carry} {mass} on {_PLACES[payload.half]}; the probability of the other '
                        f'half is {number(chance, 1) if chance > 1e-9 else "below 1e-9"}.')


def payload_json(payload: WeighedPayload, bags: Sequence[str]) -> dict[str, Any]:
    """Return the payload as a field of `identification.json`."""
    return plain({
        'bags': list(bags), 'mass': {'value': payload.mass, 'std': payload.std, 'unit': 'kg'},
        'half': payload.half, 'on_both': payload.on_both, 'seen': payload.is_seen,
        'likelier_half': payload.likelier_half, 'confidence': payload.confidence,
        'log_likelihood_ratio': payload.log_likelihood_ratio,
        'halves': {'value': payload.halves, 'covariance': payload.covariance}})
