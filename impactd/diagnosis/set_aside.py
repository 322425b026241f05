"""Shots that a diagnosis set aside, in words."""

from __future__ import annotations

from analysis import campaign
from impactd.aliases import Json


def set_aside(document: Json) -> list[Json]:
    """Return the shots that do not belong; none in documents from before they were looked for."""
    return document.get("set_aside") or []


def shot_words(one: Json) -> str:
    """Return how people know a shot that was set aside."""
    return campaign.shot_words(one["shot"], one["name"])


def likely_words(one: Json) -> str:
    """Return what a shot is most like, ``sphere acetal``; empty where nothing explains it."""
    like = one["likely"]
    parts = [f"{what} {like[what]}" for what in ("sphere", "surface") if what in like]
    if "drop_height_m" in like:
        parts.append(f"a drop from {1e3 * like['drop_height_m']:.3g} mm")
    if "gain" in like:
        parts.append(f"a gain of {like['gain']:.3g} of the others'")
    return ", ".join(parts)
