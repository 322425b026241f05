"""The restitution of a shot: from the flight to the second landing, or an entered height."""

from __future__ import annotations

import dataclasses
import math

from analysis import restitution_from_bounce, with_bounces
from analysis.bounce import restitution_from_rebound_height
from analysis.campaign import Campaign, Quantity, Shot
from analysis.fit.result import FitResult
from analysis.fit.shot_fit import RESTITUTION_DISAGREES_ABOVE
from impactd.aliases import Json
from impactd.storage.shot_metadata import ShotMetadata

_FIRST_LANDING_ONLY = ("release_speed_bias", "recontact")
"""Effects of the release and of a second touch: a bounce has neither."""


def with_later_landings(campaign: Campaign, model: str, definition: Json | None = None) -> Campaign:
    """Return what a joint fit fits: later landings are shots, too, where the model describes them.

    Daemon and terminal fit the same, so that shots and their export give the same number.

    Parameters
    ----------
    definition : dict or None
        Of a named model.
    """
    said = f"{model} {definition}"
    if any(effect in said for effect in _FIRST_LANDING_ONLY):
        return campaign
    return with_bounces(campaign)


def with_restitution(shot: Shot, metadata: ShotMetadata, rebound_height_m: Json | None) -> Shot:
    """Return a shot with its restitution: as imported, from the flight, else from the height.

    ``rebound_height_m`` has ``value`` and ``u`` as somebody entered them. The shot is unchanged
    where nothing is known.
    """
    speed = metadata.impact_speed_m_per_s
    if shot.restitution is not None or speed is None:
        return shot
    flight = restitution_from_bounce(
        shot.signal,
        shot.sample_rate_hz,
        shot.trigger_index,
        impact_speed_m_per_s=speed,
        impact_speed_u_m_per_s=speed * (metadata.speed_repeatability or 0.0),
        gravity_m_per_s2=metadata.gravity_m_per_s2,
    )
    return dataclasses.replace(shot, restitution=flight or _by_height(metadata, rebound_height_m))


def _by_height(metadata: ShotMetadata, rebound_height_m: Json | None) -> Quantity | None:
    if rebound_height_m is None or metadata.drop_height_m is None:
        return None
    return restitution_from_rebound_height(
        Quantity(**rebound_height_m),
        metadata.drop_height_m,
        speed_repeatability=metadata.speed_repeatability or 0.0,
    )


def check_rebound(metadata: ShotMetadata, rebound_height_m: Json | None, result: FitResult) -> Json:
    """Return ``rebound_height_check`` and ``flags``: an entered height against the shot's fit.

    Empty where no height was entered.
    """
    by_height = _by_height(metadata, rebound_height_m)
    if by_height is None or not result.shots:
        return {}
    shot = result.shots[0]
    pull = shot.restitution_pull
    if shot.item.shot.restitution != by_height:  # the flight was used, the height is independent
        u = math.hypot(by_height.u, shot.u_seen_ratio)
        pull = (by_height.value - shot.rebound_ratio) / u
    disagrees = pull is not None and abs(pull) > RESTITUTION_DISAGREES_ABOVE
    return {
        "rebound_height_check": {
            "by_height": dataclasses.asdict(by_height),
            "fitted": shot.rebound_ratio,
            "difference_in_u": pull,
        },
        "flags": ["rebound_height_disagrees"] if disagrees else [],
    }
