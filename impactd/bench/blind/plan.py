"""What a trial consists of, drawn from its kind and its seed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drivers.simulated.campaign import CampaignSettings
from drivers.simulated.draw import draw_effect, no_room_for
from drivers.simulated.drops import draw_drops
from drivers.simulated.effects import INVENTED, LIBRARY, Effect
from drivers.simulated.label_spread import EXACT, TYPICAL
from drivers.simulated.mistakes import Mistake, draw_mistake
from drivers.simulated.noise import NoiseSettings
from drivers.simulated.rig_model import DEFAULT_RIG, rig_model
from drivers.simulated.specimens import SPHERES, SURFACES
from impactd.bench.simulated_campaign import BASES

KINDS = ("clean", "library", "outside", "pair", "hsd", "mistake", "form")
"""Nothing, one known effect, one that no library knows, two known ones in different slots, a
clean rig that is diagnosed from the base model without a crystal, one with a mistake of people, and
one known effect whose law has another published form than in the other kinds. A kind's place is
part of what its trials are drawn from: a new one goes to the end."""
COLOURS = (("white", 0.0), ("ar1", 0.3), ("ar1", 0.6), ("pink", 0.0))
COLOUR_SHARES = (0.3, 0.3, 0.3, 0.1)
"""The last one is wrong noise: no autoregression of low order describes 1/f."""
RMS_V = (1e-3, 3e-3)
PINK_CORNER_HZ = (1e3, 3e4)
OTHER_SPHERES = ("acetal", "polypropylene", "hdpe", "ptfe")
"""Two of these fall beside the small acetal sphere, which brings the second radius."""
CHECKS = ("polycarbonate", "pvc", "ptfe")
"""One of these surfaces of stated modulus lies beside aluminium and the specimen."""
BITS = (16, 12, 8)
BITS_SHARES = (0.6, 0.2, 0.2)
"""Converters of a drawn rig; the two other rigs have 16 bits."""


@dataclass(frozen=True)
class Plan:
    """One trial, before anything fell.

    Attributes
    ----------
    settings : CampaignSettings
        For the simulator, effects and noise included.
    effects : tuple of Effect
        What acts, once more.
    campaign_seed : int
        For the simulator; no two trials share it.
    rig : str
        Which physics the rig obeys.
    whole : str
        Base model that has all of the rig's physics but its effects.
    base : str
        Model that the diagnosis starts from: ``whole``, or the one without a crystal.
    mistake : Mistake or None
        What people did wrong.
    """

    kind: str
    seed: int
    settings: CampaignSettings
    effects: tuple[Effect, ...]
    campaign_seed: int
    rig: str
    whole: str
    base: str
    mistake: Mistake | None = None


def draw_plan(kind: str, seed: int, rig: str = DEFAULT_RIG) -> Plan:
    """Draw materials, noise, effects and mistake of one trial.

    Parameters
    ----------
    seed : int
        Of everything drawn.
    rig : str
        Which physics the rig obeys. One other than the paper's also differs from its labels, and a
        drawn one has any of the published forms of an effect and of converters.

    Returns
    -------
    Plan
        54 drops: three polymer spheres of two radii, three surfaces, three heights, twice each.

    Raises
    ------
    ValueError
        If there is no such kind.
    """
    if kind not in KINDS:
        raise ValueError(f"No kind of trial is called {kind!r}; there are {', '.join(KINDS)}.")
    number = 10 * seed + KINDS.index(kind)
    rng = np.random.default_rng([number, 7])
    spheres = ("acetal_small", *sorted(rng.choice(OTHER_SPHERES, 2, replace=False).tolist()))
    surfaces = ("aluminium", str(rng.choice(CHECKS)), "specimen")
    effects = _draw_effects(kind, rng, spheres, surfaces, (rig, number))
    settings = CampaignSettings(
        spheres={name: SPHERES[name] for name in spheres},
        surfaces={name: SURFACES[name] for name in surfaces},
        noise=_draw_noise(rng),
        effects=effects,
        rig=rig,
        spread=EXACT if rig == "paper" else TYPICAL,
        bits=_draw_bits(number) if rig == "drawn" else 16,
    )
    whole = BASES[rig]
    base = "hsd" if kind == "hsd" else whole
    mistake = _draw_mistake(settings, number) if kind == "mistake" else None
    return Plan(kind, seed, settings, effects, number, rig, whole, base, mistake)


def colour_of(noise: NoiseSettings) -> str:
    """Return ``white``, ``ar1`` or ``pink``."""
    if noise.pink_corner_hz > 0.0:
        return "pink"
    return "ar1" if noise.ar1 else "white"


def _draw_noise(rng: np.random.Generator) -> NoiseSettings:
    colour, rho = COLOURS[int(rng.choice(len(COLOURS), p=COLOUR_SHARES))]
    rms = _log_uniform(rng, RMS_V)
    corner = _log_uniform(rng, PINK_CORNER_HZ)
    return NoiseSettings(rms, ar1=rho, pink_corner_hz=corner if colour == "pink" else 0.0)


def _draw_bits(number: int) -> int:
    return int(np.random.default_rng([number, 8]).choice(BITS, p=BITS_SHARES))


def _draw_mistake(settings: CampaignSettings, number: int) -> Mistake:
    return draw_mistake(np.random.default_rng([number, 9]), draw_drops(settings, number))


def _log_uniform(rng: np.random.Generator, ends: tuple[float, float]) -> float:
    return math.exp(rng.uniform(math.log(ends[0]), math.log(ends[1])))


def _draw_effects(
    kind: str,
    rng: np.random.Generator,
    spheres: tuple[str, ...],
    surfaces: tuple[str, ...],
    rig: tuple[str, int],
) -> tuple[Effect, ...]:
    """Return what acts; an effect of a material may act on one sphere's or surface's only."""
    wanted = {"library": 1, "outside": 1, "pair": 2, "form": 1}.get(kind, 0)
    among = tuple(INVENTED if kind == "outside" else LIBRARY)
    forms = "drawn" if kind == "form" else rig[0]
    without = no_room_for(rig_model(*rig))
    found: list[Effect] = []
    while len(found) < wanted:
        effect = draw_effect(rng, spheres, surfaces, among=among, without=without, forms=forms)
        if kind == "form" and effect.form == effect.form_on(rig[0]):
            continue
        if all(effect.slot != other.slot for other in found):
            found.append(effect)
    return tuple(found)
