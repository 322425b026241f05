r"""Later bounces of one record as shots of their own, at lower and well known speeds.

.. math:: v_i = g T_i / 2, \quad r_i = T_{i+1} / T_i

T_i is the flight before the i-th landing. The sphere lands as fast as it left, so no height and no
release is needed: a bounce's speed is known to the timing of the record.
"""

from __future__ import annotations

import dataclasses
import math

from analysis.bounce import (
    AIR_RELATIVE_U,
    CONTACT_RELATIVE_U,
    LARGEST_RATIO,
    Landing,
    landings,
)
from analysis.campaign import Campaign, Quantity, Shot

LEAST_SHARE = 0.05
"""Of the first impact's height; smaller bounces add more noise than knowledge."""
MOST_BOUNCES = 3
SETTLED_S = 5e-3
"""After so long the ring of the landing before is gone."""
LONGEST_BEFORE_S = 20e-3
LEAST_BEFORE_S = 1e-3
AFTER_S = 5e-3


def _flight_s(before: Landing, after: Landing, rate_hz: float) -> Quantity:
    contact = before.width_samples / rate_hz
    time = (after.onset_index - before.onset_index) / rate_hz - contact
    return Quantity(time, math.hypot(CONTACT_RELATIVE_U * contact, 1.0 / rate_hz))


def _ratio(one: Quantity, two: Quantity) -> Quantity:
    """Return two / one with its uncertainty; air slows both flights alike and mostly cancels."""
    value = two.value / one.value
    return Quantity(value, value * math.hypot(one.u / one.value, two.u / two.value, AIR_RELATIVE_U))


def _chain(shot: Shot) -> list[Landing]:
    """Return the landings up to the first that cannot be the next bounce."""
    found = list(landings(shot.signal, shot.sample_rate_hz, shot.trigger_index))
    kept = found[:2]
    for i in range(2, len(found)):
        ratio = _ratio(
            _flight_s(found[i - 2], found[i - 1], shot.sample_rate_hz),
            _flight_s(found[i - 1], found[i], shot.sample_rate_hz),
        ).value
        by_height = (found[i].height / found[i - 1].height) ** (1 / 1.2)
        if not 0 < ratio <= LARGEST_RATIO or not 0.4 * ratio < by_height < 2.5 * ratio + 0.05:
            break
        kept.append(found[i])
    return kept


def bounce_shots(shot: Shot, gravity_m_per_s2: float) -> tuple[Shot, ...]:
    """Return the later landings of a record as shots.

    Returns
    -------
    tuple of Shot
        In order of time, at most three; each with its impact speed, the restitution where the next
        landing is in the record too, and a part of the record around it. Empty where the record
        is short, clipped, or of no known pair.

    Notes
    -----
    Source: ballistic flight between contacts. A landing that the flight before does not explain
    ends the chain. Validation: ``tests/analysis/test_bounce_shots.py``.
    """
    if shot.clipped or shot.sphere is None or shot.surface is None:
        return ()
    rate = shot.sample_rate_hz
    found = _chain(shot)
    made: list[Shot] = []
    for i in range(1, min(len(found), MOST_BOUNCES + 1)):
        landing, flight = found[i], _flight_s(found[i - 1], found[i], rate)
        first = max(
            landing.onset_index - round(LONGEST_BEFORE_S * rate),
            found[i - 1].onset_index + round(SETTLED_S * rate),
        )
        last = landing.onset_index + round(AFTER_S * rate)
        if (
            landing.height < LEAST_SHARE * found[0].height
            or landing.onset_index - first < LEAST_BEFORE_S * rate
            or last > shot.signal.size
        ):
            break
        speed = gravity_m_per_s2 * flight.value / 2
        after = found[i + 1] if i + 1 < len(found) else None
        made.append(
            dataclasses.replace(
                shot,
                name=f"{shot.name}, bounce {i}",
                signal=shot.signal[first:last],
                trigger_index=landing.onset_index - first,
                drop_height_m=None,
                impact_speed_m_per_s=Quantity(
                    speed, speed * math.hypot(flight.u / flight.value, AIR_RELATIVE_U)
                ),
                restitution=None
                if after is None
                else _ratio(flight, _flight_s(landing, after, rate)),
            )
        )
    return tuple(made)


def with_bounces(campaign: Campaign) -> Campaign:
    """Return the campaign with the later bounces of its records as further shots.

    Returns
    -------
    Campaign
        Each record followed by its bounces.
    """
    shots = tuple(
        one
        for shot in campaign.shots
        for one in (shot, *bounce_shots(shot, campaign.gravity_m_per_s2))
    )
    return dataclasses.replace(campaign, shots=shots)
